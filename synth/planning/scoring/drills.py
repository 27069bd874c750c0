"""The scores that the virtual cuer performs for corpora 1 and 2, and drill lines for corpus 3."""

from collections.abc import Iterable

import numpy as np

from codec.cues.cueing import cue
from codec.cues.phonology import CONSONANTS, VOWELS
from codec.cues.score import SHAPES, Key, Phone, Score

_PHONE_OF_SHAPE = ("m", "p", "k", "s", "b", "m", "l", "g", "j")

_KEY_S = 0.36
"""Duration in seconds of a key of corpus 1."""

_VOWEL_S = 0.40
"""Duration in seconds of a vowel by itself."""

_CONSONANT_S = 0.14
"""Duration in seconds of a consonant between vowels."""

_VCV_VOWEL_S = 0.26
"""Duration in seconds of a vowel beside a consonant."""

_GAP_S = 0.6
"""Seconds between items."""

_START_S = 1.0
"""Seconds of rest before the first item."""


def shape_transitions(
    *, rounds: int = 1, start_s: float = _START_S, key_s: float = _KEY_S
) -> Score:
    """Return corpus 1: every succession of two of the nine shapes, `rounds` times, at the side.

    Examples
    --------
    >>> import itertools
    >>> keys = shape_transitions().keys
    >>> len({(a.shape, b.shape) for a, b in itertools.pairwise(keys)})
    72
    """
    keys = [
        Key(start_s + i * key_s, start_s + (i + 1) * key_s, (_PHONE_OF_SHAPE[s],), s, "side")
        for i, s in enumerate(_circuit(list(SHAPES)) * rounds)
    ]
    return Score((), tuple(keys))


def _circuit(nodes: list[int]) -> list[int]:
    """Return a walk over every ordered pair of different nodes (Hierholzer)."""
    unused = {a: [b for b in nodes if b != a] for a in nodes}
    stack, walk = [nodes[0]], []
    while stack:
        if unused[stack[-1]]:
            stack.append(unused[stack[-1]].pop(0))
        else:
            walk.append(stack.pop())
    return walk[::-1]


def isolated_sounds(*, start_s: float = _START_S) -> Score:
    """Return corpus 2: isolated vowels, then every consonant between a, i and u; no keys."""
    words = [[v] for v in VOWELS]
    words += [[v, c, v] for v in ("a", "i", "u") for c in CONSONANTS]
    return Score(tuple(_spoken(words, start_s)), ())


def _spoken(words: Iterable[list[str]], start_s: float) -> Iterable[Phone]:
    at = start_s
    for word in words:
        for symbol in word:
            long = _VOWEL_S if len(word) == 1 else _VCV_VOWEL_S
            duration = _CONSONANT_S if symbol in CONSONANTS else long
            yield Phone(symbol, at, at + duration)
            at += duration
        at += _GAP_S


def drill(n_lines: int, *, seed: int = 0, start_s: float = _START_S) -> Score:
    """Return lines of nonsense speech with keys: C, V and CV in random order, evenly chosen.

    They need no text and cover shapes and placements far more evenly than French does.
    """
    rng = np.random.default_rng([seed, 31])
    phones: list[Phone] = []
    at = start_s
    for _ in range(n_lines):
        for _ in range(int(rng.integers(6, 14))):
            kind = rng.random()
            if kind < 0.85:
                consonant = CONSONANTS[rng.integers(len(CONSONANTS))]
                at = _append(phones, consonant, at, 0.10 + 0.05 * rng.random())
            if kind > 0.2:
                vowel = VOWELS[rng.integers(len(VOWELS))]
                at = _append(phones, vowel, at, 0.12 + 0.10 * rng.random())
        at += 1.5
    return Score(tuple(phones), tuple(cue(phones)))


def _append(phones: list[Phone], symbol: str, at: float, duration: float) -> float:
    phones.append(Phone(symbol, at, at + duration))
    return at + duration
