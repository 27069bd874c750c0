"""How long a key needs on the cuer's clock, so that it is seen long enough.

A hand that moves from key to key shows each from some moment on until another moment, both counted
from the starts of the keys: which moments depends on where it comes from and goes to. What lies
between the end of one key and the beginning of the next is lost on the way.
"""

from functools import lru_cache

from codec.cues.score import PLACEMENTS

SEEN_S = 0.135
"""Seconds for which a key should be shown: three pictures at 25 a second, and the scatter."""

STILL_S = 0.08
"""Least seconds from a key to one that repeats it: the hand stays."""

_BEGINS_MS = {
    "same": (-71, -69, -67, -66, -72),
    "side": (0, -43, -4, -36, -46),
    "mouth": (-58, 0, -44, -59, -59),
    "chin": (-40, -46, 0, -48, -60),
    "cheek": (-68, -62, -36, 0, -92),
    "throat": (-37, -30, -52, -55, 0),
}
"""When a key is shown after its start, ms: from the placement before to side, mouth, chin, cheek,
throat. `python -m lab.key_times` measures these tables."""

_ENDS_MS = {
    "same": (-73, -77, -79, -75, -73),
    "side": (0, -74, -75, -73, -80),
    "mouth": (-78, 0, -78, -78, -83),
    "chin": (-87, -79, 0, -103, -82),
    "cheek": (-81, -76, -102, 0, -150),
    "throat": (-85, -77, -74, -130, 0),
}
"""Until when it is shown, after the start of the next key, ms: from its placement to the next."""

_ENDS_IN_SHAPE_MS = {
    "side": (0, -38, -49, -33, -47),
    "mouth": (-54, 0, -52, -62, -51),
    "chin": (-80, -56, 0, -116, -47),
    "cheek": (-70, -67, -94, 0, -150),
    "throat": (-73, -65, -55, -132, 0),
}
"""The same where the next key has the same shape."""

_BEGINS_LATER_S, _ENDS_LATER_S = 0.016, 0.014
"""How much later a key of two phones is shown, and a key before one of two phones is left."""

_FAR = {("side", "chin"), ("side", "throat"), ("cheek", "throat"), ("throat", "cheek")}
_FAR_S = 0.16
"""Least seconds of a key before the longest ways: knuckles stay below 1.5 m/s."""

_FROM_REST_S, _TO_REST_S = -0.04, -0.05
"""For a key at the beginning or the end, where nothing hurries."""

Form = tuple[int, str, int]
"""Hand shape, placement and number of phones of a key."""


@lru_cache(4096)
def least_s(before: Form | None, here: Form, after: Form | None) -> float:
    """Return the shortest time from the start of a key to that of the next, seconds.

    Examples
    --------
    >>> side, chin = (3, "side", 1), (5, "chin", 2)
    >>> round(least_s(side, chin, side), 3)
    0.234
    >>> least_s(chin, side, side)
    0.08
    """
    if after is not None and here[:2] == after[:2]:
        return STILL_S
    begins = _FROM_REST_S if before is None else _begins_s(before, here)
    ends = _TO_REST_S if after is None else _ends_s(here, after)
    far = after is not None and (here[1], after[1]) in _FAR
    return max(SEEN_S + begins - ends, _FAR_S if far else 0.0)


def _begins_s(before: Form, here: Form) -> float:
    row = "same" if before[1] == here[1] else before[1]
    return _entry(_BEGINS_MS[row], here) + _BEGINS_LATER_S * (here[2] - 1)


def _ends_s(here: Form, after: Form) -> float:
    if here[1] == after[1]:
        row = _ENDS_MS["same"]
    else:
        row = (_ENDS_IN_SHAPE_MS if here[0] == after[0] else _ENDS_MS)[here[1]]
    return _entry(row, after) + _ENDS_LATER_S * (after[2] - 1)


def _entry(row: tuple[int, ...], to: Form) -> float:
    return row[PLACEMENTS.index(to[1]) - 1] / 1000.0
