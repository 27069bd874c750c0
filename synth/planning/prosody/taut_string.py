"""The evenest course between bounds, for sharing out time."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def taut_string(x: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Return the evenest course between bounds: the shortest one.

    It begins at its first lower bound, ends at its last upper one and bends only where it touches
    a bound, so its least slope is as large as the bounds allow.

    Parameters
    ----------
    x : ndarray, shape (N,)
        Ascending.
    lower, upper : ndarray, shape (N,)
        Bounds of the course at `x`.

    Examples
    --------
    >>> taut_string(np.arange(3.0), np.array([0.0, 0.0, 4.0]), np.array([1.0, 1.0, 4.0])).tolist()
    [0.0, 1.0, 4.0]
    """
    n = len(x)
    out = np.empty(n)
    at, out[0] = 0, lower[0]
    while at < n - 1:
        least, most = -np.inf, np.inf
        low = high = bend = at
        value = out[at]
        # Slopes within [least, most] pass between all bounds up to k. Where the next bound leaves
        # none, the string bends at the bound that was the tightest, `high` or `low`.
        for k in range(at + 1, n):
            down, up = (np.array([lower[k], upper[k]]) - out[at]) / (x[k] - x[at])
            if k == n - 1:
                down = up
            if down > most:
                bend, value = high, upper[high]
                break
            if up < least:
                bend, value = low, lower[low]
                break
            if down >= least:
                least, low = down, k
            if up <= most:
                most, high = up, k
        else:
            bend, value = n - 1, upper[n - 1]
        out[at + 1 : bend + 1] = out[at] + (value - out[at]) * (x[at + 1 : bend + 1] - x[at]) / (
            x[bend] - x[at]
        )
        at = bend
    return out
