"""Phones of a text to their times in a recording of it.

In: the words of passages and the sound of each.  Out: phones with times.  espeak-ng speaks the
phones, with times that are known exactly; models of the phones are estimated on that rendering;
the recording is cut by them, with the usual durations of phones as a prior and silence allowed
between words; then the models are estimated again on the recording itself and it is cut anew.
Sources: F. Malfrère, T. Dutoit 1997 (alignment by synthesis); segmental Viterbi search with
explicit durations (L. Rabiner 1989, section IV.D).

Dynamic time warping of the rendering as a first step was tried and left out: on 14 recordings
of several speakers the median error was the same without it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONE_NUMBER
from codec.cues.score import Phone
from codec.errors import CueError
from synth.alignment import _kernels
from synth.alignment.cepstra import FRAME_RATE, FS, cepstra, mono
from synth.alignment.models import PARTS, PhoneModels, Unit, estimate
from synth.prosody.duration import predict_durations
from synth.speech.espeak_voice import render
from synth.text.espeak import RATE_HZ
from synth.text.words import Word

ROUNDS = 2
"""How often the models are estimated on the recording; more changes nothing."""

SHORTEST_FRAMES, LONGEST_FRAMES = 4, 80
"""A phone lasts 20 to 400 ms."""

_PAUSE_FRAMES = 10
_LENGTH_SPREAD = 0.45
"""Standard deviation of the logarithm of durations about the usual ones."""

_LENGTH_WEIGHT = 16.0
"""Neighbouring frames of 5 ms tell nearly the same: their costs together count too much."""

_WORDS_PER_MINUTE = 140
_MARGIN_S = 0.1


@dataclass(frozen=True, slots=True)
class Passage:
    """Words and the sound in which they are spoken.

    Attributes
    ----------
    words : tuple of Word
    samples : ndarray of float64, shape (n,)
        At `synth.alignment.cepstra.FS`, with all of the words in it.
    start_s : float
        Time of the first sample on the programme's clock.
    """

    words: tuple[Word, ...]
    samples: NDArray[np.float64]
    start_s: float = 0.0

    @property
    def shortest_s(self) -> float:
        """What the phones need at least, in seconds."""
        return SHORTEST_FRAMES * sum(len(word.phones) for word in self.words) / FRAME_RATE

    @property
    def long_enough(self) -> bool:
        """Whether the phones have room in the sound."""
        return len(self.samples) > self.shortest_s * FS


@dataclass(slots=True)
class _Row:
    """The units of a passage: phones, and silence wherever it may stand."""

    symbols: list[str]
    features: NDArray[np.float32]
    starts: NDArray[np.int64]
    """First frame of each unit, and the end of the last."""

    def units(self, offset: int = 0) -> list[Unit]:
        bounds = pairwise((self.starts + offset).tolist())
        return [(s, a, b) for s, (a, b) in zip(self.symbols, bounds, strict=True)]


@dataclass(frozen=True, slots=True)
class Aligned:
    """Where the phones of a passage were found.

    Attributes
    ----------
    phones : tuple of Phone
        On the programme's clock.
    fits : ndarray of float64, shape (words,)
        How much likelier the frames of each word are under its own phones than under the median
        phone, in the logarithm per frame. What the figure is worth only a comparison with other
        words on the same sound tells (`synth.alignment.trust`): models fit to anything.
    """

    phones: tuple[Phone, ...]
    fits: NDArray[np.float64]


def align(passages: Sequence[Passage]) -> list[Aligned]:
    """Return the phones of each passage with their times on the programme's clock.

    Parameters
    ----------
    passages : sequence of Passage
        Of one speaker or of few; some minutes at a time.

    Raises
    ------
    CueError
        If a passage is too short for its phones.

    Examples
    --------
    >>> from synth.text.pronounce import phonemise
    >>> words = tuple(phonemise("Bonjour à tous."))
    >>> spoken = render([s for word in words for s in word.phones])
    >>> found = align([Passage(words, mono(spoken.samples, RATE_HZ))])[0].phones
    >>> max(abs(a.start - b.start) for a, b in zip(found, spoken.phones)) < 0.04
    True
    """
    filled = [passage for passage in passages if passage.words]
    if not filled:
        return [Aligned((), np.zeros(0)) for _ in passages]
    models = estimate(*_gathered([_rendered(passage.words) for passage in filled]))
    rows = [_row(passage) for passage in filled]
    for _ in range(ROUNDS):
        for row in rows:
            _cut(row, models)
        models = estimate(*_gathered(rows), prior=models)
    for row in rows:
        _cut(row, models)
    found = iter(zip(filled, rows, strict=True))
    return [_aligned(*next(found), models) if p.words else Aligned((), np.zeros(0))
            for p in passages]  # fmt: skip


def _symbols(words: Sequence[Word]) -> list[str]:
    return [PAUSE, *(s for word in words for s in (*word.phones, PAUSE))]


def _gathered(rows: Sequence[_Row]) -> tuple[NDArray[np.float32], list[Unit]]:
    """Return the features of all rows in one line, and their units in it."""
    units: list[Unit] = []
    offset = 0
    for row in rows:
        units += row.units(offset)
        offset += len(row.features)
    return np.concatenate([row.features for row in rows]), units


def _rendered(words: Sequence[Word]) -> _Row:
    """Return a rendering of the words, cut exactly."""
    line = [s for word in words for s in (*word.phones, *([PAUSE] if word.pause else []))]
    rendering = render(line, words_per_minute=_WORDS_PER_MINUTE)
    features = cepstra(np.pad(mono(rendering.samples, RATE_HZ), round(_MARGIN_S * FS)))
    starts = [0.0]
    times = iter(rendering.phones)
    for word in words:
        spoken = [next(times) for _ in word.phones]
        starts += [_MARGIN_S + phone.start for phone in spoken]
        starts.append(_MARGIN_S + spoken[-1].end)
    frames = np.round(np.array(starts) * FRAME_RATE).astype(np.int64)
    return _Row(_symbols(words), features, np.append(frames, len(features)))


def _row(passage: Passage) -> _Row:
    """Return a passage with its phones at their usual durations from the first frame on."""
    symbols = _symbols(passage.words)
    features = cepstra(passage.samples)
    if not passage.long_enough:
        raise CueError(
            f"passage at {passage.start_s:.2f} s has {len(passage.samples) / FS:.2f} s of sound "
            f"for phones that need {passage.shortest_s:.2f} s"
        )
    ends = np.cumsum(predict_durations(symbols)) * FRAME_RATE
    return _Row(symbols, features, np.append(0, np.round(ends)).astype(np.int64))


def _cut(row: _Row, models: PhoneModels) -> None:
    """Cut a passage by the models; keep the old cuts if nothing fits."""
    kinds = np.array([PHONE_NUMBER[symbol] for symbol in row.symbols])
    optional = np.array([symbol == PAUSE for symbol in row.symbols])
    starts = np.zeros(len(kinds) + 1, np.int64)
    costs = models.costs(row.features)
    if _kernels.segment_into(costs, kinds, optional, _length_costs(row), SHORTEST_FRAMES, starts):
        row.starts = starts


def _length_costs(row: _Row) -> NDArray[np.float64]:
    """Return the price of each length of each unit: log-normal around the usual duration."""
    found = np.diff(row.starts)
    spoken = np.array([symbol != PAUSE for symbol in row.symbols])
    kept = spoken | (found >= _PAUSE_FRAMES)
    usual = predict_durations([s for s, keep in zip(row.symbols, kept, strict=True) if keep])
    expected = np.ones(len(row.symbols))
    expected[kept] = np.where(usual > 0, usual, 1.0)
    rate = found[spoken].sum() / expected[spoken].sum()
    lengths = np.arange(SHORTEST_FRAMES, LONGEST_FRAMES + 1)
    deviation = np.log(lengths[None] / (expected[:, None] * rate)) / _LENGTH_SPREAD
    return np.ascontiguousarray(_LENGTH_WEIGHT * deviation**2 / 2)


def _aligned(passage: Passage, row: _Row, models: PhoneModels) -> Aligned:
    units = row.units()
    costs = models.costs(row.features)
    phones, fits = [], np.zeros(len(passage.words))
    spoken = iter([unit for unit in units if unit[0] != PAUSE])
    for number, word in enumerate(passage.words):
        own = [next(spoken) for _ in word.phones]
        fits[number] = np.mean([_fit(unit, costs) for unit in own])
        phones += [
            Phone(symbol, passage.start_s + a / FRAME_RATE, passage.start_s + b / FRAME_RATE)
            for symbol, a, b in own
        ]
    return Aligned(tuple(phones), fits)


def _fit(unit: Unit, costs: NDArray[np.float64]) -> float:
    """Return how much less a phone costs per frame than the median phone in its place."""
    symbol, first, end = unit
    cuts = [first + (part * (end - first)) // PARTS for part in range(PARTS + 1)]
    pieces = [costs[:, p, cuts[p + 1]] - costs[:, p, cuts[p]] for p in range(PARTS)]
    every = np.sum(pieces, axis=0)
    number = PHONE_NUMBER[symbol]
    return float((np.median(np.delete(every, PHONE_NUMBER[PAUSE])) - every[number]) / (end - first))
