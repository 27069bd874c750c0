"""Allocation: how finely the coefficients of a superframe are told.

A `Plan` and a room in bits, or a step, go in; a `Content` comes out, ready to be written.
"""

import numpy as np
from numpy.typing import NDArray

from codec.bitstream.analysis import Analysis
from codec.bitstream.payload import Content, coefficient_bits
from codec.bitstream.plan import Plan
from codec.bitstream.quantise import (
    GAINS,
    NO_RESIDUAL,
    NOTHING_SENT,
    WEIGHT,
    Setting,
    basis_of,
    dequantise,
    quantise_rd,
    width_mm,
)
from codec.bitstream.tables import coefficient_tables
from codec.cuer.layout import MARKERS
from codec.cues.timeline import TICKS

Ints = NDArray[np.int64]


def allocate(plan: Plan, room_bits: float) -> Content:
    """Return a superframe with the finest step, and its gain, at which all coefficients fit."""
    analysis, left = plan.analysis, room_bits - plan.bits
    gain, step = 0, _finest(analysis, 0, left)
    better = _best_gain(analysis, step)
    if better != gain:
        gain, step = better, _finest(analysis, better, left - 4)
    return _content(plan, *_quantised(analysis, step, gain))


def allocate_at(plan: Plan, step: int) -> Content:
    """Return a superframe at a step, 0 (finest) to 63 (no residual), with the best gain."""
    return _content(plan, *_quantised(plan.analysis, step, _best_gain(plan.analysis, step)))


def without_coefficients(plan: Plan) -> Content:
    """Return a superframe that says the score alone, without previews."""
    nothing = np.zeros(plan.analysis.values[0].size, dtype=np.int64)
    return Content(plan.analysis.header, NOTHING_SENT, plan.analysis.part, nothing)


def error_mm(analysis: Analysis, step: int) -> float:
    """Return the error of a superframe at a step: RMS over its markers and frames."""
    setting, q = _quantised(analysis, step, _best_gain(analysis, step))
    error = analysis.values[setting.gain // 2]
    if setting.step != NO_RESIDUAL:
        basis = basis_of(analysis.bases, setting)
        error = error - dequantise(q, setting, basis, coefficient_tables())
    return float(np.sqrt(np.square(error).sum() / (TICKS * len(MARKERS))))


def _content(plan: Plan, setting: Setting, q: Ints) -> Content:
    return Content(plan.analysis.header, setting, plan.analysis.part, q, plan.previews)


def _finest(analysis: Analysis, gain: int, bits: float) -> int:
    low, high = 0, NO_RESIDUAL
    while low < high:
        step = (low + high) // 2
        setting, q = _quantised(analysis, step, gain)
        if coefficient_bits(q, setting, basis_of(analysis.bases, setting)) <= bits:
            high = step
        else:
            low = step + 1
    return low


def _quantised(analysis: Analysis, step: int, gain: int) -> tuple[Setting, Ints]:
    if step == NO_RESIDUAL:
        return NOTHING_SENT, np.zeros(analysis.values[0].size, dtype=np.int64)
    setting = Setting(step, gain, analysis.course, analysis.shift)
    basis = basis_of(analysis.bases, setting)
    return setting, quantise_rd(analysis.values[gain // 2], setting, basis, coefficient_tables())


def _best_gain(analysis: Analysis, step: int) -> int:
    """Return the gain at which error and bits weigh least at a step."""
    if step == NO_RESIDUAL:
        return 0
    weights = []
    for gain in range(len(GAINS)):
        setting, q = _quantised(analysis, step, gain)
        basis = basis_of(analysis.bases, setting)
        error = analysis.values[gain // 2] - dequantise(q, setting, basis, coefficient_tables())
        bits = coefficient_bits(q, setting, basis) + (3 if gain else 0)
        weights.append(np.square(error / width_mm(step)).sum() + WEIGHT * bits)
    return int(np.argmin(weights))
