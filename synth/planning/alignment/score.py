"""Subtitles and the sound of their programme to a score: the cuer moves with the actor.

Where the sound does not belong to the text, where it is too short for it, and where a passage
fits no better than any other words would, the subtitles' own intervals are used as without a
recording. Subtitles that are all early or late are moved as the sound asks. A text without times
has none to fall back to: it is cut by a sound that it may fit, at a confidence of 0.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cues.score import Phone, Score
from synth.language.subtitles import Subtitle
from synth.language.text.words import Word
from synth.planning.alignment.align import Aligned, SpokenPassage, align_passages
from synth.planning.alignment.confidence import FEWEST_WORDS, LEAST_EVIDENCE, AlignmentTrust, trust
from synth.planning.alignment.recogniser import FRAME_RATE, FS, HOP, heard
from synth.planning.alignment.runs import CaptionRun, runs_of, said_in
from synth.planning.alignment.sound import mono
from synth.planning.prosody.pacing import TimedWord
from synth.planning.prosody.timing import GRID_HZ
from synth.planning.scoring.text_score import (
    PLAIN,
    OnWord,
    Reading,
    Warn,
    ignore_word,
    log_warning,
    timed_words,
    words_of_subtitles,
)

Sound = Callable[[float, float], NDArray[np.float64]]
"""Gives the programme's sound from one time to another, mono at
`synth.planning.alignment.recogniser.FS`."""

PASSAGES_AT_ONCE = 12
"""Passages that share their offset and their verdict at most."""

TOGETHER_S = 75.0
"""Seconds of passages that share their offset and their verdict: about a minute, after which an
advertisement or a cut may have changed what holds."""

LARGEST_OFFSET_S = 4.5
"""Subtitles may be early or late by this much."""

_OFFSET_STEP_S = 1.5
"""Seconds between the offsets that are tried."""

_OFFSET_SOUND_S = 30.0
"""So much of the programme's beginning shows whether its subtitles are early or late."""

_ROOM_S = 0.5
"""A word may begin so much before its subtitle appears, or after it is gone, at no cost."""

_LEAST_DRIFT_S = 0.3
"""Least change of the lag, in seconds, that moves the places of the next passages."""

_LEAST_OFFSET_S = 0.5
"""Seconds below which an offset is left to the search."""

_LEAST_CONFIDENCE = 0.5
"""Confidence below which a run is timed by its subtitles."""


@dataclass(frozen=True, slots=True)
class Judgement:
    """How sure the times of one subtitle are.

    Attributes
    ----------
    subtitle : Subtitle
    confidence : float
        How likely its words are within `synth.planning.alignment.confidence.WITHIN_S` of their
        times, in the mean.
    offset_s : float
        How much later than the subtitles say the voices were looked for.

    Examples
    --------
    >>> Judgement(Subtitle(1.0, 2.5, "Bonjour !"), confidence=0.93, offset_s=0.4).confidence
    0.93
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


def align(
    subtitles: Iterable[Subtitle],
    sound: Sound,
    *,
    reading: Reading = PLAIN,
    warn: Warn = log_warning,
    judged: Judged = lambda judgement: None,
    on_word: OnWord = ignore_word,
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
        Receives the confidence of the times of each subtitle.
    on_word : callable
        Receives the fate of each word.

    Returns
    -------
    Score

    Raises
    ------
    CueError
        If one subtitle spans more than `synth.planning.alignment.runs.LONGEST_TEXT_S`.

    Examples
    --------
    Noise speaks no word: the subtitle keeps its times, and a warning says so.

    >>> noise = np.random.default_rng(1).normal(0, 0.1, 48_000)
    >>> warnings: list[str] = []
    >>> score = align([Subtitle(0.5, 2.5, "Oui.")], sound_of(noise, 16_000), warn=warnings.append)
    >>> len(score.keys), len(warnings)
    (1, 1)
    """
    return reading.score(
        phones_of_recording(
            subtitles, sound, reading=reading, warn=warn, judged=judged, on_word=on_word
        )
    )


def phones_of_recording(
    subtitles: Iterable[Subtitle],
    sound: Sound,
    *,
    reading: Reading = PLAIN,
    warn: Warn = log_warning,
    judged: Judged = lambda judgement: None,
    on_word: OnWord = ignore_word,
) -> Iterator[Phone]:
    """Yield the phones of `align`, some passages at a time."""

    def batches() -> Iterator[list[TimedWord]]:
        offset_s = 0.0
        usual_lag_s: float | None = None
        around_s = LARGEST_OFFSET_S + 1.0
        for batch in _batches(runs_of(said_in(subtitles))):
            runs = _heard(batch, sound, reading, around_s, offset_s)
            timed = _TimedRuns.of(runs, offset_s)
            # Nothing fits: the subtitles may all be early or late by one offset.
            if not timed.verdict.holds:
                moved_s = _offset(_beginning(runs), offset_s)
                if moved_s != offset_s:
                    elsewhere = _TimedRuns.of(runs, moved_s)
                    if elsewhere.verdict.holds:
                        timed, offset_s, usual_lag_s = elsewhere, moved_s, None
                        side = "after" if offset_s > 0 else "before"
                        warn(f"the voices come {abs(offset_s):.1f} s {side} their subtitles: moved")
            if timed.verdict.holds:
                lag_s = timed.lag_s()
                usual_lag_s = lag_s if usual_lag_s is None else usual_lag_s
                if abs(lag_s - usual_lag_s) > _LEAST_DRIFT_S:
                    offset_s += lag_s - usual_lag_s
            yield timed.words(reading, warn, judged)

    return on_grid(reading.cued(chain.from_iterable(batches()), on_word))


def _batches(runs: Iterable[CaptionRun]) -> Iterator[list[CaptionRun]]:
    """Yield runs that share a verdict, about a minute of them."""
    batch: list[CaptionRun] = []
    for run in runs:
        long = batch and run.end_s - batch[0].start_s > TOGETHER_S
        if long or len(batch) == PASSAGES_AT_ONCE:
            yield batch
            batch = []
        batch.append(run)
    if batch:
        yield batch


@dataclass(frozen=True, slots=True)
class _HeardRun:
    """A run, its words, how many each subtitle has, and the sound around its batch.

    Attributes
    ----------
    run : CaptionRun
    words : tuple of Word
    counts : tuple of int
    samples : ndarray of float64, shape (n,)
    heard : ndarray of float32, shape (n // HOP + 1, 38)
        Log likelihoods of phones in the samples.
    start_s : float
        Time of the first sample.
    """

    run: CaptionRun
    words: tuple[Word, ...]
    counts: tuple[int, ...]
    samples: NDArray[np.float64]
    heard: NDArray[np.float32]
    start_s: float

    def passage(self, offset_s: float) -> SpokenPassage:
        """Return the words and the sound where they are expected."""
        away_s = max(self.run.start_s + offset_s - self.start_s, 0.0)
        first = min(round(away_s * FRAME_RATE), len(self.samples) // HOP)
        start_s = self.start_s + first / FRAME_RATE
        end = max(first, round((self.run.end_s + offset_s - self.start_s) * FRAME_RATE))
        samples = self.samples[first * HOP : end * HOP]
        expected_s = [
            (subtitle.start_s + offset_s - _ROOM_S, subtitle.end_s + offset_s + _ROOM_S)
            for subtitle, count in zip(self.run.subtitles, self.counts, strict=True)
            for _ in range(count)
        ][: len(self.words)]
        # A word more or less than the subtitles have one by one: liaison and elision at the seams.
        expected_s += expected_s[-1:] * (len(self.words) - len(expected_s))
        expected = np.array(expected_s).reshape(-1, 2)
        likely = self.heard[first : first + len(samples) // HOP + 1]
        timed = any(subtitle.timed for subtitle in self.run.subtitles)
        return SpokenPassage(self.words, samples, start_s, expected if timed else None, likely)

    def timed(self, phones: Sequence[Phone]) -> Iterator[TimedWord]:
        """Yield the words with phones that were found, and the subtitle of each."""
        last = np.cumsum(self.counts)
        for number, word in enumerate(timed_words(self.words, phones)):
            owner = min(int(np.searchsorted(last, number, side="right")), len(last) - 1)
            yield replace(word, subtitle=self.run.subtitles[owner])

    def lags_s(self, phones: Sequence[Phone], offset_s: float) -> list[float]:
        """Return how much later than its subtitle, moved, the first word of each begins."""
        starts = np.cumsum([0, *(len(word.phones) for word in self.words)])
        firsts = np.cumsum([0, *self.counts])
        return [
            phones[starts[first]].start - subtitle.start_s - offset_s
            for subtitle, first in zip(self.run.subtitles, firsts, strict=False)
            if first < len(self.words)
        ]

    def by_subtitle(self, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Split values of the words among the subtitles."""
        return np.split(values, np.cumsum(self.counts)[:-1])


def _heard(
    batch: Sequence[CaptionRun], sound: Sound, reading: Reading, around_s: float, offset_s: float
) -> list[_HeardRun]:
    """Return the runs of a batch with their words and the phones heard around them, heard once."""
    start_s = max(0.0, batch[0].start_s + offset_s - around_s)
    samples = sound(start_s, max(start_s, batch[-1].end_s + offset_s + around_s))
    likely = heard(samples)
    return [
        _HeardRun(
            run,
            tuple(reading.words(" ".join(subtitle.text for subtitle in run.subtitles))),
            tuple(len(reading.words(subtitle.text)) for subtitle in run.subtitles),
            samples,
            likely,
            start_s,
        )
        for run in batch
    ]


def _beginning(heard: Sequence[_HeardRun]) -> Sequence[_HeardRun]:
    lengths = np.cumsum([item.run.end_s - item.run.start_s for item in heard])
    return heard[: int(np.searchsorted(lengths, _OFFSET_SOUND_S)) + 1]


def _offset(heard: Sequence[_HeardRun], now_s: float) -> float:
    """Return how much later than their subtitles the voices are, from some runs."""
    if sum(len(item.words) for item in heard) < 2 * FEWEST_WORDS:
        return now_s
    reach = LARGEST_OFFSET_S + 0.1
    steps = [now_s + step for step in np.arange(-reach + 0.1, reach, _OFFSET_STEP_S).tolist()]
    found = {step: _fit(_look(heard, step)) for step in steps}
    best = max(found, key=found.__getitem__)
    offset_s = best + _lag(heard, best)
    return offset_s if abs(offset_s - now_s) >= _LEAST_OFFSET_S else now_s


def _look(heard: Sequence[_HeardRun], offset_s: float) -> tuple[list[SpokenPassage], list[Aligned]]:
    """Return the passages that have room where they are expected, with their alignments."""
    passages = [passage for item in heard if (passage := item.passage(offset_s)).long_enough]
    return passages, align_passages(passages)


def _fit(looked: tuple[list[SpokenPassage], list[Aligned]]) -> float:
    """Return how well the words fit, in the mean."""
    fits = np.concatenate([np.zeros(0), *(item.fits for item in looked[1])])
    return float(fits.mean()) if len(fits) else -np.inf


def _lag(heard: Sequence[_HeardRun], offset_s: float) -> float:
    """Return by how much subtitles are still early, in the median over their first words."""
    kept = [item for item in heard if item.passage(offset_s).long_enough]
    lags: list[float] = []
    passages = [item.passage(offset_s) for item in kept]
    for item, found in zip(kept, align_passages(passages), strict=True):
        lags += item.lags_s(found.phones, offset_s)
    return float(np.median(lags))


@dataclass(frozen=True, slots=True)
class _TimedRuns:
    """Some runs, aligned where they are long enough, and what that is worth."""

    heard: Sequence[_HeardRun]
    found: Sequence[Aligned | None]
    verdict: AlignmentTrust
    offset_s: float

    @classmethod
    def of(cls, heard: Sequence[_HeardRun], offset_s: float) -> "_TimedRuns":
        passages = [item.passage(offset_s) for item in heard]
        fitting = [passage for passage in passages if passage.long_enough]
        aligned = align_passages(fitting)
        rest = iter(aligned)
        found = [next(rest) if passage.long_enough else None for passage in passages]
        return cls(heard, found, trust(fitting, aligned), offset_s)

    def lag_s(self) -> float:
        """Return how much later than their subtitles, moved, words begin, in the median."""
        lags = []
        for item, found in zip(self.heard, self.found, strict=True):
            if found is not None:
                lags += item.lags_s(found.phones, self.offset_s)
        return float(np.median(lags)) if lags else 0.0

    @property
    def _timed_by_guess(self) -> bool:
        """Whether sound that may not belong to its text is better than no times at all."""
        given = any(subtitle.timed for item in self.heard for subtitle in item.run.subtitles)
        return not given and self.verdict.leans and not self.verdict.holds

    def words(self, reading: Reading, warn: Warn, judged: Judged) -> list[TimedWord]:
        """Return the words, those of runs that do not fit by their subtitles."""
        if not self.verdict.holds:
            first, last = self.heard[0].run.subtitles[0], self.heard[-1].run.subtitles[-1]
            evidence = f"evidence {self.verdict.evidence:.1f} of {LEAST_EVIDENCE:.0f}"
            warn(
                f"text without times: whether it is what is said is not sure ({evidence})"
                if self._timed_by_guess
                else f"subtitles from {first.start_s:.2f} to {last.end_s:.2f} s: their text is not "
                f"what is said ({evidence}), timed by themselves"
            )
        line: list[TimedWord] = []
        # Run by run: times of the alignment where it is believed, else those of the subtitle.
        for item, found in zip(self.heard, self.found, strict=True):
            sure = np.zeros(len(item.words))
            if found is not None:
                sure = self.verdict.confidence(found.fits)
            for subtitle, part in zip(item.run.subtitles, item.by_subtitle(sure), strict=True):
                confidence = float(part.mean()) if len(part) else 0.0
                judged(Judgement(subtitle, confidence, self.offset_s))
            if found is not None and (
                self._timed_by_guess or float(sure.mean()) >= _LEAST_CONFIDENCE
            ):
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
        yield replace(phone, start=start / GRID_HZ, end=free / GRID_HZ)
