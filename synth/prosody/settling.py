"""Keys moved by some ticks, so that each is seen long enough: what tables of time cannot tell.

How long a key is seen depends on the ways to it and from it and on how long its neighbours last: a
hand that has time leaves early, so more time for a key does not always help it. So the planned line
is looked at with `synth.rules.sight`, and where a key is not seen for three pictures, or a knuckle
is too fast, runs of keys are shifted against their neighbours; the best shift is taken, if it helps
the keys together.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from synth.rules.sight import Sight

FloatArray = NDArray[np.float64]
Ticks = NDArray[np.int64]

TICK_S = 0.02
"""Grid of the bitstream."""

WANTED_S = 0.12
"""Three pictures at 25 a second."""

_SPREAD_S = 0.02
"""How far what is seen lies from what is planned: drift, scatter and head (standard deviation)."""

_EASY_S, _EASE = 0.18, 0.4
"""Up to so long more time is better still; weight of that against a key that is not seen."""

_FASTEST_M_S, _TOO_FAST = 1.3, 8.0
"""Planned peak speed from which on faster is worse, and cost of 1 m/s: drift adds a little."""

_WORTH = 0.02
"""Least gain, in keys that are seen, for which a shift is taken."""

_SHIFTS = (-4, -2, -1, 1, 2, 4)
"""Ticks of a shift."""

_FAR_SHIFTS = (-6, -4, -2, -1, 0, 1, 2, 4, 6, 8)
"""Ticks of a key's shift, and of that of all keys after it up to the next pause, in variants."""

REST_ROOM_S = 0.95
"""Shorter silences are too short for the hand to rest and to be back: she holds the last key."""

_FROM, _LENGTHS = (-1, 0, 1), (1, 2)
"""Where runs of keys that are shifted begin, against the key in question, and how long they are;
besides, all keys up to the next pause."""

_TOUCHED, _AROUND = 2, 2
"""Keys on both sides of a shift's ends whose sight it changes, and those looked at beside them."""

_ROUNDS = 4
"""How often a key is mended."""

_BAR = 0.1
"""Cost of a key from which on it is mended."""


@dataclass(frozen=True, slots=True)
class Line:
    """Keys on the cuer's clock, N of them, in ticks.

    Attributes
    ----------
    start, end : ndarray of int64
        When each sounds; most end where the next starts.
    early, late : ndarray of int64
        Earliest and latest start.
    least, pause : ndarray of int64
        Shortest length, and shortest pause before the key, 0 where there is none.
    key : ndarray of int64
        Key numbers, 6 shape + placement.
    lag : ndarray of float64
        Part of the key's length after which the hand should be there.
    frozen : int
        So many of the first keys stay as they are: they have been said.
    """

    start: Ticks
    end: Ticks
    early: Ticks
    late: Ticks
    least: Ticks
    pause: Ticks
    key: Ticks
    lag: FloatArray
    frozen: int = 0

    def __getitem__(self, part: slice) -> "Line":
        """Return some of the keys."""
        arrays = {name: getattr(self, name)[part] for name in _ARRAYS}
        return Line(**arrays, frozen=max(0, self.frozen - (part.start or 0)))

    def after(self, before: "Line") -> "Line":
        """Return the line that follows keys that have been said."""
        arrays = {
            name: np.concatenate([getattr(before, name), getattr(self, name)]) for name in _ARRAYS
        }
        return Line(**arrays, frozen=len(before.start))


_ARRAYS = tuple(f.name for f in fields(Line) if f.name != "frozen")


class Settler:
    """Moves keys by ticks.

    Parameters
    ----------
    sight : Sight
    options : CueingOptions
        Which gaps send the hand to rest.
    room_s : float
        Shorter gaps do not: the hand could not be back.
    """

    def __init__(
        self, sight: Sight, options: CueingOptions = DEFAULT_OPTIONS, room_s: float = REST_ROOM_S
    ) -> None:
        self._sight, self._rest_gap_s = sight, options.rest_gap_s
        self._rest = round(options.rest_gap_s / TICK_S)
        self._room = round(room_s / TICK_S)

    def settled(self, line: Line) -> Line:
        """Return a line whose keys are seen as long as shifts can make it."""
        if not len(line.start):
            return line
        first = line.frozen
        costs = self._costs(line, first, len(line.start))
        for k in (first + np.flatnonzero(costs > _BAR)).tolist():
            for _ in range(_ROUNDS):
                better = self._mended(line, k)
                if better is None:
                    break
                line = better
        return line

    def _mended(self, line: Line, k: int) -> Line | None:
        """Return the line with the best shift near a key, None if none is worth it."""
        if self._cost(line, [(k, k + 1)]) <= _BAR:
            return None
        most, found = _WORTH, None
        for i, j in self._runs(line, k):
            spans = _near(i, j, len(line.start))
            now = self._cost(line, spans)
            for shift in _SHIFTS:
                moved = self._shifted(line, i, j, shift)
                if moved is None:
                    continue
                gain = now - self._cost(moved, spans)
                if gain > most:
                    most, found = gain, moved
        return found

    def variants(self, line: Line, k: int, most: int) -> list[Line]:
        """Return other lines near a key, those first that the model thinks best.

        Parameters
        ----------
        line : Line
        k : int
            Number of a key that is not frozen.
        most : int
            So many lines.
        """
        n = len(line.start)
        spans = [(max(k - _TOUCHED - 1, 0), min(k + _TOUCHED + 1, n))]
        found: list[tuple[float, int, Line]] = []
        for i in sorted({max(k - 1, line.frozen), k}):
            for later, shift in itertools.product(_FAR_SHIFTS, _FAR_SHIFTS):
                one = self._run_shifted(line, k + 1, later) if k + 1 < n else line
                two = self._shifted(one, i, k + 1, shift) if one is not None and shift else one
                if two is not None and two is not line:
                    found.append((self._cost(two, spans), len(found), two))
        return [other for _, _, other in sorted(found)[:most]]

    def _run_shifted(self, line: Line, i: int, shift: int) -> Line | None:
        """Return the line with all keys from one to the next pause shifted, None without room."""
        if not shift:
            return line
        return self._shifted(line, i, self._until_pause(line, i), shift)

    @staticmethod
    def _until_pause(line: Line, i: int) -> int:
        pauses = np.flatnonzero(line.start[i + 1 :] > line.end[i:-1])
        return i + 1 + int(pauses[0]) if len(pauses) else len(line.start)

    def _runs(self, line: Line, k: int) -> Iterator[tuple[int, int]]:
        """Yield the runs of keys that may be shifted to mend a key."""
        n = len(line.start)
        for i in (k + begin for begin in _FROM):
            if not line.frozen <= i < n:
                continue
            ends = {min(i + length, n) for length in _LENGTHS}
            ends.add(self._until_pause(line, i))
            yield from ((i, j) for j in sorted(ends))

    def _cost(self, line: Line, spans: Sequence[tuple[int, int]]) -> float:
        """Return the cost of the keys in some spans."""
        return sum(float(self._costs(line, *span).sum()) for span in spans)

    def _shifted(self, line: Line, i: int, j: int, shift: int) -> Line | None:
        """Return the line with keys i to j - 1 shifted, None if there is no room."""
        start, end = line.start.copy(), line.end.copy()
        start[i:j] += shift
        end[i:j] += shift
        if (start[i:j] < line.early[i:j]).any() or (start[i:j] > line.late[i:j]).any():
            return None
        for edge in (i, j):
            if not 0 < edge < len(start):
                continue
            gap = line.start[edge] - line.end[edge - 1]
            if gap == 0 and not line.pause[edge] and edge > line.frozen:
                end[edge - 1] = start[edge]
                if end[edge - 1] - start[edge - 1] < line.least[edge - 1]:
                    return None
                continue
            new = start[edge] - end[edge - 1]
            if new < line.pause[edge] or (new >= self._rest) != (gap >= self._rest):
                return None
            if self._rest <= new < self._room:
                return None
        return replace(line, start=start, end=end)

    def _costs(self, line: Line, first: int, last: int) -> FloatArray:
        """Return the costs of some keys: those that are not seen, and too fast ones."""
        held, peak = self._look(line, first, last)
        unseen = ndtr((WANTED_S - held) / _SPREAD_S)
        uneasy = _EASE * np.maximum(_EASY_S - held, 0.0) / _EASY_S
        return np.asarray(unseen + uneasy + _TOO_FAST * np.maximum(peak - _FASTEST_M_S, 0.0))

    def _look(self, line: Line, first: int, last: int) -> tuple[FloatArray, FloatArray]:
        """Return how long some keys are seen, seconds, and how fast the knuckles are, m/s."""
        low, high = max(first - _AROUND, 0), min(last + _AROUND, len(line.start))
        part = slice(low, high)
        start, end = (TICK_S * x[part].astype(np.float64) for x in (line.start, line.end))
        target = start + line.lag[part] * (end - start)
        held, peak = self._sight.look(
            start, end, target, line.key[part], rest_gap_s=self._rest_gap_s
        )
        return held[first - low : last - low], peak[first - low : last - low]


def _near(i: int, j: int, n: int) -> list[tuple[int, int]]:
    """Return the spans of keys, of n, whose sight changes when keys i to j - 1 are shifted."""
    one, other = ((max(edge - _TOUCHED, 0), min(edge + _TOUCHED, n)) for edge in (i, j))
    return [one, other] if one[1] <= other[0] else [(one[0], other[1])]
