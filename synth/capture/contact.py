"""Contact stays contact: who touches her chin makes the voice touch hers.

Faces differ in more than size. How far the speaker's face lies from the voice's is known at some
points; what is near them is moved by as much, by a mean of the points around it that falls off with
distance (Shepard 1968, with a Gaussian).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_REACH_MM = 30.0


@dataclass(frozen=True, slots=True)
class Contact:
    """Where points of the speaker's face lie against the voice's, head at rest.

    Attributes
    ----------
    at : ndarray of float64, shape (N, 3)
        On the speaker, in the voice's coordinates and size, mm.
    gap : ndarray of float64, shape (N, 3)
        From the voice's point to the speaker's.
    """

    at: FloatArray
    gap: FloatArray

    def to_voice(self, points: FloatArray) -> FloatArray:
        """Return how points (T, 3) near the resting face have to move, shape (T, 3), mm.

        Examples
        --------
        >>> chin = Contact(np.array([[0.0, -90.0, 90.0]]), np.array([[0.0, 4.0, 0.0]]))
        >>> chin.to_voice(np.array([[-10.0, -95.0, 95.0]])).tolist()
        [[0.0, -4.0, 0.0]]
        """
        if not len(self.at):
            return np.zeros_like(points)
        away = ((points[:, None] - self.at) ** 2).sum(-1)
        # The nearest point always counts, however far it is.
        share = np.exp(-0.5 * (away - away.min(1, keepdims=True)) / _REACH_MM**2)
        share /= share.sum(1, keepdims=True)
        return np.asarray(-share @ self.gap)


NO_CONTACT = Contact(np.zeros((0, 3)), np.zeros((0, 3)))
"""Of the voice herself."""
