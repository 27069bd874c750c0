"""Small motion without end: random values on a grid of time, joined by cubic B-splines.

A value belongs to its place on the grid by a counter-based generator, so that any window of time
can be made alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_SPREAD = np.sqrt(0.4794)
"""Standard deviation of a cubic B-spline of white values, mean over its phase."""


@dataclass(frozen=True, slots=True)
class DriftNoise:
    """Slow random motion of several channels.

    Attributes
    ----------
    size : ndarray of float64, shape (C,)
        Standard deviation of each channel.
    step_s : float
        Between values of the grid; motion faster than half its inverse does not occur.
    seed : int
    """

    size: FloatArray
    step_s: float
    seed: int

    def at(self, times: FloatArray) -> FloatArray:
        """Return the channels at `times` (T,), seconds, shape (T, C).

        Examples
        --------
        >>> wander = DriftNoise(np.array([2.0]), 0.5, 7)
        >>> bool((wander.at(np.array([3.0])) == wander.at(np.array([1.0, 3.0]))[1]).all())
        True
        """
        if not len(times):
            return np.zeros((0, len(self.size)))
        place = np.asarray(times, dtype=np.float64) / self.step_s
        first = np.floor(place).astype(np.int64)
        low = int(first.min()) - 1
        grid = np.stack([self._values(k) for k in range(low, int(first.max()) + 3)])
        u = place - first
        basis = (
            np.stack(
                [(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3]
            )
            / 6.0
        )
        out = np.zeros((len(times), len(self.size)))
        for number in range(4):
            out += basis[number][:, None] * grid[first - low - 1 + number]
        return np.asarray(out * self.size / _SPREAD)

    def _values(self, place: int) -> FloatArray:
        return normals_of(self.seed, place, len(self.size))


def normals_of(seed: int, number: int, count: int) -> FloatArray:
    """Return `count` standard normal values that belong to a number, shape (count,)."""
    key = np.array([seed & 0xFFFFFFFF, number & 0xFFFFFFFFFFFFFFFF], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(key=key)).standard_normal(count)
