"""Levels of a mark: which one a superframe has, and what that means for its cells.

In: the base level of a passage and what a superframe needs; out: the superframe's level, an index
into `watermark.audio.signal.profile.LEVELS` that need not be whole, and the step and part of the
quantisation error that belong to it.
"""

import numpy as np

from watermark.audio.signal.profile import LEVELS

LEVELS_PER_DOUBLING = 2.0
"""Levels that double a superframe's information, about."""

HIGHEST_LEVEL = len(LEVELS) + 1.0
"""Highest level of a mark. Two levels above the last step 0.85 of the quantisation error is removed
in place of 0.6, which leaves half as much information again where noise leaves little."""

EQUALISATION = 0.8
"""Part of the differences in need that the levels follow; the need is an estimate."""

NEUTRAL_NEED = 5.0
"""Need of a superframe that is written at the base level."""


def level_of(base: float, need: float = NEUTRAL_NEED) -> float:
    """Level of a superframe at a base level."""
    return bounded_level(base + EQUALISATION * (need - NEUTRAL_NEED), base)


def bounded_level(level: float, base: float) -> float:
    """Level within those that a superframe may have: above the last step where the base is, too.

    There the grade leaves room to all; a single one that needs more is heard more than it gains.
    """
    highest = min(max(base, len(LEVELS) - 1.0), HIGHEST_LEVEL)
    return min(max(level, 0.0), highest)


def nearest_level(level: float) -> int:
    """Level whose step a mark has."""
    return min(round(level), len(LEVELS) - 1)


def share_of(level: float) -> np.float32:
    """Part of alpha that makes up for the step of the nearest level."""
    return np.float32(2 ** ((level - nearest_level(level)) / 4))
