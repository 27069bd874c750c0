"""From text or subtitles to a score: phones with times, and the keys that cue them."""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.cues.score import Key, Phone, Score
from codec.errors import check_kind
from synth.language.subtitles import Subtitle, spoken
from synth.language.text.lexicon import Variant
from synth.language.text.pronounce import DEFAULT_STYLE, Style, phonemise
from synth.language.text.words import Word
from synth.planning.prosody.intonation import intoned
from synth.planning.prosody.pacing import LONGEST_LAG_S, Pace, PacedWord, TimedWord, pace_words
from synth.planning.prosody.simulation import CLAIRE, PerformerChoice
from synth.planning.prosody.timing import FASTEST, CaptionFit, fit, on_grid, speak

Warn = Callable[[str], None]

OnWord = Callable[[PacedWord], None]


def ignore_word(word: PacedWord) -> None:
    """Ignore what became of a word."""


log_warning: Warn = logging.getLogger(__name__).warning
"""Where warnings go when the caller says nothing else."""


@dataclass(frozen=True, slots=True)
class Reading:
    """How French text is read and cued.

    Attributes
    ----------
    options : CueingOptions
        Where charts of the code differ.
    style : Style
        How the text is spoken where French leaves a choice.
    lexicon : mapping of str to tuple of Variant
        The user's words, from `synth.language.text.lexicon.read_user_lexicon`.
    pace : Pace, optional
        The cuer's own clock; without one she keeps in step with the speaker.
    performing : PerformerChoice
        Who is to cue at that pace.

    Examples
    --------
    >>> from synth import score_of_text
    >>> [phone.symbol for phone in score_of_text("les amis", reading=Reading()).phones]
    ['l', 'e', 'z', 'a', 'm', 'i']
    """

    options: CueingOptions = DEFAULT_OPTIONS
    style: Style = DEFAULT_STYLE
    lexicon: Mapping[str, tuple[Variant, ...]] = field(default_factory=dict)
    pace: Pace | None = None
    performing: PerformerChoice = CLAIRE

    def words(self, text: str) -> tuple[Word, ...]:
        """Return the words of a text with their phones."""
        return tuple(phonemise(text, style=self.style, user_lexicon=self.lexicon))

    def score(self, phones: Iterable[Phone]) -> Score:
        """Return phones with the keys that cue them."""
        line = tuple(phones)
        return Score(line, tuple(cue(line, self.options)))

    def cued(self, words: Iterable[TimedWord], on_word: OnWord = ignore_word) -> Iterator[Phone]:
        """Yield the phones of words on the cuer's clock, and report each word's fate."""
        if self.pace is not None:
            paced = pace_words(words, self.pace, self.options, self.performing)
        else:
            paced = (PacedWord(word, word.phones) for word in words)

        def heard() -> Iterator[PacedWord]:
            for word in paced:
                on_word(word)
                yield word

        return intoned(heard())


PLAIN = Reading()
"""Every choice as by default, in step with the speaker."""


def score_of_text(
    text: str, *, start_s: float = 0.0, reading: Reading = PLAIN, on_word: OnWord = ignore_word
) -> Score:
    """Return the score of a text spoken at its natural rate, or at that of the reading's pace.

    Parameters
    ----------
    text : str
        Written French.
    start_s : float
        When the first phone starts, rounded to the grid of `synth.planning.prosody.timing`.
    reading : Reading
        There is no programme whose clock she had to keep to: nothing is left out.
    on_word : callable
        Receives the fate of each word.

    Returns
    -------
    Score

    Examples
    --------
    >>> [(key.shape, key.placement) for key in score_of_text("Bonjour").keys]
    [(4, 'mouth'), (1, 'chin'), (3, 'side')]
    """
    check_kind(text, str, "score_of_text")
    words = reading.words(text)
    if reading.pace is not None:
        reading = replace(reading, pace=replace(reading.pace, max_lag_s=LONGEST_LAG_S))
    spoken_words = timed_words(words, speak(words, on_grid(start_s)).phones)
    return reading.score(reading.cued(spoken_words, on_word))


def keys_of(text: str, *, start_s: float = 0.0, reading: Reading = PLAIN) -> tuple[Key, ...]:
    """Return the keys that cue a text, with their times.

    Parameters
    ----------
    text : str
        Written French.
    start_s : float
        When the first phone starts, seconds.
    reading : Reading

    Returns
    -------
    tuple of Key

    Raises
    ------
    CueError
        If the text holds what cannot be read.

    Examples
    --------
    >>> [(key.shape, key.placement) for key in keys_of("Oui")]
    [(6, 'mouth')]
    """
    return score_of_text(text, start_s=start_s, reading=reading).keys


def score_of_subtitles(
    subtitles: Iterable[Subtitle],
    *,
    reading: Reading = PLAIN,
    warn: Warn = log_warning,
    on_word: OnWord = ignore_word,
) -> Score:
    """Return the score of a programme's subtitles, each spoken in its interval.

    Parameters
    ----------
    subtitles : iterable of Subtitle
        Sorted by start, as `synth.language.subtitles.read_subtitles` returns them.
    reading : Reading
    warn : callable
        Called with one line for each subtitle whose text had to be hurried or cut.
    on_word : callable
        Receives the fate of each word.

    Returns
    -------
    Score

    Examples
    --------
    >>> score = score_of_subtitles([Subtitle(1.0, 2.0, "Bonjour !")])
    >>> score.phones[0].start, len(score.keys)
    (1.0, 3)
    """
    words = words_of_subtitles(subtitles, reading=reading, warn=warn)
    return reading.score(reading.cued(words, on_word))


def stream_score(
    subtitles: Iterable[Subtitle],
    *,
    reading: Reading = PLAIN,
    warn: Warn = log_warning,
    on_word: OnWord = ignore_word,
) -> Iterator[Score]:
    """Yield the score of `score_of_subtitles` in pieces between pauses, in constant memory.

    Examples
    --------
    >>> lines = [Subtitle(0.0, 1.0, "Oui."), Subtitle(2.0, 3.0, "Non.")]
    >>> [len(piece.keys) for piece in stream_score(lines)]
    [1, 1]
    """
    words = words_of_subtitles(subtitles, reading=reading, warn=warn)
    return in_pieces(reading.cued(words, on_word), reading)


def in_pieces(phones: Iterable[Phone], reading: Reading) -> Iterator[Score]:
    """Yield the score of a line of phones in pieces, cut wherever nothing is said."""
    piece: list[Phone] = []
    for phone in phones:
        if piece and phone.start > piece[-1].end:
            yield reading.score(piece)
            piece = []
        piece.append(phone)
    if piece:
        yield reading.score(piece)


def words_of_subtitles(
    subtitles: Iterable[Subtitle], *, reading: Reading = PLAIN, warn: Warn = log_warning
) -> Iterator[TimedWord]:
    """Yield the words of subtitles that are sorted by start, none before its predecessor's end.

    Subtitles that start together are spoken in turn in the interval that they share. One that
    overlaps its predecessor cuts short the room of that one, which may run on until its own end.
    """
    free_s = 0.0
    for subtitle, next_start_s in _turns(subtitles):
        words = reading.words(subtitle.text)
        if not words:
            continue
        start_s = on_grid(max(subtitle.start_s, free_s))
        end_s = max(min(subtitle.end_s, next_start_s), start_s + 1 / FASTEST)
        borrowed_s = min(next_start_s, subtitle.end_s + LONGEST_BORROWED_S)
        limit_s = max(subtitle.end_s, borrowed_s)
        found = fit(words, start_s, end_s, limit_s, whole=reading.pace is not None)
        if reading.pace is None:
            _report(subtitle, found, warn)
        yield from timed_words(words, found.phones, subtitle)
        if found.phones:
            free_s = found.phones[-1].end


def timed_words(
    words: Sequence[Word], phones: Sequence[Phone], subtitle: Subtitle | None = None
) -> Iterator[TimedWord]:
    """Yield words with their phones, the last ones without any if there are too few."""
    at = 0
    for word in words:
        yield TimedWord(word, tuple(phones[at : at + len(word.phones)]), subtitle)
        at += len(word.phones)


def _turns(subtitles: Iterable[Subtitle]) -> Iterator[tuple[Subtitle, float]]:
    """Yield subtitles, those that start together merged, each with the next one's start."""
    waiting: Subtitle | None = None
    for shown in subtitles:
        subtitle = replace(shown, text=spoken(shown.text))
        if not subtitle.text:
            continue
        if waiting is not None and subtitle.start_s == waiting.start_s:
            waiting = replace(
                waiting,
                text=f"{waiting.text}. {subtitle.text}",
                end_s=max(waiting.end_s, subtitle.end_s),
            )
            continue
        if waiting is not None:
            yield waiting, subtitle.start_s
        waiting = subtitle
    if waiting is not None:
        yield waiting, float("inf")


LONGEST_BORROWED_S = 2.0
"""How far speech may run on after its subtitle: later it would meet other sounds and lips."""


def _report(subtitle: Subtitle, found: CaptionFit, warn: Warn) -> None:
    where = f"subtitle at {subtitle.start_s:.2f} s (line {subtitle.line})"
    if found.left_out:
        warn(f"{where}: no room for its last {found.left_out} words")
    if found.rate > FASTEST + 0.05:
        warn(f"{where}: spoken at {found.rate:.1f} phones/s, more than {FASTEST}")
