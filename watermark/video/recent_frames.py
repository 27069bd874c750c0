"""The last frames of a picture whose place is known: means of amplitudes and textures over windows.

In: luma; out: for a window of frames, the mean amplitude of each pattern and its variance, also as
if pictures or flat cells lagged behind. Specification: spec/video-carrier.md, section 6.
"""

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.video.demodulate import without_lag
from watermark.video.grid import Grid
from watermark.video.profile import COLUMNS, ROWS, TEMPLATES, TEXTURE_EVERY

Luma = NDArray[Any]
FloatArray = NDArray[np.float64]

FLAT = 0.5
"""Texture in luma of 8 bits up to which cells are also read apart from others: cleaners leave them
longest as they were."""

LAG_FRAMES = 2
"""Frames at the end of a window, and before it, whose difference shows how much a picture with a
lag still changes."""


@dataclass(frozen=True, slots=True)
class WindowReading:
    """How the frames of a window become one mean.

    Attributes
    ----------
    part : tuple of int, optional
        First frame that counts, and the one after the last; None for the window.
    flat : tuple of int, optional
        The same for flat cells alone.
    lag : float
        Lag that is taken back, see `without_lag`.
    """

    part: tuple[int, int] | None = None
    flat: tuple[int, int] | None = None
    lag: float = 0.0


PLAIN = WindowReading()


class RecentFrames:
    """Keep amplitudes and textures of the last frames in the cells of a grid.

    Parameters
    ----------
    grid : Grid
        Cells of the picture.
    window : int
        Frames of a superframe's window.
    kept : int
        Frames that are kept.

    Attributes
    ----------
    count : int
        Frames taken; they are numbered from 0.
    """

    def __init__(self, grid: Grid, window: int, kept: int) -> None:
        self._window = window
        self._frames: deque[FloatArray] = deque(maxlen=kept)
        self._textures: deque[tuple[int, FloatArray]] = deque(maxlen=kept // TEXTURE_EVERY + 1)
        self._nowhere = np.zeros(ROWS * COLUMNS)
        self.count = 0
        self.go_on(grid)

    def go_on(self, grid: Grid) -> None:
        """Take the next frames by another grid."""
        self._grid, self.seen = grid, grid.seen.reshape(-1)

    def take(self, luma: Luma) -> None:
        """Take the next frame."""
        if self.count % TEXTURE_EVERY == 0:
            self._textures.append((self.count, self._grid.texture(luma).reshape(-1)))
        self._frames.append(self._grid.project(luma).reshape(-1))
        self.count += 1

    def repeat(self) -> None:
        """Take the newest frame once more."""
        self._frames.append(self.newest)
        self.count += 1

    @property
    def newest(self) -> FloatArray:
        """Amplitudes in the newest frame, shape (POSITIONS,)."""
        return self._frames[-1]

    @property
    def oldest(self) -> int:
        """Number of the oldest frame that is kept."""
        return self.count - len(self._frames)

    def values(
        self, start: int, part: tuple[int, int], positions: NDArray[np.intp] | None = None
    ) -> FloatArray:
        """Amplitudes at some positions in frames from a window's start, shape (frames, positions).

        A picture's first frame stands for those before it, the newest for those to come.
        """
        first, newest = start - self.oldest, len(self._frames) - 1
        frames = [self._frames[min(max(0, first + n), newest)] for n in range(*part)]
        if positions is not None:
            frames = [frame[positions] for frame in frames]
        return np.array(frames)

    def mean(self, start: int, reading: WindowReading) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mean of each amplitude in a window, its variance there, and the texture of each cell."""
        values, texture = self.values(start, reading.part or (0, self._window)), self.texture(start)
        mean, variance = values.mean(axis=0), values.var(axis=0)
        textures, left = np.tile(texture, TEMPLATES), 1.0
        if reading.flat:
            late = self.values(start, reading.flat).mean(axis=0)
            mean = np.where(textures < FLAT, late, mean)
            # The rest of the pattern before fades in the course of the window.
            left = 1 - reading.flat[0] / self._window
        if reading.lag:
            mean = without_lag(mean, left * self._rise(start), textures, reading.lag)
        return mean, variance, texture

    def textured(self, start: int) -> tuple[int, ...]:
        """Numbers of the frames in a window whose texture is known."""
        window = range(start, start + self._window)
        return tuple(number for number, _ in self._textures if number in window)

    def texture(self, start: int) -> FloatArray:
        """Texture of each cell in a window, shape (ROWS * COLUMNS,)."""
        window = range(start, start + self._window)
        seen = [texture for number, texture in self._textures if number in window]
        return np.mean(seen, axis=0) if seen else self._nowhere

    def _rise(self, start: int) -> FloatArray:
        """By how much amplitudes at a window's end are above those before it."""
        before, last = (-LAG_FRAMES, 0), (self._window - LAG_FRAMES, self._window)
        return np.asarray(
            self.values(start, last).mean(axis=0) - self.values(start, before).mean(axis=0)
        )
