"""Frames and patterns in, marked frames out: one pattern to a superframe, fading into the next.

Specification: spec/video-carrier.md, V4.
"""

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.video import _kernels
from watermark.video.profile import FADE
from watermark.video.timing import Timing

NOMINAL = 16, 235
"""Black and white of luma of 8 bits (ITU-R BT.709): no pixel is moved out of that range."""

Luma = NDArray[Any]
Pattern = NDArray[np.float32]


class PatternWriter:
    """Add patterns to frames in the order of time.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the picture.
    depth : int
        Bits per sample.
    timing : Timing
        Its frame rate.

    Attributes
    ----------
    sent : int
        Frames put out.
    squares : float
        Sum of the squares of all changes made to them.
    """

    def __init__(self, shape: tuple[int, int], depth: int, timing: Timing) -> None:
        self._timing = timing
        self._unit = 2.0 ** (depth - 8)
        self._frames: deque[Luma] = deque()
        self._nothing: Pattern = np.zeros(shape, dtype=np.float32)
        self._patterns: deque[Pattern] = deque([self._nothing])
        self._first_pattern = -1  # superframe of the first pattern in the queue
        self.sent = 0
        self.squares = 0.0

    @property
    def next_place(self) -> int:
        """Place of the superframe whose pattern is due next."""
        return self._first_pattern + len(self._patterns)

    def add_frame(self, luma: Luma) -> None:
        """Take the next frame; it is kept until put out."""
        self._frames.append(luma)

    def add_pattern(self, pattern: Pattern) -> None:
        """Take the pattern of the superframe at `next_place`."""
        self._patterns.append(pattern)
        if self.next_place == 1:
            # Nothing to fade from, and much is predicted from a programme's first frame.
            self._patterns[0] = pattern

    def end(self) -> list[Luma]:
        """Return the remaining frames; those after the last pattern stay unmarked."""
        self._patterns.extend([self._nothing, self._nothing])
        return self.ready()

    def ready(self) -> list[Luma]:
        """Return the frames whose patterns are known, marked."""
        done: list[Luma] = []
        while self._frames:
            k, phase = self._timing.phase(self.sent)
            ramp = FADE / 2
            other = k - 1 if phase < ramp else k + 1 if phase > 1 - ramp else k
            if max(k, other) >= self.next_place:
                break
            while self._first_pattern < min(k, other) and len(self._patterns) > 1:
                self._patterns.popleft()
                self._first_pattern += 1
            weight = 0.5 * max(0.0, 1 - min(phase, 1 - phase) / ramp)
            done.append(self._mark(self._frames.popleft(), k, other, weight))
            self.sent += 1
        return done

    def _mark(self, luma: Luma, k: int, other: int, weight: float) -> Luma:
        first, second = (self._patterns[i - self._first_pattern] for i in (k, other))
        out = np.empty_like(luma)
        weight *= first is not second  # exactly the same, so that a beginning stays still
        black, white = (level * self._unit for level in NOMINAL)
        _kernels.add_into(luma, first, second, weight, black, white, out)
        difference = out.astype(np.float32) - luma
        self.squares += float(np.vdot(difference, difference))
        return out
