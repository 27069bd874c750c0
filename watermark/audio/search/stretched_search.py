"""Acquisition in sound that was stretched at its pitch: pilots that lie in pieces.

Within a piece pilots lie as usual; from piece to piece some milliseconds are left out or heard
twice. In: the sight of a stretch; out: the likeliest path of a superframe's pilots, by dynamic
programming (Viterbi, IEEE Trans. IT 13(2), 1967). Specification: spec/audio-carrier.md, W48.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.search.acquire import FIRST_PLACE, PLACE, ROW_HOP
from watermark.audio.search.pilot_scan import PARTS, Sight
from watermark.audio.search.stretch_scores import pilot_places
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.profile import (
    FRAMES_PER_SUPERFRAME,
    PILOT_STEPS,
    PROFILES,
    AudioProfile,
)

JUMP, PENALTY = 1000, 8.0
"""The longest jump in samples, and the correlation of pilots that it must be worth: in 12 stretches
of marked clips the best path was a true one."""

LEAST = 45.0
"""Least correlation of a path of pilots that is worth an attempt: 11 of 12 true ones have more, and
8 of 100 stretches of unmarked sound, at most 46.7."""

LEAST_KNOWN = 40.0
"""The same where a mark was read not long ago: more than half of those unmarked stretches
reach it, too."""


@dataclass(frozen=True, slots=True)
class StretchedCandidate:
    """A superframe indicated by pilots.

    Attributes
    ----------
    profile, tier : int
        Number of the profile that the pilots announce, and tier of their levels.
    places : ndarray of float64, shape (64,)
        Where its frames begin, about: samples at 48 kHz from the first one searched.
    score : float
        Correlation of its pilots, less what its jumps cost.
    """

    profile: int
    tier: int
    places: NDArray[np.float64]
    score: float


def find_stretched(key: int, seen: Sight, *, least: float = LEAST) -> StretchedCandidate | None:
    """Best candidate of a least score that lies whole in the sight of some 2 s, if any."""
    from watermark.audio.search._stretched_kernels import BLOCK, SEGMENT, add_pilots, follow_pilots

    soft, pilots = pilot_places(key, seen), make_pilots(key)
    slots = np.ascontiguousarray(pilots.slots.T)
    masks = np.where(pilots.signs.transpose(2, 0, 1) < 0, -1, 0).astype(np.int8)
    segments = FRAMES_PER_SUPERFRAME // SEGMENT
    room = soft.shape[2] - ROW_HOP * (SEGMENT - 1)
    if room <= FRAMES_PER_SUPERFRAME * ROW_HOP:
        return None
    count = room // BLOCK * BLOCK
    score = np.empty(count + (segments - 1) * SEGMENT * ROW_HOP, dtype=np.int16)
    doublings = math.ceil(math.log2(JUMP / (PLACE * BLOCK)))
    penalty = np.int16(round(PENALTY * PARTS))

    common = np.zeros((segments, count), dtype=np.int8)
    own, nothing = np.empty_like(common), np.zeros_like(common)

    # Viterbi over places: a segment begins where the last one ends, or at a price anywhere within
    # 2 ** doublings blocks.
    def follow(tier: int, profile: AudioProfile, origin: NDArray[np.int32]) -> None:
        add_pilots(soft[tier], slots[1], masks[1, profile.number], ROW_HOP, common, own)
        follow_pilots(own, SEGMENT * ROW_HOP, doublings, penalty, score, origin)

    best = None
    # First pass: scores alone, to choose tier and profile; keeping origins costs memory.
    for tier in range(len(PILOT_STEPS)):
        add_pilots(soft[tier], slots[0], masks[0, 0], ROW_HOP, nothing, common)
        for profile in PROFILES.values():
            if not profile.levels_of(tier):
                continue
            follow(tier, profile, np.empty((0, 0), dtype=np.int32))
            highest = int(score[:count].max())
            if highest >= least * PARTS and (best is None or highest > best[0]):
                best = highest, tier, profile
    if best is None:
        return None
    # Second pass for the best one, with origins, then back from the end.
    origin = np.empty((segments, count), dtype=np.int32)
    highest, tier, profile = best
    add_pilots(soft[tier], slots[0], masks[0, 0], ROW_HOP, nothing, common)
    follow(tier, profile, origin)
    starts = [int(score[:count].argmax())]
    for j in range(segments - 1, 0, -1):
        starts.append(int(origin[j, starts[-1]]))
    frame = ROW_HOP * np.arange(SEGMENT)
    places = np.add.outer(np.array(starts[::-1]), frame).reshape(-1)
    return StretchedCandidate(profile.number, tier, PLACE * places + FIRST_PLACE, highest / PARTS)
