"""Lines in capitals: their words in lower case, their sigles as they stand.

In: a line of text.  Out: the same line if it is not in capitals, else its words in lower case;
letters that are spelled (PSG, TF1), Roman numerals and the numbers of centuries stay in capitals.
"""

import itertools
import re

from synth.language.text.lexicon import lookup, lookup_name
from synth.language.text.numbers import roman
from synth.language.text.tables import SPELLED_SIGLES

_WORD = re.compile(r"(?<![\w])[^\W_]+(?![\w])")
_LETTERS = re.compile(r"[^\W\d_]{2,}")
_CODE = re.compile(r"[A-Z]{1,4}\d{1,3}[A-Z]?|\d[DGKVP]")
_CENTURY = re.compile(r"([IVX]{2,})(E|EME|ÈME)S?")
_TITLES = {
    "M": "monsieur", "MM": "messieurs", "MR": "monsieur", "MME": "madame", "MMES": "mesdames",
    "MLLE": "mademoiselle", "DR": "docteur", "ST": "saint", "STE": "sainte", "BD": "boulevard",
    "MGR": "monseigneur",
}  # fmt: skip
_WORDS_FIRST = frozenset("cap ter us spa".split())
"""Sigles that are more often words in a line of capitals."""

_LONGEST_UNKNOWN = 4
"""Letters of a sigle that no list has, at most."""


def is_shouted(line: str) -> bool:
    """Whether a line is all in capitals, with more than one word."""
    words = _LETTERS.findall(line)
    return len(words) > 1 and all(word.isupper() for word in words)


def lowered(line: str) -> str:
    """Return a line of capitals in lower case but for its sigles.

    Examples
    --------
    >>> lowered("LE PSG BAT L'OM, JT DE 20H SUR TF1")
    "le PSG bat l'OM, JT de 20h sur TF1"
    """
    return _WORD.sub(lambda m: _lowered(m, line), line.replace("M. ", "MR "))


def _lowered(match: re.Match[str], line: str) -> str:
    word = match[0]
    before, after = line[: match.start()][-1:], line[match.end() :][:1]
    if century := _CENTURY.fullmatch(word):
        return f"{century[1]}e" if roman(century[1]) else word.lower()
    if word in _TITLES and after in (" ", ".") and len(word) > 1:
        return _TITLES[word]
    tied = after == "'" or "-" in (before, after)
    return word if not tied and _is_sigle(word) else word.lower()


def _is_sigle(word: str) -> bool:
    lower = word.lower()
    if _CODE.fullmatch(word) or (len(word) > 1 and set(word) <= set("IVX") and roman(word)):
        return True
    if not word.isascii() or not word.isalpha():
        return False
    vowels = set(lower) & set("aeiouy")
    if len(word) == 1:
        return not vowels and word not in "MH"
    if lower in SPELLED_SIGLES:
        return lower not in _WORDS_FIRST
    if lookup(lower) or lookup_name(lower):
        return False
    doubled = any(a == b for a, b in itertools.pairwise(word))
    return (not vowels and not doubled) or (len(word) <= _LONGEST_UNKNOWN and not _has_word(lower))


def _has_word(lower: str) -> bool:
    """Whether letters without their accents are a word."""
    from synth.language.text.normalise import accent_candidates

    return bool(accent_candidates(lower) or (lower.endswith("s") and lookup(lower[:-1])))
