"""Closed loop from the graded quality to the level of the mark.

In: a stretch of the programme at any base level; out: the stretch at the base
level that gives the programme the wanted grade. Superframes stand above or below the base by what
they need to come through, so stretches differ in grade: it is the running passage that has the
wanted one. A stretch that would be much worse is written more softly or not at all. The loop
forgets, and its memory is constant.
Specification: spec/audio-carrier.md, W20 leaves the choice of levels to the embedder.
"""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.audio.signal.profile import FS, LEVELS
from watermark.quality import PeaqMeter
from watermark.quality.peaq import WHOLE

START_BASE = 7.5
"""Base level that is tried first."""

GRADES_PER_LEVEL = 0.28
"""Loss of grade that one level (1.5 dB) costs near the grades of interest."""

TRIALS = 5
"""Attempts at one stretch."""

CLOSE_ENOUGH = 0.08
"""Error of the grade that the first stretch may keep."""

GIVE_UP = 0.6
"""A stretch that grades this much below the wanted grade is written more softly, and left unmarked
if that does not help at the lowest level."""

QUIET_GRADE = -0.15
"""Grade aimed at where a rehearsal says that it is enough: hardly anybody hears that. With -0.12
thirteen such clips lost 142 of 481 superframes through AAC, MP3 and AAC, with this 112."""

STRIVING, STRIVING_LIMITS = 0.5, (-0.15, 0.05)
"""Part of what levels lack that the next stretch's grade makes good, and its limits."""

BASE_LIMITS = (-4.0, len(LEVELS) + 3.0)
"""Beyond these all superframes have the lowest or the highest level."""

QUIETEST = -math.inf
"""Base level at which all superframes have the lowest level, even those that need more."""

MOVE_LIMITS = (-1.5, 1.5)
"""Greatest changes of the base between stretches, in levels."""


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
    """An attempt, its base, the meter that has heard it, and its own grade, None for silence."""

    made: T
    base: float | None
    meter: PeaqMeter
    grade: float | None


PASSAGE = 16
"""Stretches of a passage: 41 s."""

HALVES, OWN = ("even", "odd"), "own"
"""Names of the meter's averages: two that begin half a passage apart, and a stretch's own."""

MAKE_GOOD = 6.0
"""How many times a passage's error of grade the next stretch makes good beyond its own share, once
half a passage has been heard; before, less by the square of the missing part."""

OVERDRAWN = 3.0
"""Factor of a passage's deficit to the lowest grade that is taken from superframes that stand out:
with 6 a clip whose grade is short lost twice the superframes, with 0 it ended 0.03 lower."""

DEFICIT, YOUNG_DEFICIT = 0.02, 0.1
"""Deficit up to which that is all, and how much more a passage may have that has just begun: beyond
it, a stretch that grades below the lowest grade is written more softly until either grades higher.
Feeding the deficit back instead left a clip at -0.46 and six of its superframes lost."""

LEAST_STEP, USELESS = 0.25, 1.5
"""Least step of such an attempt, and levels below the wanted one beyond which superframes fail all
the same, as through a named coder that leaves too little: the stretch is then written as without
it, so that later ones have their level, instead of all being short by as much."""

SPOILT = 0.03
"""Loss of a whole passage's grade by a single stretch that has it written more softly: the grade
counts the worst moment by itself."""

RIPE = 0.25
"""Least maturity for that: a quarter of a passage."""

SOFTER, MOST_STEPS = 0.75, 3
"""Step of that trial in levels, and the number of steps. One takes about half of such a loss: the
median of 15 in the 120 s of the bench's programme."""


class _Passage:
    """Running grade and mean base of the last half to whole passage, by one meter that runs on."""

    def __init__(self, channels: int) -> None:
        self._meter = PeaqMeter(FS, channels)
        for name in HALVES:
            self._meter.begin(name)
        self._bases: dict[str, list[float]] = {name: [] for name in HALVES}
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

    @property
    def count(self) -> int:
        """Stretches in it with the next one."""
        return len(self._bases[self._older]) + 1

    def grade(self, meter: PeaqMeter) -> float | None:
        """Grade with a meter's last stretch, None for silence."""
        return _odg(meter, self._older)

    def loss(self, meter: PeaqMeter) -> float:
        """Grade that a meter's last stretch has cost a passage, 0 where that is not known yet."""
        grade = _odg(meter, self._older)
        if self.maturity < RIPE or self.last is None or grade is None:
            return 0.0
        return self.last - grade

    def tried(self, attempt: Attempt) -> tuple[PeaqMeter, float | None]:
        """Let a copy of the meter hear an attempt; give it and the attempt's own grade."""
        meter = copy.deepcopy(self._meter)
        meter.begin(OWN)
        meter.process(attempt.clean, attempt.marked)
        return meter, _odg(meter, OWN)

    def add(self, meter: PeaqMeter, base: float) -> float | None:
        """Go on from the attempt that was chosen; return the passage's grade, None for silence."""
        self._meter = meter
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
    """Chooses the base level that keeps a grade.

    Parameters
    ----------
    target : float
        Objective difference grade to aim at, -4 to 0.
    channels : int
        1 or 2 channels that are listened to.
    quiet : bool
        Aim at a better grade where `strive` allows it.

    Attributes
    ----------
    base : float
        Base level of the next stretch.
    """

    def __init__(self, target: float, channels: int, *, quiet: bool = False) -> None:
        if not -4 < target < 0:
            raise CueError(f"grade {target} to aim at is not within -4..0")
        self._wanted = target
        self._best = max(target, QUIET_GRADE) if quiet else target
        self._target = target
        self.base = START_BASE
        self._passage = _Passage(channels)
        self._started = False

    @property
    def grade(self) -> float | None:
        """Grade of the programme so far, None for silence."""
        return self._passage.whole

    def settle(
        self,
        attempt: Callable[[float | None], T],
        *,
        enough: float | None = None,
        least: float = -math.inf,
    ) -> T:
        """Return the attempt that serves the wanted grade.

        Parameters
        ----------
        attempt : callable
            Gives the stretch at a base level, which may be `QUIETEST`, and unmarked for None; the
            same object again where that changes nothing.
        enough : float, optional
            Base level that suffices; a better grade is aimed at where it is below that of the
            wanted one.
        least : float
            Base level below which superframes would fail: only a stretch that grades far too low
            by itself is written more softly.
        """
        last: _HeardAttempt[T] | None = None

        def hear(base: float | None) -> _HeardAttempt[T]:
            nonlocal last
            made = attempt(base)
            if last is not None and made is last.made:
                last = replace(last, base=base)
            else:
                last = _HeardAttempt(made, base, *self._passage.tried(made))
            return last

        chosen = hear(self.base)
        if (grade := chosen.grade) is not None:
            # The first stretch searches for its level; later ones follow what was learnt, and are
            # softened only where they miss the grade by far.
            if not self._started:
                chosen = self._begin(hear, chosen, grade)
                if enough is not None and enough < self.base and self._best > self._wanted:
                    chosen = self._begin_softly(hear, chosen, enough)
            elif grade < self._wanted - GIVE_UP:
                chosen = self._soften(hear, grade)
            self._started = True
            # Last resort: step down until the passage is no more spoilt, but never below `least`.
            softest = max(self.base - SOFTER * MOST_STEPS, least)
            while (base := chosen.base) is not None and base > softest:
                if (loss := self._spoilt(chosen)) <= SPOILT:
                    break
                steps = max(round(math.log2(loss / SPOILT)), 1)
                chosen = hear(max(base - SOFTER * steps, softest))
            if enough is not None:
                chosen = self._forgo(hear, chosen, enough)
            chosen = self._bound(hear, chosen, least)
        passage = self._passage.add(chosen.meter, self.base)
        if passage is not None and grade is not None:
            self._learn(passage)
        self.base = max(self.base, least)
        return chosen.made

    @property
    def overdrawn(self) -> float:
        """Levels by which the passage stands too high for the lowest grade, 0 if it does not."""
        last = self._passage.last
        short = 0.0 if last is None else max(self._wanted - last, 0.0)
        return self._passage.maturity * OVERDRAWN * short / GRADES_PER_LEVEL

    def lack(self, enough: float) -> float:
        """Levels that a passage lacks though it has the lowest grade, below 0 if none."""
        return enough - self.base if self._target <= self._wanted + CLOSE_ENOUGH else -math.inf

    def strive(self, lack: float) -> None:
        """Aim at another grade, better or as far as the wanted one, where levels lack or exceed."""
        change = float(np.clip(-STRIVING * GRADES_PER_LEVEL * lack, *STRIVING_LIMITS))
        self._target = min(max(self._target + change, self._wanted), self._best)

    def _spoilt(self, heard: _HeardAttempt[T]) -> float:
        """Return what a stretch takes from the passage's grade by itself being below it."""
        low = heard.grade is not None and heard.grade < self._target
        return self._passage.loss(heard.meter) if low else 0.0

    def _forgo(
        self,
        hear: Callable[[float | None], _HeardAttempt[T]],
        chosen: _HeardAttempt[T],
        enough: float,
    ) -> _HeardAttempt[T]:
        """Lower the base at once where a stretch that has more than enough grades too low."""
        for _ in range(TRIALS):
            base, grade = chosen.base, chosen.grade
            if base is None or grade is None or grade >= self._wanted or base <= enough:
                break
            lowered = max((self._wanted - grade) / GRADES_PER_LEVEL, LEAST_STEP)
            self.base = max(base - lowered, enough)
            chosen = hear(self.base)
        return chosen

    def _bound(
        self,
        hear: Callable[[float | None], _HeardAttempt[T]],
        chosen: _HeardAttempt[T],
        least: float,
    ) -> _HeardAttempt[T]:
        """Write a stretch more softly until it, or the passage with it, grades high enough."""
        count = self._passage.count
        youth = 1 - min(2 * count / PASSAGE, 1.0)
        allowed = self._wanted - DEFICIT - YOUNG_DEFICIT * youth
        for _ in range(TRIALS):
            passage = self._passage.grade(chosen.meter)
            if chosen.base is None or chosen.grade is None or passage is None:
                break
            short = min((allowed - passage) * count, self._wanted - chosen.grade)
            if short <= 0 or math.isinf(chosen.base):
                break
            lowered = self.base - chosen.base + max(short / GRADES_PER_LEVEL, LEAST_STEP)
            if lowered > USELESS:
                lowered = max(lowered, least - START_BASE)
            chosen = hear(self.base - lowered)
        return chosen

    def _learn(self, passage: float) -> None:
        """Set the base so that the passage comes to its grade."""
        error = (passage - self._target) / GRADES_PER_LEVEL
        wanted = self._passage.mean_base + (1 + MAKE_GOOD * self._passage.maturity) * error
        move = np.clip(wanted - self.base, *MOVE_LIMITS)
        self.base = float(np.clip(self.base + move, *BASE_LIMITS))

    def _begin(
        self,
        hear: Callable[[float | None], _HeardAttempt[T]],
        chosen: _HeardAttempt[T],
        grade: float,
    ) -> _HeardAttempt[T]:
        """Find the base of the first stretch."""
        for _ in range(TRIALS):
            error = grade - self._target
            if abs(error) < CLOSE_ENOUGH or (error > 0 and self.base == BASE_LIMITS[1]):
                return chosen
            self.base = float(np.clip(self.base + error / GRADES_PER_LEVEL, *BASE_LIMITS))
            chosen = hear(self.base)
            grade = chosen.grade or 0.0
        return self._soften(hear, grade) if grade < self._wanted - GIVE_UP else chosen

    def _begin_softly(
        self,
        hear: Callable[[float | None], _HeardAttempt[T]],
        chosen: _HeardAttempt[T],
        enough: float,
    ) -> _HeardAttempt[T]:
        """Find the base at which the first stretch has the best grade, but not below `enough`."""
        self._target = self._best
        chosen = self._begin(hear, chosen, chosen.grade or 0.0)
        if self.base < enough:
            self.base = enough
            chosen = hear(enough)
            self._target = min(max(chosen.grade or 0.0, self._wanted), self._best)
        return chosen

    def _soften(
        self, hear: Callable[[float | None], _HeardAttempt[T]], grade: float
    ) -> _HeardAttempt[T]:
        """Write a stretch that grades far too low at a lower base, or not at all."""
        base = self.base
        for _ in range(TRIALS):
            base -= max(1.0, (self._wanted - GIVE_UP / 2 - grade) / GRADES_PER_LEVEL)
            chosen = hear(base)
            grade = chosen.grade or 0.0
            if grade >= self._wanted - GIVE_UP:
                return chosen
        return self._last_resort(hear)

    def _last_resort(self, hear: Callable[[float | None], _HeardAttempt[T]]) -> _HeardAttempt[T]:
        """Write a stretch at the lowest level, whatever it needs; if that is heard, not at all."""
        chosen = hear(QUIETEST)
        return hear(None) if (chosen.grade or 0.0) < self._wanted - GIVE_UP else chosen
