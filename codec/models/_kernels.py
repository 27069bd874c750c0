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


@njit(cache=True)
def _turned(
    motion: NDArray[np.float64], share: NDArray[np.float64], matrix: NDArray[np.float64]
) -> None:
    """Fill `matrix` (3, 4) with rotation and shift of a share of a motion (Rodrigues' formula)."""
    x, y, z = motion[0] * share[0], motion[1] * share[1], motion[2] * share[2]
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    if angle < 1e-4:
        once, twice = 1 - square / 6, 0.5 - square / 24
    else:
        once, twice = np.sin(angle) / angle, (1 - np.cos(angle)) / square
    matrix[0, 0] = 1 - twice * (y * y + z * z)
    matrix[1, 1] = 1 - twice * (x * x + z * z)
    matrix[2, 2] = 1 - twice * (x * x + y * y)
    matrix[0, 1], matrix[1, 0] = twice * x * y - once * z, twice * x * y + once * z
    matrix[0, 2], matrix[2, 0] = twice * x * z + once * y, twice * x * z - once * y
    matrix[1, 2], matrix[2, 1] = twice * y * z - once * x, twice * y * z + once * x
    for i in range(3):
        matrix[i, 3] = motion[3 + i] * share[3 + i]


@njit(cache=True)
def move_into(
    points: NDArray[np.float64],
    motion: NDArray[np.float64],
    shares: NDArray[np.float64],
    pivot: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Fill `out` with points (T, K, 3) about `pivot`, each moved by its share of a motion.

    motion is (T, 6), shares are (K, 6); equal shares of neighbours are turned once.
    """
    matrix = np.empty((3, 4))
    for t in range(points.shape[0]):
        for k in range(points.shape[1]):
            new = k == 0
            for i in range(6):
                new = new or shares[k, i] != shares[k - 1, i]
            if new:
                _turned(motion[t], shares[k], matrix)
            x, y, z = points[t, k, 0], points[t, k, 1], points[t, k, 2]
            for i in range(3):
                moved = matrix[i, 0] * x + matrix[i, 1] * y + matrix[i, 2] * z
                out[t, k, i] = moved + matrix[i, 3] + pivot[i]
