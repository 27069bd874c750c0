"""Quantiser steps and the values of indices, in integers.

Steps form a scale of quarter octaves; values are multiples of 2**-16 of the unit in which the
transform measures, a millimetre summed over markers. Specification: spec/bitstream.md,
paragraphs Q1 to Q4.
"""

import numpy as np
from numpy.typing import NDArray

from codec import _kernels
from codec.tables import CoefficientTables
from codec.transform import Basis

STEPS = 64
NO_RESIDUAL = STEPS - 1
"""The step number that says that no coefficient follows."""

FRACTION_BITS = 16
WEIGHT = 0.16
"""Squared steps per bit at which index decisions cost least overall, found by trial."""

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


def quantise_rd(
    values: Array, step: int, basis: Basis, tables: CoefficientTables, *, weight: float = WEIGHT
) -> Ints:
    """Return indices that weigh error against bits.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
        Coefficients in the scan order of `basis`.
    step : int
        Step number, 0..62.
    basis : Basis
    tables : CoefficientTables
    weight : float
        Squared steps that one bit is worth.
    """
    q = np.empty(values.size, dtype=np.int64)
    _kernels.quantise_rd(
        values, basis.scan_scales, basis.before, step, step_width(step) / (1 << FRACTION_BITS),
        weight, tables.cost, tables.inset, q,
    )  # fmt: skip
    return q


def dequantise_integers(q: Ints, scales: Ints, step: int, tables: CoefficientTables) -> Ints:
    """Return the values of indices (Q3, Q4) in 2**-16 mm, shape (n,)."""
    out = np.empty_like(q)
    _kernels.dequantise(q, scales, step, step_width(step), tables.inset, out)
    return out


def dequantise(q: Ints, scales: Ints, step: int, tables: CoefficientTables) -> Array:
    """Return the values of indices in millimetres, shape (n,)."""
    return dequantise_integers(q, scales, step, tables) / (1 << FRACTION_BITS)
