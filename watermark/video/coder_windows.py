"""A coder that a mark is tried on, and each superframe's window in its decoded pictures.

In: marked frames; out: amplitudes of the decoded pictures in the window of each superframe, read in
all ways that receivers try.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from watermark.video.demodulate import LAGS, without_lag
from watermark.video.grid import Grid
from watermark.video.profile import TEMPLATES, TEXTURE_EVERY
from watermark.video.recent_frames import LAG_FRAMES
from watermark.video.timing import Timing

BEGINS = 0.0, 0.5, 0.75
"""Parts of a window after which a pattern may begin to be seen: receivers read from there where
more is lost before."""

Luma = NDArray[Any]
FloatArray = NDArray[np.float64]


class PictureCoder(Protocol):
    """A coder and its decoder as one stream of luma.

    Examples
    --------
    >>> class Wire:
    ...     def process(self, luma):
    ...         return [luma]
    ...
    ...     def flush(self):
    ...         return []
    >>> coder: PictureCoder = Wire()
    >>> len(coder.process(np.zeros((180, 320), np.uint8)))
    1
    """

    def process(self, luma: Luma) -> list[Luma]:
        """Take a frame; return frames decoded by now, in order, in luma of 8 bits."""

    def flush(self) -> list[Luma]:
        """Return the frames still inside."""


@dataclass(frozen=True, slots=True)
class CoderWindow:
    """A superframe's window in a coder's decoded pictures.

    Attributes
    ----------
    before, seen : ndarray of float64, shape (frames, POSITIONS)
        Amplitudes in up to `LAG_FRAMES` frames before it, and in its own.
    texture : ndarray of float64, shape (ROWS * COLUMNS,)
        Of its cells.
    """

    before: FloatArray
    seen: FloatArray
    texture: FloatArray

    def readings(self) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Mean and variance of each amplitude, in all ways that receivers try."""
        for begin in BEGINS:
            late = self.seen[round(begin * len(self.seen)) :]
            yield late.mean(axis=0), late.var(axis=0)
        if len(self.before):
            mean, variance = self.seen.mean(axis=0), self.seen.var(axis=0)
            rise = self.seen[-LAG_FRAMES:].mean(axis=0) - self.before.mean(axis=0)
            textures = np.tile(self.texture, TEMPLATES)
            for lag in LAGS:
                yield without_lag(mean, rise, textures, lag), variance


class CoderWindows:
    """A coder with its decoder as one stream, and the windows in its decoded pictures.

    Parameters
    ----------
    coder : PictureCoder
    timing : Timing
        Frame rate.
    """

    def __init__(self, coder: PictureCoder, timing: Timing) -> None:
        self._coder, self._timing = coder, timing
        self._grid: Grid | None = None  # known with the first decoded frame: a coder may shrink
        self._received = 0
        self._values: list[FloatArray] = []  # of a window, and of `LAG_FRAMES` frames before it
        self._textures: list[FloatArray] = []
        self._places: deque[int] = deque()

    def expect(self, place: int) -> None:
        """Note the superframe that is on its way; all are, in order."""
        self._places.append(place)

    def process(self, frames: list[Luma]) -> list[CoderWindow]:
        """Send marked frames through the coder; return the windows that are whole by now."""
        return self._windows([out for frame in frames for out in self._coder.process(frame)])

    def flush(self) -> list[CoderWindow | None]:
        """Return the windows still in the coder; None for each that it did not give back."""
        windows: list[CoderWindow | None] = [*self._windows(self._coder.flush())]
        windows += [None] * len(self._places)
        self._places.clear()
        return windows

    def _windows(self, decoded: list[Luma]) -> list[CoderWindow]:
        windows = []
        for luma in decoded:
            grid = self._grid = self._grid or Grid(luma.shape[1], luma.shape[0])
            if self._places:
                start = self._timing.window_start(self._places[0])
                end = start + self._timing.window
                if start - LAG_FRAMES <= self._received < end:
                    self._values.append(grid.project(luma).reshape(-1))
                # At few frames a second no other one may be in the window.
                if self._received >= start and (
                    self._received % TEXTURE_EVERY == 0
                    or (self._received == end - 1 and not self._textures)
                ):
                    self._textures.append(grid.texture(luma).reshape(-1))
                if self._received == end - 1:
                    self._places.popleft()
                    windows.append(self._window())
            self._received += 1
        return windows

    def _window(self) -> CoderWindow:
        values, seen = np.array(self._values), self._timing.window
        texture = np.mean(self._textures, axis=0)
        self._values.clear()
        self._textures.clear()
        return CoderWindow(values[:-seen], values[-seen:], texture)
