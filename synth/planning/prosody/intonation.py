"""The melody that the sentences of a text ask for, set in the phones that end them.

In: words on the cuer's clock with their punctuation.  Out: their phones; the last one of
each group that the text marks knows how the voice moves there (`codec.cues.score.CONTOURS`). French
has a question that rises at its end, and an interrogation whose asking word stands first: that one
falls from a high start, as commands and exclamations do (P. Delattre 1966, "Les dix intonations de
base du français", French Review 40; A. Di Cristo 1998, "Intonation in French", section 3). Where
the asking word stays in its place (« tu vas où ? ») the voice rises as in a question.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from codec.cues.score import SENTENCE_ENDS, Phone
from synth.language.text.normalise import ASKED, EXCLAIMED, LONG_PAUSE, SHORT_PAUSE
from synth.language.text.words import Word
from synth.planning.prosody.pacing import PacedWord

_ASKING = frozenset(
    "qui que qu' quoi où quand comment pourquoi combien quel quelle quels quelles lequel laquelle "
    "lesquels lesquelles auquel auxquels auxquelles duquel desquels desquelles qu'est-ce".split()
)
_ECHOES = frozenset("quoi comment".split())
"""Alone they ask to say again."""

_BEFORE = frozenset(
    "et mais alors donc or bon ben bah eh ah oh euh enfin puis non oui ou sinon au du à de d' pour "
    "avec chez par sur dans en depuis jusqu' jusqu'à jusque vers contre sans sous entre après "
    "avant pendant dès".split()
)
"""What may stand before the asking word: conjunctions, cries, prepositions."""

_TAGS = frozenset(("non", "hein", "oui", "si", "ok", "quoi", "d' accord", "pas vrai", "ou quoi"))
"""Behind a comma they ask whatever stands before them."""

_SUBJECTS = frozenset("je j' tu il elle on nous vous ils elles ce c' ça".split())
_LONGEST_WORDS = 80
"""Words of a sentence that are remembered: its asking word stands near its start."""

_NEW_SENTENCE_S = 0.4
"""Silence after which a subtitle that begins with a capital begins a sentence."""


def intoned(words: Iterable[PacedWord]) -> Iterator[Phone]:
    """Yield the phones of words; those that end a group know its contour.

    Parameters
    ----------
    words : iterable of PacedWord
        In order of time. A sentence may go on from one subtitle to the next; one whose last words
        are left out ends with the last that is not.

    Examples
    --------
    >>> from synth.planning.prosody.pacing import TimedWord
    >>> word = Word("oui", ("w", "i"), "?")
    >>> said = (Phone("w", 0.0, 0.1), Phone("i", 0.1, 0.3))
    >>> [phone.contour for phone in intoned([PacedWord(TimedWord(word, said), said)])]
    ['', 'question']
    """
    last: Phone | None = None
    before: PacedWord | None = None
    sentence: list[Word] = []
    for word in words:
        # A phone is held back until it is known whether its word ends a group.
        if before is not None and last is not None and not last.contour:
            gap_s = word.phones[0].start - last.end if word.phones else 0.0
            if _goes_on(before, word):
                last = replace(last, contour="continuation")
            elif _other_subtitle(before, word) and gap_s >= _NEW_SENTENCE_S:
                sentence = []
        sentence = [*sentence, word.source.word][:_LONGEST_WORDS]
        if word.phones:
            if last is not None:
                yield last
            yield from word.phones[:-1]
            last = word.phones[-1]
        contour = _contour(word.source.word.pause, sentence)
        if last is not None and contour:
            last = replace(last, contour=contour)
        if contour in SENTENCE_ENDS:
            sentence = []
        before = word
    if last is not None:
        yield last


def _contour(pause: str, sentence: Sequence[Word]) -> str:
    """Return the contour of what ends with a pause."""
    if pause == ASKED:
        return "interrogation" if asks_with_a_word(sentence) else "question"
    return {SHORT_PAUSE: "continuation", LONG_PAUSE: "statement", EXCLAIMED: "exclamation"}.get(
        pause, ""
    )


def _other_subtitle(before: PacedWord, after: PacedWord) -> bool:
    return before.source.subtitle is not after.source.subtitle


def _goes_on(before: PacedWord, after: PacedWord) -> bool:
    """Tell whether a sentence without a mark at its subtitle's end goes on in the next one."""
    shown = after.source.subtitle
    if shown is None or not _other_subtitle(before, after):
        return False
    first = next((sign for sign in shown.text if sign.isalpha()), "")
    return first.islower()


def asks_with_a_word(sentence: Sequence[Word]) -> bool:
    """Tell whether a sentence that asks does so by a word at the start of one of its parts.

    Parameters
    ----------
    sentence : sequence of Word
        In order; commas stand in their pauses.

    Examples
    --------
    >>> from synth.language.text.pronounce import phonemise
    >>> [asks_with_a_word(phonemise(t)) for t in ("Et à quelle heure pars-tu ?", "Tu pars quand ?")]
    [True, False]
    >>> [asks_with_a_word(phonemise(t)) for t in ("Qui vient ?", "Qui vient, hein ?", "Quoi ?")]
    [True, False, False]
    """
    parts: list[list[Word]] = [[]]
    for word in sentence:
        parts[-1].append(word)
        if word.pause == SHORT_PAUSE:
            parts.append([])
    parts = [part for part in parts if part]
    if len(parts) > 1 and " ".join(word.text for word in parts[-1]) in _TAGS:
        return False
    return any(_asks(part, later=part is not parts[-1]) for part in parts)


def _asks(part: Sequence[Word], *, later: bool) -> bool:
    """Tell whether a part begins with an asking word; `later` if another one follows it."""
    at = next((i for i, word in enumerate(part) if word.text not in _BEFORE), len(part))
    texts = [word.text for word in part[at:]]
    if not texts or texts[0] not in _ASKING:
        return False
    following = texts[1] if len(texts) > 1 else ""
    match texts[0]:
        case "quand":
            return following != "même" and not (later and following in _SUBJECTS)
        case "que" | "qu'":
            return bool(following) and following not in _SUBJECTS
        case "qui" | "où" | "quoi" if following in ("que", "qu'"):
            return False
    return len(part) > 1 or texts[0] not in _ECHOES
