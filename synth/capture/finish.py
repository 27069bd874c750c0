"""The last steps that all sources share: the steady rate, the keys, the motion.

A hand that nobody sees for a while rests: out of the picture, or below what cameras cover.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Score
from synth.capture.keys import Held, recognise_keys
from synth.capture.options import Captured, CaptureOptions
from synth.capture.score import is_sure, score_of
from synth.capture.sources.resample import even_times, resample
from synth.rules.movement import law


def finish(
    voice: Voice,
    params: NDArray[np.floating],
    rate_hz: float,
    file_start_s: float,
    options: CaptureOptions,
    report: dict[str, Any],
    *,
    has_hand: bool,
    depth: bool = True,
) -> Captured:
    """Return the motion of parameters at the recording's rate.

    Parameters
    ----------
    voice : Voice
    params : ndarray, shape (T, P)
    rate_hz, file_start_s : float
        Clock of the recording.
    options : CaptureOptions
    report : dict
        What has been found; keys and notes are added.
    has_hand : bool
        Whether there is a hand to recognise keys of.
    depth : bool
        Whether depth was measured.
    """
    start_s = file_start_s if options.start_s is None else options.start_s
    duration_s = len(params) / rate_hz
    times = even_times(start_s, duration_s, options.rate_hz)
    even = resample(np.asarray(params, dtype=np.float64), rate_hz, times - start_s)
    score: Score | None = None
    if options.score is not None:
        score = options.score.shifted(start_s - file_start_s)
        report["keys"] = {"given": len(score.keys)}
    elif options.keys and has_hand:
        held = recognise_keys(voice, even, rate_hz=options.rate_hz, depth=depth)
        report["keys"] = _told(held)
        if is_sure(held):
            score = score_of(
                held, voice, even, rate_hz=options.rate_hz, start_s=float(times[0])
            )  # fmt: skip
        else:
            report["notes"].append("too few keys are sure: the motion carries no score")
    motion = Motion(
        even.astype(np.float32), options.rate_hz, float(times[0]), voice.layout, voice.identity,
        score,
    )  # fmt: skip
    return Captured(motion, report)


def _told(held: list[Held]) -> dict[str, Any]:
    """Return how many keys were recognised, and how surely."""
    keys = [one for one in held if one.shape]
    return {
        "recognised": len(keys),
        "confidence": round(float(np.mean([k.confidence for k in keys])), 3) if keys else None,
    }


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
