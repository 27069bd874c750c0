"""Small motion that never stops: seeded, and a function of absolute time only.

Sums of a few sinusoids with seeded frequencies and phases serve where noise would need a state,
and hashed normal numbers where an event needs its own: any window of time can be made alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Drift:
    """Slow motion of several channels.

    Attributes
    ----------
    rate, phase : ndarray, shape (K, C)
        Angular frequency, rad/s, and phase of each sinusoid of each channel.
    size : ndarray, shape (C,)
        Standard deviation of each channel.
    """

    rate: FloatArray
    phase: FloatArray
    size: FloatArray

    @classmethod
    def seeded(
        cls,
        size: FloatArray,
        rng: np.random.Generator,
        *,
        band_hz: tuple[float, float] = (0.08, 0.9),
        waves: int = 4,
    ) -> "Drift":
        """Return a drift with frequencies spread over `band_hz` and the given deviations."""
        shape = (waves, len(size))
        edges = np.geomspace(*band_hz, waves + 1)
        rate = edges[:-1, None] * (edges[1:] / edges[:-1])[:, None] ** rng.random(shape)
        return cls(2 * np.pi * rate, 2 * np.pi * rng.random(shape), np.asarray(size, dtype=float))

    def at(self, times: FloatArray) -> FloatArray:
        """Return the channels at `times` (T,), shape (T, C)."""
        out = np.zeros((len(times), len(self.size)))
        for rate, phase in zip(self.rate, self.phase, strict=True):
            out += np.sin(times[:, None] * rate + phase)
        out *= self.size * np.sqrt(2.0 / len(self.rate))
        return out


def normals_at(moment_s: float, count: int, seed: int) -> FloatArray:
    """Return `count` standard normal numbers that belong to a moment, to the millisecond.

    Examples
    --------
    >>> bool((normals_at(1.0, 3, 7) == normals_at(1.0, 3, 7)).all())
    True
    """
    key = np.array([seed & 0xFFFFFFFF, round(moment_s * 1000) & 0xFFFFFFFF], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(key=key)).standard_normal(count)
