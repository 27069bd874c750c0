"""What both meters share: intake of two streams, frames of them, averages between silences.

A recommendation speaks of whole files. Here streams come in blocks of any size; the averages
extend from the first to the last frame that holds more than silence.
"""

import copy
from collections.abc import Iterator
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError
from watermark.quality.ear import FS
from watermark.quality.resample import Resampler

FloatArray = NDArray[np.float64]

_ACTIVE_SUM = 200 / 32768  # of five neighbouring magnitudes: where a programme begins and ends


class Intake:
    """Checks blocks of two streams and brings them to 48 kHz.

    Parameters
    ----------
    fs : int
        Sampling rate in Hz.
    channels : int
        1 or 2.

    Raises
    ------
    CueError
        If the number of channels or the sampling rate is out of range.
    """

    def __init__(self, fs: int, channels: int) -> None:
        if channels not in (1, 2):
            raise CueError(f"PEAQ grades 1 or 2 channels, not {channels}")
        self._channels = channels
        self._resamplers = (Resampler(fs, FS, channels), Resampler(fs, FS, channels))

    def take(self, reference: ArrayLike, test: ArrayLike) -> FloatArray:
        """Return both blocks at 48 kHz, shape (2, n, channels).

        Raises
        ------
        CueError
            If the two blocks differ in shape.
        """
        ref, other = self._checked(reference), self._checked(test)
        if ref.shape != other.shape:
            raise CueError(f"test has shape {other.shape}, reference {ref.shape}")
        return np.stack([self._resamplers[0].process(ref), self._resamplers[1].process(other)])

    def flush(self) -> FloatArray:
        """Return the remaining frames, as if silence followed."""
        return np.stack([resampler.flush() for resampler in self._resamplers])

    def _checked(self, block: ArrayLike) -> FloatArray:
        x = np.asarray(block, dtype=np.float64)
        if x.ndim == 1 and self._channels == 1:
            x = x[:, None]
        if x.ndim != 2 or x.shape[1] != self._channels:
            raise CueError(f"block of shape {x.shape}: expected (n, {self._channels})")
        return x


class Frames:
    """Cuts a pair of streams into whole frames.

    Parameters
    ----------
    channels : int
        Columns of the streams.
    frame, hop : int
        Samples of a frame and between the starts of two.
    batch : int
        Frames handed out at once: bounds the memory.
    """

    def __init__(self, channels: int, frame: int, hop: int, batch: int) -> None:
        self._rest = np.empty((2, 0, channels))
        self._frame, self._hop, self._batch = frame, hop, batch

    @property
    def left(self) -> int:
        """Samples that make no whole frame yet."""
        return self._rest.shape[1]

    def batches(self, pair: FloatArray) -> Iterator[FloatArray]:
        """Yield samples, shape (2, n, channels), that make whole frames, from all given so far."""
        at_once = self._batch * self._hop
        for first in range(0, pair.shape[1], at_once):
            self._rest = np.concatenate([self._rest, pair[:, first : first + at_once]], axis=1)
            while (ready := (self._rest.shape[1] - self._frame) // self._hop + 1) > 0:
                count = min(ready, self._batch)
                yield self._rest[:, : (count - 1) * self._hop + self._frame]
                self._rest = self._rest[:, count * self._hop :]


def active_frames(samples: FloatArray, frame: int, hop: int) -> NDArray[np.bool_]:
    """Tell for each frame of (n, channels) samples whether it holds more than silence."""
    # A sample above the limit needs no neighbours: so nearly every frame of a programme has one.
    starts = samples[: (len(samples) - frame + hop) // hop * hop, 0].reshape(-1, hop)
    sure = starts.max(axis=1) >= _ACTIVE_SUM
    if sure.all():
        return np.asarray(sure, dtype=np.bool_)
    loud = np.zeros(len(samples) - 4, dtype=np.bool_)
    for channel in samples.T:
        magnitude = np.append(0.0, np.cumsum(np.abs(channel)))
        loud |= (magnitude[5:] - magnitude[:-5]) >= _ACTIVE_SUM
    frames = sliding_window_view(loud, frame - 4)[::hop]
    return np.asarray(frames.any(axis=1), dtype=np.bool_)


F = TypeVar("F", contravariant=True)
"""Figures of one frame."""


class Averages(Protocol[F]):
    """Running sums over frames."""

    def add(self, frame: F, *, settled: Any, audible: Any) -> None:
        """Count one frame or some; flags as in `watermark.quality.movs.MovAverages.add`."""


A = TypeVar("A", bound=Averages)  # type: ignore[type-arg]
"""Averages over one kind of frames."""


class Bounded(Generic[A]):
    """Averages from the first to the last frame that is not silent.

    Attributes
    ----------
    kept : Averages
        Averages so far, meaningful once `start` is known.
    start : int or None
        Number of the first frame.
    end : int
        Number of the last frame and one.
    """

    def __init__(self, averages: A) -> None:
        self._averages = averages
        self.kept = averages
        self.start: int | None = None
        self.end = 0

    def add(
        self, frame: object, index: int, *, active: bool, settled: Any, audible: Any, count: int = 1
    ) -> None:
        """Count frame number `index`; `active` says that it holds more than silence.

        With `count`, frames that follow each other and are all active, or all not.
        """
        if active:
            self.kept = self._averages
            self.start = index if self.start is None else self.start
            self.end = index + count
        elif self.start is None:
            return
        elif self.kept is self._averages:  # silence may be the end: keep the sums before it
            self._averages = copy.deepcopy(self.kept)
        self._averages.add(frame, settled=settled, audible=audible)
