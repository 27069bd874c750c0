"""Compiled loops of the search for pilots.

Contiguous arrays in, arrays filled in place out; no checks. Soft values and their sums are 16 bit
integers in `PARTS`: twice as many fit a vector of the processor, and sums are exact.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit
from watermark.audio.search.pilot_scan import PARTS

BLOCK = 64
"""Places that are passed over at once where all of them are too low."""

COSINE = (
    np.float32(0.9985258),
    np.float32(-19.54981647),
    np.float32(61.07633166),
    np.float32(-59.49797175),
)
"""Polynomial in the square of a phase, -1/2 to 1/2, that is its cosine within 1.5e-3, a fifth
of one of `PARTS`: interpolation at Chebyshev's points."""

LOWEST = np.int16(-(2**14))
"""Lower than any score, and less than 2**15 from each."""

PAIRED = 2
"""Sums of which the correlations of two profiles are made: what they share, where they differ."""

Parts = NDArray[np.int16]
Soft = NDArray[np.int8]


@njit(cache=True)
def pilot_soft(
    projections: NDArray[np.complex64],
    alive: NDArray[np.float32],
    turn: NDArray[np.complex64],
    dither: NDArray[np.float32],
    steps: NDArray[np.float32],
    first: int,
    soft: Soft,
) -> None:
    """soft[s, g, first + i * turns + t] = soft value of cell g in row i, turned by turn[t, g].

    The step is steps[s]; see `watermark.audio.signal.dither`.
    """
    turns, count = turn.shape[0], alive.shape[1]
    one = np.float32(1)
    real, imaginary = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    value = np.empty((turns, count), dtype=np.int8)
    for g in range(dither.size):
        for i in range(count):
            real[i], imaginary[i] = projections[g, i].real, projections[g, i].imag
        for s in range(steps.size):
            pace = one / steps[s]
            for t in range(turns):
                a, z = turn[t, g].real * pace, turn[t, g].imag * pace
                soft_row(real, imaginary, alive[g], a, z, dither[g], value[t])
            out = soft[s, g, first : first + count * turns]
            for i in range(count):
                for t in range(turns):
                    out[i * turns + t] = value[t, i]


@njit(cache=True)
def soft_row(
    real: NDArray[np.float32],
    imaginary: NDArray[np.float32],
    alive: NDArray[np.float32],
    a: np.float32,
    z: np.float32,
    dither: np.float32,
    out: Soft,
) -> None:
    """out[i] = alive[i] cos 2 pi (a real[i] - z imaginary[i] - dither)."""
    c0, c1, c2, c3 = COSINE
    half, parts = np.float32(0.5), np.float32(PARTS)
    for i in range(out.size):
        phase = real[i] * a - imaginary[i] * z - dither
        phase -= np.floor(phase + half)
        u = phase * phase
        cosine = c0 + u * (c1 + u * (c2 + u * c3))
        out[i] = np.int8(np.floor(parts * alive[i] * cosine + half))


@njit(cache=True)
def add_rows(
    values: Soft, starts: NDArray[np.int64], signs: Parts, count: int, total: Parts
) -> None:
    """total[i] += signs[n] values[starts[n] + i] for each n below count."""
    places = total.size
    whole = count - count % 4
    for n in range(0, whole, 4):
        # Slices let the compiler see that no index is negative, and vectorise.
        a, b = values[starts[n] : starts[n] + places], values[starts[n + 1] :]
        c, d = values[starts[n + 2] :], values[starts[n + 3] :]
        p, q, r, s = signs[n], signs[n + 1], signs[n + 2], signs[n + 3]
        for i in range(places):
            total[i] = np.int16(total[i] + p * a[i] + q * b[i] + r * c[i] + s * d[i])
    for n in range(whole, count):
        a, p = values[starts[n] : starts[n] + places], signs[n]
        for i in range(places):
            total[i] = np.int16(total[i] + p * a[i])


@njit(cache=True)
def pilot_sums(
    soft: Soft,
    first: int,
    hop: int,
    segment: int,
    group: NDArray[np.int64],
    sign: Parts,
    sums: Parts,
) -> None:
    """sums[s, i] += correlation of the pilots of segment s for a superframe that starts at row i.

    soft[g, first:] holds the soft value at position g for each start of a frame; a segment is
    `segment` frames, which lie `hop` rows apart.
    """
    values = soft.reshape(-1)
    starts = group * soft.shape[1] + first + hop * np.arange(group.size)
    for s in range(group.size // segment):
        own = starts[s * segment : (s + 1) * segment]
        add_rows(values, own, sign[s * segment : (s + 1) * segment], segment, sums[s])


@njit(cache=True)
def drift_peaks(
    sums: Parts, shift: NDArray[np.int64], penalty: Parts, peak: Parts, drift: Parts
) -> None:
    """peak[i] = largest score of start i, and drift[i] = its d.

    The score is the sum over the eight segments s of sums[s, i + shift[d, s]], less penalty[d].
    """
    places = peak.size
    peak[:] = LOWEST
    for d in range(shift.shape[0]):
        at = shift[d]
        a, b = sums[0, at[0] : at[0] + places], sums[1, at[1] : at[1] + places]
        c, e = sums[2, at[2] : at[2] + places], sums[3, at[3] : at[3] + places]
        f, g = sums[4, at[4] : at[4] + places], sums[5, at[5] : at[5] + places]
        h, k = sums[6, at[6] : at[6] + places], sums[7, at[7] : at[7] + places]
        less, number = penalty[d], np.int16(d)
        for i in range(places):
            total = np.int16(a[i] + b[i] + c[i] + e[i] + f[i] + g[i] + h[i] + k[i] - less)
            # No branch: not all processors can store some lanes of a vector and leave the others.
            better = np.int16(total > peak[i])
            drift[i] = np.int16(drift[i] + better * (number - drift[i]))
            peak[i] = np.int16(peak[i] + better * (total - peak[i]))


@njit(cache=True)
def best_sum(
    peak: Parts,
    error: Parts,
    lag: NDArray[np.int64],
    past: Parts,
    weights: NDArray[np.float32],
    ceiling: np.float32,
    floor: np.float32,
) -> tuple[np.float32, int, np.float32]:
    """Return the largest of all peaks and weighted sums with those before, its place, and the peak.

    The peak one before lies lag[error[i]] places back, the next one twice as far, each at the best
    of places nearby; past ends where peak begins and nowhere exceeds ceiling. Sums that cannot
    reach floor may be left out.
    """
    count = weights.size
    least, shortest, longest = np.float32(np.inf), lag.min(), lag.max()
    # near[n - 1, i] is the highest peak within n places of first[n - 1] + i.
    near = np.empty((count, peak.size + count * (longest - shortest)), dtype=np.int16)
    first = np.empty(count, dtype=np.int64)
    for back in range(1, count + 1):
        least = min(least, floor / weights[back - 1] - back * ceiling)
        start, own = past.size - back * longest, near[back - 1]
        span = peak.size + back * (longest - shortest)
        first[back - 1] = start
        own[:span] = past[start - back : start - back + span]
        for shift in range(1 - back, back + 1):
            highest_of(own, past[start + shift : start + shift + span])
    top, where, summit = np.float32(-np.inf), 0, np.float32(-np.inf)
    for begin in range(0, peak.size, BLOCK):
        block = peak[begin : begin + BLOCK]
        highest = LOWEST
        for i in range(block.size):
            highest = max(highest, block[i])
        summit = max(summit, np.float32(highest))
        if highest <= top and highest < least:
            continue
        for i in range(begin, begin + block.size):
            score = np.float32(peak[i])
            total = score
            if total >= least:
                for n in range(count):
                    total += near[n, past.size + i - (n + 1) * lag[error[i]] - first[n]]
                    score = max(score, weights[n] * total)
            if score > top:
                top, where = score, i
    return top, where, summit


@njit(cache=True)
def highest_of(one: Parts, other: Parts) -> None:
    """one[i] = the larger of one[i] and other[i]."""
    for i in range(other.size):
        one[i] = max(one[i], other[i])


@njit(cache=True)
def correlate_pilots(
    soft: Soft,
    first: int,
    places: int,
    hop: int,
    segment: int,
    slots: NDArray[np.int64],
    signs: Parts,
    pairs: NDArray[np.int64],
    shift: NDArray[np.int64],
    penalty: Parts,
    lag: NDArray[np.int64],
    weights: NDArray[np.float32],
    floor: np.float32,
    ceiling: NDArray[np.float32],
    peaks: Parts,
    past: int,
    highest: NDArray[np.float32],
    best: NDArray[np.float32],
    where: NDArray[np.int64],
) -> None:
    """best[n] = largest score of tier and profile pairs[n], where[n] its start and clock error.

    soft has the shape (tiers, slots, rows) and counts from row `first` on. The peaks of the
    `places` starts looked at are written to peaks[n, past:], the largest of them to highest[n];
    those before are bounded by ceiling[n]. slots[n] and signs[n] are those of pilot n of each
    frame, signs by profile.
    """
    common = np.empty((slots.shape[1] // segment, places + shift.max()), dtype=np.int16)
    error = np.empty(places, dtype=np.int16)
    tier = -1
    for n in range(pairs.shape[0]):
        if pairs[n, 0] != tier:
            tier = pairs[n, 0]
            common[:] = np.int16(0)
            pilot_sums(soft[tier], first, hop, segment, slots[0], signs[0, 0], common)
        sums = common.copy()
        pilot_sums(soft[tier], first, hop, segment, slots[1], signs[1, pairs[n, 1]], sums)
        peak = peaks[n, past : past + places]
        drift_peaks(sums, shift, penalty, peak, error)
        before = peaks[n, :past]
        best[n], top, highest[n] = best_sum(peak, error, lag, before, weights, ceiling[n], floor)
        where[n, 0], where[n, 1] = top, error[top]


@njit(cache=True)
def turned_scores(
    projections: NDArray[np.complex64],
    alive: NDArray[np.float32],
    dither: NDArray[np.float32],
    pace: np.float32,
    turn: NDArray[np.complex64],
    hop: int,
    slots: NDArray[np.int64],
    signs: Parts,
    score: Parts,
) -> None:
    """score[p, i] = sum over slots of the largest correlation at any phase, for start i.

    projections and alive have the shape (slots, rows); frames lie `hop` rows apart. slots[n, f] is
    the slot of pilot n of frame f, signs[n, p, f] its value in profile p. pace is 1 / step.
    """
    profiles, places = score.shape
    rows = projections.shape[1]
    real, imaginary = np.empty(rows, dtype=np.float32), np.empty(rows, dtype=np.float32)
    soft = np.empty(rows, dtype=np.int8)
    sums = np.empty((PAIRED, places), dtype=np.int16)
    starts = np.empty((PAIRED, slots.shape[1]), dtype=np.int64)
    values = np.empty((PAIRED, slots.shape[1]), dtype=np.int16)
    count = np.empty(PAIRED, dtype=np.int64)
    best = np.empty((profiles, places), dtype=np.int16)
    score[:] = np.int16(0)
    for s in range(projections.shape[0]):
        for i in range(rows):
            real[i], imaginary[i] = projections[s, i].real, projections[s, i].imag
        best[:] = LOWEST
        for t in range(turn.size):
            a, z = turn[t].real * pace, turn[t].imag * pace
            soft_row(real, imaginary, alive[s], a, z, dither[s], soft)
            # Two profiles at once: what both add, and what the second takes that the first adds.
            for p in range(0, profiles, 2):
                q = min(p + 1, profiles - 1)
                count[:] = 0
                for n in range(slots.shape[0]):
                    for f in range(slots.shape[1]):
                        if slots[n, f] == s:
                            to = 0 if signs[n, p, f] == signs[n, q, f] else 1
                            starts[to, count[to]] = hop * f
                            values[to, count[to]] = signs[n, p, f]
                            count[to] += 1
                sums[:] = np.int16(0)
                for to in range(PAIRED):
                    add_rows(soft, starts[to], values[to], count[to], sums[to])
                one, other, alike, unlike = best[p], best[q], sums[0], sums[1]
                for i in range(places):
                    one[i] = max(one[i], np.int16(alike[i] + unlike[i]))
                    other[i] = max(other[i], np.int16(alike[i] - unlike[i]))
        for p in range(profiles):
            for i in range(places):
                score[p, i] = np.int16(score[p, i] + best[p, i])
