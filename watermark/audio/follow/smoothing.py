"""Means over windows of a superframe's cells, as products with tables of weights.

In: values by frame and cell; out: their mean around each cell under a Gaussian window. A superframe
is small: two products with square matrices take a tenth of the time of a filter that slides.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

TRUNCATED = 4.0
"""Deviations at which windows end."""

Array = NDArray[np.float64]


def smooth(values: Array, window: tuple[float, float], *, around: bool = False) -> Array:
    """Return the mean of values near each, shape (frames, cells).

    Parameters
    ----------
    values : ndarray of float64, shape (frames, cells)
        Beyond their borders lie zeros.
    window : tuple of float
        Deviations of a Gaussian window in frames and cells.
    around : bool
        Whether values at the borders go on beyond them instead.
    """
    of_frames, of_cells = (
        weights_around(count, deviation, around=around)
        for count, deviation in zip(values.shape, window, strict=True)
    )
    return np.asarray(of_frames @ values @ of_cells.T)


@lru_cache(maxsize=64)
def weights_around(count: int, deviation: float, *, around: bool = False) -> Array:
    """Return the weight of each value in the mean at each, shape (count, count)."""
    reach = int(TRUNCATED * deviation + 0.5)
    far = np.arange(-reach, reach + 1)
    window = np.exp(-0.5 * (far / deviation) ** 2)
    window /= window.sum()
    weights = np.zeros((count, count))
    for at in range(count):
        place = at + far
        if around:
            np.add.at(weights[at], np.clip(place, 0, count - 1), window)
        else:
            inside = (place >= 0) & (place < count)
            weights[at, place[inside]] = window[inside]
    return weights


def weighted_sum(factors: Array, parts: Array) -> Array:
    """Return the sum of the parts, the first axis, by their factors."""
    total = factors[0] * parts[0]
    for factor, part in zip(factors[1:], parts[1:], strict=False):
        total += factor * part
    return np.asarray(total)
