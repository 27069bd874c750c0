"""From text or subtitles to a score: phones with times, and the keys that cue them."""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

from codec.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.score import Phone, Score
from synth.subtitles import Subtitle, spoken
from synth.text.lexicon import Variant
from synth.text.pronounce import DEFAULT_STYLE, Style, phonemise
from synth.timing import FASTEST, Fit, fit, on_grid, speak

Lexicon = Mapping[str, tuple[Variant, ...]]
Warn = Callable[[str], None]

log_warning: Warn = logging.getLogger(__name__).warning
"""Where warnings go when the caller says nothing else."""


def score_from_text(
    text: str,
    *,
    start_s: float = 0.0,
    options: CueingOptions = DEFAULT_OPTIONS,
    style: Style = DEFAULT_STYLE,
    user_lexicon: Lexicon | None = None,
) -> Score:
    """Return the score of a text spoken at its natural rate.

    Parameters
    ----------
    text : str
        Written French.
    start_s : float
        When the first phone starts, rounded to the grid of `synth.timing`.
    options : CueingOptions
    style : Style
        How the text is spoken where French leaves a choice.
    user_lexicon : mapping, optional
        From `synth.text.lexicon.read_user_lexicon`.

    Examples
    --------
    >>> [(key.shape, key.placement) for key in score_from_text("Bonjour").keys]
    [(4, 'mouth'), (1, 'chin'), (3, 'side')]
    """
    words = phonemise(text, style=style, user_lexicon=user_lexicon)
    phones = speak(words, on_grid(start_s)).phones
    return Score(phones, tuple(cue(phones, options)))


def score_from_subtitles(
    subtitles: Iterable[Subtitle],
    *,
    options: CueingOptions = DEFAULT_OPTIONS,
    style: Style = DEFAULT_STYLE,
    user_lexicon: Lexicon | None = None,
    warn: Warn = log_warning,
) -> Score:
    """Return the score of a programme's subtitles, each spoken in its interval.

    Parameters
    ----------
    subtitles : iterable of Subtitle
        Sorted by start, as `synth.subtitles.read_subtitles` returns them.
    options : CueingOptions
    style : Style
    user_lexicon : mapping, optional
    warn : callable
        Called with one line for each subtitle whose text had to be hurried or cut.

    Examples
    --------
    >>> score = score_from_subtitles([Subtitle(1.0, 2.0, "Bonjour !")])
    >>> score.phones[0].start, len(score.keys)
    (1.0, 3)
    """
    spoken_phones = phones_of_subtitles(
        subtitles, style=style, user_lexicon=user_lexicon, warn=warn
    )
    phones = tuple(spoken_phones)
    return Score(phones, tuple(cue(phones, options)))


def stream_score(
    subtitles: Iterable[Subtitle],
    *,
    options: CueingOptions = DEFAULT_OPTIONS,
    style: Style = DEFAULT_STYLE,
    user_lexicon: Lexicon | None = None,
    warn: Warn = log_warning,
) -> Iterator[Score]:
    """Yield the score of `score_from_subtitles` in pieces between pauses, in constant memory.

    Examples
    --------
    >>> lines = [Subtitle(0.0, 1.0, "Oui."), Subtitle(2.0, 3.0, "Non.")]
    >>> [len(piece.keys) for piece in stream_score(lines)]
    [1, 1]
    """
    phones = phones_of_subtitles(subtitles, style=style, user_lexicon=user_lexicon, warn=warn)
    return in_pieces(phones, options)


def in_pieces(phones: Iterable[Phone], options: CueingOptions) -> Iterator[Score]:
    """Yield the score of a line of phones in pieces, cut wherever nothing is said."""
    piece: list[Phone] = []
    for phone in phones:
        if piece and phone.start > piece[-1].end:
            yield Score(tuple(piece), tuple(cue(piece, options)))
            piece = []
        piece.append(phone)
    if piece:
        yield Score(tuple(piece), tuple(cue(piece, options)))


def phones_of_subtitles(
    subtitles: Iterable[Subtitle],
    *,
    style: Style = DEFAULT_STYLE,
    user_lexicon: Lexicon | None = None,
    warn: Warn = log_warning,
) -> Iterator[Phone]:
    """Yield the phones of subtitles that are sorted by start, none before its predecessor's end.

    Subtitles that start together are spoken in turn in the interval that they share. One that
    overlaps its predecessor cuts short the room of that one, which may run on until its own end.
    """
    free_s = 0.0
    for subtitle, next_start_s in _turns(subtitles):
        words = phonemise(subtitle.text, style=style, user_lexicon=user_lexicon)
        if not words:
            continue
        start_s = on_grid(max(subtitle.start_s, free_s))
        end_s = max(min(subtitle.end_s, next_start_s), start_s + 1 / FASTEST)
        borrowed_s = min(next_start_s, subtitle.end_s + LONGEST_BORROWED_S)
        found = fit(words, start_s, end_s, max(subtitle.end_s, borrowed_s))
        _report(subtitle, found, warn)
        yield from found.phones
        if found.phones:
            free_s = found.phones[-1].end


def _turns(subtitles: Iterable[Subtitle]) -> Iterator[tuple[Subtitle, float]]:
    """Yield what is said, those that start together joined, each with the next one's start."""
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


def _report(subtitle: Subtitle, found: Fit, warn: Warn) -> None:
    where = f"subtitle at {subtitle.start_s:.2f} s (line {subtitle.line})"
    if found.left_out:
        warn(f"{where}: no room for its last {found.left_out} words")
    if found.rate > FASTEST + 0.05:
        warn(f"{where}: spoken at {found.rate:.1f} phones/s, more than {FASTEST}")
