"""Compiled search for the corrections of lengths in windows (`window_writer`).

Contiguous arrays in, an array filled in place out; no checks, no globals of other modules (numba's
cache would not see them change).
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

STEADY = 4
"""Most ticks that a key may start early or late."""


@njit(cache=True)
def steer(
    usual: NDArray[np.int64],
    true: NDArray[np.int64],
    kinds: NDArray[np.int64],
    weights: NDArray[np.float64],
    limits: NDArray[np.float64],
    error: int,
    values: NDArray[np.int64],
    costs: NDArray[np.float64],
    chosen: NDArray[np.int64],
) -> float:
    """Choose corrections of rule-based lengths such that bits and weighted errors cost least.

    ``usual`` and ``true`` are the lengths of ``n`` phones, ``kinds`` 0 for a pause, which takes
    up any error, 1 for a phone as it is, 2 for one with a correction of ``values`` at ``costs``;
    ``weights`` are those of the squared error at each end, ``limits`` those of each tick by which
    it exceeds four, ``error`` is that at the beginning.
    Fills in ``chosen`` and returns the cost (Viterbi 1967, over the error).
    """
    n, reach = len(usual), 16
    size = 2 * reach + 1
    best = np.full(size, np.inf)
    best[min(max(error, -reach), reach) + reach] = 0.0
    came = np.zeros((n, size), dtype=np.int64)
    what = np.zeros((n, size), dtype=np.int64)
    # best[k + 1, e'] = min over the error e before and the correction c of
    #     best[k, e] + bits(c) + weight e'^2 + limit max(|e'| - STEADY, 0)
    for k in range(n):
        following = np.full(size, np.inf)
        for e in range(size):
            if best[e] == np.inf:
                continue
            for c in range(len(values) if kinds[k] == 2 else 1):
                late = 0
                cost = best[e]
                if kinds[k] > 0:
                    length = usual[k] + (values[c] if kinds[k] == 2 else 0)
                    late = e - reach + min(max(length, 1), 32) - true[k]
                if kinds[k] == 2:
                    cost += costs[c]
                cost += weights[k] * late * late
                cost += limits[k] * max(abs(late) - STEADY, 0)
                at = min(max(late, -reach), reach) + reach
                if cost < following[at]:
                    following[at], came[k, at], what[k, at] = cost, e, c
        best = following
    at = int(np.argmin(best))
    total: float = best[at]
    for k in range(n - 1, -1, -1):
        chosen[k] = what[k, at]
        at = came[k, at]
    return total
