"""Compiled loops of the search for pilots.

Contiguous arrays in, arrays filled in place out; no checks. Soft values and the sums of segments
are 8 bit integers in `PARTS`, scores 16 bit ones: so many fit a vector of the processor at once,
and sums are exact. A sign is a mask, 0 or -1: bits turned over (and 1 added) are a number's
negative.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit
from watermark.audio.search._soft_kernels import Soft, soft_row
from watermark.audio.search.pilot_scan import SEGMENT_FRAMES

LOWEST = np.int16(-(2**14))
"""Lower than any score, and less than 2**15 from each."""

PAIRED = 2
"""Sums behind the correlations of two profiles: their common part, and their difference."""

FITTING = 16
"""Soft values whose sum fits 8 bits."""

Parts = NDArray[np.int16]


@njit(cache=True, inner=True)
def add_rows(values: Soft, starts: NDArray[np.int64], masks: Soft, count: int, total: Soft) -> None:
    """total[i] += values[starts[n] + i] for each n below count, or less it where masks[n] is -1."""
    places = total.size
    whole = count - count % 4
    for n in range(0, whole, 4):
        # Slices let the compiler see that no index is negative, and vectorise.
        a, b = values[starts[n] : starts[n] + places], values[starts[n + 1] :]
        c, d = values[starts[n + 2] :], values[starts[n + 3] :]
        p, q, r, s = masks[n], masks[n + 1], masks[n + 2], masks[n + 3]
        more = np.int8(-(p + q + r + s))
        for i in range(places):
            total[i] = np.int8(total[i] + more + (p ^ a[i]) + (q ^ b[i]) + (r ^ c[i]) + (s ^ d[i]))
    for n in range(whole, count):
        a, p = values[starts[n] : starts[n] + places], masks[n]
        for i in range(places):
            total[i] = np.int8(total[i] + (p ^ a[i]) - p)


@njit(cache=True)
def pilot_sums(
    soft: Soft,
    first: int,
    frames: NDArray[np.int64],
    group: NDArray[np.int64],
    mask: Soft,
    before: Soft,
    sums: Soft,
) -> None:
    """sums[s, i] = before[s, i] + correlation of pilots in segment s if a superframe starts at i.

    soft[g, first:] holds the soft value at position g for each start of a frame; a segment is
    `SEGMENT_FRAMES` frames, of which frame n begins frames[n] rows later.
    """
    values = soft.reshape(-1)
    starts = np.empty(group.size, dtype=np.int64)
    for n in range(group.size):
        starts[n] = group[n] * soft.shape[1] + first + frames[n]
    for s in range(group.size // SEGMENT_FRAMES):
        n, end = s * SEGMENT_FRAMES, (s + 1) * SEGMENT_FRAMES
        add_segment(values, starts[n:end], mask[n:end], before[s], sums[s])


@njit(cache=True, inner=True)
def add_segment(
    values: Soft, starts: NDArray[np.int64], masks: Soft, before: Soft, total: Soft
) -> None:
    """total[i] = before[i] + values[starts[n] + i] for all eight n, or less it: masks[n] is -1."""
    a, b, c, d = values[starts[0] :], values[starts[1] :], values[starts[2] :], values[starts[3] :]
    e, f, g, h = values[starts[4] :], values[starts[5] :], values[starts[6] :], values[starts[7] :]
    p, q, r, s = masks[0], masks[1], masks[2], masks[3]
    t, u, v, w = masks[4], masks[5], masks[6], masks[7]
    more = np.int8(-(p + q + r + s + t + u + v + w))
    for i in range(total.size):
        one = (p ^ a[i]) + (q ^ b[i]) + (r ^ c[i]) + (s ^ d[i])
        other = (t ^ e[i]) + (u ^ f[i]) + (v ^ g[i]) + (w ^ h[i])
        total[i] = np.int8(before[i] + more + one + other)


@njit(cache=True)
def drift_peaks(sums: Soft, shift: NDArray[np.int64], penalty: Parts, peak: Parts) -> None:
    """peak[i] = largest score of start i at any clock d.

    The score is the sum over the eight segments s of sums[s, i + shift[d, s]], less penalty[d].
    """
    places = peak.size
    for i in range(places):
        peak[i] = LOWEST
    for d in range(shift.shape[0]):
        at = shift[d]
        a, b = sums[0, at[0] : at[0] + places], sums[1, at[1] : at[1] + places]
        c, e = sums[2, at[2] : at[2] + places], sums[3, at[3] : at[3] + places]
        f, g = sums[4, at[4] : at[4] + places], sums[5, at[5] : at[5] + places]
        h, k = sums[6, at[6] : at[6] + places], sums[7, at[7] : at[7] + places]
        less = penalty[d]
        for i in range(places):
            total = np.int16(a[i] + b[i] + c[i] + e[i] + f[i] + g[i] + h[i] + k[i] - less)
            peak[i] = max(peak[i], total)


@njit(cache=True)
def clock_of(sums: Soft, shift: NDArray[np.int64], penalty: Parts, place: int) -> int:
    """Return the clock that gives a start its largest score, see `drift_peaks`."""
    best, highest = 0, int(LOWEST)
    for d in range(shift.shape[0]):
        total = -int(penalty[d])
        for s in range(shift.shape[1]):
            total += int(sums[s, place + shift[d, s]])
        if total > highest:
            best, highest = d, total
    return best


@njit(cache=True, inner=True)
def highest_near(values: Parts, width: int) -> Parts:
    """Return the highest of `width` values from each on."""
    near, seen = values, 1
    while seen < width:
        # Of twice as many by two of them; out of place, or loops are not made vectors.
        step = min(seen, width - seen)
        one, other = near[: near.size - step], near[step:]
        near = np.empty(one.size, dtype=np.int16)
        for i in range(near.size):
            near[i] = max(one[i], other[i])
        seen += step
    return near


@njit(cache=True)
def best_sum(
    peak: Parts,
    past: Parts,
    lag: int,
    weights: NDArray[np.float32],
    reach: NDArray[np.int64],
    least: np.float32,
) -> tuple[np.float32, int]:
    """Return the largest of all peaks and weighted sums with those before, and its place.

    Peak n before lies n lags back, at the best of places within reach[n - 1]; past ends where peak
    begins. Where none is above `least`, that and -1.
    """
    places, best, top = peak.size, least, -1
    highest = highest_of(peak)
    if np.float32(highest) > best:
        best, top = np.float32(highest), place_of(peak, highest)
    total = peak
    for n in range(weights.size):
        first = past.size - (n + 1) * lag - reach[n]
        near = highest_near(past[first : first + places + 2 * reach[n]], 2 * reach[n] + 1)
        for i in range(places):
            near[i] = np.int16(total[i] + near[i])
        total, highest = near, highest_of(near)
        if weights[n] * np.float32(highest) > best:
            best, top = weights[n] * np.float32(highest), place_of(total, highest)
    return best, top


@njit(cache=True, inner=True)
def highest_of(values: Parts) -> np.int16:
    """Return the highest value."""
    highest = LOWEST
    for i in range(values.size):
        highest = max(highest, values[i])
    return highest


@njit(cache=True, inner=True)
def place_of(values: Parts, wanted: np.int16) -> int:
    """Return the first place of a value that is there."""
    place = 0
    while values[place] != wanted:
        place += 1
    return place


@njit(cache=True)
def correlate_pilots(
    soft: Soft,
    first: int,
    quanta: int,
    places: int,
    frames: NDArray[np.int64],
    slots: NDArray[np.int64],
    masks: Soft,
    pairs: NDArray[np.int64],
    shift: NDArray[np.int64],
    penalty: Parts,
    lag: int,
    weights: NDArray[np.float32],
    reach: NDArray[np.int64],
    peaks: Parts,
    past: int,
    least: np.float32,
) -> tuple[np.float32, int, int, int]:
    """Return the largest score above `least`, its number of tier and profile, start and clock.

    soft has the shape (tiers, slots, rows) and counts from row `first` on. The peaks of the
    starts looked at, `quanta` times `places`, are written to peaks[n, past:], by the tier and
    profile pairs[n]. slots[n] and masks[n] are those of pilot n of each frame, masks by profile.
    Where no score is above `least`, the start is -1.
    """
    longest = 0
    for clock in range(shift.shape[0]):
        for segment in range(shift.shape[1]):
            longest = max(longest, shift[clock, segment])
    nothing = np.zeros((slots.shape[1] // SEGMENT_FRAMES, places + longest), dtype=np.int8)
    common, sums = np.empty_like(nothing), np.empty_like(nothing)
    best, pair, start, clock = least, -1, -1, -1
    for quantum in range(quanta):
        ahead, tier = quantum * places, -1
        now = past + ahead
        for n in range(pairs.shape[0]):
            if pairs[n, 0] != tier:
                tier = pairs[n, 0]
                pilot_sums(
                    soft[tier], first + ahead, frames, slots[0], masks[0, 0], nothing, common
                )
            own = masks[1, pairs[n, 1]]
            pilot_sums(soft[tier], first + ahead, frames, slots[1], own, common, sums)
            peak = peaks[n, now : now + places]
            drift_peaks(sums, shift, penalty, peak)
            best, top = best_sum(peak, peaks[n, :now], lag, weights, reach, best)
            if top >= 0:
                pair, start, clock = n, ahead + top, clock_of(sums, shift, penalty, top)
    return best, pair, start, clock


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
    turned, soft = np.empty(rows, dtype=np.float32), np.empty(rows, dtype=np.int8)
    sums = np.empty((PAIRED, places), dtype=np.int16)
    starts = np.empty((PAIRED, slots.shape[1]), dtype=np.int64)
    masks = np.empty((PAIRED, slots.shape[1]), dtype=np.int8)
    part = np.empty(places, dtype=np.int8)
    count = np.empty(PAIRED, dtype=np.int64)
    best = np.empty((profiles, places), dtype=np.int16)
    score[:] = np.int16(0)
    for s in range(projections.shape[0]):
        for i in range(rows):
            real[i], imaginary[i] = projections[s, i].real, projections[s, i].imag
        best[:] = LOWEST
        for t in range(turn.size):
            a, z = turn[t].real, turn[t].imag
            for i in range(rows):
                turned[i] = real[i] * a - imaginary[i] * z
            soft_row(turned, alive[s], pace, dither[s], soft)
            # Two profiles at once: what both add, and what the second takes that the first adds.
            for p in range(0, profiles, 2):
                q = min(p + 1, profiles - 1)
                count[:] = 0
                for n in range(slots.shape[0]):
                    for f in range(slots.shape[1]):
                        if slots[n, f] == s:
                            to = 0 if signs[n, p, f] == signs[n, q, f] else 1
                            starts[to, count[to]] = hop * f
                            masks[to, count[to]] = np.int8(-1 if signs[n, p, f] < 0 else 0)
                            count[to] += 1
                sums[:] = np.int16(0)
                for to in range(PAIRED):
                    total = sums[to]
                    for n in range(0, count[to], FITTING):
                        part[:] = np.int8(0)
                        some = min(FITTING, count[to] - n)
                        add_rows(soft, starts[to, n:], masks[to, n:], some, part)
                        for i in range(places):
                            total[i] = np.int16(total[i] + part[i])
                one, other, alike, unlike = best[p], best[q], sums[0], sums[1]
                for i in range(places):
                    one[i] = max(one[i], np.int16(alike[i] + unlike[i]))
                    other[i] = max(other[i], np.int16(alike[i] - unlike[i]))
        for p in range(profiles):
            for i in range(places):
                score[p, i] = np.int16(score[p, i] + best[p, i])
