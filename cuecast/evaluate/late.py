"""How long a television that is switched on at any moment waits for the first superframe."""

from collections.abc import Callable

from cuecast.evaluate.picture_channels import Luma
from watermark.video.receive import VideoReceiver

LONGEST_TUNE_IN_S = 6.0
"""A reception that has not locked by then counts with this time."""


class LateReceivers:
    """Receivers that are switched on at different times, each until its first superframe.

    Parameters
    ----------
    tuned : callable
        Makes a receiver.
    starts_s : list of float
        When they are switched on.
    fps : float
        Frames per second of what they see.
    """

    def __init__(self, tuned: Callable[[], VideoReceiver], starts_s: list[float], fps: float):
        self._tuned, self._fps = tuned, fps
        self._starts = sorted(round(start_s * fps) for start_s in starts_s)
        self._on: list[tuple[int, VideoReceiver]] = []
        self._frames = 0
        self._locked_s: list[float] = []

    @property
    def waits_s(self) -> list[float]:
        """Seconds to the first superframe; those who still wait count with the longest time."""
        return self._locked_s + [LONGEST_TUNE_IN_S] * len(self._on)

    def process(self, luma: Luma) -> None:
        """Show a frame to all that are on."""
        while self._starts and self._starts[0] <= self._frames:
            self._on.append((self._starts.pop(0), self._tuned()))
        self._frames += 1
        waiting = []
        for start, receiver in self._on:
            receiver.process(luma)
            if receiver.first_lock_s is not None:
                self._locked_s.append(receiver.first_lock_s)
            elif self._frames - start > LONGEST_TUNE_IN_S * self._fps:
                self._locked_s.append(LONGEST_TUNE_IN_S)
            else:
                waiting.append((start, receiver))
        self._on = waiting
