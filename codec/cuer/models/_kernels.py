"""Compiled loops of the models."""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit


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


@njit(cache=True, inner=True)
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


@njit(cache=True)
def densities_into(
    values: NDArray[np.float64],
    known: NDArray[np.bool_],
    means: NDArray[np.float64],
    precisions: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Fill `out` (T, K) with the known values' distances and log determinants.

    values and known are (T, D), means (K, D), precisions (K, D, D). With P the precision, H the
    unknown values and a the distances from the mean, 0 where unknown, the known values' own
    distance is aᵀPa - (Pa)ₕᵀ Pₕₕ⁻¹ (Pa)ₕ and the determinant of their covariance that of all times
    that of Pₕₕ: few values are unknown, so that this is much less than to factorise the covariance
    of the known ones. The determinant of all is left out.
    """
    away, pull = np.empty(values.shape[1]), np.empty(values.shape[1])
    hidden = np.empty(values.shape[1], np.int64)
    factor, shift = np.empty((values.shape[1], values.shape[1])), np.empty(values.shape[1])
    for k in range(means.shape[0]):
        count, volume = 0, 0.0
        for t in range(values.shape[0]):
            if t == 0 or (known[t] != known[t - 1]).any():
                count = _factorise(precisions[k], known[t], hidden, factor)
                volume = 0.0
                for i in range(count):
                    volume += 2.0 * np.log(factor[i, i])
            _pull(values[t], known[t], means[k], precisions[k], away, pull)
            _solve(factor, hidden, count, pull, shift)
            distance = volume
            for i in range(values.shape[1]):
                distance += away[i] * pull[i]
            for i in range(count):
                distance -= shift[i] * pull[hidden[i]]
            out[t, k] = distance


@njit(cache=True)
def expect_into(
    values: NDArray[np.float64],
    known: NDArray[np.bool_],
    share: NDArray[np.float64],
    means: NDArray[np.float64],
    precisions: NDArray[np.float64],
    completed: NDArray[np.float64],
    surprise: NDArray[np.float64],
) -> None:
    """Add to `completed` and `surprise` (T, D) what each component with a share makes expect.

    Unknown values: their expectation. Known ones: their distance from the expectation given the
    other known ones, which is (P'a)ₛ / P'ₛₛ with P' the precision of the known values alone.
    """
    size = values.shape[1]
    away, pull, alone = np.empty(size), np.empty(size), np.empty(size)
    hidden, shift, column = np.empty(size, np.int64), np.empty(size), np.empty(size)
    factor = np.empty((size, size))
    for k in range(means.shape[0]):
        precision, count, last = precisions[k], 0, -1
        for t in range(values.shape[0]):
            weight = share[t, k]
            if weight == 0.0:
                continue
            if last < 0 or (known[t] != known[last]).any():
                # Gaussian with precision P: hidden = mean - P_hh^-1 P_hk (known - mean), by a
                # Cholesky factor of P_hh, which serves all frames with the same markers known.
                count = _factorise(precision, known[t], hidden, factor)
                for s in range(size):
                    for i in range(count):
                        column[hidden[i]] = precision[hidden[i], s]
                    _forward(factor, hidden, count, column, shift)
                    alone[s] = precision[s, s]
                    for i in range(count):
                        alone[s] -= shift[i] * shift[i]
            last = t
            _pull(values[t], known[t], means[k], precision, away, pull)
            _solve(factor, hidden, count, pull, shift)
            for i in range(count):
                completed[t, hidden[i]] += weight * (means[k, hidden[i]] - shift[i])
            for s in range(size):
                if known[t, s]:
                    left = pull[s]
                    for i in range(count):
                        left -= precision[hidden[i], s] * shift[i]
                    surprise[t, s] += weight * left / alone[s]


@njit(cache=True)
def gather_into(
    values: NDArray[np.float64],
    known: NDArray[np.bool_],
    share: NDArray[np.float64],
    means: NDArray[np.float64],
    precisions: NDArray[np.float64],
    total: NDArray[np.float64],
    first: NDArray[np.float64],
    second: NDArray[np.float64],
) -> None:
    """Add the expected moments about the means to `total` (K,), `first` (K, D), `second` (K, D, D).

    Unknown values count with their expectation and its covariance Pₕₕ⁻¹. Only the lower triangle
    of `second` is filled.
    """
    size = values.shape[1]
    away, pull, shift = np.empty(size), np.empty(size), np.empty(size)
    hidden, factor = np.empty(size, np.int64), np.empty((size, size))
    for k in range(means.shape[0]):
        count, last = 0, -1
        for t in range(values.shape[0]):
            weight = share[t, k]
            if weight == 0.0:
                continue
            # Consecutive frames mostly know the same values: factorise again only where these
            # change.
            if last < 0 or (known[t] != known[last]).any():
                count = _factorise(precisions[k], known[t], hidden, factor)
            last = t
            _pull(values[t], known[t], means[k], precisions[k], away, pull)
            _solve(factor, hidden, count, pull, shift)
            # E[h | k] = mean - P_hh^-1 P_hk (x_k - mean_k).
            for i in range(count):
                away[hidden[i]] = -shift[i]
            total[k] += weight
            for i in range(size):
                first[k, i] += weight * away[i]
                for j in range(i + 1):
                    second[k, i, j] += weight * away[i] * away[j]
            # Covariance P_hh^-1, column by column.
            for j in range(count):
                pull[:] = 0.0
                pull[hidden[j]] = 1.0
                _solve(factor, hidden, count, pull, shift)
                for i in range(j, count):
                    second[k, hidden[i], hidden[j]] += weight * shift[i]


@njit(cache=True)
def blend_into(
    excess: NDArray[np.float64],
    pinned: NDArray[np.bool_],
    stiffness: float,
    scratch: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Fill `out` (T, K, C) with the c of least Σ (c[t + 1] - c[t] + excess[t])² + stiffness Σ c².

    c is zero where pinned (T, K); excess is (T - 1, K, C), scratch (T,). Normal equations by
    Thomas's algorithm, marker by marker.
    """
    frames = out.shape[0]
    for k in range(out.shape[1]):
        for c in range(out.shape[2]):
            before, slope = 0.0, 0.0
            for t in range(frames):
                diagonal, right = 1.0, 0.0
                if not pinned[t, k]:
                    diagonal = stiffness
                    if t > 0:
                        diagonal += 1.0 + slope
                        right += before - excess[t - 1, k, c]
                    if t < frames - 1:
                        diagonal += 1.0
                        right += excess[t, k, c]
                # c[t] = before - slope * c[t + 1], slope never positive.
                before = right / diagonal
                slope = 0.0 if pinned[t, k] else -1.0 / diagonal
                scratch[t] = slope
                out[t, k, c] = before
            for back in range(1, frames):
                t = frames - 1 - back
                out[t, k, c] -= scratch[t] * out[t + 1, k, c]


@njit(cache=True, inner=True)
def _pull(
    row: NDArray[np.float64],
    known: NDArray[np.bool_],
    mean: NDArray[np.float64],
    precision: NDArray[np.float64],
    away: NDArray[np.float64],
    pull: NDArray[np.float64],
) -> None:
    """Fill `away` with the distances from the mean, 0 where unknown, `pull` with P times them."""
    pull[:] = 0.0
    for i in range(row.shape[0]):
        away[i] = 0.0
        if known[i]:
            away[i] = row[i] - mean[i]
            for j in range(row.shape[0]):
                pull[j] += precision[i, j] * away[i]


@njit(cache=True, inner=True)
def _factorise(
    precision: NDArray[np.float64],
    known: NDArray[np.bool_],
    hidden: NDArray[np.int64],
    factor: NDArray[np.float64],
) -> int:
    """Fill `hidden` with the unknown columns, `factor` with Cholesky's of Pₕₕ; return how many."""
    count = 0
    for i in range(known.shape[0]):
        if not known[i]:
            hidden[count] = i
            count += 1
    for i in range(count):
        for j in range(i + 1):
            left = precision[hidden[i], hidden[j]]
            for m in range(j):
                left -= factor[i, m] * factor[j, m]
            factor[i, j] = np.sqrt(left) if i == j else left / factor[j, j]
    return count


@njit(cache=True, inner=True)
def _forward(
    factor: NDArray[np.float64],
    hidden: NDArray[np.int64],
    count: int,
    right: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    for i in range(count):
        left = right[hidden[i]]
        for j in range(i):
            left -= factor[i, j] * out[j]
        out[i] = left / factor[i, i]


@njit(cache=True)
def _solve(
    factor: NDArray[np.float64],
    hidden: NDArray[np.int64],
    count: int,
    right: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Fill `out` with Pₕₕ⁻¹ times the unknown columns of `right`."""
    _forward(factor, hidden, count, right, out)
    for back in range(count):
        i = count - 1 - back
        left = out[i]
        for j in range(i + 1, count):
            left -= factor[j, i] * out[j]
        out[i] = left / factor[i, i]
