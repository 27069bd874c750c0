"""The face of the second cuer: each articulator steps from target to target and is smoothed.

A phone that does not insist on an articulator lets it pass from its neighbours' targets. The steps
are smoothed by a Gaussian, wider for the jaw than for the lips: a linear filter where the synthesis
by rule lets dominances compete.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from codec.cues.phonology import PHONE_NUMBER
from codec.cues.score import Score
from synth.motion.measured.drift_noise import normals_of
from synth.motion.rules.visemes import ARTICULATORS, viseme_table

FloatArray = NDArray[np.float64]

_INSISTS = 0.5
"""Least share of dominance of a phone that holds an articulator; others let it pass."""

_TARGET_SCATTER = 0.2
"""Standard deviation of a target's size from phone to phone, of 1."""

_TIME_SCATTER_S = 0.015
"""Standard deviation in seconds of an articulator's step about the phone's begin."""

_SMOOTH_S = {"jaw": 0.045, "larynx": 0.060, "jaw_forward": 0.055, "cheek": 0.050}

_SMOOTH_LIPS_S = 0.032
"""Standard deviation in seconds of the lips' smoothing."""

_NEAR = 6.0
"""Standard deviations of the smoothing beyond which a step has no effect."""


def own_targets(seed: int) -> FloatArray:
    """Return her targets of all phones, shape (38, 14): the common ones, each made her own."""
    common, _ = viseme_table()
    scatter = normals_of(seed, 1, common.size).reshape(common.shape)
    return np.asarray(common * (1.0 + _TARGET_SCATTER * np.clip(scatter, -2.0, 2.0)))


def steps(score: Score, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return times (N,) of the steps and the articulators after each, shape (N + 1, 14).

    Row 0 is the face before the first phone, at rest.
    """
    table, insists = own_targets(seed), viseme_table()[1] >= _INSISTS
    times, rows, holds = [], [np.zeros(len(ARTICULATORS))], [np.ones(len(ARTICULATORS), bool)]
    end = None
    for number, phone in enumerate(score.phones):
        scatter = _TIME_SCATTER_S * float(normals_of(seed + 2, number, 1)[0])
        if end is not None and phone.start - end > 2 * _SMOOTH_LIPS_S:
            times.append(end)
            rows.append(np.zeros(len(ARTICULATORS)))
            holds.append(holds[0])
        times.append(phone.start + min(scatter, 0.3 * (phone.end - phone.start)))
        rows.append(table[PHONE_NUMBER[phone.symbol]])
        holds.append(insists[PHONE_NUMBER[phone.symbol]])
        end = phone.end
    if end is not None:
        times.append(end)
        rows.append(np.zeros(len(ARTICULATORS)))
        holds.append(holds[0])
    values = np.array(rows)
    at = np.arange(len(values))
    # Where a phone leaves an articulator free, it passes from the phone before to the one after.
    for column, held in enumerate(np.array(holds).T):
        values[:, column] = np.interp(at, at[held], values[held, column])
    return np.maximum.accumulate(np.array(times, dtype=np.float64)), values


def articulators(times: FloatArray, at: FloatArray, values: FloatArray) -> FloatArray:
    """Return the articulators at rising `times` (T,), shape (T, 14).

    Parameters
    ----------
    times : ndarray of float64, shape (T,)
        Seconds.
    at, values : ndarray of float64, shapes (N,) and (N + 1, 14)
        From `steps`.
    """
    smooth = np.array([_SMOOTH_S.get(name, _SMOOTH_LIPS_S) for name in ARTICULATORS])
    out = np.empty((len(times), len(ARTICULATORS)))
    for low in range(0, len(times), 512):
        part = times[low : low + 512]
        margin = _NEAR * smooth.max()
        first, last = np.searchsorted(at, [part[0] - margin, part[-1] + margin])
        passed = ndtr((part[:, None, None] - at[None, first:last, None]) / smooth)
        out[low : low + 512] = values[first] + (
            passed * np.diff(values[first : last + 1], axis=0)
        ).sum(1)
    return out
