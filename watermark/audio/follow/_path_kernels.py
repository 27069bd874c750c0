"""Compiled loops of the search for a superframe's frames in pieces of sound.

Contiguous arrays in, arrays filled in place out; no checks.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit


@njit(cache=True, fastmath={"reassoc", "contract"})
def slide_frames(
    sound: NDArray[np.float32],
    wave: NDArray[np.float32],
    turn: NDArray[np.float32],
    apart: int,
    anew: int,
    spectra: NDArray[np.complex64],
) -> None:
    """Fill spectra of frames `apart` samples apart, a multiple of four; one of `anew` is made anew.

    wave and turn are the tables of `watermark.audio.signal.mdct.sliding_tables`.
    """
    period, bins = wave.shape[1], spectra.shape[1]
    x, y = np.empty(bins + 1, dtype=np.float32), np.empty(bins + 1, dtype=np.float32)
    x_next, y_next = x[1:], y[1:]
    on_x, on_y = turn[0], turn[1]
    own_x, own_y, other_x, other_y = turn[2], turn[3], turn[4], turn[5]
    for r in range(spectra.shape[0]):
        if r % anew == 0:
            x[:], y[:] = 0.0, 0.0
            # Sums of the whole frame, so that rounding errors of sliding cannot grow.
            for i in range(period):
                sample, wave_x, wave_y = sound[r * apart + i], wave[0, i], wave[1, i]
                for k in range(bins + 1):
                    x[k] += sample * wave_x[k]
                    y[k] += sample * wave_y[k]
        else:
            # Sliding transform: subtract the samples that leave and add those that enter, four at a
            # time for the vector unit. The window has one period, so both have the same wave.
            for i in range(0, apart, 4):
                old = (r - 1) * apart + i
                new = old + period
                d0, d1 = sound[new] - sound[old], sound[new + 1] - sound[old + 1]
                d2, d3 = sound[new + 2] - sound[old + 2], sound[new + 3] - sound[old + 3]
                a0, a1, a2, a3 = wave[0, i], wave[0, i + 1], wave[0, i + 2], wave[0, i + 3]
                b0, b1, b2, b3 = wave[1, i], wave[1, i + 1], wave[1, i + 2], wave[1, i + 3]
                for k in range(bins + 1):
                    x[k] += (d0 * a0[k] + d1 * a1[k]) + (d2 * a2[k] + d3 * a3[k])
                    y[k] += (d0 * b0[k] + d1 * b1[k]) + (d2 * b2[k] + d3 * b3[k])
            # Then turn the phases to the new frame's origin.
            for k in range(bins + 1):
                a, b = x[k], y[k]
                x[k], y[k] = a * on_x[k] - b * on_y[k], a * on_y[k] + b * on_x[k]
        for k in range(bins):
            # A sine window is two shifted exponentials: a windowed bin is a sum of two neighbours.
            a = (own_x[k] * x[k] - own_y[k] * y[k]) + (
                other_x[k] * x_next[k] - other_y[k] * y_next[k]
            )
            b = (own_x[k] * y[k] + own_y[k] * x[k]) + (
                other_x[k] * y_next[k] + other_y[k] * x_next[k]
            )
            spectra[r, k] = complex(a, b)


@njit(cache=True, fastmath={"reassoc", "contract"})
def project_rows(
    spectra: NDArray[np.complex64],
    weights: NDArray[np.float32],
    nearest: NDArray[np.int64],
    first: int,
    real: NDArray[np.float32],
    imaginary: NDArray[np.float32],
) -> None:
    """Sum over the bins b of cell g spectra[r, b] weights[n, b], into real and imaginary[r, g].

    Row n = nearest[r] of weights is 0 in all bins of a silent cell; cells begin at bin `first`.
    """
    bins = weights.shape[1] // real.shape[1]
    for r in range(real.shape[0]):
        own = weights[nearest[r]]
        for g in range(real.shape[1]):
            x, y = np.float32(0.0), np.float32(0.0)
            for i in range(g * bins, (g + 1) * bins):
                value = spectra[r, first + i]
                x += value.real * own[i]
                y += value.imag * own[i]
            real[r, g], imaginary[r, g] = x, y


@njit(cache=True, fastmath={"reassoc", "contract"})
def look_up(
    planes: NDArray[np.float32],
    step: int,
    rows: NDArray[np.uint32],
    nearest: NDArray[np.int64],
    turns: NDArray[np.float32],
    dither: NDArray[np.float32],
    units: NDArray[np.float32],
    table: NDArray[np.float32],
    values: NDArray[np.float32],
    sums: NDArray[np.float32],
) -> None:
    """values[n, r turns + d, g] = table[rows[nearest[r], g] + error of a cell]; sums over g.

    An error is units[n] times the real part of planes[., r, g] turns[., d, g] + planes[., r + step,
    g] turns[2 + ., d, g], less dither[n, g], in points of the period that a row of the table has, a
    power of two: the last row holds zeros, for cells that are not alive. Planes are real and
    imaginary parts. Sums without columns are left out, and values where there are sums.
    """
    groups, last = planes.shape[2], np.uint32(table.shape[1] - 1)
    flat = table.reshape(-1)
    part, at = np.empty(groups, dtype=np.float32), np.empty(groups, dtype=np.uint32)
    for r in range(planes.shape[1] - step):
        x, y, x_next, y_next = planes[0, r], planes[1, r], planes[0, r + step], planes[1, r + step]
        # The two nearest rows of projections are blended for every delay d between them; the blend
        # is linear, so the error of all cells costs four products each.
        begins = rows[nearest[r]]
        for d in range(turns.shape[1]):
            row = r * turns.shape[1] + d
            on_x, on_y, back_x, back_y = turns[0, d], turns[1, d], turns[2, d], turns[3, d]
            for g in range(groups):
                part[g] = x[g] * on_x[g] - y[g] * on_y[g] + x_next[g] * back_x[g]
                part[g] -= y_next[g] * back_y[g]
            for n in range(units.size):
                unit, zero = units[n], dither[n]
                for g in range(groups):
                    # The masked low bits of the quantised error are its phase in the period;
                    # negative ones wrap.
                    error = np.int32(np.floor(part[g] * unit - zero[g]))
                    at[g] = (np.uint32(error) & last) + begins[g]
                if sums.shape[1]:
                    total = np.float32(0.0)
                    for g in range(groups):
                        total += flat[at[g]]
                    sums[n, row] = total
                else:
                    for g in range(groups):
                        values[n, row, g] = flat[at[g]]


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
        # Viterbi: score(t, n) = max(score(t-1, n - shift), best(t-1) - jump) + evidence(t, n).
        if t:
            before[:] = score
            best = 0
            for n in range(count):
                if before[n] > before[best]:
                    best = n
            least = before[best] - jump
            # The same pace moves a frame by one hop; the window of places moved by the offsets'
            # difference.
            shift = hop - (first - offsets[t - 1])
            for n in range(count):
                source = n - shift
                if 0 <= source < count and before[source] >= least:
                    back[t, n], score[n] = source, before[source]
                else:
                    back[t, n], score[n] = best, least
        for n in range(count):
            row = first + n
            total = own[row]
            for i in range(slots.shape[1]):
                total += pilots[kinds[t, i], row, slots[t, i]]
            for g in range(soft.shape[1]):
                total += soft[row, g] * expected[t, g]
            score[n] += total
    # From the best last place back along the stored predecessors.
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
