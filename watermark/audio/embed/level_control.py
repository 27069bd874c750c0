"""Closed loop from the graded quality to the level of the mark.

In: a stretch of the programme at any base level; out: the stretch at the base
level that gives the programme the wanted grade. Superframes stand above or below the base by what
they need to come through, so stretches differ in grade: it is the running passage that has the
wanted one. A stretch that would be much worse is written more softly or not at all. The loop
forgets, and its memory is constant.
Specification: spec/audio-carrier.md, W20 leaves the choice of levels to the embedder.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from codec.errors import CueError
from watermark.audio.embed.graded_passage import PASSAGE, Attempt, GradedPassage
from watermark.audio.signal.profile import LEVELS
from watermark.quality import PeaqMeter

START_BASE = 7.5
"""Base level that is tried first."""

GRADES_PER_LEVEL = 0.28
"""Loss of grade that one level (1.5 dB) costs near the grades of interest. With this and five steps
and limits below rounded to one digit, a piece of orchestra graded .04 worse."""

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

LARGEST_MOVE = 1.5
"""Greatest change of the base between stretches, in levels."""


T = TypeVar("T", bound=Attempt)


@dataclass(frozen=True, slots=True)
class _HeardAttempt(Generic[T]):
    """An attempt, its base, the meter that has heard it, and its own grade, None for silence."""

    made: T
    base: float | None
    meter: PeaqMeter
    grade: float | None


Hear = Callable[[float | None], _HeardAttempt[T]]
"""Writes a stretch at a base level, see `LevelControl.settle`, and grades it."""

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

SOFTER, MOST_STEPS = 0.75, 3
"""Step of that trial in levels, and the number of steps. One takes about half of such a loss: the
median of 15 in the 120 s of the bench's programme."""


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
        self._passage = GradedPassage(channels)
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
            if self._started:
                chosen = self._soften(hear, chosen)
            else:
                chosen = self._begin(hear, chosen)
                if enough is not None and enough < self.base and self._best > self._wanted:
                    chosen = self._begin_softly(hear, chosen, enough)
            self._started = True
            chosen = self._spare(hear, chosen, least)
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

    def _spare(self, hear: Hear[T], chosen: _HeardAttempt[T], least: float) -> _HeardAttempt[T]:
        """Write a stretch more softly, not below `least`, until it spoils the passage no more."""
        softest = max(self.base - SOFTER * MOST_STEPS, least)

        def lower(heard: _HeardAttempt[T]) -> float | None:
            base, grade = heard.base, heard.grade
            if base is None or base <= softest or grade is None or grade >= self._target:
                return None
            if (loss := self._passage.loss(heard.meter)) <= SPOILT:
                return None
            steps = max(round(math.log2(loss / SPOILT)), 1)
            return max(base - SOFTER * steps, softest)

        return _walk(hear, chosen, lower)

    def _forgo(self, hear: Hear[T], chosen: _HeardAttempt[T], enough: float) -> _HeardAttempt[T]:
        """Lower the base at once where a stretch that has more than enough grades too low."""

        def lower(heard: _HeardAttempt[T]) -> float | None:
            base, grade = heard.base, heard.grade
            if base is None or base <= enough or grade is None or grade >= self._wanted:
                return None
            self.base = max(base - _step(self._wanted - grade), enough)
            return self.base

        return _walk(hear, chosen, lower)

    def _bound(self, hear: Hear[T], chosen: _HeardAttempt[T], least: float) -> _HeardAttempt[T]:
        """Write a stretch more softly until it, or the passage with it, grades high enough."""
        count = self._passage.count
        youth = 1 - min(2 * count / PASSAGE, 1.0)
        allowed = self._wanted - DEFICIT - YOUNG_DEFICIT * youth

        def lower(heard: _HeardAttempt[T]) -> float | None:
            passage = self._passage.grade(heard.meter)
            if heard.base is None or heard.grade is None or passage is None:
                return None
            short = min((allowed - passage) * count, self._wanted - heard.grade)
            if short <= 0 or math.isinf(heard.base):
                return None
            lowered = self.base - heard.base + _step(short)
            if lowered > USELESS:
                lowered = max(lowered, least - START_BASE)
            return self.base - lowered

        return _walk(hear, chosen, lower)

    def _learn(self, passage: float) -> None:
        """Set the base so that the passage comes to its grade."""
        error = (passage - self._target) / GRADES_PER_LEVEL
        wanted = self._passage.mean_base + (1 + MAKE_GOOD * self._passage.maturity) * error
        move = np.clip(wanted - self.base, -LARGEST_MOVE, LARGEST_MOVE)
        self.base = float(np.clip(self.base + move, *BASE_LIMITS))

    def _begin(self, hear: Hear[T], chosen: _HeardAttempt[T]) -> _HeardAttempt[T]:
        """Find the base of the first stretch."""

        def nearer(heard: _HeardAttempt[T]) -> float | None:
            error = (heard.grade or 0.0) - self._target
            if abs(error) < CLOSE_ENOUGH or (error > 0 and self.base == BASE_LIMITS[1]):
                return None
            self.base = float(np.clip(self.base + error / GRADES_PER_LEVEL, *BASE_LIMITS))
            return self.base

        return self._soften(hear, _walk(hear, chosen, nearer))

    def _begin_softly(
        self, hear: Hear[T], chosen: _HeardAttempt[T], enough: float
    ) -> _HeardAttempt[T]:
        """Find the base at which the first stretch has the best grade, but not below `enough`."""
        self._target = self._best
        chosen = self._begin(hear, chosen)
        if self.base < enough:
            self.base = enough
            chosen = hear(enough)
            self._target = min(max(chosen.grade or 0.0, self._wanted), self._best)
        return chosen

    def _soften(self, hear: Hear[T], chosen: _HeardAttempt[T]) -> _HeardAttempt[T]:
        """Write a stretch that grades far too low at a lower base.

        If that does not help, at the lowest level, whatever it needs, or not at all.
        """
        lowest = self._wanted - GIVE_UP

        def lower(heard: _HeardAttempt[T]) -> float | None:
            grade = heard.grade or 0.0
            if heard.base is None or grade >= lowest:
                return None
            return heard.base - max(1.0, (lowest + GIVE_UP / 2 - grade) / GRADES_PER_LEVEL)

        chosen = _walk(hear, chosen, lower)
        if (chosen.grade or 0.0) < lowest:
            chosen = hear(QUIETEST)
        return hear(None) if (chosen.grade or 0.0) < lowest else chosen


def _step(short: float) -> float:
    """Levels that a grade lacks, and are worth an attempt."""
    return max(short / GRADES_PER_LEVEL, LEAST_STEP)


def _walk(
    hear: Hear[T], heard: _HeardAttempt[T], lower: Callable[[_HeardAttempt[T]], float | None]
) -> _HeardAttempt[T]:
    """Make up to `TRIALS` attempts, each at the base that the one before asks for."""
    for _ in range(TRIALS):
        if (base := lower(heard)) is None:
            break
        heard = hear(base)
    return heard
