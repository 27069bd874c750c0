"""Demodulation of one profile's superframes: a view of sound to payloads, whatever its level.

In: a `View`; out: soft values, log-likelihood ratios and what the link makes of them. The level is
found by trying: the one that worked last first. Specification: sections 6 and 7.3.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.align import View
from watermark.dither import steps_of
from watermark.layout import make_layout
from watermark.link import Decoded, Link
from watermark.profile import FRAMES_PER_SUPERFRAME, Profile
from watermark.reliability import Reliability


@dataclass(frozen=True, slots=True)
class Reading:
    """A superframe as read at one place and level.

    Attributes
    ----------
    view : View
        Where it was read.
    level : int
        Level that was assumed.
    soft : ndarray of float64, shape (64, groups)
        Soft values.
    llr : ndarray of float64, shape (data_cells,)
        Log-likelihood ratios of the coded bits.
    decoded : Decoded
        What the link found.
    """

    view: View
    level: int
    soft: NDArray[np.float64]
    llr: NDArray[np.float64]
    decoded: Decoded


class Demodulator:
    """Reads the superframes of a profile and learns how far each cell can be trusted."""

    def __init__(self, profile: Profile, key: int) -> None:
        self.profile = profile
        self.layout = make_layout(profile, key)
        self.link = Link(profile)
        self.reliability = Reliability(profile.groups)

    def read(self, view: View, levels: list[int]) -> Reading:
        """Read at the first of `levels` that the link accepts; else at the first of all."""
        first = None
        for level in levels:
            soft = view.soft(self.layout, steps_of(self.layout, level))
            llr = self.reliability.weigh(soft).reshape(-1)[self.layout.data_cell]
            reading = Reading(view, level, soft, llr, self.link.decode(llr))
            if reading.decoded.l0 is not None:
                return reading
            first = first or reading
        if first is None:
            raise ValueError("no level to try")
        return first

    def expected(self, decoded: Decoded) -> NDArray[np.float64]:
        """Soft values that decoded bits and pilots ask for; 0 where unknown, (64, groups)."""
        line = np.zeros(self.profile.cells)
        known = decoded.coded >= 0
        line[self.layout.data_cell[known]] = 1.0 - 2.0 * decoded.coded[known]
        expected = line.reshape(FRAMES_PER_SUPERFRAME, -1)
        np.put_along_axis(expected, self.layout.pilot_group, self.layout.pilot_sign, axis=1)
        return expected
