"""Transcripts without times: a sentence in French, or its phones.

Phones stand apart, in IPA or in the ASCII letters of French corpora (``z^`` for ʒ, ``a~`` for ɑ̃).
These write ``o`` for ɔ and ``o^`` for o; a line that has none of their own symbols is read as IPA.
"""

from codec.cues.cueing import cue
from codec.cues.phonology import PAUSE, PHONE_NUMBER
from codec.cues.score import Phone, Score
from codec.errors import CueError
from synth.planning.scoring.text_score import score_of_text

_ASCII = {
    "r": "ʁ", "z^": "ʒ", "s^": "ʃ", "gn": "ɲ", "ng": "ŋ", "h": "ɥ", "e^": "ɛ", "o^": "o", "o": "ɔ",
    "x": "ə", "x^": "œ", "x_": "ø", "i~": "ɛ̃", "e~": "ɛ̃", "a~": "ɑ̃", "o~": "ɔ̃", "x~": "œ̃",
}  # fmt: skip
_MARKS = {"q", "<start>", "<end>"}
_PAUSES = {PAUSE, "_", "#", "sil", "sp", *_MARKS}

_LENGTH_S, _PAUSE_S = 0.1, 1.0
"""Seconds of a phone and of a pause in a text without times; only their order counts."""


def read_transcript(text: str) -> Score:
    """Return phones and keys of a text; their times are made up and mean nothing.

    Parameters
    ----------
    text : str
        A text in French; or at least three phones, separated by spaces.

    Raises
    ------
    CueError
        If nothing in it is spoken.

    Examples
    --------
    >>> [str(key) for key in read_transcript("b o~ z^ u r").keys]
    ['24', '31', '13']
    >>> [key.placement for key in read_transcript("n u v o^").keys]
    ['chin', 'side']
    >>> [key.placement for key in read_transcript("n u v ɔ").keys]
    ['chin', 'chin']
    >>> [str(key) for key in read_transcript("Bonjour !").keys]
    ['24', '31', '13']
    """
    words = text.split()
    ascii_line = any(word in _MARKS or (word in _ASCII and word != "o") for word in words)
    symbols = [_ASCII.get(word, word) for word in words] if ascii_line else words
    known = all(
        symbol in PHONE_NUMBER or word in _PAUSES
        for word, symbol in zip(words, symbols, strict=True)
    )
    score = _of_phones(words, symbols) if known and len(words) > 2 else score_of_text(text)
    if not score.keys:
        raise CueError("the text has nothing that is spoken")
    return score


def _of_phones(words: list[str], symbols: list[str]) -> Score:
    phones, clock = [], 0.0
    for word, symbol in zip(words, symbols, strict=True):
        if word in _PAUSES or symbol == PAUSE:
            clock += _PAUSE_S
            continue
        phones.append(Phone(symbol, clock, clock + _LENGTH_S))
        clock += _LENGTH_S
    return Score(tuple(phones), tuple(cue(phones)))
