"""The keys that a hand shows, without being told what was said.

A line of keys and ways between them is laid through the frames by dynamic programming (Viterbi
1967); what it shows of this cuer's shapes and placements is learnt, and the line laid again. How
sure each key is follows from all lines together (forward and backward sums).
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import PLACEMENT_NUMBER
from synth.capture.cues import _kernels
from synth.capture.cues.appearance import ANYBODYS, KEYS, POINTS_WITH, KeyAppearance
from synth.capture.cues.features import HandFeatures
from synth.capture.cues.lattice import COMES_FROM, END_OF, KEY_OF, SHAPE_OF, Lattice, lattice
from synth.capture.cues.turning import turn_of

FloatArray = NDArray[np.float64]

# How often French uses each shape and placement: see below.
_SHAPE_USE = np.array([0.152, 0.105, 0.209, 0.070, 0.298, 0.131, 0.009, 0.027])
_PLACE_USE = np.array([0.539, 0.159, 0.136, 0.030, 0.137])
"""How often French uses each shape and placement, by the frequency of words (Lexique 3.83)."""

_ELSEWHERE = -1.0
"""Price of a side that falls short from where the hand did not come."""

_SAME_SHAPE, _SAME_AT_SIDE = -0.5, -0.4
"""Prices of two keys of one shape in a row, and more if the first is at the side: fingers that form
the next shape ahead of the hand look like a key of their own."""

_NEVER = -50.0
"""Price of what does not happen: a key that follows itself, the one short of its place."""

_REST_USE = 0.14
"""How often the hand rests, of all keys."""

_EDGE = -3.0
"""Price of a line that begins or ends at a key, not at rest."""

_ROUNDS = 2
"""Rounds in which looks are learnt from the keys and keys told by the looks."""

_ARRIVED = 1.0 / 7.0
"""Part of its greatest speed at which a movement has ended; what the analysis of real cuers counts
as movement is faster. The last millimetres of a slow end say nothing more."""

_PASSED_S = 0.07
"""A key next to rest that is held no longer is none: the hand comes up, or goes down. Whoever
begins or ends a phrase stays; on 64 takes of a real cuer 0.05 to 0.2 s did the same."""

_AHEAD_S = 0.1
"""A key at the side that is held no longer before one of its shape elsewhere is none either: the
fingers have formed the next shape before the hand sets out. On 64 takes of a real cuer none of 19
such keys up to 0.04 s was right, 7 of 19 up to 0.12 s; whoever cues both stays longer."""

_PIECE_S, _MARGIN_S = 30.0, 4.0
"""Seconds that are searched at once, and those on either side that are not kept."""


@dataclass(frozen=True, slots=True)
class HeldKey:
    """A key held by the hand.

    Attributes
    ----------
    shape, placement : int
        Numbers; 0 and 0 for rest.
    reach_s, leave_s : float
        When the hand arrives and sets out again, seconds from the first frame.
    confidence : float
        Probability that the key is right, 0 to 1.
    """

    shape: int
    placement: int
    reach_s: float
    leave_s: float
    confidence: float


@dataclass(frozen=True, slots=True)
class Recognised:
    """What was recognised.

    Attributes
    ----------
    held : tuple of HeldKey
        In order of time, rests too.
    looks : KeyAppearance
        Of this cuer, as learnt.
    """

    held: tuple[HeldKey, ...]
    looks: KeyAppearance


def prices(looks: KeyAppearance) -> FloatArray:
    """Return the price of going from one state to another, (S, S): how rarely it is used."""
    keys = np.outer(_SHAPE_USE, _PLACE_USE).ravel()
    use = np.concatenate([[_REST_USE], keys / keys.sum()])
    eager = np.where(np.arange(len(use)) > 0, looks.eagerness, 0.0)
    enter = (np.log(use) + eager)[KEY_OF] + np.where(COMES_FROM > 0, looks.short, 0.0)
    shape, place = np.array(KEYS)[KEY_OF].T
    same = (shape[:, None] == shape) & (shape > 0)
    from_side = same & (place == PLACEMENT_NUMBER["side"])[:, None]
    # The place of a state that falls short is where it is, so it is none that one comes from.
    placed = np.where(COMES_FROM > 0, -1, place)
    elsewhere = (COMES_FROM > 0) & (placed[:, None] != COMES_FROM)
    itself = (KEY_OF[:, None] == KEY_OF) & ~np.eye(len(KEY_OF), dtype=np.bool_)
    return np.asarray(
        enter + _SAME_SHAPE * same + _SAME_AT_SIDE * from_side + _ELSEWHERE * elsewhere
        + _NEVER * itself
    )  # fmt: skip


def recognise_keys(seen: HandFeatures, *, looks: KeyAppearance = ANYBODYS) -> Recognised:
    """Return the keys that the hand holds, rests too, in order of time.

    Parameters
    ----------
    seen : HandFeatures
    looks : KeyAppearance
        What is known of the cuer before.

    Notes
    -----
    A key that repeats its predecessor without a movement cannot be told from a long one. Of the
    right keys of 64 real utterances 21 of 819 stand for two; they are held longer (0.3 s in the
    median, others 0.1 s), yet of those held for more than 0.5 s only 3 of 9 do. Splitting keys by
    their duration would be wrong more often than right, so none is split: a text tells.
    """
    if looks.turns:
        looks = replace(looks, turned=_turned(seen, looks))
    before = looks
    for _ in range(_ROUNDS):
        runs = [run for part in pieces(seen) for run in part.runs(looks, sure=False)]
        looks = looks.learnt(*_examples(seen, runs, looks), before)
    runs = [run for part in pieces(seen) for run in part.runs(looks, sure=True)]
    return Recognised(tuple(_held(seen, _stayed(runs, seen.rate_hz))), looks)


def _turned(seen: HandFeatures, looks: KeyAppearance) -> float:
    """Return what the turn of the palm counts, after the keys that are recognised without it."""
    widths, places = [], []
    plain = replace(looks, turned=0.0)
    for run in (run for part in pieces(seen) for run in part.runs(plain, sure=False)):
        shape, place = KEYS[run.state]
        at = np.arange(run.begin, run.end)
        at = at[seen.shown[at]]
        if shape and not run.short and len(at):
            widths.append(seen.width[at[seen.speed[at].argmin()]])
            places.append(place)
    return turn_of(np.array(widths), places)


@dataclass(frozen=True, slots=True)
class KeyRun:
    """Frames `begin` to `end` that hold key number `state`, with a probability.

    `short` if the hand was not quite there.
    """

    state: int
    begin: int
    end: int
    probability: float
    short: bool = False


@dataclass(frozen=True, slots=True)
class FramePiece:
    """Frames that are worked on together; those from `core` on count, up to `until`."""

    seen: HandFeatures
    first: int
    core: int
    until: int

    def runs(self, looks: KeyAppearance, *, sure: bool) -> list[KeyRun]:
        """Return the keys held from `core` on, with their probabilities if they are asked for."""
        densities = lattice(self.seen, looks)
        states, _ = likeliest(densities, looks)
        near = nearness(densities, looks) if sure else np.ones((len(states), len(KEYS)))
        found = []
        for state, a, b in _runs(states):
            begin, end = self.first + a, self.first + b
            if self.core <= begin < self.until:
                key = int(KEY_OF[state])
                likely = float(near[a:b, key].max())
                found.append(KeyRun(key, begin, end, likely, bool(COMES_FROM[state])))
        return found


def line_value(seen: HandFeatures, looks: KeyAppearance = ANYBODYS) -> float:
    """Return the log likelihood of the best line of keys, but for a constant of the frames."""
    return likeliest(lattice(seen, looks), looks)[1]


def likeliest(densities: Lattice, looks: KeyAppearance) -> tuple[NDArray[np.int64], float]:
    """Return the held state of each frame, or -1 on the way, (T,), and the line's likelihood."""
    states = np.empty(len(densities.hold), dtype=np.int64)
    value = _kernels.likeliest(
        densities.hold, densities.shapes, densities.places, SHAPE_OF, END_OF, prices(looks),
        _EDGE, states,
    )  # fmt: skip
    return states, float(value)


def nearness(densities: Lattice, looks: KeyAppearance) -> FloatArray:
    """Return how likely each key is at hand in each frame: held, coming or just left, (T, 41)."""
    near, share = np.empty_like(densities.hold), looks.sure_share
    part = densities.scaled(share)
    _kernels.nearness(
        part.hold, part.shapes, part.places, SHAPE_OF, END_OF, share * prices(looks),
        share * _EDGE, near,
    )  # fmt: skip
    whole = near[:, : len(KEYS)].copy()
    for state in range(len(KEYS), len(KEY_OF)):
        whole[:, KEY_OF[state]] += near[:, state]
    return np.minimum(whole, 1.0)


def pieces(seen: HandFeatures) -> Iterator[FramePiece]:
    """Yield pieces that overlap, so that memory does not grow with the take."""
    size, margin = round(_PIECE_S * seen.rate_hz), round(_MARGIN_S * seen.rate_hz)
    for core in range(0, len(seen), size):
        first, until = max(0, core - margin), min(core + size, len(seen))
        last = min(until + margin, len(seen))
        yield FramePiece(seen.part(slice(first, last)), first, core, until)


def _runs(states: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """Return state, begin and end of each stretch that holds a key."""
    edges = np.flatnonzero(np.diff(states, prepend=-2, append=-2))
    return [
        (int(states[a]), int(a), int(b)) for a, b in itertools.pairwise(edges) if states[a] >= 0
    ]


def _examples(
    seen: HandFeatures, runs: list[KeyRun], looks: KeyAppearance
) -> tuple[list[tuple[int, FloatArray]], list[tuple[int, FloatArray]]]:
    """Return fingers and places at the frames of each held key that look most like it."""
    fingers, places = [], []
    for run in runs:
        shape, place = KEYS[run.state]
        at = np.arange(run.begin, run.end)
        if shape == 0 or not seen.shown[at].any():
            continue
        at = at[seen.shown[at]]
        away = (seen.fingers[at] - looks.fingers[shape]) / looks.fingers_sd[shape]
        fingers.append((shape, seen.fingers[at[(away**2).sum(1).argmin()]]))
        if run.short:
            continue
        tips = seen.tips[at, POINTS_WITH[shape]]
        gap = (tips - looks.places[place]) / looks.places_sd[place]
        places.append((place, tips[(gap**2).sum(1).argmin()]))
    return fingers, places


def _held(seen: HandFeatures, runs: list[KeyRun]) -> Iterator[HeldKey]:
    before, flow = 0, seen.flow()
    for number, run in enumerate(runs):
        shape, place = KEYS[run.state]
        reach = arrival(flow, before, run.begin, run.end) if number else run.begin
        before = run.end
        yield HeldKey(
            shape, place, reach / seen.rate_hz, (run.end - 1) / seen.rate_hz, run.probability
        )


def _stayed(runs: list[KeyRun], rate_hz: float) -> list[KeyRun]:
    """Return all but what a hand passed: next to rest, or with its fingers ahead of it."""
    rest = KeyRun(0, 0, 0, 1.0)
    return [
        run
        for before, run, after in zip([rest, *runs], runs, [*runs[1:], rest], strict=False)
        if run.end - run.begin > least_held_s(before.state, run.state, after.state) * rate_hz
    ]


def least_held_s(before: int, state: int, after: int) -> float:
    """Return how long the key of a state is held at least between two others, seconds."""
    shape, place = KEYS[state]
    if shape == 0:
        return 0.0
    least = _PASSED_S if before == 0 or after == 0 else 0.0
    if place == PLACEMENT_NUMBER["side"] and KEYS[after][0] == shape:
        least = max(least, _AHEAD_S)
    return least


def arrival(flow: FloatArray, before: int, begin: int, end: int) -> int:
    """Return when the movement to a held key has ended: it is slow, or as slow as it becomes.

    Parameters
    ----------
    flow : ndarray of float64, shape (T,)
        `HandFeatures.flow`; NaN where the hand is not seen.
    before, begin, end : int
        End of the key before; begin and end of this one, frames.

    Notes
    -----
    A hand that slows down and goes on (the palm turns after the tip, the next stroke overlaps) has
    not arrived where it first slowed down.
    """
    known = np.nan_to_num(flow[:end])
    low = min(before, begin)
    at = low + int(known[low : begin + 1].argmax())
    if at == begin:
        # Fingers that are in shape early let a key begin while the hand still gathers speed.
        begin = at = _summit(known, begin)
    slow = np.flatnonzero(known[at:] <= _ARRIVED * known[at])
    return at + int(slow[0]) if len(slow) else begin + int(known[begin:].argmin())


def _summit(flow: FloatArray, begin: int) -> int:
    """Return the frame where a rising speed turns, `begin` where it rises until the last."""
    falls = np.flatnonzero(np.diff(flow[begin:]) <= 0.0)
    return begin + int(falls[0]) if len(falls) else begin
