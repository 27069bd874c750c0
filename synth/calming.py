"""Calming: no join of the synthesis is quicker than the speaker ever moves.

Dikeys squeezed into very short keys can meet at a speed that the recordings hardly know. About
such a join the anticipatory smoothing is widened until the speed is one of theirs: the hand
undershoots there, as a cuer's does in a hurry.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice

SPEED_PERCENTILE = 99.9
_WIDTH_S = 0.03
_REACH_S = 0.05
_ROUNDS = 12
_FRAMES = 4096


def quickest(motions: Iterable[Motion], voice: Voice) -> float:
    """Return the speed in mm/s that 99.9 % of all markers in all frames stay below."""
    speeds = []
    for motion in motions:
        for begin in range(0, len(motion.params) - 1, _FRAMES):
            markers = voice.reconstruct(motion.params[begin : begin + _FRAMES + 1])
            speeds.append(_lengths(np.diff(markers, axis=0)).ravel() * motion.rate_hz)
    return float(np.percentile(np.concatenate(speeds), SPEED_PERCENTILE)) if speeds else np.inf


def calm_joins(
    params: NDArray[np.float64],
    columns: list[int],
    joins: NDArray[np.int64],
    voice: Voice,
    *,
    limit_mm_s: float,
    rate_hz: float,
) -> NDArray[np.float64]:
    """Return the parameters with the joins that exceed a speed smoothed more widely.

    Parameters
    ----------
    params : ndarray of float64, shape (T, P)
    columns : list of int
        The parameters that may change.
    joins : ndarray of int64, shape (J,)
        Frames of the joins; those outside 1..T - 2 are left alone.
    voice : Voice
        Tells the markers of `params`.
    limit_mm_s : float
        Of every marker, as `quickest` finds it.
    rate_hz : float
    """
    joins = joins[(joins >= 1) & (joins < len(params) - 1)]
    out = np.array(params)
    frames = np.arange(len(params))
    for _ in range(_ROUNDS):
        around = out[joins[:, None] + (-1, 0, 1)].reshape(-1, out.shape[1])
        markers = voice.reconstruct(around).reshape(len(joins), 3, -1, 3)
        speed = _lengths(np.diff(markers, axis=1)).max((1, 2), initial=0.0) * rate_hz
        joins = joins[speed > limit_mm_s]
        if not len(joins):
            break
        away = np.abs(frames - joins[:, None]).min(0) / (_REACH_S * rate_hz)
        part = np.exp(-0.5 * away**2)[:, None]
        wide = gaussian_filter1d(out[:, columns], _WIDTH_S * rate_hz, axis=0, mode="nearest")
        out[:, columns] += part * (wide - out[:, columns])
    return out


def _lengths(steps: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(steps, axis=-1), dtype=np.float64)
