"""Compiled loops that compare a moving hand with shapes."""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

_ROUNDING = 1e-13
"""Relative step of Newton's method that is as small as rounding."""


@njit(cache=True, inner=True)
def _cofactor(m: NDArray[np.float64], i: int, j: int) -> float:
    """Return a cofactor of a matrix (4, 4)."""
    a, b, c = int(i < 1), 1 + int(i < 2), 2 + int(i < 3)
    d, e, f = int(j < 1), 1 + int(j < 2), 2 + int(j < 3)
    minor = (
        m[a, d] * (m[b, e] * m[c, f] - m[b, f] * m[c, e])
        - m[a, e] * (m[b, d] * m[c, f] - m[b, f] * m[c, d])
        + m[a, f] * (m[b, d] * m[c, e] - m[b, e] * m[c, d])
    )
    return float(minor if (i + j) % 2 == 0 else -minor)


@njit(cache=True, inner=True)
def _turn_of(
    covariance: NDArray[np.float64], n: NDArray[np.float64], turn: NDArray[np.float64]
) -> None:
    """Find the rotation (3, 3) that fits a covariance (3, 3) of points with moved points best.

    Horn 1987 (JOSA A 4:629): the eigenvector of the greatest eigenvalue of the matrix `n` (4, 4),
    which is filled here, is its quaternion. The eigenvalue is the greatest root of the
    characteristic polynomial (Theobald 2005, Acta Crystallographica A 61:478).
    """
    c = covariance
    n[0, 0] = c[0, 0] + c[1, 1] + c[2, 2]
    n[0, 1], n[0, 2], n[0, 3] = c[1, 2] - c[2, 1], c[2, 0] - c[0, 2], c[0, 1] - c[1, 0]
    n[1, 1], n[1, 2], n[1, 3] = (c[0, 0] - c[1, 1] - c[2, 2], c[0, 1] + c[1, 0], c[2, 0] + c[0, 2])
    n[2, 2], n[2, 3] = c[1, 1] - c[0, 0] - c[2, 2], c[1, 2] + c[2, 1]
    n[3, 3] = c[2, 2] - c[0, 0] - c[1, 1]
    for i in range(4):
        for j in range(i):
            n[i, j] = n[j, i]
    # det(n - x) = x**4 + square x**2 + line x + flat; the sum of the roots is 0, the sum of their
    # squares -2 square, so none exceeds the start, and Newton's steps fall towards the greatest.
    square, flat = 0.0, 0.0
    for i in range(3):
        for j in range(3):
            square -= 2.0 * c[i, j] * c[i, j]
    line = -8.0 * (
        c[0, 0] * (c[1, 1] * c[2, 2] - c[1, 2] * c[2, 1])
        - c[0, 1] * (c[1, 0] * c[2, 2] - c[1, 2] * c[2, 0])
        + c[0, 2] * (c[1, 0] * c[2, 1] - c[1, 1] * c[2, 0])
    )
    for j in range(4):
        flat += n[0, j] * _cofactor(n, 0, j)
    x = np.sqrt(-1.5 * square)
    for _ in range(50):
        slope = (4.0 * x * x + 2.0 * square) * x + line
        if slope <= 0.0:
            break
        step = (((x * x + square) * x + line) * x + flat) / slope
        x -= step
        if step <= _ROUNDING * x:
            break
    for i in range(4):
        n[i, i] -= x
    # All columns of the adjugate are multiples of the eigenvector; the longest is the surest.
    best, most = 0, 0.0
    for i in range(4):
        own = abs(_cofactor(n, i, i))
        if own > most:
            best, most = i, own
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    if most > 0.0:
        w, x = _cofactor(n, 0, best), _cofactor(n, 1, best)
        y, z = _cofactor(n, 2, best), _cofactor(n, 3, best)
        size = np.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w / size, x / size, y / size, z / size
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
    turn, covariance, horn = np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 4))
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
                _turn_of(covariance, horn, turn)
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
