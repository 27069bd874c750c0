"""Compiled loops of the sight of pilots: sliding spectra, their masks, the slots' projections.

Contiguous arrays in, arrays filled in place out; no checks. All in 32 bits: a search needs no more.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

Floats = NDArray[np.float32]
Numbers = NDArray[np.int64]

ADVANCE = 4
"""Samples from a frame's begin to the next one's."""


@njit(cache=True, inner=True, fastmath={"contract"})
def slide(
    sound: Floats,
    wave: Floats,
    turn: Floats,
    signs: Floats,
    edges: Numbers,
    scale: Floats,
    parts: Numbers,
    energy: Floats,
    real: Floats,
    imaginary: Floats,
    count: int,
) -> None:
    """Powers of bands and signed sums over parts of slots in frames `ADVANCE` samples apart.

    `count` frames are looked at. wave and turn are the tables of
    `watermark.audio.signal.mdct.sliding_tables`, signs has one entry per bin; their rows go on with
    zeros to the same length, a multiple of what vectors hold. energy[j, r] is
    scale[j] times that of band j, bins edges[j] on, in frame r; real[p, r] and imaginary[p, r] are
    sums over bins parts[p, 2] to parts[p, 3], the last left out.
    """
    period, bins = wave.shape[1], signs.size
    # The plain transform of the frame: real parts, imaginary parts, with a neighbour of the last.
    x, y = np.empty(bins + 1, dtype=np.float32), np.empty(bins + 1, dtype=np.float32)
    for k in range(bins + 1):
        x[k], y[k] = np.float32(0), np.float32(0)
    x_next, y_next = x[1:], y[1:]
    signed_x, signed_y = np.empty(bins, dtype=np.float32), np.empty(bins, dtype=np.float32)
    power = np.empty(bins, dtype=np.float32)
    a0, a1, a2, a3 = wave[0, 0], wave[0, 1], wave[0, 2], wave[0, 3]
    b0, b1, b2, b3 = wave[1, 0], wave[1, 1], wave[1, 2], wave[1, 3]
    on_x, on_y = turn[0], turn[1]
    own_x, own_y, other_x, other_y = turn[2], turn[3], turn[4], turn[5]
    for i in range(period):
        sample, wave_x, wave_y = sound[i], wave[0, i], wave[1, i]
        for k in range(bins):
            x[k] += sample * wave_x[k]
            y[k] += sample * wave_y[k]
    for r in range(count):
        if r:
            i = ADVANCE * (r - 1)
            d0, d1 = sound[i + period] - sound[i], sound[i + period + 1] - sound[i + 1]
            d2, d3 = sound[i + period + 2] - sound[i + 2], sound[i + period + 3] - sound[i + 3]
            for k in range(bins):
                a = x[k] + ((d0 * a0[k] + d1 * a1[k]) + (d2 * a2[k] + d3 * a3[k]))
                b = y[k] + ((d0 * b0[k] + d1 * b1[k]) + (d2 * b2[k] + d3 * b3[k]))
                x[k], y[k] = a * on_x[k] - b * on_y[k], a * on_y[k] + b * on_x[k]
        for k in range(bins):
            a = (own_x[k] * x[k] - own_y[k] * y[k]) + (
                other_x[k] * x_next[k] - other_y[k] * y_next[k]
            )
            b = (own_x[k] * y[k] + own_y[k] * x[k]) + (
                other_x[k] * y_next[k] + other_y[k] * x_next[k]
            )
            signed_x[k], signed_y[k], power[k] = signs[k] * a, signs[k] * b, a * a + b * b
        for j in range(energy.shape[0]):
            total = np.float32(0)
            for k in range(edges[j], edges[j + 1]):
                total += power[k]
            energy[j, r] = scale[j] * total
        for p in range(parts.shape[0]):
            a, b = np.float32(0), np.float32(0)
            for k in range(parts[p, 2], parts[p, 3]):
                a += signed_x[k]
                b += signed_y[k]
            real[p, r], imaginary[p, r] = a, b


@njit(cache=True, inner=True, fastmath={"reassoc", "contract"})
def mask(
    energy: Floats,
    spread: Floats,
    digits: Numbers,
    cap: np.float32,
    floor: np.float32,
    reference: np.float32,
    thresholds: Floats,
    hop: int,
    count: int,
) -> None:
    """thresholds[j, hop + r] = masking threshold of band j in frame r, of `count`.

    See `watermark.audio.signal.masking.Masker.thresholds`. The exponent of the compression has the
    binary digits `digits` after its point: powers are products of repeated square roots.
    """
    bands = energy.shape[0]
    spread_power, root = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    for j in range(bands):
        # Spread energy of all bands into band j.
        for r in range(count):
            spread_power[r] = np.float32(0)
        for i in range(bands):
            gain, row = spread[i, j], energy[i]
            for r in range(count):
                spread_power[r] += gain * row[r]
        own, out = energy[j], thresholds[j, hop:]
        for r in range(count):
            # out = reference * (spread / reference) ** 0.digits: root runs through the powers 1/2,
            # 1/4, 1/8 ...
            root[r] = min(spread_power[r], cap * own[r]) / reference
            out[r] = reference
        for digit in digits:
            for r in range(count):
                root[r] = np.sqrt(root[r])
            if digit:
                for r in range(count):
                    out[r] *= root[r]
        for r in range(count):
            out[r] = min(out[r], cap * own[r]) if own[r] >= floor else np.float32(0)


@njit(cache=True, inner=True, fastmath={"reassoc", "contract"})
def project(
    thresholds: Floats,
    hop: int,
    growth: np.float32,
    least: np.float32,
    parts: Numbers,
    real: Floats,
    imaginary: Floats,
    projections: NDArray[np.complex64],
    alive: Floats,
    first: int,
    count: int,
) -> None:
    """projections[g, first + r] = projection of slot g in frame r, of `count`.

    alive[g, first + r] = 1, or 0 if a bin is silent. Frame r has the thresholds[:, hop + r]; those
    a hop earlier, or `least`, limit them by `growth`. Part p lies in slot parts[p, 0] and band
    parts[p, 1]; parts go from slot to slot.
    """
    slots = projections.shape[0]
    one, nothing = np.float32(1), np.float32(0)
    x, y = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    p = 0
    for g in range(slots):
        living, out = alive[g, first : first + count], projections[g, first:]
        for r in range(count):
            x[r], y[r], living[r] = nothing, nothing, one
        # All parts (bins) of slot g, each in units of its band's threshold; a silent band kills the
        # slot.
        while p < parts.shape[0] and parts[p, 0] == g:
            now, before = thresholds[parts[p, 1], hop:], thresholds[parts[p, 1]]
            a, b = real[p], imaginary[p]
            for r in range(count):
                # Pre-echo control: a threshold may grow by no more than `growth` from hop to hop.
                limited = min(now[r], growth * max(before[r], least))
                some = limited > 0
                factor = one / np.sqrt(limited if some else one)
                x[r] += factor * a[r]
                y[r] += factor * b[r]
                living[r] = living[r] if some else nothing
            p += 1
        for r in range(count):
            out[r] = complex(living[r] * x[r], living[r] * y[r])


@njit(cache=True)
def look(
    sound: Floats,
    wave: Floats,
    turn: Floats,
    signs: Floats,
    edges: Numbers,
    scale: Floats,
    parts: Numbers,
    spread: Floats,
    digits: Numbers,
    limits: Floats,
    before: Floats,
    projections: NDArray[np.complex64],
    alive: Floats,
    rows: int,
) -> None:
    """Project the slots of all frames of a sound, `rows` of them at a time, see `project`.

    limits are cap, floor and reference of `mask`, growth and least of `project`. before holds the
    thresholds of the frames up to a hop before the first, shape (bands, hop), and is replaced by
    those of the last ones.
    """
    bands, hop = before.shape
    count = projections.shape[1]
    energy = np.empty((bands, rows), dtype=np.float32)
    real = np.empty((parts.shape[0], rows), dtype=np.float32)
    imaginary = np.empty((parts.shape[0], rows), dtype=np.float32)
    thresholds = np.empty((bands, hop + rows), dtype=np.float32)
    # Numba's assignment of arrays takes seconds to compile.
    for j in range(bands):
        for r in range(hop):
            thresholds[j, r] = before[j, r]
    for first in range(0, count, rows):
        n = min(rows, count - first)
        # Whole arrays, of which the first n count: parts of them would be no contiguous ones.
        slide(
            sound[ADVANCE * first :], wave, turn, signs, edges, scale, parts,
            energy, real, imaginary, n,
        )  # fmt: skip
        mask(energy, spread, digits, limits[0], limits[1], limits[2], thresholds, hop, n)
        project(
            thresholds, hop, limits[3], limits[4], parts, real, imaginary,
            projections, alive, first, n,
        )  # fmt: skip
        for j in range(bands):
            for r in range(hop):
                thresholds[j, r] = thresholds[j, n + r]
    for j in range(bands):
        for r in range(hop):
            before[j, r] = thresholds[j, r]
