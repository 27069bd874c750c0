"""Allocation: how finely the coefficients of a superframe are quantised.

A `SuperframePlan` and a room in bits, or a step, go in; a `Content` comes out, ready to be written.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.superframe.analysis import Analysis
from codec.superframe.payload import Content
from codec.superframe.plan import SuperframePlan
from codec.superframe.quantise import (
    LEVELS,
    NO_RESIDUAL,
    NOTHING_SENT,
    WEIGHT,
    Setting,
    basis_of,
    quantise_rd,
    weigh_rd,
    width_mm,
)
from codec.superframe.settings import choice_bits
from codec.superframe.tables import coefficient_tables
from codec.superframe.transform import Bases

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


_UPWARDS = tuple(np.argsort(LEVELS)[np.sort(LEVELS) > 0].tolist())
_DOWNWARDS = tuple(np.argsort(LEVELS)[np.sort(LEVELS) < 0].tolist())[::-1]
"""Levels in order of trial; the first that is worse than the one before ends it."""

_NEAR = 4
"""Greatest change of the step by another basis, in steps."""


@dataclass(frozen=True, slots=True)
class BasisChoice:
    """A basis and a level, and the superframe's values in that basis.

    Attributes
    ----------
    basis, level : int
    values : ndarray of float64, shape (32 P,)
        The residual, in the scan order of the basis, mm.
    """

    basis: int
    level: int
    values: Array


def allocate(plan: SuperframePlan, bases: Bases, room_bits: float) -> Content:
    """Return a superframe with the finest step, and its basis, at which all coefficients fit.

    Parameters
    ----------
    plan : SuperframePlan
    bases : Bases
    room_bits : float
        Of both parts' payloads.
    """
    analysis, left = plan.analysis, room_bits - plan.bits
    usual = BasisChoice(0, 0, bases[0].forward(analysis.lacking))
    step = _finest(analysis, usual, bases, left)
    chosen = choose(analysis, bases, step)
    more = _choice_bits(analysis, chosen.basis, chosen.level) - _choice_bits(analysis, 0, 0)
    near = max(step - _NEAR, 0), min(step + _NEAR, NO_RESIDUAL)
    return content_at(plan, bases, chosen, _finest(analysis, chosen, bases, left - more, near))


def content_at(plan: SuperframePlan, bases: Bases, chosen: BasisChoice, step: int) -> Content:
    """Return a superframe at a step, 0 (finest) to 63 (no residual)."""
    setting, q = _quantised(plan.analysis, chosen, bases, step)
    return Content(
        plan.analysis.header, setting, plan.analysis.part, q, plan.previews, plan.analysis.slow
    )


def without_coefficients(plan: SuperframePlan, bases: Bases) -> Content:
    """Return a superframe that says the score alone."""
    return content_at(
        plan, bases, BasisChoice(0, 0, np.zeros(bases[0].scan_scales.size)), NO_RESIDUAL
    )


def choose(analysis: Analysis, bases: Bases, step: int) -> BasisChoice:
    """Return the basis and then the level at which error and bits weigh least at a step."""
    tried = [
        BasisChoice(number, 0, basis.forward(analysis.lacking))
        for number, basis in enumerate(bases)
    ]
    if step == NO_RESIDUAL:
        return tried[0]

    def weight(choice: BasisChoice) -> float:
        bits, squares = weigh(analysis, choice, bases, step)
        # Lagrangian: squared error in steps, and bits at their weight.
        return squares / width_mm(step) ** 2 + WEIGHT * bits

    weights = [weight(choice) for choice in tried]
    best = tried[int(np.argmin(weights))]
    least = min(weights)
    # Outward from level 0 while it gets better; downwards only if upwards brought nothing.
    for way in _UPWARDS, _DOWNWARDS:
        for level in way:
            other = BasisChoice(best.basis, level, best.values)
            if (worth := weight(other)) >= least:
                break
            best, least = other, worth
        if best.level:
            break
    return best


def weigh(analysis: Analysis, choice: BasisChoice, bases: Bases, step: int) -> tuple[float, float]:
    """Return the bits of all coefficients and the choice, and the squared error, mm**2."""
    if step == NO_RESIDUAL:
        return 0.0, float(np.square(choice.values).sum())
    setting = Setting(step, choice.basis, choice.level)
    basis = basis_of(bases, setting)
    bits, squares = weigh_rd(choice.values, setting, basis, coefficient_tables())
    return bits + _choice_bits(analysis, choice.basis, choice.level), squares


def _choice_bits(analysis: Analysis, basis: int, level: int) -> float:
    filmed = analysis.header.filmed
    return choice_bits(basis, level, unpredicted=analysis.unpredicted, filmed=filmed)


def _finest(
    analysis: Analysis,
    choice: BasisChoice,
    bases: Bases,
    bits: float,
    among: tuple[int, int] = (0, NO_RESIDUAL),
) -> int:
    low, high = among
    while low < high:
        step = (low + high) // 2
        setting = Setting(step, choice.basis, choice.level)
        told = 0.0
        if step != NO_RESIDUAL:
            basis = basis_of(bases, setting)
            told, _ = weigh_rd(choice.values, setting, basis, coefficient_tables())
        if told <= bits:
            high = step
        else:
            low = step + 1
    return low


def _quantised(
    analysis: Analysis, choice: BasisChoice, bases: Bases, step: int
) -> tuple[Setting, Ints]:
    if step == NO_RESIDUAL:
        return NOTHING_SENT, np.zeros(choice.values.size, dtype=np.int64)
    setting = Setting(
        step, choice.basis, choice.level, analysis.course, analysis.shift, analysis.shares
    )
    basis = basis_of(bases, setting)
    return setting, quantise_rd(choice.values, setting, basis, coefficient_tables())
