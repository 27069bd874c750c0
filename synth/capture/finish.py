"""The last steps that all sources share: the steady rate, the keys, the motion."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Score
from synth.capture.keys import Held, recognise_keys
from synth.capture.options import Captured, CaptureOptions
from synth.capture.resample import even_times, resample
from synth.capture.score import is_sure, score_of


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
