"""Compiled loops of the audio carrier.

Contiguous arrays in, arrays filled in place out; no checks.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, fastmath={"reassoc", "contract"})
def interpolate(
    x: NDArray[np.float64],
    start: float,
    ratio: float,
    table: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """out[n] = x at the real index start + n * ratio, by tabulated impulse responses.

    table[p, j] weighs the sample at distance j - (taps / 2 - 1) from the whole part of an index
    whose fraction is p / (rows - 1); fractions between are interpolated. x must reach taps / 2
    samples beyond all indices on both sides.
    """
    taps = table.shape[1]
    steps = table.shape[0] - 1
    for n in range(out.size):
        position = start + n * ratio
        whole = math.floor(position)
        where = (position - whole) * steps
        cell = min(int(where), steps - 1)
        part = where - cell
        near = x[whole - taps // 2 + 1 : whole + taps // 2 + 1]
        below = table[cell]
        above = table[cell + 1]
        low = 0.0
        high = 0.0
        for j in range(taps):
            low += near[j] * below[j]
            high += near[j] * above[j]
        out[n] = low + part * (high - low)


@njit(cache=True)
def pilot_projections(
    spectra: NDArray[np.complex64],
    units: NDArray[np.float32],
    first: int,
    signs: NDArray[np.float32],
    projections: NDArray[np.complex64],
    alive: NDArray[np.float32],
) -> None:
    """projections[g, i] = projection of cell g in spectrum i; alive[g, i] = 0 if one bin is silent.

    spectra and the mark's units have the shape (rows, bins). Cells are stretches of equal length
    from bin `first` on.
    """
    slots, count = projections.shape
    bins = signs.size // slots
    scale = np.float32(1 / math.sqrt(bins))
    one, nothing = np.float32(1), np.float32(0)
    for i in range(count):
        for g in range(slots):
            real, imaginary, living = nothing, nothing, one
            for b in range(bins):
                k = first + g * bins + b
                unit = units[i, k]
                some = unit > 0
                factor = scale * signs[g * bins + b] / (unit if some else one)
                real += factor * spectra[i, k].real
                imaginary += factor * spectra[i, k].imag
                living = living if some else nothing
            projections[g, i] = complex(living * real, living * imaginary)
            alive[g, i] = living


@njit(cache=True)
def pilot_soft(
    projections: NDArray[np.complex64],
    alive: NDArray[np.float32],
    turn: NDArray[np.complex64],
    dither: NDArray[np.float32],
    steps: NDArray[np.float32],
    first: int,
    soft: NDArray[np.float32],
) -> None:
    """soft[s, g, first + i * turns + t] = soft value of cell g in row i, turned by turn[t, g].

    The step is steps[s]; see watermark.dither.
    """
    turns, count = turn.shape[0], alive.shape[1]
    one, half = np.float32(1), np.float32(0.5)
    c = np.empty(6, dtype=np.float32)
    term = 1.0
    for n in range(6):
        term *= -((2 * math.pi) ** 2) / ((2 * n + 1) * (2 * n + 2))
        c[n] = term
    c0, c1, c2, c3, c4, c5 = c[0], c[1], c[2], c[3], c[4], c[5]
    real, imaginary = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    value = np.empty((turns, count), dtype=np.float32)
    for g in range(dither.size):
        for i in range(count):
            real[i], imaginary[i] = projections[g, i].real, projections[g, i].imag
        living, offset = alive[g], dither[g]
        for s in range(steps.size):
            pace = one / steps[s]
            for t in range(turns):
                a, z, row = turn[t, g].real * pace, turn[t, g].imag * pace, value[t]
                for i in range(count):
                    phase = real[i] * a - imaginary[i] * z - offset
                    phase -= np.floor(phase + half)
                    # Taylor's series of cos(2 pi phase), within 2e-4: a search needs no more.
                    u = phase * phase
                    cosine = one + u * (c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5)))))
                    row[i] = living[i] * cosine
            out = soft[s, g, first : first + count * turns]
            for i in range(count):
                for t in range(turns):
                    out[i * turns + t] = value[t, i]


@njit(cache=True)
def pilot_sums(
    soft: NDArray[np.float32],
    first: int,
    hop: int,
    segment: int,
    group: NDArray[np.int64],
    sign: NDArray[np.float32],
    sums: NDArray[np.float32],
) -> None:
    """sums[s, i] += correlation of the pilots of segment s for a superframe that starts at row i.

    soft[g, first:] holds the soft value at position g for each start of a frame; a segment is
    `segment` frames, which lie `hop` rows apart.
    """
    places = sums.shape[1]
    for f in range(group.size):
        total = sums[f // segment]
        # Slices let the compiler see that no index is negative, and vectorise.
        values = soft[group[f], first + hop * f : first + hop * f + places]
        if sign[f] > 0:
            for i in range(places):
                total[i] += values[i]
        else:
            for i in range(places):
                total[i] -= values[i]


@njit(cache=True)
def drift_peaks(
    sums: NDArray[np.float32],
    shift: NDArray[np.int64],
    penalty: NDArray[np.float32],
    peak: NDArray[np.float32],
    drift: NDArray[np.int32],
) -> None:
    """peak[i] = largest score of start i, and drift[i] = its d.

    The score is the sum over the eight segments s of sums[s, i + shift[d, s]], less penalty[d].
    """
    places = peak.size
    peak[:] = -np.inf
    for d in range(shift.shape[0]):
        at = shift[d]
        # Slices let the compiler see that no index is negative, and vectorise.
        a, b = sums[0, at[0] : at[0] + places], sums[1, at[1] : at[1] + places]
        c, e = sums[2, at[2] : at[2] + places], sums[3, at[3] : at[3] + places]
        f, g = sums[4, at[4] : at[4] + places], sums[5, at[5] : at[5] + places]
        h, k = sums[6, at[6] : at[6] + places], sums[7, at[7] : at[7] + places]
        less, number = penalty[d], np.int32(d)
        for i in range(places):
            total = ((((a[i] - less) + b[i]) + c[i]) + e[i]) + f[i] + g[i] + h[i] + k[i]
            better = total > peak[i]
            drift[i] = number if better else drift[i]
            peak[i] = total if better else peak[i]


@njit(cache=True)
def add_priors(
    peak: NDArray[np.float32],
    error: NDArray[np.int32],
    lag: NDArray[np.int64],
    past: NDArray[np.float32],
    weights: NDArray[np.float32],
    ceiling: np.float32,
    floor: np.float32,
    score: NDArray[np.float32],
) -> None:
    """score[i] = largest of peak[i] and its weighted sums with the one, two, ... peaks before.

    The peak before lies lag[error[i]] places back, the next one twice as far, each at the best of
    places nearby; past ends where peak begins and nowhere exceeds ceiling. Sums that cannot reach
    floor may be left out.
    """
    least = np.float32(np.inf)
    for back in range(1, weights.size + 1):
        least = min(least, floor / weights[back - 1] - back * ceiling)
    score[:] = peak
    for i in range(peak.size):
        if peak[i] < least:
            continue
        total = peak[i]
        for back in range(1, weights.size + 1):
            place = past.size + i - back * lag[error[i]]
            nearby = past[place - back]
            for shift in range(1 - back, back + 1):
                nearby = max(nearby, past[place + shift])
            total += nearby
            score[i] = max(score[i], weights[back - 1] * total)


@njit(cache=True)
def correlate_pilots(
    soft: NDArray[np.float32],
    first: int,
    places: int,
    hop: int,
    segment: int,
    slots: NDArray[np.int64],
    signs: NDArray[np.float32],
    pairs: NDArray[np.int64],
    shift: NDArray[np.int64],
    penalty: NDArray[np.float32],
    lag: NDArray[np.int64],
    weights: NDArray[np.float32],
    floor: np.float32,
    ceiling: NDArray[np.float32],
    peaks: NDArray[np.float32],
    past: int,
    best: NDArray[np.float32],
    where: NDArray[np.int64],
) -> None:
    """best[n] = largest score of tier and profile pairs[n], where[n] its start and clock error.

    soft has the shape (tiers, slots, rows) and counts from row `first` on. The peaks of the
    `places` starts looked at are written to peaks[n, past:]; those before are bounded by
    ceiling[n]. slots[n] and signs[n] are those of pilot n of each frame, signs by profile.
    """
    common = np.empty((slots.shape[1] // segment, places + shift.max()), dtype=np.float32)
    error, score = np.empty(places, dtype=np.int32), np.empty(places, dtype=np.float32)
    tier = -1
    for n in range(pairs.shape[0]):
        if pairs[n, 0] != tier:
            tier = pairs[n, 0]
            common[:] = np.float32(0)
            pilot_sums(soft[tier], first, hop, segment, slots[0], signs[0, 0], common)
        sums = common.copy()
        pilot_sums(soft[tier], first, hop, segment, slots[1], signs[1, pairs[n, 1]], sums)
        peak = peaks[n, past : past + places]
        drift_peaks(sums, shift, penalty, peak, error)
        add_priors(peak, error, lag, peaks[n, :past], weights, ceiling[n], floor, score)
        top = 0
        for i in range(places):
            if score[i] > score[top]:
                top = i
        best[n], where[n, 0], where[n, 1] = score[top], top, error[top]


@njit(cache=True)
def turned_scores(
    projections: NDArray[np.complex64],
    alive: NDArray[np.float32],
    dither: NDArray[np.float32],
    pace: np.float32,
    turn: NDArray[np.complex64],
    hop: int,
    slots: NDArray[np.int64],
    signs: NDArray[np.float32],
    score: NDArray[np.float32],
) -> None:
    """score[p, i] = sum over slots of the largest correlation at any phase, for start i.

    projections and alive have the shape (slots, rows); frames lie `hop` rows apart. slots[n, f] is
    the slot of pilot n of frame f, signs[n, p, f] its value in profile p. pace is 1 / step.
    """
    profiles, places = score.shape
    rows = projections.shape[1]
    one, half, nothing = np.float32(1), np.float32(0.5), np.float32(0)
    c = np.empty(6, dtype=np.float32)
    term = 1.0
    for n in range(6):
        term *= -((2 * math.pi) ** 2) / ((2 * n + 1) * (2 * n + 2))
        c[n] = term
    soft = np.empty(rows, dtype=np.float32)
    common = np.empty(places, dtype=np.float32)
    total = np.empty(places, dtype=np.float32)
    best = np.empty((profiles, places), dtype=np.float32)
    score[:] = nothing
    for s in range(projections.shape[0]):
        best[:] = -np.inf
        for t in range(turn.size):
            a, z = turn[t].real * pace, turn[t].imag * pace
            for i in range(rows):
                phase = projections[s, i].real * a - projections[s, i].imag * z - dither[s]
                phase -= np.floor(phase + half)
                u = phase * phase
                value = c[0] + u * (c[1] + u * (c[2] + u * (c[3] + u * (c[4] + u * c[5]))))
                soft[i] = alive[s, i] * (one + u * value)
            common[:] = nothing
            for f in range(slots.shape[1]):
                if slots[0, f] == s:
                    values = soft[hop * f : hop * f + places]
                    sign = signs[0, 0, f]
                    for i in range(places):
                        common[i] += sign * values[i]
            for p in range(profiles):
                total[:] = common
                for f in range(slots.shape[1]):
                    if slots[1, f] == s:
                        values = soft[hop * f : hop * f + places]
                        sign = signs[1, p, f]
                        for i in range(places):
                            total[i] += sign * values[i]
                highest = best[p]
                for i in range(places):
                    highest[i] = max(highest[i], total[i])
        for p in range(profiles):
            for i in range(places):
                score[p, i] += best[p, i]
