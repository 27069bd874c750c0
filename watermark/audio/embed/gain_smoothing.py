"""Relief of the moments at which a mark is noticed most.

In: how probably a listener detects the mark in each of the meter's frames of a stretch; out: gains
of the mark's frames. A grade counts the most noticeable moment by itself, and the size of noticed
moments (ITU-R BS.1387-1, MFPD and ADB): a few frames that are softened buy a better grade than as
much taken from all.
Specification: spec/audio-carrier.md, W20 leaves the choice of levels to the embedder.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.embed.codec_loop import LEVELS_PER_DOUBLING
from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, HOP
from watermark.quality.ear import HOP as HEARD_HOP

SOFTENED = 0.7
"""Gain of the mark where it is noticed most: 3 dB."""

SMOOTHING, REACH = 0.9, 10
"""Share of the past in the smoothed probability, as in MFPD, and frames that it reaches back."""

MOST_SOFTENED = 0.5
"""Part of a superframe's frames up to which it is softened: where nearly all were, at a level that
should have made up for it, .96, 1.22 and 1.28 units of information arrived instead of 1.4 to 1.5,
and a superframe was lost."""

NOTICED = 0.4
"""Least probability of detection of a frame within reach that is softened."""

RARE, LEAST = 0.96, 0.3
"""Moments are those above this quantile of the passage's smoothed probabilities, and above this."""

REMEMBERED = 1920
"""The meter's frames of a passage: 41 s."""


@dataclass(frozen=True, slots=True)
class GainSmoothing:
    """Softening of some frames of a stretch.

    Attributes
    ----------
    gains : ndarray of float64, shape (frames,)
        Gain of each frame's mark.
    """

    gains: NDArray[np.float64]

    def parts(self) -> NDArray[np.float64]:
        """Gains of each superframe's frames, shape (superframes, 64)."""
        return self.gains.reshape(-1, FRAMES_PER_SUPERFRAME)

    def levels(self) -> NDArray[np.float64]:
        """Levels that make up for the information taken from each superframe, shape (superframes,).

        Examples
        --------
        >>> float(GainSmoothing(np.full(FRAMES_PER_SUPERFRAME, 0.5**0.5)).levels()[0].round(6))
        2.0
        """
        kept = np.square(self.parts()).mean(axis=1)
        return np.asarray(-LEVELS_PER_DOUBLING * np.log2(kept))


class Moments:
    """Finds the moments of a stretch that stand out in its passage."""

    def __init__(self) -> None:
        self._smooth = 0.0
        self._recent: deque[float] = deque(maxlen=REMEMBERED)
        self._heard = 0
        self._samples = 0

    def add(self, detections: NDArray[np.float64], samples: int) -> None:
        """Go on from a stretch of some samples that was chosen."""
        smoothed = self._follow(detections)
        self._recent.extend(smoothed)
        self._smooth = smoothed[-1] if smoothed else self._smooth
        self._heard += detections.size
        self._samples += samples

    def gains(self, detections: NDArray[np.float64], frames: int) -> NDArray[np.float64] | None:
        """Return gains of a stretch's frames that relieve its moments, None if there are none.

        Parameters
        ----------
        detections : ndarray of float64, shape (n,)
            Probability of detection in each of the meter's frames that the stretch completed.
        frames : int
            Frames of the mark in the stretch.

        Returns
        -------
        ndarray of float64, shape (frames,), or None
        """
        smoothed = np.array(self._follow(detections))
        known = np.concatenate([self._recent, smoothed])
        if not known.size:
            return None
        bound = max(float(np.quantile(known, RARE)), LEAST)
        noticed = np.zeros(detections.size, dtype=bool)
        for last in np.flatnonzero(smoothed > bound):
            first = max(0, last - REACH + 1)
            noticed[first : last + 1] |= detections[first : last + 1] > NOTICED
        middles = HEARD_HOP * (self._heard + 1 + np.flatnonzero(noticed)) - self._samples
        own = HOP * (1 + np.arange(frames))
        near = (np.abs(own[:, np.newaxis] - middles) < HEARD_HOP).any(axis=1)
        superframes = near.reshape(-1, FRAMES_PER_SUPERFRAME)
        superframes[superframes.mean(axis=1) > MOST_SOFTENED] = False
        return np.where(near, SOFTENED, 1.0) if near.any() else None

    def _follow(self, detections: NDArray[np.float64]) -> list[float]:
        """Smooth probabilities from where the passage stands."""
        smooth, smoothed = self._smooth, []
        for probability in detections:
            smooth = SMOOTHING * smooth + (1 - SMOOTHING) * float(probability)
            smoothed.append(smooth)
        return smoothed
