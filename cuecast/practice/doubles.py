"""Labial doubles: French words whose lips look alike and whose keys differ.

Members of a line of ``doubles.txt`` differ in consonants, or vowels, of one viseme (Owens and
Blazek 1985 for consonants): lip-reading alone cannot separate them, a key does.
"""

import itertools
from functools import cache
from importlib.resources import files


@cache
def doubles() -> tuple[tuple[str, ...], ...]:
    """Return the families of words, two or three in each.

    Examples
    --------
    >>> doubles()[:2]
    (('papi', 'mamie'), ('pain', 'bain', 'main'))
    """
    text = (files("cuecast") / "practice" / "doubles.txt").read_text(encoding="utf-8")
    lines = (line.split() for line in text.splitlines() if not line.startswith("#"))
    return tuple(tuple(words) for words in lines if words)


@cache
def minimal_pairs() -> tuple[tuple[str, str], ...]:
    """Return every pair within a family, in order.

    Examples
    --------
    >>> minimal_pairs()[:3]
    (('papi', 'mamie'), ('pain', 'bain'), ('pain', 'main'))
    """
    return tuple(pair for family in doubles() for pair in itertools.combinations(family, 2))
