"""How far the palm is turned away: it tells placements apart where the place alone does not.

A hand that goes to mouth, cheek or throat turns about the forearm, so that one camera sees its palm
narrower than at the side; depth, which a single camera guesses, is not needed. Whether a cuer turns
her hand so is told by the take: without it nothing is told from the palm's width.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_WIDTHS = np.array([1.0, 1.03, 0.94, 1.0, 0.89, 0.92])
"""Width of the palm at each placement, of its median over a take: means of 827 keys of one real
cuer whose shapes were right; with those of either half of her takes the other half was recognised
as well."""

_SPREADS = np.hypot([0.1, 0.07, 0.055, 0.055, 0.08, 0.06], 0.04)
"""Spreads of them within her, and what other cuers may differ."""

_ANY, _ANY_SPREAD = 0.98, 0.085
"""Mean and spread of the width whatever the placement."""

_FREEDOM = 7.0
"""Degrees of freedom of the heavy-tailed distribution."""

_TURN_SPREAD = 0.6
"""Spread between cuers of how far they turn the hand, of what these widths say."""

_FROM, _WHOLE = 0.3, 0.6
"""Turn from which widths count, and from which they count in full. Of 64 takes the middle half had
0.7 to 1.1; of the same takes with a flat palm, or with widths of other takes, 0.0 to 0.5."""


def turn_of(widths: FloatArray, placements: Sequence[int]) -> float:
    """Return what the width of the palm counts, 0 to 1, after what some keys have shown.

    Parameters
    ----------
    widths : ndarray of float64, shape (N,)
        Of the palm at each key, of the median.
    placements : sequence of int
        Where each key was recognised without the widths.
    """
    if not len(widths):
        return 0.0
    expected, weights = _WIDTHS[list(placements)], _SPREADS[list(placements)] ** -2.0
    expected = expected - np.average(expected, weights=weights)
    found = widths - np.average(widths, weights=weights)
    prior = _TURN_SPREAD**-2.0
    turn = ((weights * expected * found).sum() + prior) / ((weights * expected**2).sum() + prior)
    return float(np.clip((turn - _FROM) / (_WHOLE - _FROM), 0.0, 1.0))


def turned(widths: FloatArray, starts: Sequence[int], side: int) -> FloatArray:
    """Return log densities of the palm's width at each place, less those anywhere, (T, places).

    Parameters
    ----------
    widths : ndarray of float64, shape (T,)
    starts : sequence of int
        Placements from which the side is not quite reached: such places follow the placements.
    side : int
        Number of the side.
    """
    start = _WIDTHS[list(starts)]
    means = np.concatenate([_WIDTHS, 0.5 * (start + _WIDTHS[side])])
    spreads = np.concatenate([_SPREADS, 0.5 * (_SPREADS[list(starts)] + _SPREADS[side])])
    out = _density((widths[:, None] - means) / spreads) - np.log(spreads)
    anywhere = _density((widths - _ANY) / _ANY_SPREAD) - np.log(_ANY_SPREAD)
    return np.asarray(out - anywhere[:, None])


def _density(away: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (_FREEDOM + 1.0) * np.log1p(away**2 / _FREEDOM))
