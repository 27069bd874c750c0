"""Compiled loops of the audio carrier.

Contiguous arrays in, arrays filled in place out; no checks.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit


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
    flat = table.reshape(-1)
    for n in range(out.size):
        position = start + n * ratio
        whole = int(position)
        where = (position - whole) * steps
        cell = min(int(where), steps - 1)
        part = where - cell
        near, below, above = whole - taps // 2 + 1, cell * taps, (cell + 1) * taps
        low = 0.0
        high = 0.0
        # Unsigned indices let the compiler see that none is negative: four times as fast.
        for j in range(taps):
            sample = x[np.uint64(near + j)]
            low += sample * flat[np.uint64(below + j)]
            high += sample * flat[np.uint64(above + j)]
        out[n] = low + part * (high - low)
