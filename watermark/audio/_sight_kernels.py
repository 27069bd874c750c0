"""Compiled loops of the sight of pilots: sliding spectra, their masks, the slots' projections.

Contiguous arrays in, arrays filled in place out; no checks. All in 32 bits: a search needs no more.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Numbers = NDArray[np.int64]

ADVANCE = 4
"""Samples by which a frame lies after the one before."""


@njit(cache=True, fastmath={"contract"})
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
) -> None:
    """Powers of the bands and signed sums over parts of slots in frames `ADVANCE` samples apart.

    wave and turn are the tables of `watermark.audio.mdct.sliding_tables`, signs has one entry per
    bin. energy[j, r] is scale[j] times that of band j, bins edges[j] on, in frame r; real[p, r] and
    imaginary[p, r] are sums over bins parts[p, 2] to parts[p, 3], the last left out.
    """
    period, cycle, bins = wave.shape[0], turn.shape[0], signs.size
    both = 2 * bins + 2
    waves, turns = wave.reshape(-1), turn.reshape(-1)
    # Transforms of the frame, not yet turned to its own start: the real parts, the imaginary ones.
    plain = np.zeros(both, dtype=np.float32)
    signed_x, signed_y = np.empty(bins, dtype=np.float32), np.empty(bins, dtype=np.float32)
    power = np.empty(bins, dtype=np.float32)
    for i in range(period):
        sample, row = sound[i], wave[i]
        for k in range(both):
            plain[k] += sample * row[k]
    for r in range(energy.shape[1]):
        if r:
            i = ADVANCE * (r - 1)
            d0, d1 = sound[i + period] - sound[i], sound[i + period + 1] - sound[i + 1]
            d2, d3 = sound[i + period + 2] - sound[i + 2], sound[i + period + 3] - sound[i + 3]
            # Unsigned indices let the compiler see that none is negative, and vectorise.
            w = i % period * both
            for k in range(both):
                plain[np.uint64(k)] += (
                    d0 * waves[np.uint64(w + k)] + d1 * waves[np.uint64(w + both + k)]
                ) + (
                    d2 * waves[np.uint64(w + 2 * both + k)]
                    + d3 * waves[np.uint64(w + 3 * both + k)]
                )
        t = r % cycle * 4 * bins
        for k in range(bins):
            x, x_next = plain[np.uint64(k)], plain[np.uint64(k + 1)]
            y, y_next = plain[np.uint64(bins + 1 + k)], plain[np.uint64(bins + 2 + k)]
            c, d = turns[np.uint64(t + k)], turns[np.uint64(t + bins + k)]
            e, f = turns[np.uint64(t + 2 * bins + k)], turns[np.uint64(t + 3 * bins + k)]
            a, b = c * x - d * y + e * x_next - f * y_next, c * y + d * x + e * y_next + f * x_next
            signed_x[np.uint64(k)], signed_y[np.uint64(k)] = signs[k] * a, signs[k] * b
            power[np.uint64(k)] = a * a + b * b
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


@njit(cache=True, fastmath={"reassoc", "contract"})
def mask(
    energy: Floats,
    spread: Floats,
    digits: Numbers,
    cap: np.float32,
    floor: np.float32,
    reference: np.float32,
    thresholds: Floats,
) -> None:
    """thresholds[j, r] of band j in frame r: see `watermark.audio.masking.Masker.thresholds`.

    The exponent of the compression has the binary digits `digits` after its point: powers are
    products of repeated square roots.
    """
    bands, count = energy.shape
    spread_power, root = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    for j in range(bands):
        spread_power[:] = np.float32(0)
        for i in range(bands):
            gain, row = spread[i, j], energy[i]
            for r in range(count):
                spread_power[r] += gain * row[r]
        own, out = energy[j], thresholds[j]
        for r in range(count):
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


@njit(cache=True, fastmath={"reassoc", "contract"})
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
) -> None:
    """projections[g, r] = projection of slot g in frame r; alive[g, r] = 0 if a bin is silent.

    Frame r has the thresholds[:, hop + r]; those a hop earlier, or `least`, limit them by `growth`.
    Part p lies in slot parts[p, 0] and band parts[p, 1]; parts go from slot to slot.
    """
    slots, count = projections.shape
    one, nothing = np.float32(1), np.float32(0)
    x, y = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    p = 0
    for g in range(slots):
        x[:], y[:] = nothing, nothing
        living, out = alive[g], projections[g]
        living[:] = one
        while p < parts.shape[0] and parts[p, 0] == g:
            now, before = thresholds[parts[p, 1], hop:], thresholds[parts[p, 1]]
            a, b = real[p], imaginary[p]
            for r in range(count):
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
    thresholds[:, :hop] = before
    for first in range(0, count, rows):
        n = min(rows, count - first)
        slide(
            sound[ADVANCE * first :], wave, turn, signs, edges, scale, parts,
            energy[:, :n], real[:, :n], imaginary[:, :n],
        )  # fmt: skip
        mask(
            energy[:, :n], spread, digits, limits[0], limits[1], limits[2],
            thresholds[:, hop : hop + n],
        )  # fmt: skip
        project(
            thresholds[:, : hop + n], hop, limits[3], limits[4], parts, real[:, :n],
            imaginary[:, :n], projections[:, first : first + n], alive[:, first : first + n],
        )  # fmt: skip
        thresholds[:, :hop] = thresholds[:, n : n + hop].copy()
    before[:] = thresholds[:, :hop]
