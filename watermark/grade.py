"""Closed loop from the graded quality to the level of the mark.

In: the programme's mid before and after marking, superframe by superframe; out: the level of the
next one. Grades are taken over windows that overlap by half, each by a meter of its own, so the
loop forgets and its memory is constant. Specification: none, an embedder may choose levels freely.
"""

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.profile import FS, LEVELS
from watermark.quality import PeaqMeter

START_LEVEL = 5
"""Level before anything was graded: fair for most programmes."""

WINDOW = 8
"""Superframes of a grading window: 5.12 s."""

GRADES_PER_LEVEL = 0.28
"""Loss of grade that one level (1.5 dB) costs near the grades of interest."""

LARGEST_MOVE = 2
"""Levels by which the mark may change at once."""


class LevelControl:
    """Chooses the level that keeps a grade.

    Parameters
    ----------
    target : float
        Objective difference grade to aim at, -4 to 0.
    """

    def __init__(self, target: float) -> None:
        if not -4 < target < 0:
            raise CueError(f"grade {target} to aim at is not within -4..0")
        self._target = target
        self._meters = [PeaqMeter(FS, 1), PeaqMeter(FS, 1)]
        self._count = 0

    def follow(self, clean: NDArray[np.float64], marked: NDArray[np.float64], level: int) -> int:
        """Take a superframe before and after marking at `level`; return the next level."""
        for meter in self._meters:
            meter.process(clean[:, np.newaxis], marked[:, np.newaxis])
        self._count += 1
        if self._count % (WINDOW // 2):
            return level
        # The meters begin half a window apart: the one that is full is read and starts again.
        full = (self._count // (WINDOW // 2)) % 2
        move = self._move(self._meters[full])
        self._meters[full] = PeaqMeter(FS, 1)
        return int(np.clip(level + move, 0, len(LEVELS) - 1))

    def _move(self, meter: PeaqMeter) -> int:
        try:
            grade = meter.result().odg
        except CueError:  # nothing but silence in the window
            return 0
        move = np.round((grade - self._target) / GRADES_PER_LEVEL)
        return int(np.clip(move, -LARGEST_MOVE, LARGEST_MOVE))
