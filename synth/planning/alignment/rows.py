"""The row of units that a passage is cut into: phones, and between words silence or other speech.

Sound between two words may be a pause, speech that the text leaves out, as television
condenses, or nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONE_NUMBER, PHONES
from codec.errors import CueError
from synth.language.text.words import Word
from synth.planning.alignment.recogniser import FRAME_RATE, FS, heard
from synth.planning.prosody.duration import predict_durations

FILLER = "*"
"""Symbol of speech that is not in the text."""

OUTSIDE = "**"
"""Symbol of speech before the first word of a text without times, and after the last."""

Unit = tuple[str, int, int]
"""Symbol, first frame, end frame."""

GAP = (PAUSE, FILLER, PAUSE)
"""What may stand between words; each of it may be absent."""

SHORTEST_FRAMES, LONGEST_FRAMES = 2, 40
"""A phone lasts 20 to 400 ms."""

_PAUSE_FRAMES = 5
"""Least frames of a silence between words that counts as a pause."""

_LENGTH_SPREAD = 0.45
"""Standard deviation of the logarithm of durations about the usual ones."""

_LENGTH_WEIGHT = 3.3
"""Neighbouring frames of 10 ms say nearly the same, so that their costs together count too much:
of 1.0, 2.0, 3.3 and 4.4 the third misplaces fewest words, with music and with texts condensed."""

_FAR_FRAMES = 200
"""A word is looked for up to 2 s from where its subtitle expects it."""


@dataclass(frozen=True, slots=True)
class SpokenPassage:
    """Words and the sound that contains them.

    Attributes
    ----------
    words : tuple of Word
    samples : ndarray of float64, shape (n,)
        At `synth.planning.alignment.recogniser.FS`, with all of the words in it.
    start_s : float
        Time of the first sample on the programme's clock.
    expected_s : ndarray of float64, shape (words, 2), optional
        Between which times on that clock each word is expected to begin.
    heard : ndarray of float32, shape (n // HOP + 1, 38), optional
        What `synth.planning.alignment.recogniser.heard` gives of the samples, where it is known
        already.
    """

    words: tuple[Word, ...]
    samples: NDArray[np.float64]
    start_s: float = 0.0
    expected_s: NDArray[np.float64] | None = None
    heard: NDArray[np.float32] | None = None

    def likelihoods(self) -> NDArray[np.float32]:
        """Return how likely each phone is in each frame, in the logarithm, shape (frames, 38)."""
        return heard(self.samples) if self.heard is None else self.heard

    @property
    def anywhere(self) -> bool:
        """Whether the text may lie anywhere in the sound: it has no times of its own."""
        return self.expected_s is None

    @property
    def shortest_s(self) -> float:
        """Least duration of the phones, in seconds."""
        return SHORTEST_FRAMES * sum(len(word.phones) for word in self.words) / FRAME_RATE

    @property
    def long_enough(self) -> bool:
        """Whether the phones have room in the sound."""
        return len(self.samples) > self.shortest_s * FS


@dataclass(slots=True)
class Row:
    """The units of a passage."""

    symbols: list[str]
    starts: NDArray[np.int64]
    """First frame of each unit, and the end of the last."""

    window: NDArray[np.int64]
    """As in `_kernels.segment_into`."""

    def units(self) -> list[Unit]:
        """Return symbol, first frame and end frame of each unit."""
        bounds = pairwise(self.starts.tolist())
        return [(s, a, b) for s, (a, b) in zip(self.symbols, bounds, strict=True)]


def is_phone(symbol: str) -> bool:
    """Whether a symbol of a row is a phone, not silence or other speech."""
    return symbol not in (PAUSE, FILLER, OUTSIDE)


def symbols_of(passage: SpokenPassage) -> list[str]:
    """Return the symbols of a row of words."""
    line = [*GAP, *(s for word in passage.words for s in (*word.phones, *GAP))]
    if not passage.anywhere:
        return line
    return [*line[: len(GAP)], OUTSIDE, PAUSE, *line[len(GAP) :], OUTSIDE, PAUSE]


def row_of(passage: SpokenPassage, frames: int) -> Row:
    """Return a passage with its phones at their usual durations from the first frame on.

    Raises
    ------
    CueError
        If the passage is too short for its phones.
    """
    if not passage.long_enough:
        raise CueError(
            f"passage at {passage.start_s:.2f} s has {len(passage.samples) / FS:.2f} s of sound "
            f"for phones that need {passage.shortest_s:.2f} s"
        )
    symbols = symbols_of(passage)
    plain = [symbol if is_phone(symbol) else PAUSE for symbol in symbols]
    ends = np.cumsum(predict_durations(plain)) * FRAME_RATE
    starts = np.append(0, np.round(ends)).astype(np.int64)
    return Row(symbols, starts, _window(passage, symbols, frames))


def _window(passage: SpokenPassage, symbols: Sequence[str], frames: int) -> NDArray[np.int64]:
    """Return where the units may start: those of a word near its subtitle."""
    window = np.tile(np.array([0, 0, frames, frames]), (len(symbols), 1))
    if passage.expected_s is None:
        return window
    expected = np.round((passage.expected_s - passage.start_s) * FRAME_RATE).astype(np.int64)
    position = next(i for i, symbol in enumerate(symbols) if is_phone(symbol))
    for word, (first, last) in zip(passage.words, expected, strict=True):
        phones = len(word.phones)
        earliest, latest = np.clip([first - _FAR_FRAMES, last + _FAR_FRAMES], 0, frames)
        window[position : position + phones, 0] = earliest
        window[position : position + phones, 3] = min(frames, latest + phones * LONGEST_FRAMES)
        window[position, 1:3] = np.clip([first, last], 0, frames)
        position += phones + len(GAP)
    return window


def length_costs(row: Row) -> NDArray[np.float64]:
    """Return the price of each length of each unit: log-normal around the usual duration.

    Returns
    -------
    ndarray of float64, shape (units, LONGEST_FRAMES - SHORTEST_FRAMES + 1)
    """
    found = np.diff(row.starts)
    spoken = np.array([is_phone(symbol) for symbol in row.symbols])
    pauses = np.array([symbol == PAUSE for symbol in row.symbols])
    kept = spoken | (pauses & (found >= _PAUSE_FRAMES))
    usual = predict_durations([s for s, keep in zip(row.symbols, kept, strict=True) if keep])
    expected = np.ones(len(row.symbols))
    expected[kept] = np.where(usual > 0, usual, 1.0)
    heard = spoken & (found > 0)
    rate = found[heard].sum() / expected[heard].sum() if heard.any() else FRAME_RATE
    lengths = np.arange(SHORTEST_FRAMES, LONGEST_FRAMES + 1)
    deviation = np.log(lengths[None] / (expected[:, None] * rate)) / _LENGTH_SPREAD
    return np.ascontiguousarray(_LENGTH_WEIGHT * deviation**2 / 2)


def kinds_of(symbols: Sequence[str]) -> NDArray[np.int64]:
    """Return the kind of each unit: its phone's number, or one more, or two, for other speech."""
    others = {FILLER: len(PHONES), OUTSIDE: len(PHONES) + 1}
    return np.array([others[s] if s in others else PHONE_NUMBER[s] for s in symbols])


def skips_of(symbols: Sequence[str]) -> NDArray[np.int64]:
    """Return at the last phone of each word how many it has, 0 elsewhere."""
    skips = np.zeros(len(symbols), np.int64)
    count = 0
    for i, symbol in enumerate(symbols):
        if is_phone(symbol):
            count += 1
        else:
            if count:
                skips[i - 1] = count
            count = 0
    return skips
