"""How different two phones sound: steps of height, place, manner and the like between them."""

import functools

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONES, VOWELS

_FEATURES = {
    # height, backness, rounding, nasality of vowels
    "i": (0, 0, 0, 0), "e": (1, 0, 0, 0), "ɛ": (2, 0, 0, 0), "a": (3, 1, 0, 0), "ɑ": (3, 2, 0, 0),
    "y": (0, 0, 1, 0), "ø": (1, 0, 1, 0), "œ": (2, 0, 1, 0), "ə": (2, 1, 1, 0), "u": (0, 2, 1, 0),
    "o": (1, 2, 1, 0), "ɔ": (2, 2, 1, 0), "ɛ̃": (2, 0, 0, 2), "ɑ̃": (3, 2, 0, 2),
    "ɔ̃": (1, 2, 1, 2), "œ̃": (2, 0, 1, 2),
    # place from the lips backwards, manner, voicing, nasality of consonants
    "p": (0, 0, 0, 0), "b": (0, 0, 1, 0), "m": (0, 0, 1, 2), "f": (1, 1, 0, 0), "v": (1, 1, 1, 0),
    "t": (2, 0, 0, 0), "d": (2, 0, 1, 0), "n": (2, 0, 1, 2), "s": (2, 1, 0, 0), "z": (2, 1, 1, 0),
    "l": (2, 2, 1, 0), "ʃ": (3, 1, 0, 0), "ʒ": (3, 1, 1, 0), "ɲ": (4, 0, 1, 2), "j": (4, 3, 1, 0),
    "ɥ": (4, 3, 1, 1), "k": (5, 0, 0, 0), "g": (5, 0, 1, 0), "ŋ": (5, 0, 1, 2), "w": (5, 3, 1, 1),
    "ʁ": (6, 2, 1, 0),
}  # fmt: skip

_OTHER_CLASS = 20
"""Cost of phones of different classes: more than any within one."""


@functools.cache
def phone_distance(a: str, b: str) -> int:
    """Return how different two phones are: 0 for the same, 20 for another class.

    Examples
    --------
    >>> phone_distance("p", "b"), phone_distance("i", "u"), phone_distance("a", "t")
    (1, 3, 20)
    """
    if a == b:
        return 0
    if PAUSE in (a, b) or (a in VOWELS) != (b in VOWELS):
        return _OTHER_CLASS
    pairs = zip(_FEATURES[a], _FEATURES[b], strict=True)
    return max(1, sum(abs(x - y) for x, y in pairs))


def same_but_voiced(a: str, b: str) -> bool:
    """Return whether two phones are the same but for their voicing.

    Examples
    --------
    >>> same_but_voiced("z", "s"), same_but_voiced("z", "l"), same_but_voiced("_", "s")
    (True, False, False)
    """
    if a == b or PAUSE in (a, b) or a in VOWELS or b in VOWELS:
        return a == b
    return all(_FEATURES[a][i] == _FEATURES[b][i] for i in (0, 1, 3))


@functools.cache
def phone_distances() -> NDArray[np.int64]:
    """Return the distances of all phones by their numbers, shape (38, 38)."""
    return np.array([[phone_distance(a, b) for b in PHONES] for a in PHONES])
