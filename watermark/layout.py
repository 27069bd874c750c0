"""Seeded layout of a superframe: signs, dither, pilots and the interleaver.

Implements spec/audio-carrier.md section 4. Everything pseudorandom is drawn from SHAKE-256 of a
label and the key, one named stream per purpose, so that another implementation needs a hash
function only. What the pilots use is alike in all profiles.
"""

import hashlib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.profile import (
    FIRST_BIN,
    FRAMES_PER_SUPERFRAME,
    PILOT_GROUPS,
    PILOTS_PER_FRAME,
    PROFILES,
    Profile,
)

MAX_KEY = 2**64


@dataclass(frozen=True, slots=True)
class Layout:
    """Arrays that both ends share; `groups` is the number of cells of a frame.

    Attributes
    ----------
    starts : ndarray of int64, shape (groups + 1,)
        First bin of each cell, and of what follows the last.
    signs : ndarray of float64, shape (bins,)
        Spreading sequence from the first cell's first bin on, +1 or -1.
    dither : ndarray of float64, shape (groups,)
        Offset of each cell position's quantiser in steps, 0 to 1.
    pilot_group : ndarray of int64, shape (64, 2)
        Cell positions of each frame's pilots.
    pilot_sign : ndarray of float64, shape (64, 2)
        Their known values, +1 for bit 0 and -1 for bit 1.
    data_cell : ndarray of int64, shape (data_cells,)
        Cell (frame times groups plus position) of each coded bit: the interleaver.
    """

    starts: NDArray[np.int64]
    signs: NDArray[np.float64]
    dither: NDArray[np.float64]
    pilot_group: NDArray[np.int64]
    pilot_sign: NDArray[np.float64]
    data_cell: NDArray[np.int64]

    @property
    def expected_pilots(self) -> NDArray[np.float64]:
        """Known soft values at the pilots' positions, 0 elsewhere; shape (64, PILOT_GROUPS)."""
        expected = np.zeros((FRAMES_PER_SUPERFRAME, PILOT_GROUPS))
        np.put_along_axis(expected, self.pilot_group, self.pilot_sign, axis=1)
        return expected


def stream_words(purpose: str, key: int, count: int) -> NDArray[np.int64]:
    """Return `count` pseudorandom integers in 0..2**32-1 of the stream called `purpose`.

    Raises
    ------
    CueError
        If the key does not fit into 64 bits.

    Examples
    --------
    >>> bool((stream_words("signs", 0, 4) < 2**32).all())
    True
    """
    if not 0 <= key < MAX_KEY:
        raise CueError(f"key {key} is not within 0..2**64-1")
    raw = hashlib.shake_256(f"cuecast audio 1/{purpose}/{key}".encode()).digest(4 * count)
    return np.frombuffer(raw, dtype="<u4").astype(np.int64)


def _signs(words: NDArray[np.int64]) -> NDArray[np.float64]:
    """+1 for an even word, -1 for an odd one."""
    return np.where(words & 1, -1.0, 1.0)


def pilot_signs(key: int) -> NDArray[np.float64]:
    """Known pilot values of each profile, shape (profiles, 64, 2); the first pilot is common."""
    frames = FRAMES_PER_SUPERFRAME
    signs = np.empty((len(PROFILES), frames, PILOTS_PER_FRAME))
    signs[:, :, 0] = _signs(stream_words("pilot", key, frames))
    for profile in PROFILES.values():
        words = stream_words(f"announcement {profile.number}", key, frames)
        signs[profile.number, :, 1] = _signs(words)
    return signs


def pilot_groups(key: int) -> NDArray[np.int64]:
    """Cell positions of the pilots, shape (64, 2)."""
    words = stream_words("pilot positions", key, FRAMES_PER_SUPERFRAME * PILOT_GROUPS)
    order = np.argsort(words.reshape(FRAMES_PER_SUPERFRAME, PILOT_GROUPS), axis=1, kind="stable")
    return np.ascontiguousarray(order[:, :PILOTS_PER_FRAME], dtype=np.int64)


@lru_cache(maxsize=16)
def make_layout(profile: Profile, key: int = 0) -> Layout:
    """Draw the layout of a profile and key."""
    starts = np.array(profile.starts, dtype=np.int64)
    pilot_group = pilot_groups(key)
    is_pilot = np.zeros((FRAMES_PER_SUPERFRAME, profile.groups), dtype=bool)
    np.put_along_axis(is_pilot, pilot_group, True, axis=1)
    cells = np.flatnonzero(~is_pilot.reshape(-1))
    words = stream_words(f"interleaver {profile.number}", key, cells.size)
    return Layout(
        starts=starts,
        signs=_signs(stream_words("signs", key, int(starts[-1]) - FIRST_BIN)),
        dither=stream_words("dither", key, profile.groups) / 2.0**32,
        pilot_group=pilot_group,
        pilot_sign=pilot_signs(key)[profile.number],
        data_cell=cells[np.argsort(words, kind="stable")].astype(np.int64),
    )
