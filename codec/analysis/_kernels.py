"""Compiled loops that compare a moving hand with shapes."""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

_SWEEPS = 12
"""Sweeps of Jacobi's rotations at most; four or five are enough."""


@njit(cache=True)
def _turn_of(covariance: NDArray[np.float64], turn: NDArray[np.float64]) -> None:
    """Find the rotation (3, 3) that fits a covariance (3, 3) of points with moved points best.

    Horn 1987 (JOSA A 4:629): the eigenvector of the greatest eigenvalue is its quaternion.
    """
    c = covariance
    n = np.empty((4, 4))
    n[0, 0] = c[0, 0] + c[1, 1] + c[2, 2]
    n[0, 1], n[0, 2], n[0, 3] = c[1, 2] - c[2, 1], c[2, 0] - c[0, 2], c[0, 1] - c[1, 0]
    n[1, 1], n[1, 2], n[1, 3] = (c[0, 0] - c[1, 1] - c[2, 2], c[0, 1] + c[1, 0], c[2, 0] + c[0, 2])
    n[2, 2], n[2, 3] = c[1, 1] - c[0, 0] - c[2, 2], c[1, 2] + c[2, 1]
    n[3, 3] = c[2, 2] - c[0, 0] - c[1, 1]
    for i in range(4):
        for j in range(i):
            n[i, j] = n[j, i]
    # Jacobi's method: each rotation in a plane (i, j) makes n[i, j] zero, and v collects them.
    v = np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            v[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        off = 0.0
        whole = 0.0
        for i in range(4):
            whole += n[i, i] ** 2
            for j in range(i):
                off += n[i, j] ** 2
        if off <= 1e-28 * whole:
            break
        for i in range(3):
            for j in range(i + 1, 4):
                if n[i, j] == 0.0:
                    continue
                # The smaller root t = tan(angle) of t**2 + 2 theta t - 1 = 0.
                theta = (n[j, j] - n[i, i]) / (2.0 * n[i, j])
                t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                cosine = 1.0 / np.sqrt(t * t + 1.0)
                sine = t * cosine
                for k in range(4):
                    a, b = n[k, i], n[k, j]
                    n[k, i], n[k, j] = cosine * a - sine * b, sine * a + cosine * b
                for k in range(4):
                    a, b = n[i, k], n[j, k]
                    n[i, k], n[j, k] = cosine * a - sine * b, sine * a + cosine * b
                for k in range(4):
                    a, b = v[k, i], v[k, j]
                    v[k, i], v[k, j] = cosine * a - sine * b, sine * a + cosine * b
    best = 0
    for i in range(1, 4):
        if n[i, i] > n[best, best]:
            best = i
    w, x, y, z = v[0, best], v[1, best], v[2, best], v[3, best]
    turn[0, 0], turn[0, 1], turn[0, 2] = (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
    )
    turn[1, 0], turn[1, 1], turn[1, 2] = (
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
    )
    turn[2, 0], turn[2, 1], turn[2, 2] = (
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


@njit(cache=True)
def shapes_apart_into(
    back: NDArray[np.float64],
    fingers: NDArray[np.float64],
    still_back: NDArray[np.float64],
    still_fingers: NDArray[np.float64],
    outlier: float,
    rounds: int,
    out: NDArray[np.float64],
) -> None:
    """Find how far T hands are from S shapes once the backs of the hands lie on each other.

    Parameters
    ----------
    back : ndarray, shape (T, K, 3)
        Markers of the back of the hand.
    fingers : ndarray, shape (T, F, 3)
        Those of the fingers.
    still_back, still_fingers : ndarray, shape (S, K, 3) and (S, F, 3)
        Those of each shape.
    outlier, rounds : float, int
        As of `codec.cuer.models.rigid.estimate_motion`.
    out : ndarray, shape (T, S)
        Root mean square over the fingers' markers.
    """
    n, n_back, n_fingers = len(back), back.shape[1], fingers.shape[1]
    turn, covariance = np.empty((3, 3)), np.empty((3, 3))
    here, there = np.empty(3), np.empty(3)
    kept, keeps = np.empty(n_back, np.bool_), np.empty(n_back, np.bool_)
    apart, ordered = np.empty(n_back), np.empty(n_back)
    for t in range(n):
        for s in range(len(still_back)):
            for k in range(n_back):
                kept[k] = True
            # Fit the back of the hand, drop markers farther off than twice the median, fit again.
            for fitted in range(rounds):
                for i in range(3):
                    here[i], there[i] = 0.0, 0.0
                    for j in range(3):
                        covariance[i, j] = 0.0
                count = 0
                for k in range(n_back):
                    if kept[k]:
                        count += 1
                        for c in range(3):
                            here[c] += still_back[s, k, c]
                            there[c] += back[t, k, c]
                for c in range(3):
                    here[c] /= count
                    there[c] /= count
                for k in range(n_back):
                    if kept[k]:
                        for i in range(3):
                            for j in range(3):
                                covariance[i, j] += (still_back[s, k, i] - here[i]) * (
                                    back[t, k, j] - there[j]
                                )
                _turn_of(covariance, turn)
                if fitted + 1 == rounds:
                    break
                for k in range(n_back):
                    apart[k] = 0.0
                    for i in range(3):
                        d = there[i] - back[t, k, i]
                        for j in range(3):
                            d += turn[i, j] * (still_back[s, k, j] - here[j])
                        apart[k] += d * d
                    apart[k] = np.sqrt(apart[k])
                for k in range(n_back):
                    place = k
                    while place and ordered[place - 1] > apart[k]:
                        ordered[place] = ordered[place - 1]
                        place -= 1
                    ordered[place] = apart[k]
                limit = max(max(outlier, 2.0 * ordered[(n_back - 1) // 2]), ordered[2])
                same = True
                for k in range(n_back):
                    keeps[k] = apart[k] <= limit
                    same = same and keeps[k] == kept[k]
                if same:
                    break
                for k in range(n_back):
                    kept[k] = keeps[k]
            total = 0.0
            for k in range(n_fingers):
                for i in range(3):
                    d = there[i] - fingers[t, k, i]
                    for j in range(3):
                        d += turn[i, j] * (still_fingers[s, k, j] - here[j])
                    total += d * d
            out[t, s] = np.sqrt(total / n_fingers)
