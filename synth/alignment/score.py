"""Subtitles and the sound of their programme to a score: the cuer moves with the actor.

Where the sound does not belong to the text, where it is too short for it, and where a passage
fits no better than any other words would, the subtitles' own intervals are used as without a
recording. Subtitles that are all early or late are moved as the sound asks.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cues.score import Phone, Score
from synth.alignment.align import Aligned, Passage, align
from synth.alignment.cepstra import FS, mono
from synth.alignment.runs import Run, runs_of, said_in
from synth.alignment.trust import FEWEST_WORDS, LEAST_EVIDENCE, Trust, trust
from synth.prosody.pacing import TimedWord
from synth.prosody.timing import GRID_HZ
from synth.scoring.text_score import (
    PLAIN,
    Reading,
    Told,
    Warn,
    log_warning,
    tell_nobody,
    timed_words,
    words_of_subtitles,
)
from synth.subtitles import Subtitle
from synth.text.words import Word

Sound = Callable[[float, float], NDArray[np.float64]]
"""Gives the programme's sound from one time to another, mono at `synth.alignment.cepstra.FS`."""

PASSAGES_AT_ONCE = 12
"""Passages that share their models: some minutes, mostly of the same speakers."""

LARGEST_OFFSET_S = 4.5
"""Subtitles may be early or late by this much."""

_OFFSET_STEP_S = 1.5
_OFFSET_SOUND_S = 30.0
"""So much of the programme's beginning shows whether its subtitles are early or late."""

_BETTER = 0.05
_LEAST_OFFSET_S = 0.5
_LEAST_CONFIDENCE = 0.25


@dataclass(frozen=True, slots=True)
class Judgement:
    """How sure the times of one subtitle are.

    Attributes
    ----------
    subtitle : Subtitle
    confidence : float
        From 0, no better than any other words in its place, to 1, as good as its neighbours.
    offset_s : float
        How much later than the subtitles say the voices were looked for.
    """

    subtitle: Subtitle
    confidence: float
    offset_s: float


Judged = Callable[[Judgement], None]


def sound_of(samples: ArrayLike, fs: int) -> Sound:
    """Return the `Sound` of samples in memory.

    Parameters
    ----------
    samples : array_like, shape (n,) or (n, channels)
        Of full scale 1.
    fs : int
        Their rate in Hz.

    Returns
    -------
    callable
        Gives the samples between two times in seconds, one channel at the aligner's rate.

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
    reading: Reading = PLAIN,
    warn: Warn = log_warning,
    judged: Judged = lambda judgement: None,
    told: Told = tell_nobody,
) -> Score:
    """Return the score of subtitles timed by the voices of their programme.

    Parameters
    ----------
    subtitles : iterable of Subtitle
        Sorted by start. For a text without times: one subtitle as long as the sound.
    sound : callable
        `sound_of` an array, or a function that reads the programme piece by piece.
    reading : Reading
    warn : callable
        Called with one line for each passage that the sound does not fit.
    judged : callable
        Told how sure the times of each subtitle are.
    told : callable
        Told what became of each word.

    Returns
    -------
    Score

    Raises
    ------
    CueError
        If one subtitle spans more than `synth.alignment.runs.LONGEST_TEXT_S`.
    """
    return reading.score(
        phones_of_recording(subtitles, sound, reading=reading, warn=warn, judged=judged, told=told)
    )


def phones_of_recording(
    subtitles: Iterable[Subtitle],
    sound: Sound,
    *,
    reading: Reading = PLAIN,
    warn: Warn = log_warning,
    judged: Judged = lambda judgement: None,
    told: Told = tell_nobody,
) -> Iterator[Phone]:
    """Yield the phones of `score_from_recording`, some passages at a time."""

    def batches() -> Iterator[list[TimedWord]]:
        runs = runs_of(said_in(subtitles))
        offset_s: float | None = None
        while batch := list(islice(runs, PASSAGES_AT_ONCE)):
            around_s = LARGEST_OFFSET_S + 1.0 if offset_s is None else 0.0
            heard = [_Heard.of(run, sound, reading, around_s, offset_s or 0.0) for run in batch]
            moved_s = _offset(_beginning(heard)) if offset_s is None else offset_s
            timed = _Timed.of(heard, moved_s)
            if timed.verdict.holds and offset_s is None:
                offset_s = moved_s
                if offset_s:
                    side = "after" if offset_s > 0 else "before"
                    warn(f"the voices come {abs(offset_s):.1f} s {side} their subtitles: moved")
            yield timed.words(reading, warn, judged)

    return on_grid(reading.cued(chain.from_iterable(batches()), told))


@dataclass(frozen=True, slots=True)
class _Heard:
    """A run, its words, how many each subtitle has, and the sound around it."""

    run: Run
    words: tuple[Word, ...]
    counts: tuple[int, ...]
    samples: NDArray[np.float64]
    start_s: float

    @classmethod
    def of(
        cls, run: Run, sound: Sound, reading: Reading, around_s: float, offset_s: float
    ) -> "_Heard":
        words = reading.words(" ".join(subtitle.text for subtitle in run.subtitles))
        counts = tuple(len(reading.words(subtitle.text)) for subtitle in run.subtitles)
        start_s = max(0.0, run.start_s + offset_s - around_s)
        end_s = run.end_s + offset_s + around_s
        return cls(run, words, counts, sound(start_s, max(end_s, start_s)), start_s)

    def passage(self, offset_s: float) -> Passage:
        """Return the words and the sound where they are expected."""
        start_s = max(self.run.start_s + offset_s, self.start_s)
        first = round((start_s - self.start_s) * FS)
        last = max(first, round((self.run.end_s + offset_s - self.start_s) * FS))
        return Passage(self.words, self.samples[first:last], start_s)

    def timed(self, phones: Sequence[Phone]) -> Iterator[TimedWord]:
        """Yield the words with phones that were found, and the subtitle of each."""
        last = np.cumsum(self.counts)
        for number, word in enumerate(timed_words(self.words, phones)):
            owner = min(int(np.searchsorted(last, number, side="right")), len(last) - 1)
            yield replace(word, subtitle=self.run.subtitles[owner])

    def by_subtitle(self, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Split values of the words among the subtitles."""
        return np.split(values, np.cumsum(self.counts)[:-1])


def _beginning(heard: Sequence[_Heard]) -> Sequence[_Heard]:
    lengths = np.cumsum([item.run.end_s - item.run.start_s for item in heard])
    return heard[: int(np.searchsorted(lengths, _OFFSET_SOUND_S)) + 1]


def _offset(heard: Sequence[_Heard]) -> float:
    """Return how much later than their subtitles the voices are, from some runs."""
    if sum(len(item.words) for item in heard) < 2 * FEWEST_WORDS:
        return 0.0
    here = _look(heard, 0.0)
    found = {
        0.0: _fit(here),
        **{d: _fit(_look(heard, d)) for d in (-_OFFSET_STEP_S, _OFFSET_STEP_S)},
    }
    if max(found, key=found.__getitem__) == 0.0 and trust(*here).holds:
        return 0.0
    steps = np.arange(-LARGEST_OFFSET_S, LARGEST_OFFSET_S + 0.1, _OFFSET_STEP_S).tolist()
    found |= {step: _fit(_look(heard, step)) for step in steps if step not in found}
    best = max(found, key=found.__getitem__)
    if found[best] < found[0.0] + _BETTER * abs(found[0.0]):
        return 0.0
    offset = best + _lag(heard, best)
    return offset if abs(offset) >= _LEAST_OFFSET_S else 0.0


def _look(heard: Sequence[_Heard], offset_s: float) -> tuple[list[Passage], list[Aligned]]:
    """Return the passages that have room where they are expected, and what is found in them."""
    passages = [passage for item in heard if (passage := item.passage(offset_s)).long_enough]
    return passages, align(passages)


def _fit(looked: tuple[list[Passage], list[Aligned]]) -> float:
    """Return how well the words fit, in the mean."""
    fits = np.concatenate([np.zeros(0), *(item.fits for item in looked[1])])
    return float(fits.mean()) if len(fits) else -np.inf


def _lag(heard: Sequence[_Heard], offset_s: float) -> float:
    """Return by how much subtitles are still early, in the median over their first words."""
    kept = [item for item in heard if item.passage(offset_s).long_enough]
    lags = []
    for item, found in zip(kept, align([item.passage(offset_s) for item in kept]), strict=True):
        starts = np.cumsum([0, *(len(word.phones) for word in item.words)])
        for subtitle, first in zip(item.run.subtitles, np.cumsum([0, *item.counts]), strict=False):
            if first < len(item.words):
                lags.append(found.phones[starts[first]].start - subtitle.start_s - offset_s)
    return float(np.median(lags))


@dataclass(frozen=True, slots=True)
class _Timed:
    """Some runs, aligned where they are long enough, and what that is worth."""

    heard: Sequence[_Heard]
    found: Sequence[Aligned | None]
    verdict: Trust
    offset_s: float

    @classmethod
    def of(cls, heard: Sequence[_Heard], offset_s: float) -> "_Timed":
        passages = [item.passage(offset_s) for item in heard]
        fitting = [passage for passage in passages if passage.long_enough]
        aligned = align(fitting)
        rest = iter(aligned)
        found = [next(rest) if passage.long_enough else None for passage in passages]
        return cls(heard, found, trust(fitting, aligned), offset_s)

    def words(self, reading: Reading, warn: Warn, judged: Judged) -> list[TimedWord]:
        """Return the words, those of runs that do not fit by their subtitles."""
        if not self.verdict.holds:
            first, last = self.heard[0].run.subtitles[0], self.heard[-1].run.subtitles[-1]
            warn(
                f"subtitles from {first.start_s:.2f} to {last.end_s:.2f} s: their text is not what "
                f"is said (evidence {self.verdict.evidence:.1f} of {LEAST_EVIDENCE:.0f}), timed by "
                "themselves"
            )
        line: list[TimedWord] = []
        for item, found in zip(self.heard, self.found, strict=True):
            sure = [0.0] * len(item.counts)
            if found is not None:
                sure = [self.verdict.confidence(fits) for fits in item.by_subtitle(found.fits)]
            for subtitle, confidence in zip(item.run.subtitles, sure, strict=True):
                judged(Judgement(subtitle, confidence, self.offset_s))
            if found is not None and self.verdict.confidence(found.fits) >= _LEAST_CONFIDENCE:
                line += item.timed(found.phones)
                continue
            if self.verdict.holds:
                what = "too little sound to align" if found is None else "not what is said"
                warn(f"subtitle at {item.run.start_s:.2f} s: {what}, timed by itself")
            subtitles = item.run.subtitles
            line += words_of_subtitles(subtitles, reading=reading, warn=warn)
        return line


def on_grid(phones: Iterable[Phone]) -> Iterator[Phone]:
    """Yield the phones with their bounds on the grid, none shorter than a step.

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
