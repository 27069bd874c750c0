"""Words that are drawn out in writing, as cries are: Nooooon, Grrr, Saluuut.

In: a line of text.  Out: the line with each run of three or more same letters cut to the length
that the lexicon knows.
"""

import itertools
import re

from synth.language.text.lexicon import lookup
from synth.language.text.numbers import roman

_DRAWN_OUT = re.compile(r"[^\W\d_]*?([^\W\d_])\1\1[^\W\d_]*", re.I)
_RUN = re.compile(r"([^\W\d_])\1{2,}", re.I)

_ORDINAL = re.compile(r"(?<=[IVXLCDM])(e|es|ème|èmes|ième|ièmes)$")
"""What makes an ordinal of a Roman numeral."""

_MOST_RUNS = 4
"""Drawn-out letters of a word at most: more is no cry."""

_VOWELS = "aeiouyàâéèêëîïôùûü"


def shortened(line: str) -> str:
    """Return a line without drawn-out words.

    A word that no cut makes known keeps one letter of each run; Roman numerals stay.

    Examples
    --------
    >>> shortened("Nooooon ! Grrrr, www, Louis XIII, au XVIIIe, alleeeeez")
    'Non ! Grr, www, Louis XIII, au XVIIIe, allez'
    """
    return _DRAWN_OUT.sub(lambda m: _shortened(m[0]), line)


def _shortened(word: str) -> str:
    if word.lower() == "www" or roman(_ORDINAL.sub("", word)):
        return word
    if len(_RUN.findall(word)) > _MOST_RUNS:
        return _RUN.sub(r"\1", word)
    pieces = _RUN.split(word)
    # split() alternates what stands between the runs and the letter of each run.
    between, letters = pieces[::2], pieces[1::2]
    for lengths in itertools.product((1, 2), repeat=len(letters)):
        runs = [
            letter + (length - 1) * letter.lower()
            for letter, length in zip(letters, lengths, strict=True)
        ]
        cut = "".join(a + b for a, b in zip(between, [*runs, ""], strict=True))
        if lookup(cut.lower()) and (len(cut) > 1 or cut.lower() in _VOWELS):
            return cut
    least = 1 if any(letter in _VOWELS for letter in word.lower()) else 2
    return _RUN.sub(lambda m: m[1] + (least - 1) * m[1].lower(), word)
