"""Where the next superframe of stretched sound is expected, and at which tempo.

In: the places of the frames of superframes that were read, and how many were not; out: where the
next one begins. Specification: spec/audio-carrier.md, W48.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, HOP, LEVELS, SUPERFRAME

MOST_TEMPO, APART = 0.06, 0.01
"""Largest change of duration that is followed, and how far tempi lie apart that are both tried."""

PRIOR = 2.0
"""Superframes that the tempo at first counts for beside those that were read."""

SETTLED = 4
"""Superframes that were read after which the tempo is known."""

MAX_MISSES, MAX_UNSETTLED = 6, 2
"""Superframes in a row that may fail before the lock is given up, and while the tempo is not known:
the place of the next one is not, either."""

EVEN, MAX_EVEN = 1.0, 4
"""Samples that are no jump, and superframes in a row without one after which the sound is left to
the usual search."""

LEVELS_BESIDE = (0, -1, 1, -2, 2)
"""Levels tried beside that of the superframe before."""

FRAMES = np.arange(FRAMES_PER_SUPERFRAME, dtype=np.float64)
"""Numbers of a superframe's frames."""

Array = NDArray[np.float64]


@dataclass(slots=True)
class StretchedPlace:
    """Where the next superframe is expected.

    Attributes
    ----------
    position : float
        Where it begins at an even pace: samples of the tape.
    nominal : float
        Samples of the tape that come for one of the mark's own.
    piece : float or None
        Where it begins if the last piece goes on; None where that is not known.
    tempo : float
        Nominal duration of superframes over that which is heard, as far as is known.
    assumed : float
        The tempo assumed at first.
    origin : float
        Where the first superframe began.
    level : float
        Level of the superframe before.
    count, read : int
        Superframes since the first, and those of them that were read.
    misses, even : int
        Superframes in a row that failed, and that had their nominal duration.
    """

    position: float
    tempo: float
    assumed: float
    origin: float
    level: float
    nominal: float
    piece: float | None = None
    count: int = 0
    read: int = 0
    misses: int = 0
    even: int = 0

    @property
    def levels(self) -> list[float]:
        """Likely levels of the next superframe."""
        near = [self.level + beside for beside in LEVELS_BESIDE]
        return [level for level in near if 0 <= level < len(LEVELS)]

    @property
    def settled(self) -> bool:
        """Whether the tempo is known."""
        return self.read >= SETTLED

    @property
    def lost(self) -> bool:
        """Whether so many failed that the lock is to be given up."""
        return self.misses > (MAX_MISSES if self.settled else MAX_UNSETTLED)

    @property
    def unstretched(self) -> bool:
        """Whether the sound has had no jump for long."""
        return self.even >= MAX_EVEN

    def miss(self) -> None:
        """Go on to the next superframe from one that was not read."""
        self.count, self.misses, self.piece = self.count + 1, self.misses + 1, None
        self.position += SUPERFRAME * self.nominal / self.tempo

    def learn(self, level: float, places: Array, tempo: float) -> None:
        """Go on to the next superframe from one that was read."""
        nominal = SUPERFRAME * self.nominal
        if not self.settled:
            self.assumed = tempo
        self.count, self.read = self.count + 1, self.read + 1
        end = even_start(places, self.assumed, self.nominal) + nominal / self.assumed
        heard = end - self.origin + PRIOR * nominal / self.assumed
        mean = (self.count + PRIOR) * nominal / heard
        self.tempo = min(max(mean, 1 - MOST_TEMPO), 1 + MOST_TEMPO)
        jumps = np.abs(np.diff(places) - HOP * self.nominal) > EVEN
        self.even = 0 if jumps.any() else self.even + 1
        self.position, self.piece = end, float(places[-1]) + HOP * self.nominal
        self.level, self.misses = level, 0


def even_start(places: Array, tempo: float, nominal: float) -> float:
    """Where a superframe whose frames have some places would begin at an even pace."""
    return float(np.median(places - HOP * nominal / tempo * FRAMES))
