"""Keys moved by some ticks, so that each is visible long enough: tables of time cannot do it.

How long a key is seen depends on the ways to it and from it and on how long its neighbours last: a
hand that has time leaves early, so more time for a key does not always help it. So the planned line
is looked at with `synth.motion.rules.visibility`, and where a key is not seen for three pictures,
or a knuckle is too fast, runs of keys are shifted against their neighbours; the best shift is
taken, if it helps the keys together. Keys known to be short also get ticks from keys that can
spare them, one by one where it costs least, however far away: the way to the chin needs many at
once.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from codec.analysis.readability import HELD_S
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from synth.motion.rules.visibility import VisibilityModel

FloatArray = NDArray[np.float64]
Ticks = NDArray[np.int64]

TICK_S = 0.02
"""Grid of the bitstream."""

WANTED_S = 0.12
"""Three pictures at 25 a second."""

_SPREAD_S = 0.02
"""Distance between visible and planned times: drift, scatter and head (standard deviation)."""

_KNOWN_SPREAD_S = 0.01
"""The same once a performance has been looked at."""

_EASY_S, _EASE = 0.18, 0.2
"""Up to so long more time is better still; weight of that against a key that is not seen."""

_FASTEST_M_S, _TOO_FAST = 1.3, 8.0
"""Greatest planned peak speed without a cost, and cost of 1 m/s beyond: drift adds a little."""

_WORTH = 0.02
"""Least gain, in keys that are seen, for which a shift is taken."""

_SHIFTS = (-4, -2, -1, 1, 2, 4)
"""Ticks of a shift."""

REST_ROOM_S = 0.95
"""Shorter silences are too short for the hand to rest and to be back: she holds the last key."""

_FROM, _LENGTHS = (-1, 0, 1), (1, 2)
"""Where runs of keys that are shifted begin, against the key in question, and how long they are;
besides, all keys up to the next pause."""

_GIVERS, _GIVEN = 24, 8
"""Keys on both sides of one in need that may give it ticks, and how many ticks it gets at most."""

_TOUCHED, _AROUND = 2, 2
"""Keys on both sides of a shift's ends whose sight it changes, and those looked at beside them."""

_ROUNDS = 4
"""How often a key is mended."""

_BAR = 0.1
"""Least cost of a key that is mended."""


@dataclass(frozen=True, slots=True)
class KeyLine:
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
    more : ndarray of float64
        How much longer each was visible in a performance than in the model, seconds.
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
    more: FloatArray
    frozen: int = 0

    def __getitem__(self, part: slice) -> "KeyLine":
        """Return some of the keys."""
        arrays = {name: getattr(self, name)[part] for name in _ARRAYS}
        return KeyLine(**arrays, frozen=max(0, self.frozen - (part.start or 0)))

    def after(self, before: "KeyLine") -> "KeyLine":
        """Return the line that follows keys that have been said."""
        arrays = {
            name: np.concatenate([getattr(before, name), getattr(self, name)]) for name in _ARRAYS
        }
        return KeyLine(**arrays, frozen=len(before.start))


_ARRAYS = tuple(f.name for f in fields(KeyLine) if f.name != "frozen")


class TimingOptimiser:
    """Moves keys by ticks.

    Parameters
    ----------
    sight : VisibilityModel
    options : CueingOptions
        Which gaps send the hand to rest.
    room_s : float
        Shorter gaps do not: the hand could not be back.
    """

    def __init__(
        self,
        sight: VisibilityModel,
        options: CueingOptions = DEFAULT_OPTIONS,
        room_s: float = REST_ROOM_S,
    ) -> None:
        self._sight, self._rest_gap_s = sight, options.rest_gap_s
        self._rest = round(options.rest_gap_s / TICK_S)
        self._room = round(room_s / TICK_S)
        self._prices: dict[tuple[int, bytes, bytes], float] = {}
        self._looks: dict[tuple[object, ...], tuple[FloatArray, FloatArray]] = {}
        self._spread_s = _SPREAD_S

    def seen(self, line: KeyLine) -> FloatArray:
        """Return how long the model sees the keys that have not been said, seconds."""
        return self._look(line, line.frozen, len(line.start))[0]

    def settled(self, line: KeyLine, short: Ticks | None = None) -> KeyLine:
        """Return a line whose keys are seen as long as shifts can make it.

        Parameters
        ----------
        line : KeyLine
        short : ndarray of int64, optional
            Numbers of the keys, from the first that is not frozen on, that a performance showed too
            short: only these are mended, but with ticks of keys that are farther away too. Without
            them all that the model does not see for certain.
        """
        if not len(line.start):
            return line
        first = line.frozen
        self._spread_s = _SPREAD_S if short is None else _KNOWN_SPREAD_S
        self._prices, self._looks = {}, {}
        if short is None:
            short = np.flatnonzero(self._costs(line, first, len(line.start)) > _BAR)
        for k in (first + short).tolist():
            for _ in range(_ROUNDS):
                better = self._mended(line, k)
                if better is None:
                    break
                line = better
        return line

    def _mended(self, line: KeyLine, k: int) -> KeyLine | None:
        """Return the line with the best shift near a key, None if none is worth it."""
        if self._cost(line, [(k, k + 1)]) <= _BAR:
            return None
        most, found = self._given(line, k) if self._spread_s < _SPREAD_S else (_WORTH, None)
        for i, j in self._runs(line, k):
            spans = _near(i, j, len(line.start))
            now = self._cost(line, spans)
            for shift in _SHIFTS:
                moved = self._shifted(line, i, j, shift)
                if moved is None:
                    continue
                gain = now - self._cost(moved, spans, now - most)
                if gain > most:
                    most, found = gain, moved
        return found

    def _given(self, line: KeyLine, k: int) -> tuple[float, KeyLine | None]:
        """Return the best gain of ticks that others give to a key or the one before, and the line.

        Every tick comes from whom it costs least; gains may need several ticks to show.
        """
        most, found = _WORTH, None
        first, last = max(k - _GIVERS, line.frozen), min(k + _GIVERS + 1, len(line.start))
        for taker in range(max(k - 1, line.frozen), k + 1):
            near = max(taker - 1, 0), min(taker + _TOUCHED + 1, len(line.start))
            now = self._cost(line, [near])
            prices: dict[int, float] = {}
            other, paid = line, 0.0
            for _ in range(_GIVEN):
                giver = self._cheapest(other, taker, range(first, last), prices)
                if giver == taker:
                    break
                paid += prices[giver]
                if paid > now - most:
                    break
                other = self._handed(other, giver, taker) or other
                prices[giver] = self._price(other, giver)
                if now - self._cost(other, [near]) - paid > most:
                    gain = self._cost(line, [(first, last)]) - self._cost(other, [(first, last)])
                    if gain > most:
                        most, found = gain, other
        return most, found

    def _cheapest(self, line: KeyLine, taker: int, among: range, prices: dict[int, float]) -> int:
        """Return which key gives a tick to another one for least; the taker if none can.

        Missing prices are added: those of the keys as they are.
        """
        ahead = (line.late - line.start)[taker + 1 : among.stop] <= 0
        behind = (line.start - line.early)[among.start + 1 : taker + 1][::-1] <= 0
        lowest = taker - (int(behind.argmax()) if behind.any() else len(behind))
        highest = taker + (int(ahead.argmax()) if ahead.any() else len(ahead))
        givers = [d for d in range(lowest, highest + 1) if d != taker]
        for giver in givers:
            if giver not in prices:
                prices[giver] = self._price(line, giver)
        givers.sort(key=lambda d: (prices[d], abs(d - taker)))
        return next((d for d in givers if self._handed(line, d, taker) is not None), taker)

    def _handed(self, line: KeyLine, giver: int, taker: int) -> KeyLine | None:
        """Return the line with one tick of a key handed to another, None if that cannot be."""
        if giver > taker:
            return self._shifted(line, taker + 1, giver + 1, 1)
        return self._shifted(line, giver + 1, taker + 1, -1)

    def _price(self, line: KeyLine, k: int) -> float:
        """Return the cost of making a key, or the pause after it, one tick shorter."""
        low, high = max(k - _TOUCHED - _AROUND, 0), min(k + _TOUCHED + _AROUND + 1, len(line.start))
        first = line.start[low]
        sight = k, (line.start[low:high] - first).tobytes(), (line.end[low:high] - first).tobytes()
        if sight not in self._prices:
            part, at = line[low:high], k - low
            free = replace(part, early=part.early - 1)
            other = self._shifted(free, at + 1, len(part.start), -1)
            span = [(max(at - 1, 0), min(at + _TOUCHED + 1, len(part.start)))]
            self._prices[sight] = (
                np.inf if other is None else self._cost(other, span) - self._cost(part, span)
            )
        return self._prices[sight]

    @staticmethod
    def _until_pause(line: KeyLine, i: int) -> int:
        pauses = np.flatnonzero(line.start[i + 1 :] > line.end[i:-1])
        return i + 1 + int(pauses[0]) if len(pauses) else len(line.start)

    def _runs(self, line: KeyLine, k: int) -> Iterator[tuple[int, int]]:
        """Yield the runs of keys that may be shifted to mend a key."""
        n = len(line.start)
        for i in (k + begin for begin in _FROM):
            if not line.frozen <= i < n:
                continue
            ends = {min(i + length, n) for length in _LENGTHS}
            ends.add(self._until_pause(line, i))
            yield from ((i, j) for j in sorted(ends))

    def _cost(
        self, line: KeyLine, spans: Sequence[tuple[int, int]], bound: float = math.inf
    ) -> float:
        """Return the cost of the keys in some spans, or of the first ones once above a bound."""
        cost = 0.0
        for span in spans:
            cost += float(self._costs(line, *span).sum())
            if cost >= bound:
                break
        return cost

    def _shifted(self, line: KeyLine, i: int, j: int, shift: int) -> KeyLine | None:
        """Return the line with keys i to j - 1 shifted, None if there is no room."""
        starts, ends, joined = line.start.item, line.end.item, []
        # At both borders of the shifted keys: contiguous keys stay so, the neighbour grows or
        # shrinks; a gap keeps its pause, and does not change between a rest and none.
        for edge, wider in ((i, shift), (j, -shift)):
            if not 0 < edge < len(line.start):
                continue
            gap = starts(edge) - ends(edge - 1)
            if gap == 0 and not line.pause.item(edge) and edge > line.frozen:
                if starts(edge) - starts(edge - 1) + wider < line.least.item(edge - 1):
                    return None
                joined.append(edge)
                continue
            new = gap + wider
            if new < line.pause.item(edge) or (new >= self._rest) != (gap >= self._rest):
                return None
            if self._rest <= new < self._room:
                return None
        start = line.start.copy()
        moved = start[i:j]
        moved += shift
        if np.count_nonzero((moved < line.early[i:j]) | (moved > line.late[i:j])):
            return None
        end = line.end.copy()
        end[i:j] += shift
        for edge in joined:
            end[edge - 1] = start[edge]
        # As `replace`, in half its time.
        return KeyLine(
            start, end, line.early, line.late, line.least, line.pause, line.key, line.lag,
            line.more, line.frozen,
        )  # fmt: skip

    def _costs(self, line: KeyLine, first: int, last: int) -> FloatArray:
        """Return the costs of some keys: those that are not seen, and too fast ones."""
        held, peak = self._look(line, first, last)
        spread = math.sqrt(2.0) * self._spread_s
        costs = []
        # Numbers one by one: mostly four to six keys, for which arrays take three times as long.
        for seen, fast in zip((held + line.more[first:last]).tolist(), peak.tolist(), strict=True):
            unseen = 0.5 * math.erfc(-(WANTED_S - seen) / spread)
            unseen += 0.5 * math.erfc(-(HELD_S - seen) / spread)
            uneasy = _EASE * max(_EASY_S - seen, 0.0) / _EASY_S + max(HELD_S - seen, 0.0) / HELD_S
            costs.append(unseen + uneasy + _TOO_FAST * max(fast - _FASTEST_M_S, 0.0))
        return np.array(costs)

    def _look(self, line: KeyLine, first: int, last: int) -> tuple[FloatArray, FloatArray]:
        """Return how long some keys are seen, seconds, and how fast the knuckles are, m/s.

        A fifth of the looks are at keys that were looked at before.
        """
        low, high = max(first - _AROUND, 0), min(last + _AROUND, len(line.start))
        part, inner = slice(low, high), slice(first - low, last - low)
        arrays = line.start, line.end, line.lag, line.key
        same = inner.start, inner.stop, *(x[part].tobytes() for x in arrays)
        if same not in self._looks:
            start, end = (TICK_S * x[part].astype(np.float64) for x in (line.start, line.end))
            target = start + line.lag[part] * (end - start)
            self._looks[same] = self._sight.look(
                start, end, target, line.key[part],
                rest_gap_s=self._rest_gap_s, asked=(inner.start, inner.stop),
            )  # fmt: skip
        held, peak = self._looks[same]
        return held[inner], peak[inner]


def _near(i: int, j: int, n: int) -> list[tuple[int, int]]:
    """Return the spans of keys, of n, whose sight changes when keys i to j - 1 are shifted."""
    one, other = ((max(edge - _TOUCHED, 0), min(edge + _TOUCHED, n)) for edge in (i, j))
    return [one, other] if one[1] <= other[0] else [(one[0], other[1])]
