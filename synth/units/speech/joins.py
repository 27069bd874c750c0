"""Joins of recorded speech: phase, level and spectrum of one stretch pass into the next one's.

In: sound, pitch marks, and grains of two stretches that meet. Out: per grain a shift and a gain,
and grains of the other stretch that are heard beside it. Dutoit 1997 ("An Introduction to
Text-to-Speech Synthesis", chapter 10) names the three mismatches.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from synth.units.speech.marks import PitchMarks

_FADE_S = 0.012
"""Seconds on either side of a join over which the two stretches are mixed: two or three periods."""

_FARTHEST_S = 0.018
"""Farthest grains in seconds beyond a stretch's end: inside the sound around it."""

_NEAR_S = 0.006
"""A grain is taken of a mark that lies so near to the wanted time, seconds."""

_LEVEL_S = 0.02
"""Seconds of sound whose levels are compared."""

_MOST_DB = 6.0
"""Larger steps of level are met in part: vowels and their neighbours differ by more."""

_LEVEL_FADE_S = 0.08
"""Seconds over which a stretch leaves its own level to meet the next one's."""


@dataclass(slots=True)
class Grains:
    """Grains in the order of playing, all arrays of shape (N,).

    Attributes
    ----------
    place_s : ndarray of float64
        Where each goes, seconds.
    index : ndarray of int64
        Its analysis mark.
    piece : ndarray of int64
        The stretch that it belongs to.
    shift : ndarray of int64
        Samples by which its middle lies off its mark.
    gain : ndarray of float64
    """

    place_s: NDArray[np.float64]
    index: NDArray[np.int64]
    piece: NDArray[np.int64]
    shift: NDArray[np.int64]
    gain: NDArray[np.float64]


def smooth_joins(
    x: NDArray[np.float64],
    marks: PitchMarks,
    edges: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
    grains: Grains,
) -> Grains:
    """Shift and weigh grains around joins; return the grains heard beside them.

    Parameters
    ----------
    x : ndarray of float64, shape (n,)
    marks : PitchMarks
    edges : sequence of (source times, target times)
        Time maps of the stretches, seconds.
    grains : Grains
        Changed in place.

    Returns
    -------
    Grains
        One beside each of `grains`, of gain 0 away from joins.
    """
    n = len(grains.index)
    beside = Grains(
        grains.place_s, grains.index.copy(), grains.piece, np.zeros(n, dtype=np.int64), np.zeros(n)
    )
    at = marks.sample / marks.fs
    level_db = np.zeros(n)
    for k in range(len(edges) - 1):
        (source_a, target_a), (source_b, target_b) = edges[k], edges[k + 1]
        if abs(source_b[0] - source_a[-1]) < 1e-6:
            continue
        join_s = target_b[0]
        # The piece behind a join is moved by the lag at which the periods on both sides are most
        # alike, up to its first unvoiced grain.
        before, after = _nearest(at, source_a[-1]), _nearest(at, source_b[0])
        last_lag = _lag_at_end(grains, k)
        lag, likeness = _best_lag(x, marks, before, last_lag, after)
        own = np.flatnonzero(grains.piece == k + 1)
        unvoiced = np.flatnonzero(~marks.voiced[grains.index[own]])
        grains.shift[own[: unvoiced[0] if len(unvoiced) else len(own)]] = lag
        # Each side takes half of the step in level, less with the distance from the join.
        step = _level_db(x, marks.fs, source_b[0]) - _level_db(x, marks.fs, source_a[-1])
        step = float(np.clip(step, -_MOST_DB, _MOST_DB))
        for piece, sign, length in ((k, 0.5, np.ptp(target_a)), (k + 1, -0.5, np.ptp(target_b))):
            mine = grains.piece == piece
            away = np.abs(grains.place_s[mine] - join_s) / min(_LEVEL_FADE_S, length)
            level_db[mine] += sign * step * np.clip(1 - away, 0.0, 1.0)
        reach = min(_FADE_S, np.ptp(target_a) / 2, np.ptp(target_b) / 2)
        near = np.flatnonzero(
            (np.abs(grains.place_s - join_s) < reach)
            & ((grains.piece == k) | (grains.piece == k + 1))
        )
        for g in near.tolist():
            away_s = grains.place_s[g] - join_s
            later = 0.5 + 0.5 * np.sin(np.pi / 2 * away_s / reach)
            first = grains.piece[g] == k
            start_s = source_b[0] if first else source_a[-1]
            wanted = start_s + np.clip(away_s, -_FARTHEST_S, _FARTHEST_S)
            other = _nearest(at, wanted)
            if abs(at[other] - wanted) > _NEAR_S:
                continue
            # Amplitudes l and 1 - l of grains of likeness r have the power l^2 + (1 - l)^2 + 2 l (1
            # - l) r; divided by its root, the level stays.
            power = later**2 + (1 - later) ** 2 + 2 * later * (1 - later) * likeness
            parts = (1 - later, later) if first else (later, 1 - later)
            grains.gain[g] *= parts[0] / np.sqrt(power)
            met_db = (-0.5 if first else 0.5) * step
            beside.gain[g] = parts[1] / np.sqrt(power) * 10 ** (met_db / 20)
            beside.index[g] = other
            beside.shift[g] = lag if first else last_lag
    grains.gain *= 10 ** (level_db / 20)
    return beside


def _nearest(at: NDArray[np.float64], time_s: float) -> int:
    """Return the number of the mark nearest to a time."""
    k = int(np.clip(np.searchsorted(at, time_s), 1, len(at) - 1))
    return k - int(time_s - at[k - 1] < at[k] - time_s)


def _lag_at_end(grains: Grains, piece: int) -> int:
    own = np.flatnonzero(grains.piece == piece)
    return int(grains.shift[own[-1]]) if len(own) else 0


def _best_lag(
    x: NDArray[np.float64], marks: PitchMarks, before: int, shift: int, after: int
) -> tuple[int, float]:
    """Return the shift of a mark's grain that is most like another mark's, and the likeness.

    Within half a period; 0 where one of them is unvoiced.
    """
    if not (marks.voiced[before] and marks.voiced[after]) or after + 1 >= len(marks.sample):
        return 0, 0.0
    period = int(marks.sample[after + 1] - marks.sample[after])
    period = min(period, round(_FARTHEST_S / 2 * marks.fs))
    first, second = int(marks.sample[before]) + shift, int(marks.sample[after])
    half = period // 2
    low, high = period, len(x) - period - 1
    if not (low <= first <= high and low + half <= second <= high - half):
        return 0, 0.0
    window = np.hanning(2 * period + 1)
    one = x[first - period : first + period + 1] * window
    around = x[second - period - half : second + period + half + 1]
    rows = np.lib.stride_tricks.sliding_window_view(around, 2 * period + 1) * window
    norm = np.linalg.norm(rows, axis=1) * np.linalg.norm(one) + 1e-12
    likeness = rows @ one / norm
    best = int(np.argmax(likeness))
    return best - half, float(np.clip(likeness[best], 0.0, 1.0))


def _level_db(x: NDArray[np.float64], fs: float, at_s: float) -> float:
    half = round(_LEVEL_S * fs)
    part = x[max(round(at_s * fs) - half, 0) : round(at_s * fs) + half]
    return float(10 * np.log10(np.mean(part**2) + 1e-8)) if len(part) else -80.0
