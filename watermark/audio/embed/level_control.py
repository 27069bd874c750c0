"""The level of the mark: least audibility subject to a margin through the rehearsed coders.

In: a stretch of the programme as it would sound at any base level, and the base at which its margin
suffices; out: the stretch at the base that solves this. A grade above `QUIET_GRADE` counts as
inaudible, so the base never stands below that of this grade; where the margin asks for more, the
base follows the margin, up to that of the lowest grade allowed. Without a rehearsal that grade is
the aim. Superframes stand above or below the base by what they need to come through, so stretches
differ in grade: it is the running passage that is graded. A stretch that would be much worse is
written more softly or not at all. The loop forgets, and its memory is constant. The effect of each
constant is shown by ``python -m tests.bench.level_constants NAME=VALUE --clips CLIP ...``.
Specification: spec/audio-carrier.md, W20 leaves the choice of levels to the embedder.
"""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.audio.embed.gain_smoothing import GainSmoothing, Moments
from watermark.audio.signal.profile import FS, HOP, LEVELS
from watermark.quality import PeaqMeter
from watermark.quality.peaq import WHOLE

START_BASE = 7.5
"""Base level that is tried first."""

GRADES_PER_LEVEL = 0.28
"""Loss of grade that one level (1.5 dB) costs near the grades of interest."""

TRIALS = 5
"""Attempts at one stretch."""

CLOSE_ENOUGH = 0.3
"""Levels by which the base of the first stretch may be wrong."""

GIVE_UP = 0.6
"""A stretch that grades this much below the wanted grade is written more softly, and left unmarked
if that does not help at the lowest level."""

QUIET_GRADE = -0.12
"""Grade aimed at where a rehearsal says that it is enough: hardly anybody hears that."""

BASE_LIMITS = (-4.0, len(LEVELS) + 3.0)
"""Beyond these all superframes have the lowest or the highest level."""

QUIETEST = -math.inf
"""Base level at which all superframes have the lowest level, even those that need more."""

MOVE_LIMITS = (-1.5, 1.5)
"""Levels by which the base may change between stretches."""


class Attempt(Protocol):
    """A stretch as it would sound."""

    @property
    def clean(self) -> NDArray[np.float64]:
        """The programme's front, shape (n, 1 or 2)."""

    @property
    def marked(self) -> NDArray[np.float64]:
        """The same with its mark."""


T = TypeVar("T", bound=Attempt)


@dataclass(frozen=True, slots=True)
class _HeardAttempt(Generic[T]):
    """An attempt, the meter that has heard it, and its own grade, None for silence."""

    made: T
    meter: PeaqMeter
    grade: float | None


PASSAGE = 16
"""Stretches of a passage: 41 s."""

HALVES, OWN = ("even", "odd"), "own"
"""Names of the meter's averages: two that begin half a passage apart, and a stretch's own."""

MAKE_GOOD = 6.0
"""How many times a passage's error of grade the next stretch makes good beyond its own share, once
half a passage has been heard; before, less by the square of what is missing."""

OVERDRAFT = 0.05
"""How far the grade may fall below the lowest one where a passage lacks a level for the least
margin; in proportion where it lacks less."""

SHORT = 0.06
"""Above the lowest grade by less than this, moments that are noticed most are relieved."""

RELIEVED = 0.01
"""Gain of a stretch's own grade that relief must bring, with as much information as before. Where
levels made up for half of it only, the demonstration lost 2 of 126 superframes, so none."""


class _Passage:
    """Running grade and mean base of the last half to whole passage, by one meter that runs on."""

    def __init__(self, channels: int) -> None:
        self._meter = PeaqMeter(FS, channels)
        for name in HALVES:
            self._meter.begin(name)
        self._bases: dict[str, list[float]] = {name: [] for name in HALVES}
        self._moments = Moments()
        self._count = 0
        self.last: float | None = None
        self.maturity = 0.0

    @property
    def _older(self) -> str:
        return HALVES[(self._count // (PASSAGE // 2)) % 2]

    @property
    def whole(self) -> float | None:
        """Grade of all that was heard so far, None for silence."""
        return _odg(self._meter, WHOLE)

    def grade_with(self, meter: PeaqMeter) -> float | None:
        """Grade of the passage with a meter's last stretch."""
        return _odg(meter, self._older)

    def relief(self, meter: PeaqMeter, samples: int) -> NDArray[np.float64] | None:
        """Gains that soften the most noticeable moments of a meter's last stretch."""
        return self._moments.gains(meter.detections, samples // HOP)

    def tried(self, attempt: Attempt) -> tuple[PeaqMeter, float | None]:
        """Let a copy of the meter hear an attempt; give it and the attempt's own grade."""
        meter = copy.deepcopy(self._meter)
        meter.begin(OWN)
        meter.process(attempt.clean, attempt.marked)
        return meter, _odg(meter, OWN)

    def add(self, meter: PeaqMeter, base: float, samples: int) -> float | None:
        """Go on from the attempt that was chosen; return the passage's grade, None for silence."""
        self._meter = meter
        self._moments.add(meter.detections, samples)
        for bases in self._bases.values():
            bases.append(base)
        older = self._older
        self.mean_base = float(np.mean(self._bases[older]))
        # Squared: a young passage tells little of a programme.
        self.maturity = min(1.0, len(self._bases[older]) / (PASSAGE // 2)) ** 2
        self.last = grade = _odg(meter, older)
        self._count += 1
        if self._count % (PASSAGE // 2) == 0:
            meter.begin(older)
            self._bases[older] = []
            self.last = _odg(meter, self._older)
        return grade


def _odg(meter: PeaqMeter, name: str) -> float | None:
    result = meter.grade(name)
    return None if result is None else float(result.odg)


class LevelControl:
    """Chooses the base level of each stretch.

    Parameters
    ----------
    lowest : float
        Objective difference grade to aim at, -4 to 0; with a rehearsal, the lowest one allowed.
    channels : int
        1 or 2 channels that are listened to.
    quiet : bool
        Whether a rehearsal may allow a better grade.

    Attributes
    ----------
    base : float
        Base level of the stretch that was written last, `START_BASE` before.
    lack : float
        Levels that it lacked for its margin because of the lowest grade, 0 if none.
    """

    def __init__(self, lowest: float, channels: int, *, quiet: bool = False) -> None:
        if not -4 < lowest < 0:
            raise CueError(f"grade {lowest} to aim at is not within -4..0")
        self._lowest, self._rehearsed = lowest, quiet
        self._best = max(lowest, QUIET_GRADE) if quiet else lowest
        self.base, self.lack = START_BASE, 0.0
        self._passage = _Passage(channels)
        self._started = False

    @property
    def grade(self) -> float | None:
        """Grade of the programme so far, None for silence."""
        return self._passage.whole

    def settle(
        self,
        attempt: Callable[[float | None, GainSmoothing | None], T],
        *,
        enough: float | None = None,
        least: float | None = None,
    ) -> T:
        """Return the stretch at the base that serves margin and grade.

        Parameters
        ----------
        attempt : callable
            Gives the stretch at a base level, which may be `QUIETEST`, and unmarked for None;
            with relief where that is given.
        enough, least : float, optional
            Base levels at which the margin suffices, and at which it is the least that may be
            chosen for the sake of the grade; None if unknown.
        """
        relief: GainSmoothing | None = None

        def hear(base: float | None) -> _HeardAttempt[T]:
            made = attempt(base, relief)
            return _HeardAttempt(made, *self._passage.tried(made))

        if self._started and self._passage.last is not None:
            moved = self._solve(self._passage.mean_base, self._passage.last, enough, least)
            self.base += float(np.clip(moved - self.base, *MOVE_LIMITS))
        chosen = hear(self.base)
        if (grade := chosen.grade) is not None:
            if not self._started:
                chosen = self._begin(hear, chosen, enough, least)
                grade = chosen.grade or 0.0
            self._started = True
            base = self.base
            if grade < self._lowest - GIVE_UP:
                chosen = self._soften(hear, grade)
            if (relief := self._relief(chosen)) is not None:
                relieved = hear(base)
                if self._better(relieved, chosen):
                    chosen = relieved
                else:
                    relief = None
        self._passage.add(chosen.meter, self.base, len(chosen.made.clean))
        return chosen.made

    def _solve(self, base: float, grade: float, enough: float | None, least: float | None) -> float:
        """Return the base that serves margin and grade, by a base and the grade that it had."""
        gain = 1 + MAKE_GOOD * self._passage.maturity if self._started else 1.0

        def of(wanted: float) -> float:
            return base + gain * (grade - wanted) / GRADES_PER_LEVEL

        lowest = self._lowest
        if least is not None:
            lowest -= OVERDRAFT * float(np.clip(least - base, 0.0, 1.0))
        highest = float(np.clip(of(lowest), *BASE_LIMITS))
        wanted = of(self._best) if enough is None else max(of(self._best), enough)
        self.lack = max(0.0, wanted - highest) if enough is not None else 0.0
        return float(np.clip(min(wanted, highest), *BASE_LIMITS))

    def _begin(
        self,
        hear: Callable[[float | None], _HeardAttempt[T]],
        chosen: _HeardAttempt[T],
        enough: float | None,
        least: float | None,
    ) -> _HeardAttempt[T]:
        """Find the base of the first stretch."""
        for _ in range(TRIALS):
            base = self._solve(self.base, chosen.grade or 0.0, enough, least)
            if abs(base - self.base) < CLOSE_ENOUGH:
                break
            self.base = base
            chosen = hear(base)
        return chosen

    def _relief(self, heard: _HeardAttempt[T]) -> GainSmoothing | None:
        """Relief to try where a rehearsed stretch and its passage have hardly any grade left."""
        passage = self._passage.grade_with(heard.meter)
        if not self._rehearsed or passage is None or passage > self._lowest + SHORT:
            return None
        if heard.grade is None or heard.grade > self._lowest:
            return None
        gains = self._passage.relief(heard.meter, len(heard.made.clean))
        return None if gains is None else GainSmoothing(gains)

    def _better(self, heard: _HeardAttempt[T], than: _HeardAttempt[T]) -> bool:
        """Whether relief serves the stretch, and its passage not worse."""
        own, passage = heard.grade, self._passage.grade_with(heard.meter)
        own_before, passage_before = than.grade, self._passage.grade_with(than.meter)
        if own is None or own_before is None or passage is None or passage_before is None:
            return False
        return own > own_before + RELIEVED and passage >= passage_before

    def _soften(
        self, hear: Callable[[float | None], _HeardAttempt[T]], grade: float
    ) -> _HeardAttempt[T]:
        """Write a stretch that grades far too low at a lower base, or not at all."""
        base = self.base
        for _ in range(TRIALS):
            base -= max(1.0, (self._lowest - GIVE_UP / 2 - grade) / GRADES_PER_LEVEL)
            chosen = hear(base)
            grade = chosen.grade or 0.0
            if grade >= self._lowest - GIVE_UP:
                return chosen
        return self._last_resort(hear)

    def _last_resort(self, hear: Callable[[float | None], _HeardAttempt[T]]) -> _HeardAttempt[T]:
        """Write a stretch at the lowest level, whatever it needs; if that is heard, not at all."""
        chosen = hear(QUIETEST)
        return hear(None) if (chosen.grade or 0.0) < self._lowest - GIVE_UP else chosen
