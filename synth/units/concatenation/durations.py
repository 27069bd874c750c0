"""Durations of chosen units: near their own, on the clock of the score.

A unit that is shortened in one half and lengthened in the other is understood worse than one that
keeps its proportions, and borders of labels are only known to some 20 ms. Between two silences
the borders move a little so that all parts are changed alike. The hand stays on the score's clock.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from codec.cues.phonology import PAUSE
from synth.units.concatenation.sounds import PlacedUnit

_TOLERANCE, _FLOOR_S = 0.2, 0.01
"""Relative change of a part's duration that costs as much as a usual shift, and the seconds added
to the part: short ones change more."""

_SHIFT_S = 0.02
"""Usual shift of a border in seconds: to which labels of speech are repeatable."""

_LARGEST_SHIFT_S = 0.05
"""Largest shift in seconds."""

_SHORTEST = 0.25
"""Smallest share of its length in the score that a part keeps."""


def stretches(choices: Sequence[PlacedUnit]) -> Iterator[list[PlacedUnit]]:
    """Split a line of units where the time between two of them is silent."""
    stretch: list[PlacedUnit] = []
    for choice in choices:
        if stretch and choice.target.edges_s[0] - stretch[-1].target.edges_s[-1] > 1e-6:
            yield stretch
            stretch = []
        stretch.append(choice)
    if stretch:
        yield stretch


def near_own_durations(choices: Sequence[PlacedUnit]) -> list[PlacedUnit]:
    """Return units with the inner borders of each stretch moved towards their own proportions.

    Parameters
    ----------
    choices : sequence of PlacedUnit
        In order of time. Each stretch keeps its start and its end; no border moves by more than
        50 ms.
    """
    moved: list[PlacedUnit] = []
    for stretch in stretches(choices):
        wanted = np.concatenate([choice.target.parts_s for choice in stretch])
        own = np.concatenate([choice.source.parts_s for choice in stretch])
        spoken = np.array([symbol != PAUSE for choice in stretch for symbol in choice.target.label])
        shift = np.concatenate(([0.0], _shifts(wanted, own, spoken), [0.0]))
        first = 0
        for choice in stretch:
            last = first + len(choice.target.edges_s)
            edges = np.array(choice.target.edges_s) + shift[first:last]
            moved.append(replace(choice, target=replace(choice.target, edges_s=tuple(edges))))
            first = last - 1
    return moved


def _shifts(
    wanted: NDArray[np.float64], own: NDArray[np.float64], spoken: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the shifts of the inner edges between parts, shape (parts - 1,).

    The least sum of squares of the relative changes of all spoken parts and of the shifts; the
    whole keeps its length, so that parts are compared at a common rate.
    """
    if len(wanted) < 2:
        return np.zeros(0)
    own = own * (wanted[spoken].sum() / max(own[spoken].sum(), 1e-9))
    weight = np.where(spoken, 1.0 / (_TOLERANCE * (own + _FLOOR_S)) ** 2, 0.0)
    matrix = np.zeros((3, len(wanted) - 1))
    matrix[0, 1:] = matrix[2, :-1] = -weight[1:-1]
    matrix[1] = weight[:-1] + weight[1:] + 1.0 / _SHIFT_S**2
    lacks = weight * (own - wanted)
    shift = np.asarray(solve_banded((1, 1), matrix, lacks[:-1] - lacks[1:]))
    change = np.diff(shift, prepend=0.0, append=0.0)
    room = (1.0 - _SHORTEST) * wanted
    share = min(
        1.0,
        _LARGEST_SHIFT_S / max(float(np.abs(shift).max()), 1e-9),
        float((room / np.maximum(-change, 1e-9)).min()),
    )
    return shift * share
