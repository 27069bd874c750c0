"""How far each cell position can be trusted, learnt from the superframes that were decoded.

In: soft values and the bits they should have had; out: weights that turn soft values into
log-likelihood ratios. A soft value is the cosine of a phase; with von Mises noise of concentration
kappa the ratio of a cosine c is 2 kappa c, and kappa follows from the mean resultant length.
Source: Mardia and Jupp, "Directional Statistics", 2000, section 5.3. Specification: section 7.3.
"""

import numpy as np
from numpy.typing import NDArray

PRIOR_LOW, PRIOR_HIGH = 0.5, 0.2
"""Mean resultant length assumed at the lowest and at the highest bin before anything was decoded:
codecs treat high bands worst."""

MEMORY = 0.7
"""Weight of the past when a superframe is learnt."""

LIMITS = (0.02, 0.95)
"""A resultant outside is an accident of few cells."""


class Reliability:
    """Weights of the cell positions of a frame.

    Parameters
    ----------
    groups : int
        Number of cell positions, from low to high.

    Examples
    --------
    >>> reliability = Reliability(2)
    >>> bits = np.tile([1.0, -1.0], (64, 1))
    >>> reliability.learn(bits * [0.9, 0.1], bits)
    >>> bool(reliability.weights[0] > reliability.weights[1])
    True
    """

    def __init__(self, groups: int) -> None:
        self._resultant = np.linspace(PRIOR_LOW, PRIOR_HIGH, groups)

    @property
    def weights(self) -> NDArray[np.float64]:
        """Log-likelihood ratio of a soft value of 1 at each cell position, shape (groups,)."""
        r = self._resultant
        return np.asarray(2 * r * (2 - r**2) / (1 - r**2))

    def weigh(self, soft: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log-likelihood ratios of soft values, shape (64, groups)."""
        return soft * self.weights

    def learn(self, soft: NDArray[np.float64], expected: NDArray[np.float64]) -> None:
        """Take a superframe's soft values and their true signs (0 unknown), shape (64, groups)."""
        known = (np.abs(expected) * (soft != 0)).sum(axis=0)
        seen = known > 8
        mean = (soft * expected).sum(axis=0)[seen] / known[seen]
        old = self._resultant[seen]
        self._resultant[seen] = np.clip(MEMORY * old + (1 - MEMORY) * mean, *LIMITS)
