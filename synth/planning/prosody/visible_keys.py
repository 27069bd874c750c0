"""Keys that are timed, put on the bitstream's grid and moved so that each is seen.

The timing optimiser moves them by a quick model of a key's visibility. Those that a performance
by the chosen cuer then shows too short are moved again, by that measurement.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.analysis.readability import HELD_S
from codec.cuer.movement import FLOWING
from codec.cues.cueing import CueingOptions, cue
from codec.cues.score import Phone
from synth.planning.prosody.simulation import PerformanceSimulation, SimulatedPerformance
from synth.planning.prosody.timing_optimiser import WANTED_S, KeyLine, TimingOptimiser

FloatArray = NDArray[np.float64]

GRID_HZ = 50
"""Ticks of the bitstream's grid in a second."""

SAME_S = 1e-9
"""Seconds within which times count as the same: what rounding leaves."""

_LOOKS = 6
"""How often the keys are settled again by the performance."""

_VAIN = 2
"""Looks in a row that gain nothing, after which no other is taken. On programmes of 120 and
148 s that spared 8 of 35 looks, and one key was seen 5 ms shorter than after six."""

_SURE_S = WANTED_S + 0.015
"""So long a key should be seen in a performance: coding changes it by 13 ms (standard deviation,
profile `standard`)."""

_CAUTION_S = 0.005
"""By how much less is counted on for a key, each time that it was seen too short."""

_LEAST_TICKS = 2
"""Ticks that a phone keeps."""

_KNOWN_KEYS = 4
"""Keys of the block before that still matter."""


@dataclass(frozen=True, slots=True)
class Keys:
    """Keys of the words that stay, N of them.

    Attributes
    ----------
    members : list of list of (int, int)
        Word and phone numbers of each key.
    first : ndarray, shape (N,)
        When the speaker says it, seconds.
    least, pause : ndarray, shape (N,)
        Shortest length of the key, and of the pause before it, seconds.
    said : ndarray, shape (N,)
        How long the speaker takes for it, seconds.
    consonant : ndarray, shape (N,)
        Share of the consonant in keys of two phones.
    key : ndarray of int64, shape (N,)
        Key numbers, 6 shape + placement.
    symbols : list of list of str
        The phones of each key.
    """

    members: list[list[tuple[int, int]]]
    first: FloatArray
    least: FloatArray
    pause: FloatArray
    said: FloatArray
    consonant: FloatArray
    key: NDArray[np.int64]
    symbols: list[list[str]]

    @property
    def work(self) -> FloatArray:
        """Shortest way from the start of each key to that of the next, (N,)."""
        return np.asarray(self.least + np.append(self.pause[1:], 0.0))

    @property
    def parts(self) -> FloatArray:
        """How much of the spare time goes to each key and to the pause after it, (N,)."""
        return np.asarray(1.0 + (np.append(self.pause[1:], 0.0) > 0))


@dataclass(frozen=True, slots=True)
class Said:
    """The last words: keys on the grid, and the phones of these keys.

    Attributes
    ----------
    line : KeyLine, optional
        None before the first key.
    phones : tuple of Phone
    """

    line: KeyLine | None = None
    phones: tuple[Phone, ...] = ()


class VisibleKeys:
    """Moves the keys of a block so that each is seen.

    Parameters
    ----------
    keys : Keys
    options : CueingOptions
        Which gaps send the hand to rest, and the chart of the code.
    before : Said
        What these keys come after; it stays as it is.
    mirror : PerformanceSimulation
        Of who is to cue.
    least_s : float
        Least duration of a key.
    """

    def __init__(
        self,
        keys: Keys,
        options: CueingOptions,
        before: Said,
        mirror: PerformanceSimulation,
        least_s: float,
    ) -> None:
        self._keys, self._options, self._before = keys, options, before
        self._mirror, self._least = mirror, int(np.ceil(GRID_HZ * least_s - SAME_S))
        self._performed: SimulatedPerformance | None = None

    def settled(
        self, start: FloatArray, end: FloatArray, early: FloatArray, late: FloatArray
    ) -> tuple[FloatArray, FloatArray, Said]:
        """Return start and length of each key, moved to be visible, and the words then said.

        Parameters
        ----------
        start, end : ndarray, shape (N,)
            As planned, seconds.
        early, late : ndarray, shape (N,)
            Bounds of the starts, seconds.
        """
        line = self._best(self._line(start, end, early, late))
        fresh = slice(line.frozen, None)
        start, end = line.start[fresh] / GRID_HZ, line.end[fresh] / GRID_HZ
        last = line[max(len(line.start) - _KNOWN_KEYS, 0) :]
        phones = [*self._before.phones, *itertools.chain(*self._phones(start, end))]
        since_s = last.start[0] / GRID_HZ - SAME_S
        return start, end - start, Said(last, tuple(p for p in phones if p.start >= since_s))

    def _best(self, plain: KeyLine) -> KeyLine:
        """Return the line that a performance shows best, never one that is worse than `plain`.

        A performance differs from the model's visibility key by key; optimising goes on from
        the difference.
        """
        settler = TimingOptimiser(self._mirror.sight, self._options)
        line = settler.settled(plain)
        held = self._held(line)
        best, most = line, held
        caution, vain = np.zeros(len(held)), 0
        for _ in range(_LOOKS):
            short = held < _SURE_S - SAME_S
            if not short.any() or vain == _VAIN:
                break
            caution += _CAUTION_S * short
            more = line.more.copy()
            # `more` corrects the model by what the performance showed, with some caution for keys
            # still short.
            more[line.frozen :] = held - settler.seen(line) - caution
            line = settler.settled(replace(line, more=more), np.flatnonzero(short))
            held = self._held(line)
            vain += 1
            if _worth(held) > _worth(most):
                best, most, vain = line, held, 0
        if most.min() < _SURE_S - SAME_S and _worth(self._held(plain)) > _worth(most):
            return plain
        return best

    def _line(
        self, start: FloatArray, end: FloatArray, early: FloatArray, late: FloatArray
    ) -> KeyLine:
        """Return keys in ticks, after those of the block before."""
        keys = self._keys
        phones = np.array([len(members) for members in keys.members])
        least = np.maximum(_LEAST_TICKS * phones, self._least)
        pause = np.ceil(GRID_HZ * keys.pause - SAME_S).astype(np.int64)
        begins, ends = (np.round(GRID_HZ * x).astype(np.int64) for x in (start, end))
        # In whole ticks: begin[k] >= begin[k - 1] + least[k - 1] + pause[k].
        for k in range(1, len(begins)):
            begins[k] = max(begins[k], begins[k - 1] + least[k - 1] + pause[k])
        ends[:-1] = np.where(
            pause[1:] > 0, np.minimum(ends[:-1], begins[1:] - pause[1:]), begins[1:]
        )
        line = KeyLine(
            start=begins,
            end=np.maximum(ends, begins + least),
            early=np.ceil(GRID_HZ * early - SAME_S).astype(np.int64),
            late=np.floor(GRID_HZ * late + SAME_S).astype(np.int64),
            least=least,
            pause=pause,
            key=keys.key,
            lag=np.where(phones > 1, FLOWING.lag_share * keys.consonant, 0.0),
            more=np.zeros(len(begins)),
        )
        before = self._before.line
        return line if before is None else line.after(before)

    def _held(self, line: KeyLine) -> FloatArray:
        """Return how long the keys of a line are held in a performance, seconds."""
        fresh = slice(line.frozen, None)
        phones = self._phones(line.start[fresh] / GRID_HZ, line.end[fresh] / GRID_HZ)
        told = [*self._before.phones, *itertools.chain(*phones)]
        keys = tuple(cue(told, self._options))
        if not keys:
            return np.zeros(0)
        self._performed = self._mirror.performed(told, keys, self._performed)
        held = self._performed.held_s
        return held[len(held) - len(phones) :]

    def _phones(self, start: FloatArray, end: FloatArray) -> list[list[Phone]]:
        """Return the phones of each key."""
        found = spans(self._keys, start, end - start)
        return [
            [Phone(symbol, *found[at]) for symbol, at in zip(symbols, members, strict=True)]
            for symbols, members in zip(self._keys.symbols, self._keys.members, strict=True)
        ]


def _worth(held: FloatArray) -> float:
    """Return the worth of a performance that shows each key for `held` seconds."""
    seen = (held >= HELD_S - SAME_S).sum() + (held >= WANTED_S - SAME_S).sum()
    return float(seen + np.clip(held / _SURE_S, 0.0, 1.0).sum())


def spans(
    keys: Keys, start: FloatArray, length: FloatArray
) -> dict[tuple[int, int], tuple[float, float]]:
    """Return start and end of each phone on the grid.

    Parameters
    ----------
    keys : Keys
    start, length : ndarray, shape (N,)
        Of each key, seconds.

    Returns
    -------
    dict
        Start and end, seconds, by word and phone number.
    """
    found: dict[tuple[int, int], tuple[float, float]] = {}
    step = -(1 << 40)
    for k, members in enumerate(keys.members):
        end = start[k] + length[k]
        if k + 1 < len(start) and not keys.pause[k + 1]:
            end = start[k + 1]
        bounds = np.linspace(start[k], end, len(members) + 1)
        if len(members) == 2:
            bounds[1] = start[k] + keys.consonant[k] * (end - start[k])
        step = max(step, round(bounds[0] * GRID_HZ))
        for member, bound in zip(members, bounds[1:].tolist(), strict=True):
            after = max(step + 1, round(bound * GRID_HZ))
            found[member] = step / GRID_HZ, after / GRID_HZ
            step = after
        if k + 1 < len(start) and keys.pause[k + 1]:
            step += 1
    return found
