"""Training of the score's tables: counts of phones and lengths in example scores.

Scores go in, integer tables come out, smoothed such that every event keeps a probability.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from codec.phonology import PHONES
from codec.preview import BEGINNING, CELL, SILENCE, preview_of
from codec.range_coder import cumulative
from codec.score import Score
from codec.score_coding import NOTHING, is_consonant, is_vowel, letter_of, part_of
from codec.tables import COARSE_LENGTHS, TEMPOS, ScoreTables
from codec.timeline import TICKS, Line, to_line

N = len(PHONES)
_PHASES = 8
"""Every score is cut into superframes at so many different places."""

_PAUSE_FIRST = 0.02
"""Share of compact superframes that begin with a pause (their writer decides)."""

_OF_NONE, _OF_ONE = 640.0, 960.0
"""Examples that phones count for whatever stands before, and those after one, against two."""

Counts = NDArray[np.float64]


def train_score(scores: Iterable[Score]) -> dict[str, list[object]]:
    """Return the tables of `codec.tables.ScoreTables` as nested lists of integers.

    Parameters
    ----------
    scores : iterable of Score
        Examples; only phones and their times matter.

    Returns
    -------
    dict of nested lists
        Frequencies that sum to 2**15 in every row.
    """
    first, following = np.zeros(N), np.zeros((N + 1, N, N))
    left, length = np.zeros((N, TICKS + 1)), np.zeros((N, TEMPOS, TICKS + 1))
    whole, keys = _Whole(), _Keys()
    for score in scores:
        line = to_line(score)
        whole.count(line)
        for phase in range(_PHASES):
            _count(score.shifted(phase * 0.08), first, following, left, length)
            keys.count(to_line(score.shifted(phase * 0.08)))
    return {
        "first": _rows(first + 1),
        "next": _rows(_after_two(following)),
        "left": _rows(_by_kind(left, 100.0)),
        "length": _rows(_lengths(length)),
        "opening": _rows(whole.opening + _PAUSE_FIRST * whole.opening.sum() * _is_pause()),
        "coarse": _rows(_lengths(whole.coarse)),
        "usual": whole.usual(),
        "key": _rows(_back_off(keys.key, keys.key.sum(axis=0) + 0.5, _OF_NONE)),
        "gap": _rows(_back_off(keys.gap, _blurred(keys.gap.sum(axis=0)) + 0.5, 20.0)),
    }


def _is_pause() -> Counts:
    """Return 1 for the letter of a pause, and a little for all."""
    return np.where(np.arange(N) == letter_of(0), 1.0, 0.01)


class _Whole:
    """Counts of whole phones, as compact superframes tell them."""

    def __init__(self) -> None:
        self.opening = np.zeros(N)
        self.coarse = np.zeros((N, TEMPOS, COARSE_LENGTHS))
        self._ticks, self._phones = np.zeros(N), np.zeros(N)

    def count(self, line: Line) -> None:
        last = 0
        for k in range(1, len(line.starts) - 1):
            number, ticks = line.numbers[k], line.starts[k + 1] - line.starts[k]
            if number and not (is_vowel(number) and is_consonant(line.numbers[k - 1])):
                self.opening[letter_of(number)] += 1
            units = min((ticks + line.starts[k] % 2) // 2, COARSE_LENGTHS - 1)
            self.coarse[number, ScoreTables.tempo(last), max(units, 1) - 1] += 1
            self._ticks[number] += ticks
            self._phones[number] += 1
            last = ticks if number else 0

    def usual(self) -> list[object]:
        """Return the mean lengths in sixteenths of a tick."""
        mean = self._ticks.sum() / self._phones.sum()
        ticks = (self._ticks + mean) / (self._phones + 1)
        rounded: list[object] = np.rint(16 * ticks).astype(int).tolist()
        return rounded


class _Keys:
    """Counts of keys and silences, as previews tell them."""

    def __init__(self) -> None:
        self.key = np.zeros((SILENCE + 2, SILENCE + 2))
        self.gap = np.zeros((SILENCE + 2, TICKS // CELL + 1))

    def count(self, line: Line) -> None:
        for index in range(line.starts[-1] // TICKS + 1):
            cell, before = -1, BEGINNING
            for tick, symbol in preview_of(part_of(line, index)):
                self.gap[before, tick // CELL - cell - 1] += 1
                self.key[before, symbol] += 1
                cell, before = tick // CELL, symbol
            # What the superframe's end hides counts by how gaps go on elsewhere.
            rest = self.gap[before, TICKS // CELL - 1 - cell :]
            rest += (rest + 0.01) / (rest + 0.01).sum()


def _count(score: Score, first: Counts, following: Counts, left: Counts, length: Counts) -> None:
    line = to_line(score)
    for index in range(line.starts[-1] // TICKS + 1):
        part = part_of(line, index)
        first[letter_of(part.first)] += 1
        left[part.first, part.first_end] += 1
        context, last = (NOTHING, part.first), 0
        ends = (*part.starts, TICKS)[1:]
        for number, start, end in zip(part.numbers, part.starts, ends, strict=True):
            following[context][letter_of(number)] += 1
            if end < TICKS:
                length[number, ScoreTables.tempo(last), end - start - 1] += 1
            else:
                # A cut phone counts by how such phones go on where they are not cut.
                rest = length[number, ScoreTables.tempo(last), end - start - 1 :]
                if rest.sum() > 0:
                    rest += rest / rest.sum()
            last = end - start if number else 0
            context = context[1], number


def _after_two(counts: Counts) -> Counts:
    """Smooth the rows of phones after two others by those after the later one alone."""
    single = counts.sum(axis=0)
    later = _back_off(single, single.sum(axis=0) + 1, _OF_NONE)
    prior = later / later.sum(axis=1, keepdims=True)
    rows: Counts = counts + _OF_ONE * prior
    rows[NOTHING] = later
    return rows


def _kinds() -> list[list[int]]:
    consonants = [n for n in range(N) if is_consonant(n)]
    return [[0], [n for n in range(N) if is_vowel(n)], consonants]


def _back_off(counts: Counts, prior: Counts, weight: float) -> Counts:
    """Return rows of counts plus `weight` examples that follow `prior`."""
    smoothed: Counts = counts + weight * prior / prior.sum()
    return smoothed


def _by_kind(counts: Counts, weight: float) -> Counts:
    """Smooth every phone's row by the sum over its kind: pause, vowel or consonant."""
    result = np.empty_like(counts)
    for kind in _kinds():
        prior = _blurred(counts[kind].sum(axis=0)) + 0.5
        if kind == [0]:
            # The examples' silences have a few lengths, those of speakers any.
            prior += prior.mean()
            weight = float(counts[0].sum()) + weight
        result[kind] = _back_off(counts[kind], prior, weight)
    return result


def _lengths(counts: Counts) -> Counts:
    result = np.empty_like(counts)
    for tempo in range(TEMPOS):
        result[:, tempo] = _by_kind(counts[:, tempo], 300.0)
    return result


def _blurred(counts: Counts) -> Counts:
    """Spread counts over neighbouring lengths: other speakers have other clocks."""
    wide = np.concatenate([[0.0], counts, [0.0]])
    return np.asarray(0.25 * wide[:-2] + 0.5 * wide[1:-1] + 0.25 * wide[2:], dtype=np.float64)


def _rows(counts: Counts) -> list[object]:
    table = np.array([np.diff(cumulative(row)) for row in counts.reshape(-1, counts.shape[-1])])
    rows: list[object] = table.reshape(counts.shape).tolist()
    return rows
