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


@njit(cache=True)
def turn_into(
    points: NDArray[np.float64],
    turn: NDArray[np.float64],
    shift: NDArray[np.float64],
    out: NDArray[np.float32],
) -> None:
    """Fill `out` (T, n, K, 3) with turn × point + shift.

    points is (T, K, 3); turn and shift are (T, K or 1, 3, n): a vector per point or for all.
    """
    each = 1 if turn.shape[1] > 1 else 0
    for t in range(points.shape[0]):
        for i in range(turn.shape[3]):
            for k in range(points.shape[1]):
                x, y, z = points[t, k, 0], points[t, k, 1], points[t, k, 2]
                m = k * each
                u, v, w = turn[t, m, 0, i], turn[t, m, 1, i], turn[t, m, 2, i]
                out[t, i, k, 0] = v * z - w * y + shift[t, m, 0, i]
                out[t, i, k, 1] = w * x - u * z + shift[t, m, 1, i]
                out[t, i, k, 2] = u * y - v * x + shift[t, m, 2, i]
