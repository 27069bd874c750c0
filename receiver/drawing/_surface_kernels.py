"""The fine surface over a coarse mesh, vertex by vertex."""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

FloatArray = NDArray[np.float64]


@njit(cache=True)
def refine_into(
    control: FloatArray,
    sources: NDArray[np.int64],
    shares: FloatArray,
    offsets: FloatArray,
    out: FloatArray,
) -> None:
    """Fill `out` (T, V, 3) with means of a mesh (T, M, 3), by sources and shares (V, 3)."""
    for t in range(len(control)):
        for v in range(len(sources)):
            a, b, c = sources[v, 0], sources[v, 1], sources[v, 2]
            p, q, r = shares[v, 0], shares[v, 1], shares[v, 2]
            for k in range(3):
                out[t, v, k] = offsets[v, k] + (
                    p * control[t, a, k] + q * control[t, b, k] + r * control[t, c, k]
                )
