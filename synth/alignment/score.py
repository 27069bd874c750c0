"""Subtitles and the sound of their programme to a score: the cuer moves with the actor.

Subtitles that follow each other closely are aligned as one passage, so that speech may begin
before its subtitle appears and run on after it. Where the sound does not fit the text the
subtitle's own interval is used as without a recording.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise

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

LONGEST_PASSAGE_S = 25.0
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
    phones = tuple(
        phones_of_recording(subtitles, sound, style=style, user_lexicon=user_lexicon, warn=warn)
    )
    return Score(phones, tuple(cue(phones, options)))


def phones_of_recording(
    subtitles: Iterable[Subtitle],
    sound: Sound,
    *,
    style: Style = DEFAULT_STYLE,
    user_lexicon: Lexicon | None = None,
    warn: Warn = log_warning,
) -> Iterator[Phone]:
    """Yield the phones of `score_from_recording`, some passages at a time."""

    def batches() -> Iterator[list[Phone]]:
        batch: list[_Run] = []
        for run in _runs(_said(subtitles)):
            batch.append(run)
            if len(batch) == PASSAGES_AT_ONCE:
                yield _aligned(batch, sound, style, user_lexicon, warn)
                batch = []
        yield _aligned(batch, sound, style, user_lexicon, warn)

    return on_grid(chain.from_iterable(batches()))


@dataclass(frozen=True, slots=True)
class _Run:
    """Subtitles that are aligned together, and the stretch of sound in which to look."""

    subtitles: tuple[Subtitle, ...]
    start_s: float
    end_s: float


def _said(subtitles: Iterable[Subtitle]) -> list[Subtitle]:
    """Return the subtitles in which something is said, as it is said."""
    said = [replace(s, text=text) for s in subtitles if (text := spoken(s.text))]
    for subtitle in said:
        if subtitle.end_s - subtitle.start_s > LONGEST_TEXT_S:
            raise CueError(
                f"line {subtitle.line}: text spans {subtitle.end_s - subtitle.start_s:.0f} s, "
                f"more than the {LONGEST_TEXT_S:.0f} s that can be aligned"
            )
    return said


def _runs(said: Sequence[Subtitle]) -> Iterator[_Run]:
    """Yield runs of subtitles, cut at their widest gaps until none is longer than the limit."""
    if not said:
        return
    cuts = [0, *_cuts(said), len(said)]
    for first, end in pairwise(cuts):
        before = said[first].start_s - said[first - 1].end_s if first else 2 * _MARGIN_S
        after = said[end].start_s - said[end - 1].end_s if end < len(said) else 2 * _MARGIN_S
        yield _Run(
            tuple(said[first:end]),
            max(0.0, said[first].start_s - _margin(before)),
            said[end - 1].end_s + _margin(after),
        )


def _margin(gap_s: float) -> float:
    """Return how far a run may look into the gap beside it: neighbours must not overlap."""
    return min(_MARGIN_S, max(0.0, gap_s / 2))


def _cuts(said: Sequence[Subtitle]) -> list[int]:
    """Return the indices of the subtitles that open a run, the first excepted."""
    cuts = []
    waiting = [(0, len(said))]
    while waiting:
        first, end = waiting.pop()
        if end - first < 2:
            continue
        gaps = [(said[i].start_s - said[i - 1].end_s, i) for i in range(first + 1, end)]
        middle = (first + end) / 2
        gap, cut = max(gaps, key=lambda g: (g[0], -abs(g[1] - middle)))
        if gap > _CLOSE_S or said[end - 1].end_s - said[first].start_s > LONGEST_PASSAGE_S:
            cuts.append(cut)
            waiting += [(first, cut), (cut, end)]
    return sorted(cuts)


def _aligned(
    batch: Sequence[_Run],
    sound: Sound,
    style: Style,
    user_lexicon: Lexicon | None,
    warn: Warn,
) -> list[Phone]:
    """Return the phones of some runs, each aligned or else fitted to its subtitles."""
    passages = []
    for run in batch:
        text = " ".join(subtitle.text for subtitle in run.subtitles)
        words = tuple(phonemise(text, style=style, user_lexicon=user_lexicon))
        passages.append(Passage(words, sound(run.start_s, run.end_s), run.start_s))
    fitting = [len(passage.samples) > passage.shortest_s * FS for passage in passages]
    found = iter(align([p for p, fits in zip(passages, fitting, strict=True) if fits]))
    line: list[Phone] = []
    for run, fits in zip(batch, fitting, strict=True):
        if fits:
            line += next(found)
            continue
        warn(f"subtitle at {run.start_s:.2f} s: too little sound to align, timed by itself")
        line += phones_of_subtitles(
            run.subtitles, style=style, user_lexicon=user_lexicon, warn=warn
        )
    return line


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
