"""How cuers differ from anybody's mean, and what some keys of a cuer say about her.

What sets a cuer apart shows in many keys at once: the length of her fingers in every finger that is
out, how far her thumb is folded in all shapes that fold it, where her mouth is in all placements.
Deviations of means are jointly normal, with covariances that say so; a few keys then move also the
shapes and placements that have not been seen (maximum a posteriori, as eigenvoices are adapted;
Kuhn et al. 2000).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import SHAPES

FloatArray = NDArray[np.float64]

_TAIL = 6.0
"""Squared distance, in spreads, of an example that counts half."""

_OUT = {1: (0,), 2: (0, 1), 3: (1, 2, 3), 4: (0, 1, 2, 3), 5: (0, 1, 2, 3), 6: (0,), 7: (0, 1),
        8: (0, 1)}  # fmt: skip
"""Fingers that each shape has out, index first."""

_THUMB_OUT = (5, 6, 7)
"""Shapes with the thumb stretched out."""

_SPREADS = ((1, 6), (2, 4, 5, 7), (3,), (8,))
"""Shapes whose index and middle finger are equally far apart."""

_LENGTH, _OWN_LENGTH = 0.08, 0.06
"""Spread between cuers of all fingers that are out, and of one finger; lengths of the palm."""

_FOLD, _OWN_FOLD = 0.10, 0.06
"""The same of fingers that are folded."""

_THUMB_ACROSS, _THUMB_ALONG = 0.18, 0.10
"""Of the thumb's tip, over all shapes that have it out, and over all that fold it."""

_APART = (0.18, 0.08, 0.18, 0.15)
"""Of the distance of index and middle finger, by `_SPREADS`."""

_OF_ONE = 0.06
"""Least variance of a feature of one shape alone."""

_SHIFT_MM, _SCALE = (4.0, 6.0), 0.08
"""Of all places together: shift to the side and up, and their distance from the mouth."""

_PLACE_MM = np.array([[40, 40], [14, 11], [4, 5], [4, 7], [5, 9], [8, 13]], dtype=np.float64)
"""Of each place alone."""


@dataclass(frozen=True, slots=True)
class KeyExample:
    """Evidence on shape or placement `number`: features (D,) and their likelihood."""

    number: int
    value: FloatArray
    weight: float


@dataclass(frozen=True, slots=True)
class CuerPrior:
    """Means (C, D) of classes, spreads within a cuer (C, D), and covariances between cuers.

    `between` has one matrix (n, n) for each group of columns; a group's n means are those of its
    columns, class after class. `trust` is the weight of one example: neighbouring keys err alike.
    """

    means: FloatArray
    within: FloatArray
    groups: tuple[tuple[int, ...], ...]
    between: tuple[FloatArray, ...]
    trust: float

    @property
    def spreads(self) -> FloatArray:
        """Spreads (C, D) of an example of a cuer nobody knows."""
        return self.posterior([], self.means, self.within)[1]

    def posterior(
        self, examples: Iterable[KeyExample], means: FloatArray, spreads: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return means and spreads (C, D) after examples, far ones counting little.

        `means` and `spreads` (C, D) say how far out an example is.
        """
        counts, sums = np.zeros_like(self.means), np.zeros_like(self.means)
        for one in examples:
            away = (one.value - means[one.number]) / spreads[one.number]
            weight = one.weight * self.trust / (1.0 + away**2 / _TAIL)
            counts[one.number] += weight
            sums[one.number] += weight * (one.value - self.means[one.number])
        out, variance = self.means.copy(), np.empty_like(self.means)
        for columns, between in zip(self.groups, self.between, strict=True):
            at = list(columns)
            noise = np.square(self.within[:, at]).ravel()
            # Woodbury: covariances may be singular, precisions of examples may be zero.
            precision = counts[:, at].ravel() / noise
            left = between * precision
            after = np.linalg.solve(np.eye(len(noise)) + left, between)
            moved = after @ (sums[:, at].ravel() / noise)
            out[:, at] += moved.reshape(-1, len(at))
            variance[:, at] = np.diag(after).reshape(-1, len(at))
        return out, np.sqrt(self.within**2 + np.maximum(variance, 0.0))


def _loaded(size: int, loads: Iterable[tuple[Sequence[int], float]], own: FloatArray) -> FloatArray:
    """Return a covariance (n, n): each load moves some numbers together, each its own alone."""
    out = np.diag(own**2)
    for members, spread in loads:
        one = np.zeros(size)
        one[list(members)] = spread
        out += np.outer(one, one)
    return out


@cache
def between_fingers() -> FloatArray:
    """Return the covariance (63, 63) of finger features between cuers, shape after shape."""
    features = 7

    def at(shapes: Iterable[int], feature: int) -> list[int]:
        return [shape * features + feature for shape in shapes]

    loads: list[tuple[list[int], float]] = []
    for out, together, alone in ((True, _LENGTH, _OWN_LENGTH), (False, _FOLD, _OWN_FOLD)):
        of = [at([s for s, fingers in _OUT.items() if (f in fingers) == out], f) for f in range(4)]
        loads += [([one for own in of for one in own], together)]
        loads += [(own, alone) for own in of]
    folded = [shape for shape in SHAPES[1:] if shape not in _THUMB_OUT]
    for shapes in (_THUMB_OUT, folded):
        loads += [(at(shapes, 4), _THUMB_ACROSS), (at(shapes, 5), _THUMB_ALONG)]
    loads += [(at(shapes, 6), spread) for shapes, spread in zip(_SPREADS, _APART, strict=True)]
    size = len(SHAPES) * features
    return _loaded(size, loads, np.full(size, _OF_ONE))


def between_places(means: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the covariances (6, 6) of places' x and y between cuers, for means (6, 2), mm."""
    return tuple(
        _loaded(len(means), [(range(len(means)), _SHIFT_MM[axis])], _PLACE_MM[:, axis])
        + _SCALE**2 * np.outer(means[:, axis], means[:, axis])
        for axis in (0, 1)
    )  # type: ignore[return-value]


def between_stances(turn: float, width: float) -> tuple[FloatArray, FloatArray]:
    """Return the covariances (6, 6) of the palm's direction and width at each placement."""
    every = range(6)
    return (_loaded(6, [(every, _STAND)], np.full(6, turn)), _loaded(6, [], np.full(6, width)))


_STAND = 0.17
"""Spread between cuers of the palm's direction at all placements, radians."""
