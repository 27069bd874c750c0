"""A hand that nobody sees for a while rests: out of the picture, or below what cameras cover."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from synth.movement import law

FloatArray = NDArray[np.float64]

_TO_REST_S = 0.4


def resting_when_away(
    found: NDArray[np.floating],
    shown: NDArray[np.bool_],
    rest: FloatArray,
    *,
    away_s: float,
    rate_hz: float,
) -> FloatArray:
    """Return the hand's parameters with rests where it is not seen for longer.

    Parameters
    ----------
    found : ndarray, shape (T, P)
        Parameters; anything finite where the hand is not seen.
    shown : ndarray of bool, shape (T,)
        Frames that show the hand.
    rest : ndarray of float64, shape (P,)
    away_s : float
        Shorter gaps stay as they are.
    rate_hz : float

    Examples
    --------
    >>> shown = np.array([True] * 5 + [False] * 20 + [True] * 5)
    >>> out = resting_when_away(np.ones((30, 1)), shown, np.zeros(1), away_s=0.5, rate_hz=20.0)
    >>> out[[4, 9, 15, 25], 0].round(1).tolist()
    [1.0, 0.3, 0.0, 1.0]
    """
    out = found.astype(np.float64)
    profile = law("minimum-jerk")
    gaps, count = label(~shown)
    ramp = max(1, round(_TO_REST_S * rate_hz))
    for number in range(1, count + 1):
        at = np.flatnonzero(gaps == number)
        begin, end = int(at[0]), int(at[-1]) + 1
        if len(at) < away_s * rate_hz:
            continue
        away = np.ones(len(at))
        if begin > 0:
            away = np.minimum(away, np.arange(1, len(at) + 1) / ramp)
        if end < len(found):
            away = np.minimum(away, np.arange(len(at), 0, -1) / ramp)
        share = profile(np.clip(away, 0.0, 1.0))[:, None]
        left = found[begin - 1] if begin > 0 else found[min(end, len(found) - 1)]
        right = found[end] if end < len(found) else left
        early = (np.arange(len(at)) < len(at) // 2)[:, None]
        out[begin:end] = share * rest + (1.0 - share) * np.where(early, left, right)
    return out
