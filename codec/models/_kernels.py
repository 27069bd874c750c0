"""Compiled loops of the models."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def prune_into(
    frames: NDArray[np.float32], squared_distance: float, kept: NDArray[np.int64]
) -> int:
    """Fill `kept` with the frames that differ from all kept ones; return their number.

    frames is (T, K, 3). Two frames differ when some marker is farther than the limit.
    """
    count = 0
    for t in range(frames.shape[0]):
        new = True
        # The latest kept frame is the likeliest neighbour of a moving body.
        for back in range(count):
            other = kept[count - 1 - back]
            differs = False
            for k in range(frames.shape[1]):
                dx = frames[t, k, 0] - frames[other, k, 0]
                dy = frames[t, k, 1] - frames[other, k, 1]
                dz = frames[t, k, 2] - frames[other, k, 2]
                if dx * dx + dy * dy + dz * dz >= squared_distance:
                    differs = True
                    break
            if not differs:
                new = False
                break
        if new:
            kept[count] = t
            count += 1
    return count
