"""Coarticulation of the face: phones that compete in time, after Cohen and Massaro (1993).

Every phone pulls each articulator to its target with a dominance that falls off before and after
the phone; the face is the dominance-weighted mean. Dominances have a bounded reach, so that a
frame depends on nearby phones only and any window of time gives the same frames.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PHONE_NUMBER
from codec.cues.score import Score
from synth.motion.rules.visemes import ARTICULATORS, viseme_table

FloatArray = NDArray[np.float64]

REACH_S = 0.45
"""Seconds from a phone beyond which it has no say."""

_RISE_S = 0.045
"""Time constant in seconds of the fall of a phone's weight, beside a share of its length."""

_REST_DOMINANCE = 0.05
"""Weight of the mouth at rest against phones."""

_FRAMES_AT_ONCE = 512
"""Frames that are computed at once, for constant memory."""


@dataclass(frozen=True, slots=True)
class PhoneLine:
    """The phones of a score as arrays.

    Attributes
    ----------
    number : ndarray of int64, shape (N,)
        Phone numbers of `codec.cues.phonology.PHONE_NUMBER`.
    start, end : ndarray, shape (N,)
        Seconds.
    """

    number: NDArray[np.int64]
    start: FloatArray
    end: FloatArray

    @classmethod
    def of(cls, score: Score) -> "PhoneLine":
        """Return the phones of `score`."""
        return cls(
            np.array([PHONE_NUMBER[p.symbol] for p in score.phones], dtype=np.int64),
            np.array([p.start for p in score.phones], dtype=np.float64),
            np.array([p.end for p in score.phones], dtype=np.float64),
        )

    def silent(self, times: FloatArray, margin_s: float) -> NDArray[np.bool_]:
        """Return which times are `margin_s` or more away from every phone, shape (T,)."""
        following = np.searchsorted(self.start, times + margin_s, side="left")
        latest_end = np.append(-np.inf, np.maximum.accumulate(self.end))
        return latest_end[following] <= times - margin_s


def articulate(line: PhoneLine, times: FloatArray) -> FloatArray:
    """Return the articulator weights of the face.

    Parameters
    ----------
    line : PhoneLine
    times : ndarray, shape (T,)
        Increasing, seconds.

    Returns
    -------
    ndarray, shape (T, 14)
        Columns as `synth.motion.rules.visemes.ARTICULATORS`.
    """
    out = np.zeros((len(times), len(ARTICULATORS)))
    targets, strength = viseme_table()
    for first in range(0, len(times), _FRAMES_AT_ONCE):
        block = slice(first, min(first + _FRAMES_AT_ONCE, len(times)))
        pull, near = dominance(line, times[block])
        number = line.number[near]
        weights = pull @ strength[number] + _REST_DOMINANCE
        out[block] = (pull @ (strength * targets)[number]) / weights
    return out


def dominance(line: PhoneLine, times: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the dominance (T, N) of the phones that have a say at some times, and which they are.

    Parameters
    ----------
    line : PhoneLine
    times : ndarray, shape (T,)
        Increasing, seconds.
    """
    if not len(times):
        return np.zeros((0, 0)), np.zeros(0, dtype=np.int64)
    low, high = times[0] - REACH_S, times[-1] + REACH_S
    near = np.flatnonzero((line.end > low) & (line.start < high))
    return _pull(times, line.start[near], line.end[near]), near


def _pull(times: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the time course (T, N) of each phone's dominance, 1 at its middle."""
    middle, half = 0.5 * (start + end), 0.5 * (end - start)
    away = np.abs(times[:, None] - middle)
    fade = np.clip((away - half) / (REACH_S - half).clip(0.05), 0.0, 1.0)
    scale = 0.6 * half + _RISE_S
    pull: FloatArray = np.exp(-((away / scale) ** 2)) * (1.0 - fade) ** 2
    return pull
