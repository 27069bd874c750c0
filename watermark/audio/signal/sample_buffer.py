"""A tape of mono samples that forgets its past and can be read at any real position and speed.

In: blocks of samples; out: samples interpolated at ``position + n * ratio``. One windowed-sinc
interpolator serves conversion between sampling rates, alignment by a fraction of a sample and
correction of a clock error. Source: Smith and Gossett, ICASSP 1984.
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.audio.signal import _kernels

STEPS = 256
"""Tabulated fractions of a sample."""

REACH = 32
"""Half the length of the impulse response in samples of the slower of both rates."""

SPARE = 192_000
"""Samples for which a tape that holds more has room before it is moved to the front of its store:
4 s, 0.8 MB of single precision."""

KAISER_BETA = 9.0
"""Side lobes of the window below -90 dB."""


@lru_cache(maxsize=16)
def impulse_responses(cutoff: float, length: int = REACH, kind: str = "float64") -> NDArray[Any]:
    """Low-pass responses at all fractions of a sample.

    Parameters
    ----------
    cutoff : float
        Edge of the pass band as a part of half the input rate, 0 to 1; 1 interpolates only.
    length : int
        Half the length in samples of the slower rate.
    kind : str
        Precision.

    Returns
    -------
    ndarray of that precision, shape (STEPS + 1, taps)
        Row p: weights of the samples around an index whose fraction is p / STEPS.
    """
    reach = round(length / cutoff)
    distance = np.arange(2 * reach) - (reach - 1)
    t = np.arange(STEPS + 1)[:, np.newaxis] / STEPS - distance
    window = np.i0(KAISER_BETA * np.sqrt(np.clip(1 - (t / reach) ** 2, 0, None)))
    response = cutoff * np.sinc(cutoff * t) * window / np.i0(KAISER_BETA)
    return np.ascontiguousarray(response, dtype=kind)


def _cutoff(ratio: float) -> float:
    """Edge of the pass band at a speed, a little below half the slower rate for the window's sake.

    Speeds that are nearly alike have the same, and with it the same table.
    """
    return math.floor(200 * 0.94 / ratio + 1e-9) / 200 if ratio > 1.01 else 1.0


class SampleBuffer:
    """Samples from `first` on; what lies before was forgotten, what lies beyond is unknown.

    Parameters
    ----------
    first : int
        Index of the first sample that is to come.
    kind : type
        Precision of the samples: `np.float64`, or `np.float32` in half the memory and time.

    Examples
    --------
    >>> tape = SampleBuffer()
    >>> tape.append(np.arange(100.0))
    >>> tape.read(10.0, 1.0, 3).tolist()
    [10.0, 11.0, 12.0]
    """

    def __init__(self, first: int = 0, kind: type[Any] = np.float64) -> None:
        self.first = self.end = first
        self._kind, self._store = kind, np.empty(1024, dtype=kind)
        self._offset = first

    @property
    def samples(self) -> NDArray[Any]:
        """The samples in memory, from `first` to `end`."""
        return self._store[self.first - self._offset : self.end - self._offset]

    def append(self, block: NDArray[Any]) -> None:
        """Add samples at the end."""
        self.grow(block.size)[:] = block

    def grow(self, count: int) -> NDArray[Any]:
        """Return the place of the next samples, to be filled at once."""
        if self.end - self._offset + count > self._store.size:
            kept, size = self.samples, self.end - self.first + count
            # Half as much again as is needed, and two seconds: a long tape is not copied for each
            # short block. New memory costs more than copying, so the present store serves while an
            # eighth is free.
            room = size + max(size // 2, SPARE if kept.size > SPARE else 0)
            fits = 9 * size <= 8 * self._store.size
            store = self._store if fits else np.empty(room, dtype=self._kind)
            store[: kept.size] = kept
            self._store, self._offset = store, self.first
        begin = self.end - self._offset
        self.end += count
        return self._store[begin : begin + count]

    def forget(self, before: int) -> None:
        """Drop all samples with an index below `before`."""
        self.first = min(max(before, self.first), self.end)

    def reach(self, ratio: float, length: int = REACH) -> int:
        """Return how many samples on either side of a position are looked at, see `read`."""
        return round(length / _cutoff(ratio)) + 2

    def read(self, position: float, ratio: float, count: int, length: int = REACH) -> NDArray[Any]:
        """Return samples at ``position + n * ratio`` for n below `count`; silence outside.

        `length` is half that of the impulse response in samples of the slower rate: a shorter one
        is for those who look at low frequencies only.

        Raises
        ------
        CueError
            If the ratio is not a positive number.
        """
        if not 0 < ratio < 64:
            raise CueError(f"resampling ratio {ratio} is not within 0..64")
        if ratio == 1.0 and position == (whole := round(position)):
            return self._cut(whole, count)
        table = impulse_responses(_cutoff(ratio), length, self._store.dtype.name)
        margin = table.shape[1] // 2
        begin = math.floor(position) - margin
        long = math.ceil(count * ratio) + 2 * margin + 2
        sound = self.part(begin, long)
        out = np.empty(count, dtype=self._kind)
        _kernels.interpolate(sound, position - begin, ratio, table, out)
        return out

    def view(self, position: int, count: int) -> NDArray[Any]:
        """Return samples that are all in memory, without a copy: they hold until the next ones."""
        begin = position - self._offset
        return self._store[begin : begin + count]

    def part(self, position: int, count: int) -> NDArray[Any]:
        """Return samples from a whole position on; those in memory as a `view`."""
        known = self.first <= position and position + count <= self.end
        return self.view(position, count) if known else self._cut(position, count)

    def _cut(self, position: int, count: int) -> NDArray[Any]:
        begin, end = max(position, self.first), min(position + count, self.end)
        if end - begin == count:
            return self.view(position, count).copy()
        out = np.zeros(count, dtype=self._kind)
        if begin < end:
            out[begin - position : end - position] = self.samples[
                begin - self.first : end - self.first
            ]
        return out


class StereoBuffer(SampleBuffer):
    """The mid of two channels, and beside it their side.

    Parameters
    ----------
    first : int
        Index of the first sample that is to come.
    kind : type
        Precision of the samples.

    Attributes
    ----------
    side : SampleBuffer
        Half the difference of left and right.
    """

    def __init__(self, first: int = 0, kind: type[Any] = np.float64) -> None:
        super().__init__(first, kind)
        self.side = SampleBuffer(first, kind)

    def append_pair(self, mid: NDArray[Any], side: NDArray[Any]) -> None:
        """Add samples of both at the end."""
        self.append(mid)
        self.side.append(side)

    def forget(self, before: int) -> None:
        """Drop all samples with an index below `before`."""
        super().forget(before)
        self.side.forget(before)
