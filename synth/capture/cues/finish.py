"""The last steps that all sources share: the steady rate, the keys, the motion.

A hand that nobody sees for a while rests: out of the picture, or below what cameras cover.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import PLACEMENTS, Score
from synth.capture.cues.appearance import ANYBODYS, KeyAppearance, looks_of
from synth.capture.cues.features import HandFeatures, see_motion
from synth.capture.cues.follow import follow_keys
from synth.capture.cues.recognise import HeldKey, recognise_keys
from synth.capture.cues.score import is_sure, score_of, score_of_text
from synth.capture.options import Captured, CaptureOptions
from synth.capture.sources.resample import even_times, resample
from synth.motion.rules.movement import law


def finish(
    voice: Voice,
    params: NDArray[np.floating],
    rate_hz: float,
    file_start_s: float,
    options: CaptureOptions,
    report: dict[str, Any],
    *,
    has_hand: bool,
    seen: HandFeatures | None = None,
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
        Findings so far; keys and notes are added.
    has_hand : bool
        Whether there is a hand to recognise keys of.
    seen : HandFeatures, optional
        Features of keys; default: from the parameters.
    """
    start_s = file_start_s if options.start_s is None else options.start_s
    duration_s = len(params) / rate_hz
    times = even_times(start_s, duration_s, options.rate_hz)
    even = resample(np.asarray(params, dtype=np.float64), rate_hz, times - start_s)
    given = options.score and options.score.shifted(start_s - file_start_s)
    score = given
    # Keys: a given score is compared with the hand, a text is searched in it, else they are
    # recognised alone.
    if has_hand and (options.keys or given):
        looks = ANYBODYS
        if seen is None:
            seen, looks = see_motion(voice, even, rate_hz=options.rate_hz), looks_of(voice)
        timed = _TimedHand(voice, even, options.rate_hz, float(times[0]), seen, looks)
        if given is not None:
            timed.compare(given, report)
        else:
            score = timed.score(options.text, report)
    elif given is not None:
        report["keys"] = {"given": len(given.keys)}
    motion = Motion(
        even.astype(np.float32),
        options.rate_hz,
        float(times[0]),
        voice.layout,
        voice.identity,
        score,
    )
    return Captured(motion, report)


@dataclass(frozen=True, slots=True)
class _TimedHand:
    """A hand's keys and times; `even` (T, P) are the motion's parameters."""

    voice: Voice
    even: NDArray[np.float64]
    rate_hz: float
    start_s: float
    seen: HandFeatures
    looks: KeyAppearance

    def compare(self, given: Score, report: dict[str, Any]) -> None:
        """Tell whether the hand shows the keys of a score that has times."""
        report["keys"] = {"given": len(given.keys)}
        if given.keys and self.seen.shown.any():
            found = follow_keys(self.seen, given.keys, looks=self.looks)
            report["keys"]["agreement"] = round(found.agreement, 3)
            if not found.believed:
                report["notes"].append(_NOT_SHOWN.format("score", found.agreement))

    def score(self, text: Score | None, report: dict[str, Any]) -> Score | None:
        """Return the hand's keys: a text's keys if it shows them, else those recognised."""
        if text is not None and text.keys:
            found = follow_keys(self.seen, text.keys, looks=self.looks)
            # The text is believed only if enough of its keys are seen: a wrong text must not be
            # confirmed.
            if found.believed:
                held = [one for one in found.held if one is not None]
                report["keys"] = {
                    "given": len(text.keys),
                    "left_out": len(text.keys) - len(held),
                    "agreement": round(found.agreement, 3),
                }
                return score_of_text(
                    found.held,
                    text.keys,
                    self.voice,
                    self.even,
                    rate_hz=self.rate_hz,
                    start_s=self.start_s,
                )
            report["notes"].append(
                _NOT_SHOWN.format("text", found.agreement) + ": keys are recognised without it"
            )
        recognised = recognise_keys(self.seen, looks=self.looks)
        report["keys"] = _told(recognised.held, self.start_s)
        if text is not None:
            report["keys"]["agreement"] = round(found.agreement, 3) if text.keys else 0.0
        if is_sure(recognised.held):
            return score_of(
                recognised.held, self.voice, self.even, rate_hz=self.rate_hz, start_s=self.start_s
            )
        report["notes"].append("too few keys are sure: the motion carries no score")
        return None


_NOT_SHOWN = "the hand does not show the given {}, agreement {:.2f}"


def _told(held: Sequence[HeldKey], start_s: float) -> dict[str, Any]:
    """Return how many keys were recognised, and how surely; then each of them, by time."""
    keys = [one for one in held if one.shape]
    return {
        "recognised": len(keys),
        "confidence": round(float(np.mean([k.confidence for k in keys])), 3) if keys else None,
        "held": [
            {
                "start_s": round(start_s + key.reach_s, 3),
                "end_s": round(start_s + key.leave_s, 3),
                "shape": key.shape,
                "placement": PLACEMENTS[key.placement],
                "confidence": round(key.confidence, 3),
            }
            for key in keys
        ],
    }


FloatArray = NDArray[np.float64]

_TO_REST_S = 0.4
"""Seconds that a hand that has gone out of sight takes to rest."""


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
        # 0 beside the frames that show the hand, 1 from a ramp's length on; a gap at an end of the
        # take has only one ramp.
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
