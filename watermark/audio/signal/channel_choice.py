"""Places of stereo: whether a bin is read from the mid, from left or from right.

A single channel of wide stereo does not hold the cells of the mid, so some cells of two channels
stand in left alone and some in right. Low ones, which coders keep best, and all pilots stand in
the mid. Specification: spec/audio-carrier.md, W43.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.profile import (
    FIRST_PILOT_BIN,
    FRAMES_PER_SUPERFRAME,
    HOP,
    PILOT_BINS,
    AudioProfile,
)

MID, LEFT, RIGHT = range(3)
"""Where a cell stands."""

FIRST_SIDE_BIN = 30
"""Lowest bin of left and right: 1.5 kHz. Below, coders keep twice as much of a cell's information,
and of the mid more than of left and right."""

SIDE_BINS = 4
"""Bins of a block that stands in one channel."""


@dataclass(frozen=True, slots=True)
class ChannelChoice:
    """Where bins and cells of a profile stand.

    Attributes
    ----------
    bins : ndarray of int64, shape (64, HOP)
        Place of each bin in each frame; pilots are of the mid.
    cells : ndarray of int64, shape (groups,)
        Place of each data cell.
    """

    bins: NDArray[np.int64]
    cells: NDArray[np.int64]


@lru_cache(maxsize=16)
def make_places(profile: AudioProfile, key: int) -> ChannelChoice:
    """Return the places of a profile; the key moves its pilots."""
    above = np.arange(HOP) - FIRST_SIDE_BIN
    turn = above // SIDE_BINS % profile.side_period
    row = np.where(turn == 0, LEFT, np.where(turn == profile.side_period // 2, RIGHT, MID))
    row[(above < 0) | (np.arange(HOP) >= profile.last_bin)] = MID
    bins = np.tile(row, (FRAMES_PER_SUPERFRAME, 1))
    first = FIRST_PILOT_BIN + PILOT_BINS * make_pilots(key).slots
    under = first[:, :, np.newaxis] + np.arange(PILOT_BINS)
    np.put_along_axis(bins, under.reshape(FRAMES_PER_SUPERFRAME, -1), MID, axis=1)
    cells = row[profile.first_bin + profile.cell_bins * np.arange(profile.groups)]
    return ChannelChoice(bins, cells)
