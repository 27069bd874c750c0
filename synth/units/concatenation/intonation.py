"""Pitch of chosen units: approach a melody, with bounded changes.

TD-PSOLA costs intelligibility with every semitone that it changes. Units keep their own contour;
those that follow each other in a recording are moved and tilted together towards the melody, by a
bounded number of semitones, farther where the melody itself rises far, as in a question. Where two
runs meet, both glide to the middle of the jump that is left.
"""

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from synth.planning.prosody.melody import Melody
from synth.units.concatenation.sounds import PlacedUnit
from synth.units.speech.pitch import PitchTrack

_BREAK_S = 0.01
"""Seconds between points at which time and pitch are changed."""

_MOST_ST = 1.5
"""Semitones that units are moved at most; small distances are followed fully."""

_USUAL_RISE_ST = 0.5
"""Where the melody rises above this, over the middle of its stretch, units are moved in
addition."""

_GLIDE_S = 0.08
"""Seconds over which a run leaves its own pitch to meet the next one's."""

_LARGEST_JUMP_ST = 7.0
"""Larger jumps between two runs are errors of an octave in tracking: the rest stays."""

_BURST_S = 0.025
"""Seconds at the end of a stop, its burst, that are neither shortened nor lengthened."""

_LEAST_CLOSURE_S = 0.005
"""Seconds of a stop before its burst, at least."""

_STOPS = frozenset("ptkbdg")

PitchedUnit = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""Source times (s), target times (s) and ratio of new to old pitch, each (k,)."""


def intone(
    melody: Melody, choices: Sequence[PlacedUnit], tracks: Sequence[PitchTrack]
) -> list[PitchedUnit]:
    """Return the time map and the change of pitch of units without a gap between them.

    Parameters
    ----------
    melody : Melody
        Wanted pitch, on the clock of the targets.
    choices : sequence of PlacedUnit
    tracks : sequence of PitchTrack
        Pitch of their recordings.
    """
    maps = [_time_map(choice) for choice in choices]
    own = [_semitones_at(track, source) for (source, _), track in zip(maps, tracks, strict=True)]
    times = [target for _, target in maps]
    change = [np.zeros(len(target)) for target in times]
    wanted = [12 * np.log2(melody.at(target)) for target in times]
    usual = float(np.median(np.concatenate(wanted))) + _USUAL_RISE_ST
    pieces = list(runs(choices))
    for run in pieces:
        joined = [np.concatenate([line[k] for k in run]) for line in (times, own, wanted)]
        moved = _moved(joined[0], joined[1], joined[2], usual)
        ends = np.cumsum([len(times[k]) for k in run])
        for k, part in zip(run, np.split(moved, ends[:-1]), strict=True):
            change[k] = part
    for before, after in itertools.pairwise(pieces):
        end, start = before[-1], after[0]
        # Each side takes half of the step in pitch, less with the distance from the join.
        jump = own[start][0] + change[start][0] - own[end][-1] - change[end][-1]
        jump = float(np.clip(jump, -_LARGEST_JUMP_ST, _LARGEST_JUMP_ST))
        at = times[start][0]
        room_before = min(_GLIDE_S, at - times[before[0]][0])
        room_after = min(_GLIDE_S, times[after[-1]][-1] - at)
        for k in before:
            change[k] = change[k] + jump / 2 * _near(at - times[k], room_before)
        for k in after:
            change[k] = change[k] - jump / 2 * _near(times[k] - at, room_after)
    return [(s, t, 2 ** (st / 12)) for (s, t), st in zip(maps, change, strict=True)]


def _moved(
    times: NDArray[np.float64], own: NDArray[np.float64], wanted: NDArray[np.float64], usual: float
) -> NDArray[np.float64]:
    """Return by how many semitones a run is moved: a bounded line through what it lacks."""
    line = np.polynomial.Polynomial.fit(times, wanted - own, 1 if np.ptp(times) > 0 else 0)
    lacks = line(times)
    most = _MOST_ST + np.where(lacks > 0, np.maximum(wanted - usual, 0.0), 0.0)
    return np.asarray(most * np.tanh(lacks / most))


def _near(distance_s: NDArray[np.float64], reach_s: float) -> NDArray[np.float64]:
    """Return 1 at a join, falling to 0 at `reach_s` from it."""
    return np.asarray(np.clip(1 - distance_s / max(reach_s, 1e-6), 0.0, 1.0))


def runs(choices: Sequence[PlacedUnit]) -> Iterator[list[int]]:
    """Yield the numbers of units that follow each other in a recording."""
    run = [0]
    for k, (before, after) in enumerate(itertools.pairwise(choices), 1):
        if not after.follows(before):
            yield run
            run = []
        run.append(k)
    yield run


def _semitones_at(track: PitchTrack, at_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pitch of a recording, carried over where it has none."""
    known = track.f0 > 0
    if not known.any():
        return np.zeros(len(at_s))
    frames = np.arange(len(track.f0)) * track.hop_s
    return 12 * np.log2(np.interp(at_s, frames[known], track.f0[known]))


def _time_map(choice: PlacedUnit) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times in a recording and in the target, every 10 ms; a burst keeps its length."""
    source_edges, target_edges = _strictly_ascending(choice)
    if choice.source.label[0] in _STOPS and len(source_edges) > 1:
        shorter = min(source_edges[1] - source_edges[0], target_edges[1] - target_edges[0])
        burst = min(_BURST_S, shorter - _LEAST_CLOSURE_S)
        if burst > 0:
            source_edges = np.insert(source_edges, 1, source_edges[1] - burst)
            target_edges = np.insert(target_edges, 1, target_edges[1] - burst)
    steps = max(int((target_edges[-1] - target_edges[0]) / _BREAK_S), 1)
    target = np.union1d(np.linspace(target_edges[0], target_edges[-1], steps + 1), target_edges)
    target = target[np.concatenate(([True], np.diff(target) > 1e-6))]
    target[-1] = target_edges[-1]
    return np.interp(target, target_edges, source_edges), target


def _strictly_ascending(choice: PlacedUnit) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a unit's edges without those that coincide in source or target."""
    source, target = np.array(choice.source.edges_s), np.array(choice.target.edges_s)
    kept = [0]
    for i in range(1, len(source)):
        if source[i] - source[kept[-1]] > 1e-4 and target[i] - target[kept[-1]] > 1e-4:
            kept.append(i)
    if len(kept) == 1:
        return np.array([source[0], source[0] + 1e-3]), np.array([target[0], target[0] + 1e-3])
    kept[-1] = len(source) - 1
    return source[kept], target[kept]
