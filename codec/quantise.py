"""Quantiser steps and the values of indices, in integers.

Steps form a scale of quarter octaves; values are multiples of 2**-16 of the unit in which the
transform measures, a millimetre summed over markers. Specification: spec/bitstream.md,
paragraphs Q1 to Q4.
"""

import numpy as np
from numpy.typing import NDArray

from codec import _kernels
from codec.tables import CoefficientTables

STEPS = 64
NO_RESIDUAL = STEPS - 1
"""The step number that says that no coefficient follows."""

FRACTION_BITS = 16
_MANTISSAS = (65536, 77936, 92682, 110218)

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def step_width(step: int) -> int:
    """Return the width of a step in units of 2**-16: 2**(16 + step / 4), rounded (Q1).

    Examples
    --------
    >>> step_width(0), step_width(5)
    (65536, 155872)
    """
    return _MANTISSAS[step % 4] << (step // 4)


def quantise(values: Array, step: int, *, rounding: float = 0.4) -> Ints:
    """Return the indices of coefficients.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
    step : int
        Step number, 0..62.
    rounding : float
        0.5 rounds to the nearest cell; less favours small indices, which cost less.
    """
    ratio = np.abs(values) * (1 << FRACTION_BITS) / step_width(step)
    index = np.minimum(np.floor(ratio + rounding), 1 << 19).astype(np.int64)
    return np.where(values < 0, -index, index)


def dequantise(q: Ints, scales: Ints, step: int, tables: CoefficientTables) -> Array:
    """Return the values of indices (Q3, Q4), shape (n,)."""
    out = np.empty_like(q)
    _kernels.dequantise(q, scales, step, step_width(step), tables.inset, out)
    return out / (1 << FRACTION_BITS)
