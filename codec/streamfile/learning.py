"""Learning: where a cuer holds her hand, from past superframes.

A voice knows one cuer's targets; another one, filmed, holds her hand elsewhere, with other fingers.
The prediction from a score is linear in the targets, so that its residual in the superframes so
far gives their corrections by least squares, drawn to none. Both ends of a file know the same past:
the corrections cost nothing. Specification: spec/bitstream.md, section 8.1, F13.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.streamfile.whole_score import WholeResynthesis
from codec.superframe.coding import Coding

Array = NDArray[np.float64]

PRIOR_FRAMES = 25.0
"""Weight of no correction against the frames that speak for one: half a second."""


class Learner:
    """The prediction of a whole score, corrected by past superframes.

    Parameters
    ----------
    moved : WholeResynthesis
    coding : Coding
    gain : Gain, optional
        Where to count what learning was worth.
    """

    def __init__(self, moved: WholeResynthesis, coding: Coding, gain: "Gain | None" = None) -> None:
        targets = coding.targets
        face, hand, head = (t.shape[1] for t in (targets.face, targets.hand, targets.head))
        self._moved = moved
        self._matrix = coding.residual.matrix
        self._gain = gain
        self._groups = [
            _Group(slice(0, moved.n_shapes), slice(face, face + hand)),
            _Group(slice(moved.n_shapes, None), slice(face + hand + head, None)),
        ]

    def params(self, index: int, course: int = 0, shift: int = 0) -> Array:
        """Return the parameters of superframe `index`, shape (32, P)."""
        weights = self._moved.weights(index, course, shift)
        return self._corrected(self._moved.params(index, course, shift), weights)

    def take(self, index: int, block: Array) -> None:
        """Learn from superframe `index`, shape (32, P), as it was decoded; in order of time."""
        bare = self._moved.params(index)
        weights = self._moved.weights(index)
        if self._gain is not None:
            learnt = self._corrected(bare.copy(), weights)
            self._gain.bare += float(np.square((block - bare) @ self._matrix).sum())
            self._gain.learnt += float(np.square((block - learnt) @ self._matrix).sum())
        for group in self._groups:
            group.take(weights[:, group.kinds], (block - bare)[:, group.columns])

    def _corrected(self, params: Array, weights: Array) -> Array:
        """Add the corrections so far to parameters, in place."""
        for group in self._groups:
            if group.corrections is not None:
                params[:, group.columns] += weights[:, group.kinds] @ group.corrections
        return params


@dataclass(slots=True)
class Gain:
    """Energy that predictions lacked so far, without corrections and with them, mm**2."""

    bare: float = 0.0
    learnt: float = 0.0


class _Group:
    """Least squares of the parameters of hand or forearm, over the superframes so far."""

    def __init__(self, kinds: slice, columns: slice) -> None:
        self.kinds, self.columns = kinds, columns
        self.corrections: Array | None = None
        self._square = self._right = np.zeros(0)

    def take(self, weights: Array, gap: Array) -> None:
        if self.corrections is None:
            self._square = PRIOR_FRAMES * np.eye(weights.shape[1])
            self._right = np.zeros((weights.shape[1], gap.shape[1]))
        self._square = self._square + weights.T @ weights
        self._right = self._right + weights.T @ gap
        from scipy.linalg.lapack import dposv

        _, self.corrections, _ = dposv(self._square, self._right)
