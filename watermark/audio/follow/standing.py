"""What cells of mid, left and right are worth where a single channel may be heard.

In: soft values of a superframe; out: factors of the weights of its cells. A single channel has its
own cells only: they lie near points of either bit, others anywhere.
Specification: spec/audio-carrier.md, W38 and W42.
"""

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow.align import SuperframeView
from watermark.audio.signal.channel_choice import LEFT, MID, RIGHT, ChannelChoice
from watermark.audio.signal.layout import Cells
from watermark.audio.signal.profile import AudioProfile

LEAST_STANDING = 0.02
"""Least weight of the cells of other channels where a single one is heard."""

SURELY = 2.0
"""Standard deviations that cells of one place must lie nearer to points of either bit than
those of another, for the sound to be taken for a single channel; and how many the others must have
to be given weight."""

Array = NDArray[np.float64]


class CellStanding:
    """Compares the cells of each place with each other.

    Parameters
    ----------
    profile : AudioProfile
        How superframes are written.
    cells : Cells
        Its cells.
    places : ChannelChoice
        Where they stand.

    Attributes
    ----------
    kinds : ndarray of float64, shape (4, groups)
        Which cells are alike: low ones, and above those of mid, left, right.
    """

    def __init__(self, profile: AudioProfile, cells: Cells, places: ChannelChoice) -> None:
        self._profile, self._cells = profile, cells
        above = np.arange(places.cells.size) >= np.flatnonzero(places.cells)[0]
        kinds = [~above, *((places.cells == place) & above for place in (MID, LEFT, RIGHT))]
        self.kinds = np.array(kinds, dtype=np.float64)

    def of_unknown(self, view: SuperframeView, level: float) -> Array:
        """Factors of weights by cells whose bits are not known, shape (groups,).

        They are 1 unless cells of one place lie nearer to a point of either bit than others.
        """
        if view.paired:
            return np.ones(self._profile.groups)
        soft = view.soft(self._cells, self._profile.step(level))
        return self.factors(_agreement(soft), soft != 0)

    def lone_levels(self, view: SuperframeView, levels: list[float]) -> list[tuple[Array, float]]:
        """Cells of left and of right, shape (groups,), and the level at which they seem written."""
        if view.paired:
            return []
        soft = [view.soft(self._cells, self._profile.step(level)) for level in levels]
        near = [_agreement(at_level).sum(axis=0) for at_level in soft]
        return [(kind, levels[int((near @ kind).argmax())]) for kind in self.kinds[2:]]

    def factors(self, near: Array, seen: NDArray[np.bool_]) -> Array:
        """Factors of weights by how near the cells of each place lie to the right points."""
        cells = np.maximum(self.kinds @ seen.sum(axis=0), 1)
        mean, deviation = self.kinds @ near.sum(axis=0) / cells, np.sqrt(0.5 / cells)
        best = int(mean[1:].argmax()) + 1
        apart = SURELY * np.hypot(deviation, deviation[best])
        if not (mean[1:] < mean[best] - apart[1:]).any():
            return np.ones(self._profile.groups)
        sure = mean - SURELY * deviation
        factors = np.clip(sure / max(sure[best], deviation[best]), LEAST_STANDING, 1.0)
        return np.asarray(factors @ self.kinds)


def _agreement(soft: Array) -> Array:
    """Second harmonic of soft values, in which both bits agree."""
    return np.where(soft != 0, 2 * soft**2 - 1, 0.0)
