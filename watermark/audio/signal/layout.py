"""Seeded layout of a superframe: signs, dither, pilots and the interleaver.

Implements spec/audio-carrier.md section 4. Everything pseudorandom is drawn from SHAKE-256 of a
label and the key, one named stream per purpose, so that another implementation needs a hash
function only. The pilots' cells are alike in all profiles.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.audio.signal.profile import (
    FIRST_PILOT_BIN,
    FRAMES_PER_SUPERFRAME,
    PILOT_BINS,
    PILOT_SLOTS,
    PILOTS_PER_FRAME,
    PROFILES,
    AudioProfile,
)
from watermark.link.keystream import stream_words


@dataclass(frozen=True, slots=True)
class Cells:
    """Cells of a frame that lie side by side.

    Attributes
    ----------
    first_bin : int
        Lowest bin of the lowest cell.
    bins : int
        Bins of each cell.
    signs : ndarray of float64, shape (groups * bins,)
        Spreading sequence, +1 or -1.
    dither : ndarray of float64, shape (groups,)
        Offset of each cell's quantiser in steps, 0 to 1.
    """

    first_bin: int
    bins: int
    signs: NDArray[np.float64]
    dither: NDArray[np.float64]

    @property
    def last_bin(self) -> int:
        """First bin above the cells."""
        return self.first_bin + self.signs.size


@dataclass(frozen=True, slots=True)
class Pilots:
    """Known cells of a superframe, alike in all profiles but for the announcement.

    Attributes
    ----------
    cells : Cells
        The six slots where pilots may stand.
    slots : ndarray of int64, shape (64, 2)
        Slots of each frame's pilots.
    signs : ndarray of float64, shape (profiles, 64, 2)
        Their soft values: +1 for bit 0, -1 for bit 1. The first is the same in all profiles.
    """

    cells: Cells
    slots: NDArray[np.int64]
    signs: NDArray[np.float64]

    def expected(self, profile: int) -> NDArray[np.float64]:
        """Soft values of all slots, 0 where no pilot stands; shape (64, PILOT_SLOTS)."""
        expected = np.zeros((FRAMES_PER_SUPERFRAME, PILOT_SLOTS))
        np.put_along_axis(expected, self.slots, self.signs[profile], axis=1)
        return expected


@dataclass(frozen=True, slots=True)
class AudioLayout:
    """Data cells of a profile.

    Attributes
    ----------
    cells : Cells
        Cells of a frame; those under a pilot are not used.
    order : ndarray of int64, shape (data_cells,)
        Cell (frame times groups plus position) of each coded bit: the interleaver.
    """

    cells: Cells
    order: NDArray[np.int64]

    def spread(self, line: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
        """Values of the coded bits at their cells, shape (64, groups); 0 under pilots."""
        values = np.zeros(FRAMES_PER_SUPERFRAME * self.cells.dither.size)
        values[self.order] = line
        return values.reshape(FRAMES_PER_SUPERFRAME, -1)

    def gather(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Inverse of `spread`."""
        return np.asarray(values.reshape(-1)[self.order])


def _signs(words: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return +1 for an even word, -1 for an odd one."""
    return np.where(words & 1, -1.0, 1.0)


def _cells(purpose: str, key: int, first_bin: int, bins: int, groups: int) -> Cells:
    """Draw the signs and dither of `groups` cells."""
    signs = _signs(stream_words(f"{purpose} signs", key, groups * bins))
    return Cells(first_bin, bins, signs, stream_words(f"{purpose} dither", key, groups) / 2.0**32)


@lru_cache(maxsize=16)
def make_pilots(key: int) -> Pilots:
    """Draw the pilots of a key."""
    frames = FRAMES_PER_SUPERFRAME
    words = stream_words("pilot slots", key, frames * PILOT_SLOTS).reshape(frames, -1)
    slots = np.argsort(words, axis=1, kind="stable")[:, :PILOTS_PER_FRAME]
    signs = np.empty((len(PROFILES), frames, PILOTS_PER_FRAME))
    signs[:, :, 0] = _signs(stream_words("pilot bits", key, frames))
    for profile in PROFILES.values():
        announcement = stream_words(f"announcement {profile.number}", key, frames)
        signs[profile.number, :, 1] = _signs(announcement)
    cells = _cells("pilot", key, FIRST_PILOT_BIN, PILOT_BINS, PILOT_SLOTS)
    return Pilots(cells, np.ascontiguousarray(slots, dtype=np.int64), signs)


@lru_cache(maxsize=16)
def make_layout(profile: AudioProfile, key: int) -> AudioLayout:
    """Draw the data cells of a profile and key."""
    name = f"data {profile.number}"
    cells = _cells(name, key, profile.first_bin, profile.cell_bins, profile.groups)
    per_slot = PILOT_BINS // profile.cell_bins
    free = np.ones((FRAMES_PER_SUPERFRAME, profile.groups), dtype=bool)
    open_slots = np.ones((FRAMES_PER_SUPERFRAME, PILOT_SLOTS), dtype=bool)
    np.put_along_axis(open_slots, make_pilots(key).slots, False, axis=1)
    low = (FIRST_PILOT_BIN - profile.first_bin) // profile.cell_bins
    free[:, low : low + PILOT_SLOTS * per_slot] = np.repeat(open_slots, per_slot, axis=1)
    usable = np.flatnonzero(free)
    words = stream_words(f"{name} interleaver", key, usable.size)
    return AudioLayout(cells, usable[np.argsort(words, kind="stable")].astype(np.int64))
