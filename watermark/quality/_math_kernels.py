"""Compiled functions of one number that a loop takes for several numbers at once."""

import numpy as np

from codec.compiled import njit

TURNED = 6755399441055744.0
"""Added to a number, it leaves its whole part in the lowest bits."""

LOG_2_HIGH, LOG_2_LOW = 0.6931471803691238, 1.9082149292705877e-10
"""Natural logarithm of 2 in two parts: products of the first with whole numbers are exact."""

HALVED_ROOT = 0x3FE6A09E667F3BCD
"""Bits of the root of a half."""


@njit(cache=True, error_model="numpy", fastmath={"contract"}, inner=True)
def exponential(x: float) -> float:
    """Exponential function of x < 709, below -700 as there, to 3e-16.

    Unlike the library's it is part of a loop that takes several numbers at once.
    """
    x = max(x, -700.0)
    shifted = x * 1.4426950408889634 + TURNED
    whole = shifted - TURNED
    y = x - whole * LOG_2_HIGH - whole * LOG_2_LOW
    # Taylor series: y is at most half of log 2.
    p = 1.0 / 6227020800.0
    p = p * y + 1.0 / 479001600.0
    p = p * y + 1.0 / 39916800.0
    p = p * y + 1.0 / 3628800.0
    p = p * y + 1.0 / 362880.0
    p = p * y + 1.0 / 40320.0
    p = p * y + 1.0 / 5040.0
    p = p * y + 1.0 / 720.0
    p = p * y + 1.0 / 120.0
    p = p * y + 1.0 / 24.0
    p = p * y + 1.0 / 6.0
    p = p * y + 0.5
    p = (p * y + 1.0) * y + 1.0
    exponent = np.float64(shifted).view(np.int64) << np.int64(52)
    return np.int64(np.float64(p).view(np.int64) + exponent).view(np.float64)


@njit(cache=True, error_model="numpy", fastmath={"contract"}, inner=True)
def logarithm(x: float) -> float:
    """Natural logarithm of a normal number x > 0, to 2e-16, see `exponential`.

    Source: Sun Microsystems, fdlibm 5.3, e_log.c, 1993.
    """
    bits = np.float64(x).view(np.int64)
    exponent = (bits - np.int64(HALVED_ROOT)) >> np.int64(52)
    f = np.int64(bits - (exponent << np.int64(52))).view(np.float64) - 1.0
    whole = np.int64(exponent + np.float64(TURNED).view(np.int64)).view(np.float64) - TURNED
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    odd = 0.22222198432149784 + w * 0.15313837699209373
    odd = w * (0.3999999999940942 + w * odd)
    even = 0.1818357216161805 + w * 0.14798198605116586
    even = z * (0.6666666666666735 + w * (0.2857142874366239 + w * even))
    half = 0.5 * f * f
    return whole * LOG_2_HIGH - ((half - (s * (half + odd + even) + whole * LOG_2_LOW)) - f)


@njit(cache=True, error_model="numpy", inner=True)
def raised(x: float, exponent: float) -> float:
    """Raise a normal number x > 0 to an exponent."""
    power: float = exponential(exponent * logarithm(x))
    return power
