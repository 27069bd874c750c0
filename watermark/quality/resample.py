"""Change of the sampling rate of a stream by a rational factor.

A polyphase windowed-sinc filter: each output sample is one phase of the filter applied to the
input around it, so the output does not depend on how the input is cut into blocks.
"""

from math import gcd

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.quality import _kernels

FloatArray = NDArray[np.float64]

_ZERO_CROSSINGS = 24  # of the sinc on each side, at the lower of the two rates

_KAISER_BETA = 9.0
"""Shape of the window without unit: stop band 90 dB down, below 16 bit noise."""

_LOWEST, _HIGHEST = 8_000, 384_000
"""Rates in Hz that are taken: from telephone sound to four times studio sound."""


class Resampler:
    """Resample (n, channels) blocks from `source_hz` to `target_hz` without delay.

    Parameters
    ----------
    source_hz, target_hz : int
        Rates between 8 and 384 kHz. Equal rates pass samples through untouched.
    channels : int
        Number of columns of a block.

    Raises
    ------
    CueError
        If a rate is out of range.

    Examples
    --------
    >>> up = Resampler(44100, 48000, 1)
    >>> y = np.concatenate([up.process(np.ones((441, 1))), up.flush()])
    >>> y.shape, bool(abs(y[240, 0] - 1) < 1e-4)
    ((480, 1), True)
    """

    def __init__(self, source_hz: int, target_hz: int, channels: int) -> None:
        for rate in (source_hz, target_hz):
            if not _LOWEST <= rate <= _HIGHEST:
                raise CueError(f"sampling rate {rate} Hz: must be {_LOWEST} to {_HIGHEST} Hz")
        common = gcd(source_hz, target_hz)
        self._up, self._down = target_hz // common, source_hz // common
        self._taps = _polyphase(self._up, self._down)
        self._half = self._taps.shape[1] // 2
        self._history = np.zeros((self._half, channels))
        self._first = 0  # input index of the sample after the leading `half` of the history
        self._next = 0  # index of the next output sample
        self._received = 0

    def process(self, block: FloatArray) -> FloatArray:
        """Return the output samples whose whole neighbourhood has been received."""
        if self._up == self._down:
            return block
        self._received += block.shape[0]
        self._history = np.concatenate([self._history, block])
        return self._emit((self._received - self._half) * self._up)

    def flush(self) -> FloatArray:
        """Return the rest, as if silence followed."""
        if self._up == self._down:
            return self._history[:0]
        self._history = np.pad(self._history, ((0, self._half), (0, 0)))
        return self._emit(self._received * self._up)

    def _emit(self, end: int) -> FloatArray:
        """Output samples m with m * down < end, in units of 1 / up input samples."""
        count = max(0, -(-end // self._down) - self._next)
        out = np.empty((count, self._history.shape[1]))
        _kernels.polyphase_into(self._history, self._taps, self._down, self._first, self._next, out)
        self._next += count
        used = min(self._next * self._down // self._up, self._received) - self._first
        self._history = self._history[used:]
        self._first += used
        return out


def _polyphase(up: int, down: int) -> FloatArray:
    """Filter phases, shape (up, 2 * half): tap j of phase p weighs input n + j - half + 1."""
    stretch = max(1.0, down / up)
    half = int(np.ceil(_ZERO_CROSSINGS * stretch))
    offset = np.arange(-half + 1, half + 1)[None, :] - np.arange(up)[:, None] / up
    window = np.i0(_KAISER_BETA * np.sqrt(np.maximum(0, 1 - (offset / half) ** 2)))
    taps = np.sinc(offset / stretch) * window
    return np.ascontiguousarray(taps / taps.sum(axis=1, keepdims=True))
