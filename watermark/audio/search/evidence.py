"""What all stretches together say of a hypothesis: scores folded on the superframe's period.

Pilots are the same in every superframe. A stretch correlates them coherently within each
superframe; here the scores of superframes add up, from stretch to stretch, at the places of one
period, as long as the clock is as right as clocks are. In: scores of a stretch's places; out: the
place that stands out. Cost: 200000 additions a stretch, 0.8 MB for each hypothesis that was tried.
"""

import math

import numpy as np
from numpy.typing import NDArray

FADING = 0.85
"""Part of the evidence that outlives a stretch: some seven of them count."""

DRIFT = 30e-6
"""Part by which a clock may be wrong while its evidence adds up."""

FARTHEST = 12
"""Places to either side, at most, where evidence of an earlier stretch is looked for."""


class Evidence:
    """Evidence of one hypothesis."""

    def __init__(self) -> None:
        self._sum: NDArray[np.float32] | None = None
        self._at = 0.0

    def add(
        self, peaks: NDArray[np.int16] | NDArray[np.float32], first: int, period: int
    ) -> tuple[int, int, float]:
        """Add a stretch and return outstanding places.

        Parameters
        ----------
        peaks : ndarray of int16 or float32, shape (pairs, n)
            Scores of the stretch's places, of each tier and profile; n is at least the period.
        first : int
            Place of the first of them since the beginning of the sound.
        period : int
            Places of a superframe.

        Returns
        -------
        pair : int
            The likeliest pair of tier and profile.
        place : int
            The stretch's place with the most evidence; it is below the period.
        significance : float
            Deviations by which the evidence there stands above the mean.
        """
        rounds = -(-peaks.shape[1] // period)
        padded = np.zeros((len(peaks), rounds * period), dtype=np.float32)
        level = peaks.mean(axis=1, keepdims=True, dtype=np.float32)
        padded[:, : peaks.shape[1]] = peaks - level
        count = np.zeros(rounds * period, dtype=np.float32)
        count[: peaks.shape[1]] = 1
        folded = padded.reshape(len(peaks), rounds, period).sum(axis=1)
        folded /= np.sqrt(np.maximum(count.reshape(rounds, period).sum(axis=0), 1))
        folded /= folded.std(axis=1, keepdims=True) + np.float32(1e-9)
        if self._sum is not None:
            apart = DRIFT * abs(first - self._at)
            reach = min(math.ceil(apart), FARTHEST)
            before = np.roll(self._sum, -(first % period), axis=1)
            near = _highest_near(before, reach)
            near -= near.mean(axis=1, keepdims=True)
            folded += np.float32(FADING) * near
        self._sum, self._at = np.roll(folded, first % period, axis=1), float(first)
        deviation = folded.std(axis=1, keepdims=True) + np.float32(1e-9)
        pair, place = np.unravel_index(int((folded / deviation).argmax()), folded.shape)
        return int(pair), int(place), float(folded[pair, place] / deviation[pair, 0])


def _highest_near(values: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
    """Return the highest value within so many places of each, round and round."""
    near = np.concatenate([values[:, values.shape[1] - reach :], values, values[:, :reach]], axis=1)
    seen, width = 1, 2 * reach + 1
    while seen < width:
        step = min(seen, width - seen)
        near = np.maximum(near[:, : near.shape[1] - step], near[:, step:])
        seen += step
    return near
