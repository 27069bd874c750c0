"""Compiled loops of the audio carrier.

Contiguous arrays in, arrays filled in place out; no checks.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit


@njit(cache=True, fastmath={"reassoc", "contract"})
def interpolate(
    x: NDArray[Any], start: float, ratio: float, table: NDArray[Any], out: NDArray[Any]
) -> None:
    """out[n] = x at the real index start + n * ratio, by tabulated impulse responses.

    table[p, j] weighs the sample at distance j - (taps / 2 - 1) from the whole part of an index
    whose fraction is p / (rows - 1); fractions between are interpolated. x must reach taps / 2
    samples beyond all indices on both sides.
    """
    taps = table.shape[1]
    steps = table.shape[0] - 1
    flat = table.reshape(-1)
    for n in range(out.size):
        position = start + n * ratio
        whole = int(position)
        where = (position - whole) * steps
        cell = min(int(where), steps - 1)
        part = where - cell
        near, below, above = whole - taps // 2 + 1, cell * taps, (cell + 1) * taps
        # Sums have the precision of the samples.
        out[n] = 0.0
        low = high = out[n]
        # Unsigned indices let the compiler see that none is negative: four times as fast.
        if part == 0.0:
            for j in range(taps):
                low += x[np.uint64(near + j)] * flat[np.uint64(below + j)]
            out[n] = low
            continue
        for j in range(taps):
            sample = x[np.uint64(near + j)]
            low += sample * flat[np.uint64(below + j)]
            high += sample * flat[np.uint64(above + j)]
        out[n] = low + part * (high - low)


@njit(cache=True, fastmath={"contract"})
def change_cells(
    coefficients: NDArray[np.float32],
    amplitudes: NDArray[np.float32],
    signs: NDArray[np.float64],
    first: int,
    dither: NDArray[np.float64],
    wanted: NDArray[np.float32],
    step: float,
    alpha: NDArray[np.float32],
    change: NDArray[np.float32],
) -> int:
    """Fill change[t, k] of the cells from bin `first` on; return how many can carry.

    See `watermark.audio.signal.dither.mark_change`.
    """
    bins, living = signs.size // dither.size, 0
    root = math.sqrt(bins)
    for t in range(wanted.shape[0]):
        for g in range(dither.size):
            total, alive = 0.0, True
            for i in range(g * bins, (g + 1) * bins):
                unit = amplitudes[t, first + i]
                if unit > 0:
                    total += coefficients[t, first + i] * signs[i] / unit
                else:
                    alive = False
            living += alive
            if not alive or wanted[t, g] == 0:
                continue
            error = (dither[g] + (1.0 - wanted[t, g]) / 4.0) - total / (root * step)
            move = alpha[g] * step * (error - math.floor(error + 0.5)) / root
            for i in range(g * bins, (g + 1) * bins):
                change[t, first + i] = move * signs[i] * amplitudes[t, first + i]
    return living


SINE = (
    6.283185307179586, -41.341702240399755, 81.60524927607504, -76.70585975306136,
    42.058693944897644, -15.094642576822984, 3.8199525848482793, -0.7181223017785001,
)  # fmt: skip
"""Taylor coefficients of sin(2 pi z): within a quarter of a turn it errs by less than 1e-11."""


@njit(cache=True, inline="always")
def cosine_of_turns(turns: float) -> float:
    """Return cos(2 pi turns)."""
    z = 0.25 - abs(turns - math.floor(turns + 0.5))
    y = z * z
    high = SINE[4] + y * (SINE[5] + y * (SINE[6] + y * SINE[7]))
    return z * (SINE[0] + y * (SINE[1] + y * (SINE[2] + y * (SINE[3] + y * high))))


@njit(cache=True, fastmath={"contract"})
def soft_cells(
    projections: NDArray[np.float64],
    alive: NDArray[np.bool_],
    dither: NDArray[np.float64],
    scale: float,
    out: NDArray[np.float64],
) -> None:
    """out[t, g] = cos(2 pi (projections[t, g] scale - dither[g])), 0 where a cell is not alive."""
    for t in range(out.shape[0]):
        for g in range(out.shape[1]):
            value = cosine_of_turns(projections[t, g] * scale - dither[g])
            out[t, g] = value if alive[t, g] else 0.0


@njit(cache=True, fastmath={"reassoc", "contract"})
def affordable_noise(
    ratio: NDArray[np.float64],
    bits: float,
    rounds: int,
    low: float,
    high: float,
    out: NDArray[np.float64],
) -> None:
    """out[n] = logarithm of the least noise that `bits` allow, by halving the interval from low.

    It is that for which half the sum of log2(1 + ratio[n] / noise) is at most `bits`.
    """
    grown = np.empty(ratio.shape[2])
    whole = grown.size - grown.size % 4
    for block in range(ratio.shape[0]):
        below, above = low, high
        for _ in range(rounds):
            middle = 0.5 * (below + above)
            scale, total = math.exp(-middle), 0.0
            grown[:] = 1.0
            for t in range(ratio.shape[1]):
                for k in range(grown.size):
                    grown[k] *= 1.0 + ratio[block, t, k] * scale
            # One logarithm for many factors, those of a frame are below 2^60; and four products
            # side by side, as each factor waits for the one before.
            a, b, c, d = 1.0, 1.0, 1.0, 1.0
            for k in range(0, whole, 4):
                a, b, c, d = a * grown[k], b * grown[k + 1], c * grown[k + 2], d * grown[k + 3]
                if max(max(a, b), max(c, d)) > 1e150:
                    total += (math.log2(a) + math.log2(b)) + (math.log2(c) + math.log2(d))
                    a, b, c, d = 1.0, 1.0, 1.0, 1.0
            for k in range(whole, grown.size):
                total += math.log2(grown[k])
            total += (math.log2(a) + math.log2(b)) + (math.log2(c) + math.log2(d))
            if 0.5 * total <= bits:
                above = middle
            else:
                below = middle
        out[block] = above


@njit(cache=True)
def noise_ratios(
    power: NDArray[Any],
    least: float,
    shape: NDArray[np.float64],
    edges: NDArray[np.int64],
    ratio: NDArray[np.float64],
    first: int,
    bins: int,
) -> None:
    """ratio[t, first + k] = (power[t, k] + least) / shape[t, b] of bins k below `bins`, band b."""
    for t in range(power.shape[0]):
        for b in range(edges.size - 1):
            for k in range(edges[b], min(edges[b + 1], bins)):
                ratio[t, first + k] = (power[t, k] + least) / shape[t, b]
