"""Compiled loops of the search for a superframe's frames in pieces of sound.

Contiguous arrays in, arrays filled in place out; no checks.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit


@njit(cache=True, fastmath={"reassoc", "contract"})
def project_rows(
    spectra: NDArray[np.complex64],
    inverse: NDArray[np.float32],
    nearest: NDArray[np.int64],
    signs: NDArray[np.float32],
    first: int,
    projections: NDArray[np.complex64],
) -> None:
    """projections[r, g] = sum over the bins b of cell g of spectra[r, b] signs[b] inverse[n, b].

    Row n = nearest[r] of inverse holds what amplitudes are divided by, 0 in all bins of a silent
    cell; cells begin at bin `first`.
    """
    groups = projections.shape[1]
    bins = signs.size // groups
    for r in range(projections.shape[0]):
        n = nearest[r]
        for g in range(groups):
            total = np.complex64(0.0)
            for i in range(g * bins, (g + 1) * bins):
                total += spectra[r, first + i] * (signs[i] * inverse[n, first + i])
            projections[r, g] = total


@njit(cache=True, fastmath={"reassoc", "contract"})
def look_up(
    before: NDArray[np.complex64],
    after: NDArray[np.complex64],
    alive: NDArray[np.bool_],
    nearest: NDArray[np.int64],
    turns: NDArray[np.complex64],
    dither: NDArray[np.float32],
    scale: float,
    table: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """out[r turns + d, g] = table[g, error] of a cell, 0 where it is not alive.

    An error is scale times the real part of before[r, g] turns[0, d, g] + after[r, g]
    turns[1, d, g], less dither[g]: in steps, to which a table's row has a power of two of values.
    With one column only, out sums over g.
    """
    points = table.shape[1]
    mask = points - 1
    whole = out.shape[1] == 1
    unit = np.float32(scale * points)
    for r in range(before.shape[0]):
        n = nearest[r]
        for d in range(turns.shape[1]):
            row, total = r * turns.shape[1] + d, np.float32(0.0)
            for g in range(before.shape[1]):
                p, own, q, next_one = before[r, g], turns[0, d, g], after[r, g], turns[1, d, g]
                part = p.real * own.real - p.imag * own.imag
                part += q.real * next_one.real - q.imag * next_one.imag
                at = int(np.floor(part * unit - dither[g] * points + np.float32(0.5))) & mask
                value = table[g, at] if alive[n, g] else np.float32(0.0)
                if whole:
                    total += value
                else:
                    out[row, g] = value
            if whole:
                out[row, 0] = total


@njit(cache=True)
def follow_frames(
    own: NDArray[np.float32],
    pilots: NDArray[np.float32],
    slots: NDArray[np.int64],
    kinds: NDArray[np.int64],
    soft: NDArray[np.float32],
    expected: NDArray[np.float32],
    offsets: NDArray[np.int64],
    hop: int,
    jump: float,
    start: NDArray[np.float64],
    path: NDArray[np.int64],
) -> float:
    """Fill path with the likeliest place of each frame; return the path's score.

    Frame t lies at one of start.size places from row offsets[t] on, and where the one before goes
    on, `hop` rows after it; anywhere else for a jump. Its score at a row is own[row], plus
    pilots[kinds[t, i], row, slots[t, i]] of its pilots, plus soft[row] . expected[t] if there are
    soft values. `start` is the score of each place before that of the first frame.
    """
    frames, count = offsets.size, start.size
    back = np.empty((frames, count), dtype=np.int32)
    score, before = start.copy(), np.empty(count)
    for t in range(frames):
        first = offsets[t]
        if t:
            before[:] = score
            best = 0
            for n in range(count):
                if before[n] > before[best]:
                    best = n
            least = before[best] - jump
            shift = hop - (first - offsets[t - 1])
            for n in range(count):
                source = n - shift
                if 0 <= source < count and before[source] >= least:
                    back[t, n], score[n] = source, before[source]
                else:
                    back[t, n], score[n] = best, least
        for n in range(count):
            row = first + n
            total = own[row, 0]
            for i in range(slots.shape[1]):
                total += pilots[kinds[t, i], row, slots[t, i]]
            for g in range(soft.shape[1]):
                total += soft[row, g] * expected[t, g]
            score[n] += total
    at = 0
    for n in range(count):
        if score[n] > score[at]:
            at = n
    highest = score[at]
    for t in range(frames - 1, -1, -1):
        path[t] = offsets[t] + at
        if t:
            at = back[t, at]
    return float(highest)
