"""Compiled search of the aligner: the cheapest cut of frames into units."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def segment_into(
    cumulated: NDArray[np.float64],
    kinds: NDArray[np.int64],
    optional: NDArray[np.bool_],
    lengths: NDArray[np.float64],
    shortest: int,
    starts: NDArray[np.int64],
) -> bool:
    """Cut frames into a given row of units at the least cost.

    cumulated : float64 (kinds, parts, frames + 1), running sums of the cost of a frame under each
    part of a kind of unit; kinds : int64 (units,); optional : bool (units,), units that may be
    absent and have no price for their length (silence); lengths : float64 (units, longest), cost
    of a unit of shortest + index frames; starts : int64 (units + 1,), filled with the first
    frames; an absent unit starts with its successor. The result is False if nothing fits.
    """
    units, frames, parts = kinds.shape[0], cumulated.shape[2] - 1, cumulated.shape[1]
    best = np.full((units + 1, frames + 1), np.inf)
    came = np.zeros((units + 1, frames + 1), np.int64)
    best[0, 0] = 0.0
    for u in range(units):
        kind = kinds[u]
        if optional[u]:
            running, since = np.inf, 0
            for t in range(frames + 1):
                cost = cumulated[kind, 0, t]
                if best[u, t] - cost < running:
                    running, since = best[u, t] - cost, t
                best[u + 1, t] = running + cost
                came[u + 1, t] = since
        else:
            for t in range(shortest, frames + 1):
                for k in range(min(lengths.shape[1], t - shortest + 1)):
                    begin = t - shortest - k
                    if best[u, begin] == np.inf:
                        continue
                    cost = best[u, begin] + lengths[u, k]
                    left = begin
                    for part in range(parts):
                        right = begin + ((part + 1) * (t - begin)) // parts
                        cost += cumulated[kind, part, right] - cumulated[kind, part, left]
                        left = right
                    if cost < best[u + 1, t]:
                        best[u + 1, t] = cost
                        came[u + 1, t] = begin
    t = frames
    starts[units] = frames
    for u in range(units - 1, -1, -1):
        t = came[u + 1, t]
        starts[u] = t
    return bool(best[units, frames] < np.inf)
