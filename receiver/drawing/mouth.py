"""The lips over the teeth: a rule that a linear map of markers cannot keep.

The coarse mesh of the head comes in, bent by its map; the same mesh goes out with lips that
neither cut each other nor the teeth. ``page/mouth.js`` computes the same.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

EDGE = 6
"""Ring of the lips that closes the mouth; those before it line its inside."""

FOLLOW = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.85, 0.65, 0.45, 0.25, 0.1, 0.0)
"""Share of the edge's correction that each ring follows."""

LOWER_SHARE = 0.65
"""Part of an overlap that the lower lip yields; the upper lip yields the rest."""

_BULGE_MM = 1.2
"""Height in mm of the lower lip's edge over the line between the corners that levels it wholly:
f and v, where the lip lies along the edge of the upper teeth."""

_CLEARANCE_MM = 1.4
"""Thickness of a lip before the teeth, at least."""

_RAMP_MM = 2.0
"""Height in mm over which the teeth's edge begins to hold a lip off."""


@dataclass(frozen=True, slots=True)
class Mouth:
    """Lips and teeth.

    Attributes
    ----------
    rings : ndarray of int, shape (13, 38)
        Control vertices of the lips, from inside to the outer edge of the red; columns run from
        the middle of the upper lip around the mouth.
    upper, lower : ndarray of int, shapes (U,) and (L,)
        Columns of both lips from one corner to the other; the corners are in both.
    beside : ndarray of int, shapes (U,)
        Place in `lower` of the column before each column of `upper`.
    between : ndarray, shape (U,)
        Share of the next one.
    lining : ndarray, shape (6, 38, 3)
        Offset of the inner rings from the edge.
    arch : ndarray, shape (2, 5)
        For upper and lower teeth: front, bend (1/mm, 1/mm3) and height of their cutting edge,
        x of their middle.
    jaw : int
        Control vertex that carries the lower front teeth.
    jaw_rest : ndarray, shape (3,)
        Its place at rest.
    """

    rings: NDArray[np.int64]
    upper: NDArray[np.int64]
    lower: NDArray[np.int64]
    beside: NDArray[np.int64]
    between: FloatArray
    lining: FloatArray
    arch: FloatArray
    jaw: int
    jaw_rest: FloatArray

    def solve(self, control: FloatArray) -> None:
        """Correct the coarse mesh (T, M, 3) of the head, before its motion, in place."""
        lips = control[:, self.rings]
        heights = lips[:, EDGE, :, 1].copy()
        heights[:, self.lower] = self._levelled(lips[:, EDGE, self.lower])
        below = self._lower_at(heights[:, self.lower])
        overlap = np.maximum(below - heights[:, self.upper], 0)
        # The lower lip has fewer columns: each yields to the largest overlap beside it.
        for place, column in enumerate(self.lower):
            near = (self.beside == place) | (self.beside == place - 1)
            heights[:, column] -= LOWER_SHARE * overlap[:, near].max(axis=1)
        inner = self.upper[1:-1]
        below = self._lower_at(heights[:, self.lower])[:, 1:-1]
        heights[:, inner] = np.maximum(heights[:, inner], below)
        pressed = heights - lips[:, EDGE, :, 1]
        lips[..., 1] += np.array(FOLLOW)[:, None] * pressed[:, None]
        jaw = control[:, self.jaw] - self.jaw_rest
        for teeth, side in ((self.arch[0], 1.0), (self.arch[1], -1.0)):
            front, bend, steep, tip, middle = teeth
            moved = jaw if side < 0 else np.zeros_like(jaw)
            across = (lips[:, EDGE:, :, 0] - middle) ** 2
            wall = front + moved[:, None, None, 2] - across * (bend + steep * across)
            height = side * (lips[:, EDGE:, :, 1] - tip - moved[:, None, None, 1])
            held = np.clip(1 + height / _RAMP_MM, 0, 1)
            lips[:, EDGE:, :, 2] += held * np.maximum(
                wall + _CLEARANCE_MM - lips[:, EDGE:, :, 2], 0
            )
        lips[:, :EDGE] = lips[:, EDGE, None] + self.lining
        control[:, self.rings] = lips

    def _levelled(self, edge: FloatArray) -> FloatArray:
        """Return heights (T, L) of the lower lip's edge (T, L, 3), level where it bulges."""
        x, y = edge[..., 0], edge[..., 1]
        along = (x - x[:, :1]) / (x[:, -1:] - x[:, :1])
        above = y - (y[:, :1] + along * (y[:, -1:] - y[:, :1]))
        share = np.minimum(above.max(axis=1, initial=0) / _BULGE_MM, 1)
        return np.asarray(y - share[:, None] * above)

    def _lower_at(self, heights: FloatArray) -> FloatArray:
        """Return the lower lip's heights (T, U) at the upper lip's columns."""
        a, b = heights[:, self.beside], heights[:, self.beside + 1]
        return np.asarray(a + self.between * (b - a))
