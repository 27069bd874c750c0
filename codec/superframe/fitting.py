"""Fitting: the form and extent of a superframe's prediction from its score.

A block of frames and a prediction in any form go in; form, time and the shares of the parts that
cost least come out, with the remaining difference. Specification: spec/bitstream.md, P4, P9, P10.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.superframe.coding import Coding
from codec.superframe.quantise import N_COURSES, PARTS, SHARES, UNUSED, WHOLE_USED
from codec.superframe.resynthesis.trajectory import SHIFTS
from codec.superframe.superframe import scaled
from codec.superframe.transform import COSINES

Array = NDArray[np.float64]
Predict = Callable[[int, int], Array]

_USUAL = 0.95
"""Energy that the usual form of movement counts for: it costs least, another has to explain more.
"""

NOMINAL_MM = 40.0
"""Width of the steps at which predictions are compared: that of 4 mm on films of real cuers."""

_CLEAR_BITS = 12.0
"""Bits: where the whole prediction beats none by so many, its parts are not looked at."""

_TOLD_BITS = 3.0
"""Bits that it takes, about, to say that a part of the prediction counts less."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """How a superframe uses its prediction.

    Attributes
    ----------
    course, shift : int
        Form and time of the hand's movements.
    shares : tuple of int
        How much of the prediction counts, by part.
    lacking : ndarray of float64, shape (32, P)
    """

    course: int
    shift: int
    shares: tuple[int, ...]
    lacking: Array


def fits(
    block: Array, predict: Predict, coding: Coding, width_mm: float = NOMINAL_MM
) -> list[Fitted]:
    """Return likely uses of a prediction, first the one that seems cheapest, last none at all.

    Parameters
    ----------
    block : ndarray of float64, shape (32, P)
    predict : callable
        The prediction by course and shift.
    coding : Coding
    width_mm : float
        Of the step at which bits are compared.
    """

    def lacking(forms: list[tuple[int, int]]) -> tuple[Array, Array]:
        """Return predictions and the energies that they lack."""
        likely = np.stack([predict(*form) for form in forms])
        gaps = (likely - block) @ coding.residual.matrix
        return likely, np.einsum("ntc,ntc->n", gaps, gaps)

    # First choose the trajectory profile without a shift, then the shift: all pairs would cost
    # N_COURSES times as much.
    usual, energies = lacking([(c, 0) for c in range(N_COURSES)])
    energies[0] *= _USUAL
    course, shift = int(np.argmin(energies)), 0
    prediction = usual[course]
    moved, others = lacking([(course, s) for s in range(1, len(SHIFTS))])
    if others.min() < energies[course]:
        shift = 1 + int(np.argmin(others))
        prediction = moved[shift - 1]
    # Candidates: shares by part of the body, the whole prediction, none.
    tried = [_shares(block, prediction, coding, width_mm), WHOLE_USED, UNUSED]
    found = []
    for shares in dict.fromkeys(tried):
        form = (0, 0) if shares == UNUSED else (course, shift)
        found.append(Fitted(*form, shares, block - scaled(prediction, coding, shares)))
    return found


def _shares(block: Array, prediction: Array, coding: Coding, width_mm: float) -> tuple[int, ...]:
    """Return how much of each part of a prediction counts.

    The transform is linear: what any shares lack follows from the coefficients of the parts.
    """

    def coefficients(blocks: Array) -> Array:
        told: Array = COSINES @ (blocks @ coding.plain.matrix) / width_mm
        return told.reshape(*blocks.shape[:-2], -1)

    def bits(ratio: Array) -> float:
        return float(0.5 * np.log2(1.0 + ratio * ratio).sum())

    own, predicted = block - coding.mean, prediction - coding.mean
    coded = coefficients(np.stack([own, own - predicted]))
    bare, cost = bits(coded[0]), bits(coded[1])
    whole = WHOLE_USED
    if cost < bare - _CLEAR_BITS:
        return whole
    targets = coding.targets
    widths = [part.shape[1] for part in (targets.face, targets.hand, targets.head, targets.forearm)]
    of_part = np.repeat(np.eye(PARTS), widths, axis=1)[:, None]
    parts = coefficients(of_part * predicted)
    best = whole if cost <= bare else UNUSED
    cost = min(cost, bare)
    # Bits of the residual by its energy: sum of 0.5 log2(1 + (c / width)^2). Coordinate descent:
    # each part of the prediction gets its best share once.
    for part in range(PARTS):
        for share in range(len(SHARES)):
            tried = (*best[:part], share, *best[part + 1 :])
            if tried == best:
                continue
            left = coded[0] - np.array([SHARES[k] for k in tried]) @ parts
            other = bits(left) + _TOLD_BITS * sum(share > 0 for share in tried)
            if other < cost:
                best, cost = tried, other
    return best
