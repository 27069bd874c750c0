"""From target to target: laws of movement and the timing of hand gestures.

A gesture leaves one target at time ``leave`` and is on the next at time ``reach``; in between,
its progress follows one of the `LAWS`, each a monotone profile from 0 to 1. Times come from the
score by the rules that Attina (2005) measured on cuers of French, or by those of Gibert, Bailly,
Elisei (2004, section 5.1).
"""

import bisect
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import PLACEMENT_NUMBER, Key, Score
from codec.errors import CueError

FloatArray = NDArray[np.float64]

ALIGNMENTS = ("attina", "paper")

_LOG_SIGMA = 0.45
_DAMPING = 9.0


def _minimum_jerk(s: FloatArray) -> FloatArray:
    """Flash and Hogan 1985: the smoothest movement between two rests."""
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def _lognormal(s: FloatArray) -> FloatArray:
    """Plamondon 1995: early peak of speed, long approach; cut at three deviations."""
    low, high = -3.0 * _LOG_SIGMA, 3.0 * _LOG_SIGMA
    span = math.exp(high) - math.exp(low)
    log_time = np.log(math.exp(low) + s * span)
    area = math.erf(3.0 / math.sqrt(2.0))
    progress = 0.5 + 0.5 * erf(log_time / (_LOG_SIGMA * math.sqrt(2.0))) / area
    return np.asarray(np.clip(progress, 0.0, 1.0))


def _damped(s: FloatArray) -> FloatArray:
    """Step response of a critically damped second-order system, scaled to end at 1."""
    x = _DAMPING * s
    return np.asarray(
        (1.0 - (1.0 + x) * np.exp(-x)) / (1.0 - (1.0 + _DAMPING) * math.exp(-_DAMPING))
    )


LAWS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "minimum-jerk": _minimum_jerk,
    "lognormal": _lognormal,
    "damped": _damped,
}
"""Progress 0..1 of a movement as a function of its elapsed part 0..1."""


def law(name: str) -> Callable[[FloatArray], FloatArray]:
    """Return a movement law.

    Raises
    ------
    CueError
        If there is no such law.

    Examples
    --------
    >>> float(law("minimum-jerk")(np.array(0.5)))
    0.5
    """
    if name not in LAWS:
        raise CueError(f"unknown movement law {name!r}; known: {', '.join(LAWS)}")
    return LAWS[name]


@dataclass(frozen=True, slots=True)
class Gestures:
    """A line of gestures of the hand, rest included.

    Attributes
    ----------
    shape, placement : ndarray of int, shape (G,)
        Target of each gesture; the first one is the rest before everything.
    leave, reach : ndarray, shape (G,)
        When placement leaves the previous target and reaches its own, seconds.
    shape_leave, shape_reach : ndarray, shape (G,)
        The same for the fingers.
    """

    shape: NDArray[np.int64]
    placement: NDArray[np.int64]
    leave: FloatArray
    reach: FloatArray
    shape_leave: FloatArray
    shape_reach: FloatArray


_FIRST_LEAD_S = 0.45
_LEAD_LIMITS_S = (0.14, 0.24)
_LEAD_PART = 0.62
_SHAPE_EARLIER_S = 0.03
_TO_REST_DELAY_S = 0.08
_TO_REST_S = 0.55
_LEAST_MOVE_S = 0.06
_LONG_AGO_S = -1e6


def plan_gestures(
    score: Score, *, alignment: str = "attina", options: CueingOptions = DEFAULT_OPTIONS
) -> Gestures:
    """Return when the hand leaves and reaches every target of `score`.

    Parameters
    ----------
    score : Score
    alignment : {"attina", "paper"}
        Target of a consonant-vowel key in the first part of the consonant (Attina 2005), or in
        its middle (Gibert, Bailly, Elisei 2004, section 5.1).
    options : CueingOptions
        Which gaps send the hand to rest.

    Raises
    ------
    CueError
        If `alignment` is unknown.
    """
    check_alignment(alignment)
    rows: list[tuple[int, int, float, float]] = [(0, 0, _LONG_AGO_S, _LONG_AGO_S)]
    previous: Key | None = None
    for key in score.keys:
        target = key.start + _lag(key, score, alignment)
        rested = previous is None or key.start - previous.end >= options.rest_gap_s
        if rested:
            lead = _FIRST_LEAD_S
            if previous is not None:
                lead = min(lead, 0.5 * (key.start - previous.end))
                rows.append(_to_rest(previous, key.start - lead))
        else:
            assert previous is not None
            lead = float(np.clip(_LEAD_PART * (key.start - previous.start), *_LEAD_LIMITS_S))
        leave = max(key.start - lead, rows[-1][3])
        reach = max(target, leave + _LEAST_MOVE_S)
        rows.append((key.shape, PLACEMENT_NUMBER[key.placement], leave, reach))
        previous = key
    if previous is not None:
        rows.append(_to_rest(previous, math.inf))
    return _assemble(rows)


def target_times(
    score: Score, *, alignment: str = "attina", options: CueingOptions = DEFAULT_OPTIONS
) -> list[float]:
    """Return when the hand is on the target of each key, seconds, as in `plan_gestures`."""
    gestures = plan_gestures(score, alignment=alignment, options=options)
    return [
        float(reach)
        for placement, reach in zip(gestures.placement, gestures.reach, strict=True)
        if placement
    ]


def check_alignment(name: str) -> None:
    """Raise `CueError` if there is no such alignment."""
    if name not in ALIGNMENTS:
        raise CueError(f"unknown alignment {name!r}; known: {', '.join(ALIGNMENTS)}")


def _to_rest(key: Key, before: float) -> tuple[int, int, float, float]:
    leave = key.end + _TO_REST_DELAY_S
    return 0, 0, leave, max(min(leave + _TO_REST_S, before), leave + _LEAST_MOVE_S)


def _lag(key: Key, score: Score, alignment: str) -> float:
    """Return how long after the key's acoustic start its target is reached, seconds."""
    if len(key.phones) < 2:
        return 0.0
    part = 0.16 if alignment == "attina" else 0.5
    return part * (_vowel_onset(key, score) - key.start)


def _vowel_onset(key: Key, score: Score) -> float:
    """Return the start of the key's vowel; the middle of the key if the score has no phones."""
    number = bisect.bisect_right(score.phones, key.start + 1e-6, key=lambda p: p.start)
    if number < len(score.phones) and score.phones[number].start < key.end:
        return score.phones[number].start
    return 0.5 * (key.start + key.end)


def _assemble(rows: list[tuple[int, int, float, float]]) -> Gestures:
    shape, placement = (np.array([row[i] for row in rows], dtype=np.int64) for i in (0, 1))
    leave, reach = (np.array([row[i] for row in rows]) for i in (2, 3))
    for number in range(1, len(rows)):
        leave[number] = max(leave[number], reach[number - 1])
        reach[number] = max(reach[number], leave[number] + 1e-3)
    shape_reach = np.maximum(reach - _SHAPE_EARLIER_S, leave + 0.5 * (reach - leave))
    return Gestures(shape, placement, leave, reach, leave.copy(), shape_reach)


def progress(
    times: FloatArray,
    leave: FloatArray,
    reach: FloatArray,
    profile: Callable[[FloatArray], FloatArray],
) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the gesture under way and its progress at each time.

    Parameters
    ----------
    times : ndarray, shape (T,)
        Seconds.
    leave, reach : ndarray, shape (G,)
        Ordered, ``leave[g] >= reach[g - 1]``.
    profile : callable
        One of `LAWS`.

    Returns
    -------
    current : ndarray of int, shape (T,)
        Number of the last gesture that has left, at least 1 if there is one.
    part : ndarray, shape (T,)
        Progress from target ``current - 1`` to ``current``, 0..1.
    """
    if len(leave) == 1:
        return np.zeros(len(times), dtype=np.int64), np.ones(len(times))
    current = np.clip(np.searchsorted(leave, times, side="right") - 1, 1, len(leave) - 1)
    elapsed = (times - leave[current]) / (reach[current] - leave[current])
    return current, profile(np.clip(elapsed, 0.0, 1.0))
