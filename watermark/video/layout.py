"""Seeded layout of a superframe's values: dither, pilots, interleaver.

Specification: spec/video-carrier.md, section 5. Pseudorandom numbers come from the named streams
of `watermark.audio.signal.layout`.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from watermark.link.keystream import stream_words
from watermark.video.profile import COMMON, COMMON_OF, NUMBERS, PILOTS, POSITIONS, VideoProfile


@dataclass(frozen=True, slots=True)
class VideoLayout:
    """Arrays that both ends share.

    Attributes
    ----------
    dither : ndarray of float64, shape (POSITIONS,)
        Offset of each value's quantiser in steps, 0 to 1.
    pilots : ndarray of int64, shape (PILOTS,)
        Positions of the pilots, the same for all profiles.
    pilot_bits : ndarray of int64, shape (PILOTS,)
        Their bits in even superframes; odd ones hold the opposite.
    data : ndarray of int64, shape (DATA,)
        Position of each coded bit: the interleaver.
    """

    dither: NDArray[np.float64]
    pilots: NDArray[np.int64]
    pilot_bits: NDArray[np.int64]
    data: NDArray[np.int64]


@lru_cache(maxsize=16)
def make_layout(profile: VideoProfile, key: int = 0, rung: int = 0) -> VideoLayout:
    """Draw the layout of a profile, key and step.

    Examples
    --------
    >>> from watermark.video.profile import PROFILES
    >>> make_layout(PROFILES["standard"]).data.size
    6880
    """
    dither = stream_words("video dither", key, POSITIONS) / 2.0**32
    order = np.argsort(stream_words("video positions", key, POSITIONS), kind="stable")
    number = profile.number + NUMBERS * rung
    words = stream_words(f"video pilot bits {number}", key, PILOTS)
    words = np.where(common_pilots(), stream_words("video pilot bits", key, PILOTS), words)
    return VideoLayout(dither, np.sort(order[:PILOTS]), words & 1, order[PILOTS:])


def common_pilots() -> NDArray[np.bool_]:
    """Which pilots have the same bits in all modes, shape (PILOTS,)."""
    return np.asarray(np.arange(PILOTS) % COMMON_OF < COMMON)
