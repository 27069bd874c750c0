"""Seeded layout of a superframe: signs, dither, pilots and the interleaver.

Implements spec/audio-carrier.md section 4. Everything pseudorandom is drawn from SHAKE-256 of a
label, the profile's number and the key, one named stream per purpose, so that another
implementation needs a hash function only.
"""

import hashlib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.profile import FRAMES_PER_SUPERFRAME, Profile

MAX_KEY = 2**64


@dataclass(frozen=True, slots=True)
class Layout:
    """Arrays that both ends share; `groups` is the number of cells of a frame.

    Attributes
    ----------
    signs : ndarray of float64, shape (groups, cell_bins)
        Spreading sequence of each cell position, +1 or -1.
    dither : ndarray of float64, shape (groups,)
        Offset of each cell position's quantiser in steps, 0 to 1.
    pilot_group : ndarray of int64, shape (64, pilots_per_frame)
        Cell positions of each frame's pilots.
    pilot_sign : ndarray of float64, shape (64, pilots_per_frame)
        Their known values, +1 for bit 0 and -1 for bit 1.
    data_cell : ndarray of int64, shape (data_cells,)
        Cell (frame times groups plus position) of each coded bit: the interleaver.
    """

    signs: NDArray[np.float64]
    dither: NDArray[np.float64]
    pilot_group: NDArray[np.int64]
    pilot_sign: NDArray[np.float64]
    data_cell: NDArray[np.int64]


def stream_words(purpose: str, profile: Profile, key: int, count: int) -> NDArray[np.int64]:
    """Return `count` pseudorandom integers in 0..2**32-1 of the stream called `purpose`.

    Raises
    ------
    CueError
        If the key does not fit into 64 bits.

    Examples
    --------
    >>> from watermark.profile import STANDARD
    >>> bool((stream_words("signs", STANDARD, 0, 4) < 2**32).all())
    True
    """
    if not 0 <= key < MAX_KEY:
        raise CueError(f"key {key} is not within 0..2**64-1")
    label = f"cuecast audio 1/{purpose}/{profile.number}/{key}".encode()
    raw = hashlib.shake_256(label).digest(4 * count)
    return np.frombuffer(raw, dtype="<u4").astype(np.int64)


def permutation(words: NDArray[np.int64]) -> NDArray[np.int64]:
    """Order of 0..n-1 that sorts n pseudorandom words, ties kept in place."""
    return np.argsort(words, kind="stable").astype(np.int64)


def _signs(words: NDArray[np.int64]) -> NDArray[np.float64]:
    """+1 for an even word, -1 for an odd one."""
    return np.where(words & 1, -1.0, 1.0)


@lru_cache(maxsize=16)
def make_layout(profile: Profile, key: int = 0) -> Layout:
    """Draw the layout of a profile and key."""
    groups, bins = profile.groups, profile.cell_bins
    frames, pilots = FRAMES_PER_SUPERFRAME, profile.pilots_per_frame
    signs = _signs(stream_words("signs", profile, key, groups * bins))
    dither = stream_words("dither", profile, key, groups) / 2.0**32
    order = stream_words("pilot positions", profile, key, frames * profile.pilot_groups)
    by_frame = order.reshape(frames, profile.pilot_groups)
    pilot_group = np.argsort(by_frame, axis=1, kind="stable")[:, :pilots].astype(np.int64)
    pilot_sign = _signs(stream_words("pilot bits", profile, key, frames * pilots))
    is_pilot = np.zeros((frames, groups), dtype=bool)
    np.put_along_axis(is_pilot, pilot_group, True, axis=1)
    cells = np.flatnonzero(~is_pilot.reshape(-1))
    shuffle = permutation(stream_words("interleaver", profile, key, cells.size))
    return Layout(
        signs=signs.reshape(groups, bins),
        dither=dither,
        pilot_group=pilot_group,
        pilot_sign=pilot_sign.reshape(frames, pilots),
        data_cell=cells[shuffle].astype(np.int64),
    )
