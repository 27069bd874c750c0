"""Spreading: the bytes of a file over its superframes, where they lower the error most.

Superframes of a file need not have one size. They take one step, and for as many as the limit
allows the next wider one, so that a bit is worth the same everywhere. The score is told once for
all; corrections of the voice's targets travel with it where they pay.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from codec.bitstream.allocation import Choice, choose, content_at, weigh
from codec.bitstream.analysis import Analysis, block_at
from codec.bitstream.bits import PLAIN, SCORE, SEQUENCES, Header
from codec.bitstream.coding import Coding
from codec.bitstream.decoder import likely_block, residual_of
from codec.bitstream.file_score import Told, trimmed, write_told
from codec.bitstream.fitting import NOMINAL_MM, fits
from codec.bitstream.joining import Joined, join_line
from codec.bitstream.learning import Gain, Learner
from codec.bitstream.payload import payload_of
from codec.bitstream.plan import Plan, plan_of
from codec.bitstream.quantise import (
    NO_RESIDUAL,
    NOTHING_SENT,
    STEPS,
    WEIGHT,
    Setting,
    width_mm,
)
from codec.bitstream.resynthesis.whole import WholeResynthesis
from codec.bitstream.score_coding import part_of
from codec.cuer.layout import MARKERS
from codec.cuer.motion import Motion
from codec.cues.cueing import CueingOptions
from codec.cues.timeline import TICKS, Line, to_line
from codec.errors import CueError

Array = NDArray[np.float64]
Size = Callable[[bytes], int]

_GOLDEN = (5**0.5 - 1) / 2
"""Golden section: it orders superframes so that every beginning is spread evenly."""

_NEAR = 2
"""Steps by which the right one may be off for what was chosen to stay."""

_COARSE = 24
"""Step at which superframes are weighed before the right one is known."""


_CLEAR = 0.85
"""Part of the prediction's error that learning has to leave for it to be taken untried."""

_PAYS = 0.97
"""Part of the squared error without it that a score has to stay below: models are not linear."""

_SPARE_PART = 250
"""Part of a file's room that may stay empty."""

_FILLINGS = 4
"""Times that a file is filled to its room, each time with what the last one left."""


@dataclass(frozen=True, slots=True)
class Spread:
    """What a file says.

    Attributes
    ----------
    told : bytes
        What it says once.
    payloads : list of bytes
        Those of its superframes.
    """

    told: bytes
    payloads: list[bytes]


@dataclass(frozen=True, slots=True)
class _Part:
    """A superframe, ready to be told at any step."""

    plan: Plan
    choice: Choice

    def setting(self, step: int) -> Setting:
        """Return how it uses its prediction at a step: whole, if nothing but that is told."""
        analysis = self.plan.analysis
        if step == NO_RESIDUAL:
            return NOTHING_SENT
        return Setting(step, 0, 0, analysis.course, analysis.shift, analysis.shares)


def line_of(line: Line, indices: range, options: CueingOptions) -> Joined:
    """Return the whole score of a file, joined."""
    around = range(indices.start - 1, indices.stop + 1)
    return join_line(line, {k: part_of(line, k, options) for k in around})


class _Take:
    """A motion that is to be spread, with its score or without.

    Parameters
    ----------
    motion : Motion
    coding : Coding
    indices : range
    options : CueingOptions
    """

    def __init__(
        self, motion: Motion, coding: Coding, indices: range, options: CueingOptions
    ) -> None:
        self.indices, self.coding = indices, coding
        self.blocks = np.stack([block_at(motion, index) for index in indices])
        self._told = Told(None, options, learning=False)
        self._joined: Joined | None = None
        self._moved: WholeResynthesis | None = None
        if motion.score is not None:
            line = trimmed(to_line(motion.score, options), indices)
            self._told = replace(self._told, line=line)
            self._joined = line_of(line, indices, options)

    def without_score(self) -> "_Take":
        """Return the same take without its score."""
        other = copy.copy(self)
        other._joined = None
        return other

    def plain(self) -> "_Version":
        """Return the motion without its score."""
        return _Version(self, replace(self._told, line=None), None)

    def scored(self, *, learning: bool) -> "_Version":
        """Return the motion with its score, if it has one."""
        if self._joined is None:
            return self.plain()
        if self._moved is None:
            self._moved = WholeResynthesis(self._joined, self.coding.targets)
        return _Version(self, replace(self._told, learning=learning), self._moved)


class _Version:
    """A take with one prediction: bits and squared errors of its superframes at any step."""

    def __init__(self, take: _Take, told: Told, moved: WholeResynthesis | None) -> None:
        self._take, self._moved, self._learning = take, moved, told.learning
        self.told = write_told(told, take.indices)
        self._parts: list[_Part] = []
        self._known: dict[int, tuple[Array, Array]] = {}
        self._gain: Gain | None = None

    def _learner(self) -> Learner | None:
        return None if self._moved is None else Learner(self._moved, self._take.coding)

    def prepare(self, step: int, width: float = NOMINAL_MM) -> None:
        """Choose how each superframe is told, for a step and near ones.

        What is learnt by then is learnt of the motion itself, of which little is lost.
        """
        take, bases, learner = self._take, self._take.coding.bases, self._learner()
        self._known.clear()
        self._parts = []
        for block, index in zip(take.blocks, take.indices, strict=True):
            tried = [
                _Part(plan_of(analysis, {}), choose(analysis, bases, step))
                for analysis in self._analyses(block, index, width, learner)
            ]
            self._parts.append(
                min(tried, key=lambda part: self._weight(part, step)) if tried[1:] else tried[0]
            )
            if learner is not None and self._learning:
                learner.take(index, block)
        self._gain = None if learner is None else learner.gain

    @property
    def clearly_gains(self) -> bool:
        """Whether there is no doubt that learning pays."""
        gain = self._gain
        return gain is not None and self._learning and gain.learnt < _CLEAR * gain.bare

    def _weight(self, part: _Part, step: int) -> float:
        bits, squares = weigh(part.plan.analysis, part.choice, self._take.coding.bases, step)
        return squares / width_mm(step) ** 2 + WEIGHT * (bits + part.plan.bits)

    def _analyses(
        self, block: Array, index: int, width: float, learner: Learner | None
    ) -> list[Analysis]:
        """Return the ways in which a superframe can use its prediction."""
        coding = self._take.coding
        header = Header(PLAIN if learner is None else SCORE, index % SEQUENCES, 0)
        bare = Analysis(index, header, None, False, {}, (), block - coding.mean)
        if learner is None:
            return [bare]
        return [
            replace(
                bare, lacking=fitted.lacking, course=fitted.course, shift=fitted.shift,
                shares=fitted.shares,
            )
            for fitted in fits(block, partial(learner.params, index), coding, width)
        ]  # fmt: skip

    def at(self, step: int) -> tuple[Array, Array]:
        """Return bits and squared errors at a step, shape (n,) each."""
        if step not in self._known:
            bases = self._take.coding.bases
            rows = [weigh(p.plan.analysis, p.choice, bases, step) for p in self._parts]
            bits, squares = np.array(rows).T
            self._known[step] = bits + [p.plan.bits for p in self._parts], squares
        return self._known[step]

    def worth(self, step: int) -> float:
        """Return what all costs at a step: squared errors in steps, and bits."""
        bits, squares = self.at(step)
        whole = float(bits.sum()) + 8 * len(self.told)
        return float(squares.sum()) / width_mm(step) ** 2 + WEIGHT * whole

    def steps(self, within: Callable[[Array, Array], bool], *, finest: bool) -> NDArray[np.int64]:
        """Return the finest steps that keep a size, or the widest that keep an error.

        Parameters
        ----------
        within : callable
            Says of bits and squared errors whether they keep the limit.
        finest : bool
            Whether finer steps break the limit, else wider ones.
        """
        low, high = 0, NO_RESIDUAL
        while low < high:
            middle = (low + high + (not finest)) // 2
            if within(*self.at(middle)) == finest:
                low, high = (low, middle) if finest else (low, middle - 1)
            else:
                low, high = (middle + 1, high) if finest else (middle, high)
        steps = np.full(len(self._parts), low)
        other = low - 1 if finest else low + 1
        if not 0 <= other < STEPS:
            return steps
        # Spread evenly by the golden section, in whatever number.
        order = np.argsort(np.arange(len(steps)) * _GOLDEN % 1.0)
        few, many = 0, len(steps)
        while few < many:
            middle = (few + many + 1) // 2
            if within(*self._mixed(low, other, order[:middle])):
                few = middle
            else:
                many = middle - 1
        steps[order[:few]] = other
        return steps

    def _mixed(self, step: int, other: int, where: NDArray[np.int64]) -> tuple[Array, Array]:
        bits, squares = (values.copy() for values in self.at(step))
        for values, more in zip((bits, squares), self.at(other), strict=True):
            values[where] = more[where]
        return bits, squares

    def written(self, steps: NDArray[np.int64]) -> tuple[list[bytes], float]:
        """Return the superframes at steps of their own, and their squared error."""
        coding, learner = self._take.coding, self._learner()
        payloads, squares = [], 0.0
        for part, step, block in zip(self._parts, steps, self._take.blocks, strict=True):
            index = part.plan.analysis.index
            predict = None if learner is None else partial(learner.params, index)
            setting = part.setting(int(step))
            likely = likely_block(setting, predict, coding)
            choice = part.choice
            if self._learning:
                values = coding.bases[choice.basis].forward(block - likely)
                choice = replace(choice, values=values)
            content = content_at(part.plan, coding.bases, choice, int(step))
            payloads.append(payload_of(content, coding.bases))
            done = likely + residual_of(content.setting, content.q, coding)
            squares += float(np.square((done - block) @ coding.residual.matrix).sum())
            if self._learning and learner is not None:
                learner.take(index, done)
        return payloads, squares


def _prepared(version: "_Version", about: Callable[["_Version"], int]) -> int:
    """Choose how superframes are told at about the right step; return it."""
    version.prepare(_COARSE)
    step = about(version)
    if abs(step - _COARSE) > _NEAR:
        version.prepare(step, width_mm(min(step, STEPS - 2)))
    return step


def _better(take: _Take, about: Callable[[_Version], int]) -> _Version:
    """Return the motion with its score, learning what is passed if that is worth it.

    Parameters
    ----------
    take : _Take
    about : callable
        The step that a version will have.
    """
    learning = take.scored(learning=True)
    step = _prepared(learning, about)
    if learning.clearly_gains:
        return learning
    fixed = take.scored(learning=False)
    fixed.prepare(step, width_mm(min(step, STEPS - 2)))
    return min(learning, fixed, key=lambda version: version.worth(step))


def spread_by_error(
    motion: Motion,
    coding: Coding,
    indices: range,
    error_mm: float,
    size: Size,
    *,
    drop: bool,
    options: CueingOptions,
) -> Spread:
    """Return the smallest superframes that keep an error together.

    Parameters
    ----------
    motion : Motion
    coding : Coding
    indices : range
        Superframes that cover it.
    error_mm : float
        RMS over all markers and frames.
    size : callable
        Bytes that a payload takes.
    drop : bool
        Leave the score out if the file is smaller so.
    options : CueingOptions
    """
    take = _Take(motion, coding, indices, options)
    most = error_mm**2 * len(indices) * TICKS * len(MARKERS)

    def within(_: Array, squares: Array) -> bool:
        return float(squares.sum()) <= most

    def about(version: _Version) -> int:
        return int(np.median(version.steps(within, finest=False)))

    def told(version: _Version) -> Spread:
        kept, best = most, None
        for _ in range(_FILLINGS):
            steps = version.steps(lambda _, squares: float(squares.sum()) <= kept, finest=False)  # noqa: B023
            payloads, squares = version.written(steps)
            best = Spread(version.told, payloads)
            if squares <= most:
                break
            kept *= most / squares
        assert best is not None
        return best

    spread = told(_better(take, about))
    if motion.score is None or not drop:
        return spread
    other = told(_better(take.without_score(), about))
    return min(spread, other, key=lambda s: size(s.told) + sum(map(size, s.payloads)))


def spread_by_size(
    motion: Motion,
    coding: Coding,
    indices: range,
    room: int,
    size: Size,
    *,
    drop: bool,
    options: CueingOptions,
) -> Spread:
    """Return the superframes of least error that fit into a number of bytes together.

    Parameters
    ----------
    motion : Motion
    coding : Coding
    indices : range
        Superframes that cover it.
    room : int
        Bytes, of what is said once too.
    size : callable
        Bytes that a payload takes.
    drop : bool
        Leave the score out if the error is less so.
    options : CueingOptions

    Raises
    ------
    CueError
        If they do not fit even without coefficients.
    """
    take = _Take(motion, coding, indices, options)

    def finest(version: _Version, spare: float) -> NDArray[np.int64]:
        left = 8.0 * (room - size(version.told)) - spare
        return version.steps(lambda bits, _: float(bits.sum()) <= left, finest=True)

    def about(version: _Version) -> int:
        return int(np.median(finest(version, _record_bits(len(indices)))))

    def told(version: _Version) -> tuple[Spread, float]:
        spare, found = _record_bits(len(indices)), list[tuple[Spread, float]]()
        for _ in range(_FILLINGS):
            steps = finest(version, spare)
            payloads, squares = version.written(steps)
            over = sum(map(size, payloads)) + size(version.told) - room
            if over <= 0:
                found.append((Spread(version.told, payloads), squares))
            elif (steps == NO_RESIDUAL).all():
                break
            if -room // _SPARE_PART <= over <= 0:
                break
            spare += 8.0 * over
        if not found:
            raise CueError(f"{room} bytes do not hold {len(indices)} superframes")
        return min(found, key=lambda one: one[1])

    if motion.score is None or not drop:
        return told(_better(take, about))[0]
    without = told(_better(take.without_score(), about))
    try:
        spread = told(_better(take, about))
    except CueError:
        return without[0]
    return (spread if spread[1] < _PAYS * without[1] else without)[0]


def _record_bits(count: int) -> float:
    """Return the bits that records take beside their payload's ideal length, about."""
    return 12.0 * count
