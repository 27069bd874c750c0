"""Closed loop from the graded quality to the level of the mark.

In: what a stretch of the programme sounds like at any level; out: the level at which it has
the wanted grade. Each stretch is graded by itself, after a superframe of what came before. A long
passage grades better or worse than its stretches: what it has to spare is given to the next one.
The loop forgets, and its memory is constant. Specification: none, an embedder may choose levels
freely.
"""

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.profile import FS, LEVELS, SUPERFRAME
from watermark.quality import PeaqMeter

START_LEVEL = 6
"""Level that is tried first."""

GRADES_PER_LEVEL = 0.28
"""Loss of grade that one level (1.5 dB) costs near the grades of interest."""

LARGEST_RISE = 2
"""Levels by which the mark may grow between stretches, the first excepted."""

LARGEST_FALL = 2
"""Levels by which the mark may shrink for one stretch that is only a little too low: a mark of
half the size is lost in coding, whereas the passage has time to make up for a poor grade."""

GIVE_UP = 0.6
"""A stretch that grades this much too low falls on, and at the lowest level is left unmarked."""

TOLERANCE = 0.1
"""A stretch that grades this much too low is written one level lower."""


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

SPARE_LIMITS = (-0.2, 0.35)
"""Grades that a passage may take from, or give to, one stretch."""


class _Passage:
    """Running grade of the last half to whole passage."""

    def __init__(self, channels: int) -> None:
        self._channels = channels
        self._meters = [PeaqMeter(FS, channels), PeaqMeter(FS, channels)]
        self._count = 0

    def spare(self, target: float) -> float:
        """Grades above the target, within `SPARE_LIMITS`; 0 while nothing is known."""
        older = (self._count // (PASSAGE // 2)) % 2
        try:
            return float(np.clip(self._meters[older].result().odg - target, *SPARE_LIMITS))
        except CueError:
            return 0.0

    def add(self, attempt: Attempt) -> None:
        """Take the stretch that was chosen."""
        for meter in self._meters:
            meter.process(attempt.clean, attempt.marked)
        self._count += 1
        if self._count % (PASSAGE // 2) == 0:
            younger = (self._count // (PASSAGE // 2) + 1) % 2
            self._meters[younger] = PeaqMeter(FS, self._channels)


class LevelControl:
    """Chooses the level that keeps a grade.

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
        self._level = START_LEVEL
        self._largest = len(LEVELS)
        self._channels = channels
        self._clean = self._marked = np.zeros((0, channels))
        self._passage = _Passage(channels)

    def settle(self, attempt: Callable[[int | None], T]) -> T:
        """Return the attempt that has the wanted grade.

        Parameters
        ----------
        attempt : callable
            Gives the stretch at a level, and unmarked for None.
        """
        chosen = attempt(self._level)
        grade = self._grade(chosen)
        if grade is not None:
            target = self._target - self._passage.spare(self._target)
            chosen = self._adjust(attempt, chosen, grade, target)
            self._largest = LARGEST_RISE
        self._passage.add(chosen)
        self._clean = chosen.clean[-SUPERFRAME:]
        self._marked = chosen.marked[-SUPERFRAME:]
        return chosen

    def _adjust(
        self, attempt: Callable[[int | None], T], first: T, grade: float, target: float
    ) -> T:
        move = min(round((grade - target) / GRADES_PER_LEVEL), self._largest)
        level = int(np.clip(self._level + move, 0, len(LEVELS) - 1))
        chosen, found = first, grade
        floor = self._level - LARGEST_FALL
        while level != self._level:
            down = level < self._level
            self._level = level
            chosen = attempt(level)
            found = self._grade(chosen) or 0.0
            if not down or found >= target - TOLERANCE:
                break
            if level <= floor and found >= target - GIVE_UP:
                break
            level = max(level - 1, 0)
        if self._level == 0 and found < target - GIVE_UP:
            return attempt(None)
        return chosen

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
