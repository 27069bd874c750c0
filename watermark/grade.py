"""Closed loop from the graded quality to the level of the mark.

In: what a stretch of the programme sounds like at any base level; out: the stretch at the base
level that gives the programme the wanted grade. Superframes stand above or below the base by what
they need to come through, so stretches differ in grade: it is the running passage that has the
wanted one. A stretch that would be much worse is written more softly or not at all. The loop
forgets, and its memory is constant. Specification: none, an embedder may choose levels freely.
"""

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.profile import FS, LEVELS, SUPERFRAME
from watermark.quality import PeaqMeter

START_BASE = 8.0
"""Base level that is tried first."""

GRADES_PER_LEVEL = 0.28
"""Loss of grade that one level (1.5 dB) costs near the grades of interest."""

TRIALS = 5
"""Attempts at one stretch."""

CLOSE_ENOUGH = 0.08
"""Error of the grade that the first stretch may keep."""

GIVE_UP = 0.6
"""A stretch that grades this much too low is written more softly, and left unmarked if that does
not help at the lowest level."""

BASE_LIMITS = (-4.0, len(LEVELS) + 3.0)
"""Beyond these all superframes have the lowest or the highest level."""

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

PASSAGE = 16
"""Stretches of a passage: 41 s."""

MAKE_GOOD = 0.7
"""Part of a passage's error of grade that the next stretch makes good beyond its own share."""


class _Passage:
    """Running grade and mean base of the last half to whole passage."""

    def __init__(self, channels: int) -> None:
        self._channels = channels
        self._meters = [PeaqMeter(FS, channels), PeaqMeter(FS, channels)]
        self._bases: list[list[float]] = [[], []]
        self._count = 0

    def add(self, attempt: Attempt, base: float) -> float | None:
        """Take the stretch that was chosen; return the passage's grade, None for silence."""
        for meter, bases in zip(self._meters, self._bases, strict=True):
            meter.process(attempt.clean, attempt.marked)
            bases.append(base)
        older = (self._count // (PASSAGE // 2)) % 2
        self.mean_base = float(np.mean(self._bases[older]))
        try:
            grade = float(self._meters[older].result().odg)
        except CueError:
            grade = None
        self._count += 1
        if self._count % (PASSAGE // 2) == 0:
            self._meters[older] = PeaqMeter(FS, self._channels)
            self._bases[older] = []
        return grade


class LevelControl:
    """Chooses the base level that keeps a grade.

    Parameters
    ----------
    target : float
        Objective difference grade to aim at, -4 to 0.
    channels : int
        1 or 2 channels that are listened to.
    """

    def __init__(self, target: float, channels: int) -> None:
        if not -4 < target < 0:
            raise CueError(f"grade {target} to aim at is not within -4..0")
        self._target = target
        self._base = START_BASE
        self._channels = channels
        self._clean = self._marked = np.zeros((0, channels))
        self._passage = _Passage(channels)
        self._started = False

    def settle(self, attempt: Callable[[float | None], T]) -> T:
        """Return the attempt that serves the wanted grade.

        Parameters
        ----------
        attempt : callable
            Gives the stretch at a base level, and unmarked for None.
        """
        chosen = attempt(self._base)
        grade = self._grade(chosen)
        if grade is not None:
            if not self._started:
                chosen, self._base = self._begin(attempt, chosen, grade)
            elif grade < self._target - GIVE_UP:
                chosen = self._soften(attempt, chosen, grade)
            self._started = True
        passage = self._passage.add(chosen, self._base)
        if passage is not None and grade is not None:
            self._learn(passage)
        self._clean = chosen.clean[-SUPERFRAME:]
        self._marked = chosen.marked[-SUPERFRAME:]
        return chosen

    def _learn(self, passage: float) -> None:
        """Set the base so that the passage comes to its grade."""
        error = (passage - self._target) / GRADES_PER_LEVEL
        wanted = self._passage.mean_base + (1 + MAKE_GOOD) * error
        move = np.clip(wanted - self._base, *MOVE_LIMITS)
        self._base = float(np.clip(self._base + move, *BASE_LIMITS))

    def _begin(
        self, attempt: Callable[[float | None], T], first: T, grade: float
    ) -> tuple[T, float]:
        """Find the base of the first stretch."""
        chosen, base = first, self._base
        for _ in range(TRIALS):
            error = grade - self._target
            if abs(error) < CLOSE_ENOUGH or (error > 0 and base == BASE_LIMITS[1]):
                return chosen, base
            base = float(np.clip(base + error / GRADES_PER_LEVEL, *BASE_LIMITS))
            chosen = attempt(base)
            grade = self._grade(chosen) or 0.0
        if grade < self._target - GIVE_UP:
            return attempt(None), base
        return chosen, base

    def _soften(self, attempt: Callable[[float | None], T], first: T, grade: float) -> T:
        """Write a stretch that grades far too low at a lower base, or not at all."""
        chosen, base = first, self._base
        for _ in range(TRIALS):
            base -= max(1.0, (self._target - GIVE_UP / 2 - grade) / GRADES_PER_LEVEL)
            chosen = attempt(base)
            grade = self._grade(chosen) or 0.0
            if grade >= self._target - GIVE_UP:
                return chosen
        return attempt(None)

    def _grade(self, attempt: Attempt) -> float | None:
        """Grade of an attempt, None for silence."""
        clean = np.concatenate([self._clean, attempt.clean])
        marked = np.concatenate([self._marked, attempt.marked])
        meter = PeaqMeter(FS, self._channels)
        try:
            meter.process(clean, marked)
            return float(meter.result().odg)
        except CueError:
            return None
