"""Subtitles and the sound of their programme to a score: the cuer moves with the actor.

Subtitles that follow each other closely are aligned as one passage, so that speech may begin
before its subtitle appears and run on after it. Where the sound does not fit the text the
subtitle's own interval is used as without a recording.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.errors import CueError
from codec.score import Phone, Score
from synth.alignment.align import Passage, align
from synth.alignment.cepstra import FS, mono
from synth.score import Lexicon, Warn, log_warning, phones_of_subtitles
from synth.subtitles import Subtitle, spoken
from synth.text.pronounce import DEFAULT_STYLE, Style, phonemise
from synth.timing import GRID_HZ

Sound = Callable[[float, float], NDArray[np.float64]]
"""Gives the programme's sound from one time to another, mono at `synth.alignment.cepstra.FS`."""

LONGEST_PASSAGE_S = 20.0
"""Subtitles are aligned together up to this length."""

LONGEST_TEXT_S = 120.0
"""Limit of the sound that one subtitle, or a text without times, may span."""

PASSAGES_AT_ONCE = 12
"""Passages that share their models: some minutes, mostly of the same speakers."""

_CLOSE_S = 0.8
_MARGIN_S = 0.4


def sound_of(samples: ArrayLike, fs: int) -> Sound:
    """Return the `Sound` of samples in memory, shape (n,) or (n, channels).

    Examples
    --------
    >>> sound_of(np.zeros((48_000, 2)), 48_000)(0.25, 0.75).shape
    (8000,)
    """
    x = mono(samples, fs)
    return lambda start_s, end_s: x[max(0, round(start_s * FS)) : max(0, round(end_s * FS))]


def score_from_recording(
    subtitles: Iterable[Subtitle],
    sound: Sound,
    *,
    options: CueingOptions = DEFAULT_OPTIONS,
    style: Style = DEFAULT_STYLE,
    user_lexicon: Lexicon | None = None,
    warn: Warn = log_warning,
) -> Score:
    """Return the score of subtitles timed by the voices of their programme.

    Parameters
    ----------
    subtitles : iterable of Subtitle
        Sorted by start. For a text without times: one subtitle as long as the sound.
    sound : callable
        `sound_of` an array, or a function that reads the programme piece by piece.
    options : CueingOptions
    style : Style
    user_lexicon : mapping, optional
    warn : callable
        Called with one line for each passage that the sound does not fit.

    Raises
    ------
    CueError
        If one subtitle spans more than `LONGEST_TEXT_S`.
    """
    line: list[Phone] = []
    batch: list[list[Subtitle]] = []
    for passage in [*_passages(subtitles), None]:
        if passage is not None:
            batch.append(passage)
        if len(batch) == PASSAGES_AT_ONCE or passage is None:
            line += _aligned(batch, sound, style, user_lexicon, warn)
            batch = []
    phones = tuple(on_grid(line))
    return Score(phones, tuple(cue(phones, options)))


def _passages(subtitles: Iterable[Subtitle]) -> Iterator[list[Subtitle]]:
    """Yield runs of subtitles that follow each other closely."""
    run: list[Subtitle] = []
    for subtitle in subtitles:
        if subtitle.end_s - subtitle.start_s > LONGEST_TEXT_S:
            raise CueError(
                f"line {subtitle.line}: text spans {subtitle.end_s - subtitle.start_s:.0f} s, "
                f"more than the {LONGEST_TEXT_S:.0f} s that can be aligned"
            )
        if not spoken(subtitle.text):
            continue
        if run and (
            subtitle.start_s - run[-1].end_s > _CLOSE_S
            or subtitle.end_s - run[0].start_s > LONGEST_PASSAGE_S
        ):
            yield run
            run = []
        run.append(subtitle)
    if run:
        yield run


def _aligned(
    batch: Sequence[list[Subtitle]],
    sound: Sound,
    style: Style,
    user_lexicon: Lexicon | None,
    warn: Warn,
) -> list[Phone]:
    """Return the phones of some passages, each aligned or else fitted to its subtitles."""
    fitting: list[Passage] = []
    rest: list[Phone] = []
    for run in batch:
        text = " ".join(spoken(subtitle.text) for subtitle in run)
        words = tuple(phonemise(text, style=style, user_lexicon=user_lexicon))
        start_s = max(0.0, run[0].start_s - _MARGIN_S)
        passage = Passage(words, sound(start_s, run[-1].end_s + _MARGIN_S), start_s)
        if len(passage.samples) > passage.shortest_s * FS:
            fitting.append(passage)
            continue
        warn(f"subtitle at {run[0].start_s:.2f} s: too little sound to align, timed by itself")
        rest += phones_of_subtitles(run, style=style, user_lexicon=user_lexicon, warn=warn)
    found = [phone for phones in align(fitting) for phone in phones]
    return sorted([*found, *rest], key=lambda phone: phone.start)


def on_grid(phones: Iterable[Phone]) -> Iterator[Phone]:
    """Yield the phones with their bounds on the grid of `synth.timing`, none shorter than a step.

    Examples
    --------
    >>> list(on_grid([Phone("a", 0.101, 0.104), Phone("s", 0.104, 0.2)]))
    [Phone(symbol='a', start=0.1, end=0.12), Phone(symbol='s', start=0.12, end=0.2)]
    """
    free = 0
    for phone in phones:
        start = max(free, round(phone.start * GRID_HZ))
        free = max(start + 1, round(phone.end * GRID_HZ))
        yield Phone(phone.symbol, start / GRID_HZ, free / GRID_HZ)
