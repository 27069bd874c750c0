"""How far each cell can be trusted, learnt from the superframes that were decoded.

In: soft values and the bits they should have had; out: weights that turn soft values into
log-likelihood ratios. A soft value is the cosine of a phase; with von Mises noise of concentration
kappa the ratio of a cosine c is 2 kappa c, and kappa follows from the mean resultant length. Within
a superframe the weights follow the strength of each cell and of its frame, upwards where noise was
added and downwards where a coder was short of bits, and the noise that a coder would have left
there: three exponents, learnt by logistic regression.
Source: Mardia and Jupp, "Directional Statistics", 2000, section 5.3.
Specification: spec/audio-carrier.md, W38.
"""

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow.smoothing import weighted_sum

PRIOR_LOW, PRIOR_HIGH = 0.5, 0.15
"""Mean resultant length assumed at the lowest and at the highest bin before anything was decoded:
codecs treat high bands worst."""

MEMORY = 0.7
"""Weight of the past when a superframe is learnt; 0.5 to 0.8 give as much information."""

LIMITS = (0.02, 0.95)
"""A resultant outside is an accident of few cells."""

PACE, RIDGE = 0.3, 20.0
"""Part of a Newton step that the exponents move, and curvature added for the sake of calm; 0.2 to
0.6 and 5 to 40 do as well."""

LARGEST_EXPONENT = 1.0
"""Exponents of power stay within this."""

PRIOR_EXPONENTS = (0.0, 0.0, -0.3)
"""Exponents before anything was decoded: codecs teach -0.2 to -0.5 for their noise."""

NOISY = np.array([0.5, 0.0, 0.0])
"""Exponents to be tried where the learnt ones fail: noise was added, and covers the soft cells."""

CAUTION = 0.75
"""Exponent of the learnt weights when bits are read: they are not quite the true ones. In twenty
clips through four channels .5 for the cells' own weights loses superframes through coders, and 1
under another voice."""


class Reliability:
    """Weights of the cells of a superframe.

    Parameters
    ----------
    groups : int
        Number of cell positions, from low to high.

    Examples
    --------
    >>> reliability = Reliability(2)
    >>> bits, clues = np.tile([1.0, -1.0], (64, 1)), np.zeros((3, 64, 2))
    >>> reliability.learn(bits * [0.9, 0.1], bits, clues)
    >>> weights = reliability.weights(clues)
    >>> bool(weights[0, 0] > weights[0, 1])
    True
    """

    def __init__(self, groups: int) -> None:
        self._resultant = np.geomspace(PRIOR_LOW, PRIOR_HIGH, groups)
        self._exponents = np.array(PRIOR_EXPONENTS)

    def weights(
        self, clues: NDArray[np.float64], *, exponents: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Log-likelihood ratio of a soft value of 1 in each cell, shape (64, groups).

        Parameters
        ----------
        clues : ndarray of float64, shape (3, 64, groups)
            See `watermark.audio.follow.align.SuperframeView.clues`.
        exponents : ndarray of float64, shape (3,), optional
            To be used instead of the learnt ones.
        """
        used = self._exponents if exponents is None else exponents
        return np.asarray(_concentration(self._resultant) * np.exp(weighted_sum(used, clues)))

    def cautious(self, clues: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weights with which bits are read that nothing is known of, see `weights`."""
        return self.weights(clues) ** CAUTION

    def plain(self, clues: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cautious weights before anything was learnt."""
        return Reliability(self._resultant.size).cautious(clues)

    def learn(
        self, soft: NDArray[np.float64], expected: NDArray[np.float64], clues: NDArray[np.float64]
    ) -> None:
        """Take a superframe's soft values and their true signs (0 unknown), shape (64, groups)."""
        known = (np.abs(expected) * (soft != 0)).sum(axis=0)
        seen = known > 8
        mean = (soft * expected).sum(axis=0)[seen] / known[seen]
        old = self._resultant[seen]
        self._resultant[seen] = np.clip(MEMORY * old + (1 - MEMORY) * mean, *LIMITS)
        ratio = self.weights(clues) * soft * expected
        slope = ratio / (1 + np.exp(np.clip(ratio, -30, 30)))
        gradient = (clues * slope).sum(axis=(1, 2)) - RIDGE * self._exponents
        curvature = (clues**2 * np.abs(slope)).sum(axis=(1, 2)) + RIDGE
        moved = self._exponents + PACE * gradient / curvature
        self._exponents = np.clip(moved, -LARGEST_EXPONENT, LARGEST_EXPONENT)


def _concentration(r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Log-likelihood ratio of a cosine of 1 at a mean resultant length, about."""
    return 2 * r * (2 - r**2) / (1 - r**2)
