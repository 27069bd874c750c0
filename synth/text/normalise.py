"""Written French to words: everything that is not a word is spelled out.

In: a line of text as subtitles have it.  Out: a list of tokens, lower-case words (an elided
word keeps its apostrophe: ``l'``, ``qu'``; words joined by a hyphen stay one token) and the
marks ``,`` (a short pause) and ``.`` (a long one).
"""

import re
import unicodedata

from synth.text.capitals import accented, without_accents
from synth.text.lexicon import lookup
from synth.text.readings import RULES
from synth.text.stretched import shortened

SHORT_PAUSE, LONG_PAUSE = ",", "."
PAUSES = frozenset((SHORT_PAUSE, LONG_PAUSE))

_TRANSLATION = str.maketrans(
    dict.fromkeys("\u00a0\u2007\u2009\u202f\t\r\n_|~*^[]{}\\", " ")
    | dict.fromkeys("’ʼ‘`´′＇", "'")
    | dict.fromkeys("‐‑‒−", "-")
    | dict.fromkeys("\u00ad\ufeff\u200b\u200e\u200f")
    | {"—": " , ", "–": " , ", "…": " ... ", "ﬁ": "fi", "ﬂ": "fl"}
)

_TOKEN = re.compile(r"[^\W\d_]+(?:[-'][^\W\d_]+)*'?|\.{2,}|[,;:.?!()«»\"]")
_LONG = re.compile(r"[.?!]+")
_ELIDED = re.compile(r"(?:c|ç|d|j|l|m|n|s|t|y|z|qu|jusqu|lorsqu|puisqu|quoiqu|quelqu|presqu|entr)'")


def normalise(text: str) -> list[str]:
    """Return the tokens of `text`.

    Examples
    --------
    >>> " ".join(normalise("M. Dupont arrive à 20h30, n° 3."))
    'monsieur dupont arrive à vingt heures trente , numéro trois .'
    >>> normalise("Aujourd’hui, l'homme qu'on attend…")
    ["aujourd'hui", ',', "l'", 'homme', "qu'", 'on', 'attend', '.']
    """
    line = unicodedata.normalize("NFC", text).translate(_TRANSLATION)
    line = shortened(_lower_shouting(line))
    for pattern, reading in RULES:
        line = pattern.sub(reading, line)
    line = "".join(" " if sign.isdigit() else sign for sign in line.lower())
    tokens: list[str] = []
    for piece in _TOKEN.findall(line):
        if piece[0].isalpha():
            tokens += _words(piece)
        elif tokens:
            _add_pause(tokens, LONG_PAUSE if _LONG.fullmatch(piece) else SHORT_PAUSE)
    return tokens


def _lower_shouting(line: str) -> str:
    """Return a line in capitals in lower case: its capitals do not mark sigles.

    Where no capital bears an accent, they are missing.
    """
    words = re.findall(r"[^\W\d_]{2,}", line)
    if len(words) > 1 and all(word.isupper() for word in words):
        lower = line.lower()
        return lower if without_accents(lower) != lower else accented(lower)
    return line


def _add_pause(tokens: list[str], mark: str) -> None:
    """Append a pause; of two pauses in a row the longer stays."""
    if tokens[-1] not in PAUSES:
        tokens.append(mark)
    elif mark == LONG_PAUSE:
        tokens[-1] = LONG_PAUSE


def _words(piece: str) -> list[str]:
    """Split the elided words off a run of letters, hyphens and apostrophes.

    Examples
    --------
    >>> _words("qu'aujourd'hui"), _words("l'ex-champion"), _words("p'tit")
    (["qu'", "aujourd'hui"], ["l'", 'ex-champion'], ["p'tit"])
    """
    words = []
    while not lookup(piece) and (elided := _ELIDED.match(piece)):
        words.append(elided[0])
        piece = piece[elided.end() :]
    if piece:
        words.append(piece if lookup(piece) else piece.rstrip("'"))
    return words
