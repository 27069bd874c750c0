"""What all stretches together say of a hypothesis: scores folded on the superframe's period.

Pilots are the same in every superframe. A stretch correlates them coherently within each
superframe; here the scores of superframes add up, from stretch to stretch, at the places of one
period, as long as the clock is as right as clocks are. In: scores of a stretch's places; out: the
place that stands out. Cost: `hypotheses.COST_EVIDENCE`, 0.4 MB for each gain that was tried.
"""

import math

import numpy as np
from numpy.typing import NDArray

from watermark.audio.search import _evidence_kernels

FADING = 0.85
"""Part of the evidence that outlives a stretch: some seven of them count."""

DRIFT = 30e-6
"""Greatest relative error of a clock whose evidence adds up."""

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
            Height of the evidence there above the mean, in deviations.
        """
        if self._sum is None:
            self._sum = np.zeros((len(peaks), period), dtype=np.float32)
        apart = DRIFT * abs(first - self._at)
        best = np.empty(len(peaks), dtype=np.float32)
        where = np.empty(len(peaks), dtype=np.int64)
        _evidence_kernels.add_stretch(
            peaks.astype(np.float32),
            first % period,
            self._sum,
            min(math.ceil(apart), FARTHEST),
            np.float32(FADING),
            best,
            where,
        )
        self._at = float(first)
        pair = int(best.argmax())
        return pair, int(where[pair]), float(best[pair])
