"""Which subtitles are French: the others must not be cued by the rules of French.

In: the texts of a file in their order, and the languages that the file declares.  Out: for each
the language, "fr" unless something speaks against it.  The evidence of a text is the share of its
words that the French lexicon knows, its script, and the margin of a language identifier (py3langid,
byte n-grams) over French; texts too short for this follow their neighbours.
"""

import functools
import re
import unicodedata
from collections.abc import Sequence
from typing import Any

from synth.language.subtitles.phrasebook import phrase_language
from synth.language.text.lexicon import lookup

FRENCH = "fr"
RIVALS = (
    "fr en es it pt de nl ca ro sv da no fi pl cs hr hu tr vi id br eu ar he fa hi ru uk bg el zh "
    "ja ko th"
).split()
"""Languages between which is chosen: those of European television and its neighbours."""

_MOSTLY_KNOWN = 0.75
"""Share of known French words that makes a caption French whatever else is seen."""

_HALF_KNOWN = 0.5
"""Share that keeps it French unless more speaks for another language."""

_MARGIN, _LARGE_MARGIN = 8.0, 20.0
"""Logarithm of how much likelier another language must be where few words are French, and where
most are. Of 400 French sentences and 300 of eight other languages these err in none and two."""

_REACH = 10
"""Subtitles on either side among which one without a clear language is judged."""

_TURN = re.compile(r"\s*[-–—]")
_SENTENCE = re.compile(r"\s*[-–—]?\s*[^\W\d_a-zà-ÿ].*[.!?…\"»]\s*$")
_WORD = re.compile(r"[^\W\d_]+(?:['’][^\W\d_]+)*")
_ELIDED = re.compile(r"^(?:c|d|j|l|m|n|s|t|qu|jusqu|lorsqu|puisqu)['’]", re.I)


def languages(texts: Sequence[str], declared: Sequence[str]) -> list[str]:
    """Return the language of each text of a file, ISO 639-1.

    Parameters
    ----------
    texts : sequence of str
        As they are spoken (`synth.language.subtitles.spoken`), in their order.
    declared : sequence of str
        The file's statement on each, such as ``fr``, ``en-GB`` or "" for nothing.

    Examples
    --------
    >>> languages(["Tu viens ?", "What are you doing?", "مرحبا"], ["", "", ""])
    ['fr', 'en', 'ar']
    >>> languages(["Who is he?", "No.", "I have no idea."], ["", "", ""])
    ['en', 'en', 'en']
    """
    found = [_evidence(text) for text in texts]
    return [
        language if sure else _by_neighbours(found, position, declared[position])
        for position, (language, sure) in enumerate(found)
    ]


def _evidence(text: str) -> tuple[str, bool]:
    """Return the language of a text, "" if nothing shows it, and whether that is sure."""
    letters = [letter for letter in text if letter.isalpha()]
    if sum(map(_is_latin, letters)) * 2 < len(letters):
        return _best(text)[0], True
    if phrase := phrase_language(text):
        return phrase, True
    words = _telling(text)
    known = sum(map(_is_known, words)) / max(1, len(words))
    if known >= _MOSTLY_KNOWN and len(words) > 3:
        return FRENCH, True
    if not words:
        return "", False
    if known == 1 and len(words) < 3:
        return FRENCH, False
    language, margin = _best(text)
    if margin >= (_LARGE_MARGIN if known > _HALF_KNOWN else _MARGIN):
        return language, True
    return (FRENCH, True) if margin <= 0 and known > _HALF_KNOWN else ("", False)


def is_surely_french(text: str) -> bool:
    """Whether the words of a text leave no doubt that it is French."""
    return _evidence(text) == (FRENCH, True)


def french_lines(text: str) -> list[str]:
    """Return the lines of a text in another language that are French beyond doubt."""
    return [line for line in text.split("\n") if is_surely_french(line)]


def native_lines(text: str) -> list[str]:
    """Return the lines of a French text without sentences in another language beyond doubt."""
    lines = text.split("\n")
    if len(lines) < 2:
        return lines
    kept = []
    for position, line in enumerate(lines):
        language, sure = _evidence(line)
        before = lines[position - 1].rstrip() if position else "."
        alone = _SENTENCE.match(line) and (before[-1:] in ".!?…" or _TURN.match(line))
        if sure and language != FRENCH and alone:
            continue
        kept.append(line)
    return kept


def _by_neighbours(found: Sequence[tuple[str, bool]], position: int, declared: str) -> str:
    """Return the language of a text that has no evidence of its own.

    One of few words, all French, is taken for another language only among several of that one.
    """
    near = [*found[max(0, position - _REACH) : position], *found[position + 1 :][:_REACH]]
    sure = [language for language, certain in near if certain]
    looks_french = found[position][0] == FRENCH
    if len(set(sure)) == 1 and (not looks_french or len(sure) > 1):
        return sure[0]
    if sure or (looks_french and not declared):
        return FRENCH
    return declared.partition("-")[0].lower()[:2] or FRENCH


def _telling(text: str) -> list[str]:
    """Return the words of a text without names: capitals inside a sentence, unknown openings."""
    words = []
    for match in _WORD.finditer(text):
        opens = not re.search(r"[\w,'’]", text[: match.start()].rstrip()[-1:])
        word = _ELIDED.sub("", match[0])
        if word[:1].isupper() and not word.isupper() and not (opens and _is_known(word)):
            continue
        words.append(word.lower())
    return words


def _is_known(word: str) -> bool:
    return len(word) < 2 or bool(lookup(word.lower()))


@functools.lru_cache(maxsize=4096)
def _is_latin(letter: str) -> bool:
    return unicodedata.name(letter, "").startswith("LATIN")


def _best(text: str) -> tuple[str, float]:
    """Return the likeliest language and by how much it is likelier than French."""
    ranked = _identifier().rank(text.lower() if text.isupper() else text)
    french = next(float(score) for language, score in ranked if language == FRENCH)
    best, score = next(
        ((name, float(score)) for name, score in ranked if name != FRENCH), (FRENCH, french)
    )
    return best, score - french


@functools.cache
def _identifier() -> Any:
    from py3langid.langid import MODEL_FILE, LanguageIdentifier

    identifier = LanguageIdentifier.from_model_file(MODEL_FILE)
    identifier.set_languages(RIVALS)
    return identifier
