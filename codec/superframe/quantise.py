"""Quantiser steps and the values of indices, in integers.

Steps form a scale of quarter octaves; values are multiples of 2**-16 of the unit that the
transform has, a millimetre summed over markers. Specification: spec/bitstream.md,
paragraphs Q1 to Q4.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.superframe import _kernels
from codec.superframe.tables import CoefficientTables
from codec.superframe.transform import Bases, Basis

STEPS = 64
"""Numbers of steps; the last one says that there is no residual."""

NO_RESIDUAL = STEPS - 1
"""The step number that says that no coefficient follows."""

LEVELS = (0, 4, -4, 8, -8, 12, -12)
"""Changes of all scales of a superframe in quarter octaves, if it moves more or less than
expected (Q6)."""

SHARES = (1.0, 0.5, 0.0)
"""Shares of a part's prediction that a superframe can use (P10)."""

PARTS = 4
"""Face, hand, head and forearm: each has a share."""

WHOLE_USED = (0,) * PARTS
"""Shares of a superframe that uses all of its prediction."""

UNUSED = (len(SHARES) - 1,) * PARTS
"""Shares of a superframe that does without its prediction."""

N_COURSES = 4
"""Forms of movement; a superframe names one (`resynthesis.course.COURSES`)."""

FRACTION_BITS = 16
"""Bits behind the point of values in mm (Q1)."""

WEIGHT = 0.16
"""Squared steps per bit at which index decisions cost least overall, found by trial."""

_MANTISSAS = (65536, 77936, 92682, 110218)
"""Widths of four steps within an octave (Q1)."""

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Setting:
    """How a superframe codes its residual.

    Attributes
    ----------
    step : int
        Step number, `NO_RESIDUAL` if no coefficient was sent.
    basis : int
        Index in `codec.superframe.transform.Bases`.
    level : int
        Index in `LEVELS`.
    course : int
        Form of the hand's movements, 0..3.
    shift : int
        Index in `codec.superframe.resynthesis.trajectory.SHIFTS`.
    shares : tuple of int
        Indices in `SHARES` of face, hand, head and forearm.
    """

    step: int
    basis: int = 0
    level: int = 0
    course: int = 0
    shift: int = 0
    shares: tuple[int, ...] = (0,) * PARTS


NOTHING_SENT = Setting(NO_RESIDUAL)


def step_width(step: int) -> int:
    """Return the width of a step in units of 2**-16: 2**(16 + step / 4), rounded (Q1).

    Examples
    --------
    >>> step_width(0), step_width(5)
    (65536, 155872)
    """
    return _MANTISSAS[step % 4] << (step // 4)


def quantise_rd(
    values: Array,
    setting: Setting,
    basis: Basis,
    tables: CoefficientTables,
    *,
    weight: float = WEIGHT,
) -> Ints:
    """Return indices that weigh error against bits.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
        Coefficients in the scan order of `basis`.
    setting : Setting
    basis : Basis
    tables : CoefficientTables
    weight : float
        Squared steps that one bit is worth.
    """
    q = np.empty(values.size, dtype=np.int64)
    _kernels.quantise_rd(
        values, raised(basis, setting), basis.before, setting.step, width_mm(setting.step),
        weight, tables.cost, tables.inset, q,
    )  # fmt: skip
    return q


def weigh_rd(
    values: Array,
    setting: Setting,
    basis: Basis,
    tables: CoefficientTables,
    *,
    weight: float = WEIGHT,
) -> tuple[float, float]:
    """Return the bits of what `quantise_rd` returns, and its squared error in mm**2."""
    width = width_mm(setting.step)
    bits, squares = _kernels.quantise_rd(
        values, raised(basis, setting), basis.before, setting.step, width, weight, tables.cost,
        tables.inset, np.empty(values.size, dtype=np.int64),
    )  # fmt: skip
    return bits, squares * width * width


def basis_of(bases: Bases, setting: Setting) -> Basis:
    """Return the basis that a superframe names (Q6)."""
    return bases[setting.basis]


def raised(basis: Basis, setting: Setting) -> Ints:
    """Return the scales of a basis in scan order, raised by the level (Q6)."""
    return basis.scan_scales + LEVELS[setting.level]


def width_mm(step: int) -> float:
    """Return the width of a step in millimetres."""
    return step_width(step) / (1 << FRACTION_BITS)


def dequantise_integers(q: Ints, setting: Setting, basis: Basis, tables: CoefficientTables) -> Ints:
    """Return the values of indices (Q3, Q4) in 2**-16 mm, shape (n,)."""
    out = np.empty_like(q)
    _kernels.dequantise(
        q, raised(basis, setting), setting.step, step_width(setting.step), tables.inset, out
    )
    return out


def dequantise(q: Ints, setting: Setting, basis: Basis, tables: CoefficientTables) -> Array:
    """Return the values of indices in millimetres, shape (n,)."""
    return dequantise_integers(q, setting, basis, tables) / (1 << FRACTION_BITS)
