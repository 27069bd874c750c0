"""Strokes of the hand that overlap: each carries it by a vector along an arc, in a time of its own.

Where the hand is, is the sum of what all strokes have carried it so far; the next one sets out
before the last has ended, so that there are few holds. The speed of a stroke is a sine over a
warped time; a part of it follows late and slowly, the slow end that real cuers show. Durations,
overlaps, curvature and the fingers' lag are drawn from the distributions measured on real cuers
(64 utterances; medians and spreads only).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_CHUNK = 512
"""Moments that are computed at once, for constant memory."""


@dataclass(frozen=True, slots=True)
class Strokes:
    """A line of strokes of several channels that move together, N of them.

    Attributes
    ----------
    origin : ndarray of float64, shape (C,)
        Before the first stroke.
    carries : ndarray of float64, shape (N, C)
        Displacement by each stroke.
    begin, span : ndarray of float64, shape (N,) or (N, C)
        Start and duration, seconds; one column per channel where joints are out of step.
    peak : ndarray of float64, shape (N,)
        Part of the duration at which the stroke is fastest, 0.25 to 0.75.
    late : ndarray of float64, shape (N,)
        Part of the displacement that follows late.
    arc : ndarray of float64, shape (N,)
        Angle through which the direction turns on the way, rad; 0 is straight.
    across : ndarray of float64, shape (N, C)
        Where the arc bulges to at a turn of two radians: a vector across the stroke.
    """

    origin: FloatArray
    carries: FloatArray
    begin: FloatArray
    span: FloatArray
    peak: FloatArray
    late: FloatArray
    arc: FloatArray
    across: FloatArray

    def at(self, times: FloatArray) -> FloatArray:
        """Return the channels at rising `times` (T,), seconds, shape (T, C)."""
        out = np.tile(self.origin, (len(times), 1))
        if not len(self.begin):
            return out
        start = self.begin.reshape(len(self.begin), -1)
        first, last = start.min(1), (start + 2.0 * self.span.reshape(start.shape)).max(1)
        for low in range(0, len(times), _CHUNK):
            part = times[low : low + _CHUNK]
            done = last <= part[0]
            now = np.flatnonzero(~done & (first < part[-1]))
            place = np.tile(self.origin + self.carries[done].sum(0), (len(part), 1))
            for number in now:
                place += self._of(int(number), part)
            out[low : low + _CHUNK] = place
        return out

    def _of(self, number: int, times: FloatArray) -> FloatArray:
        begin, span = np.atleast_1d(self.begin[number]), np.atleast_1d(self.span[number])
        elapsed = (times[:, None] - begin) / span
        share = float(self.late[number])
        gone = (1.0 - share) * travelled(elapsed, self.peak[number])
        gone += share * travelled(0.7 * elapsed - 0.1, 0.4)
        bulge = _bulge(gone, float(self.arc[number]))
        return np.asarray(gone * self.carries[number] + bulge * self.across[number])


def travelled(elapsed: FloatArray, peak: float) -> FloatArray:
    """Return the part of the way after a part of the time, 0 to 1, fastest at `peak`.

    The mean of a half cosine and a cycloid over time raised to the power that puts the peak there.

    Examples
    --------
    >>> travelled(np.array([-1.0, 0.0, 0.3, 1.0, 2.0]), 0.3).round(3).tolist()
    [0.0, 0.0, 0.5, 1.0, 1.0]
    """
    w = np.clip(elapsed, 0.0, 1.0) ** (np.log(0.5) / np.log(peak))
    return np.asarray(
        0.25 * (1.0 - np.cos(np.pi * w)) + 0.5 * w - np.sin(2 * np.pi * w) / (4 * np.pi)
    )


def _bulge(gone: FloatArray, arc: float) -> FloatArray:
    """Return how far an arc stands off its chord, in parts of it, where `gone` of it is done."""
    if abs(arc) < 1e-6:
        return np.zeros_like(gone)
    half = 0.5 * arc
    return np.asarray((np.cos(arc * gone - half) - np.cos(half)) / (2.0 * np.sin(half)))
