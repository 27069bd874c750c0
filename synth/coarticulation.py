"""Coarticulation of the face: phones that compete in time, after Cohen and Massaro (1993).

Every phone pulls each articulator to its target with a dominance that falls off before and after
the phone; the face is the dominance-weighted mean. Dominances have a bounded reach, so that a
frame depends on nearby phones only and any window of time gives the same frames.
"""

import numpy as np
from numpy.typing import NDArray

from codec.phonology import PHONE_NUMBER
from codec.score import Score
from synth.visemes import ARTICULATORS, viseme_table

FloatArray = NDArray[np.float64]

_REACH_S = 0.45
_RISE_S = 0.085
_REST_DOMINANCE = 0.05
_FRAMES_AT_ONCE = 512


def articulate(score: Score, times: FloatArray) -> FloatArray:
    """Return the articulator weights of the face.

    Parameters
    ----------
    score : Score
        Its phones count, keys do not.
    times : ndarray, shape (T,)
        Increasing, seconds.

    Returns
    -------
    ndarray, shape (T, 14)
        Columns as `synth.visemes.ARTICULATORS`.
    """
    out = np.zeros((len(times), len(ARTICULATORS)))
    if not score.phones:
        return out
    numbers = np.array([PHONE_NUMBER[p.symbol] for p in score.phones])
    start = np.array([p.start for p in score.phones])
    end = np.array([p.end for p in score.phones])
    targets, strength = viseme_table()
    for first in range(0, len(times), _FRAMES_AT_ONCE):
        block = slice(first, min(first + _FRAMES_AT_ONCE, len(times)))
        low, high = times[block.start] - _REACH_S, times[block.stop - 1] + _REACH_S
        near = np.flatnonzero((end > low) & (start < high))
        pull = _pull(times[block], start[near], end[near])
        weights = pull @ strength[numbers[near]] + _REST_DOMINANCE
        out[block] = (pull @ (strength * targets)[numbers[near]]) / weights
    return out


def _pull(times: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the time course (T, N) of each phone's dominance, 1 at its middle."""
    middle, half = 0.5 * (start + end), 0.5 * (end - start)
    away = np.abs(times[:, None] - middle)
    fade = np.clip((away - half) / (_REACH_S - half).clip(0.05), 0.0, 1.0)
    return np.exp(-((away / (0.6 * half + _RISE_S * 0.6)) ** 1.5)) * (1.0 - fade) ** 2
