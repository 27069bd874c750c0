"""Acoustic models of phones: a Gaussian for each third of each phone, variances shared.

They are estimated first on a rendering whose times are known, then on the programme itself,
on the segments that were found so far; where a phone is rare its means stay close to the
earlier models (maximum a posteriori: J.-L. Gauvain, C.-H. Lee 1994).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONE_NUMBER, PHONES

PARTS = 3
"""Parts of a phone with a model each."""

Unit = tuple[str, int, int]
"""Symbol, first frame, end frame."""


@dataclass(frozen=True, slots=True)
class PhoneModels:
    """Means and the common variance of the phones' thirds.

    Attributes
    ----------
    means : ndarray of float64, shape (38, 3, k)
        By phone number.
    variance : ndarray of float64, shape (k,)
    """

    means: NDArray[np.float64]
    variance: NDArray[np.float64]

    def costs(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return running sums of the negative log likelihood of each frame.

        Parameters
        ----------
        features : ndarray of float32, shape (frames, k)

        Returns
        -------
        ndarray of float64, shape (38, 3, frames + 1)
        """
        scale = 1 / np.sqrt(2 * self.variance)
        x = features * scale
        means = (self.means * scale).reshape(-1, x.shape[1])
        distance = (x**2).sum(axis=1) - 2 * means @ x.T + (means**2).sum(axis=1)[:, None]
        sums = np.zeros((len(PHONES) * PARTS, len(x) + 1))
        np.cumsum(distance, axis=1, out=sums[:, 1:])
        return sums.reshape(len(PHONES), PARTS, -1)

    def filler(self, costs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the running cost of speech of which nothing is known: the best phone at any time.

        Parameters
        ----------
        costs : ndarray of float64, shape (38, 3, frames + 1)
            From `costs`.

        Returns
        -------
        ndarray of float64, shape (frames + 1,)
            Without what knowing nothing has to cost in a search.
        """
        frames = np.diff(costs[1:], axis=2).reshape(-1, costs.shape[2] - 1)
        return np.append(0.0, np.cumsum(frames.min(axis=0)))


def estimate(
    features: NDArray[np.float32],
    units: Sequence[Unit],
    prior: PhoneModels | None = None,
    prior_frames: float = 20.0,
) -> PhoneModels:
    """Estimate models on segments.

    Parameters
    ----------
    features : ndarray of float32, shape (frames, k)
    units : sequence of (symbol, first frame, end frame)
    prior : PhoneModels, optional
        Where the means of rare phones stay; without, at the mean of all frames.
    prior_frames : float
        Weight of the prior in frames.
    """
    x = features.astype(np.float64)
    if prior is None:
        means = np.tile(x.mean(axis=0), (len(PHONES), PARTS, 1))
    else:
        means = prior.means.copy()
    spread, count = np.zeros(x.shape[1]), 0
    for number, parts in enumerate(_frames_by_part(units)):
        for part, chosen in enumerate(parts):
            total = x[chosen].sum(axis=0) + prior_frames * means[number, part]
            means[number, part] = total / (len(chosen) + prior_frames)
            spread += ((x[chosen] - means[number, part]) ** 2).sum(axis=0)
            count += len(chosen)
    return PhoneModels(means, spread / max(1, count) + 1e-3)


def _frames_by_part(units: Sequence[Unit]) -> list[list[NDArray[np.int64]]]:
    """Return the frames of each third of each phone; the thirds of a pause are the whole."""
    found: list[list[list[NDArray[np.int64]]]] = [[[] for _ in range(PARTS)] for _ in PHONES]
    for symbol, first, end in units:
        for part in range(PARTS):
            cut = [first + (p * (end - first)) // PARTS for p in (part, part + 1)]
            if symbol == PAUSE:
                cut = [first, end]
            found[PHONE_NUMBER[symbol]][part].append(np.arange(*cut))
    empty = [np.zeros(0, np.int64)]
    return [[np.concatenate(part or empty) for part in parts] for parts in found]
