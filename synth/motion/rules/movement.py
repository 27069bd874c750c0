"""From target to target: laws of movement and the timing of hand gestures.

A gesture leaves one target at time ``leave`` and is on the next at time ``reach``; in between,
its progress follows one of the `LAWS`, each a monotone profile from 0 to 1. Gestures may overlap:
their strokes add up. Times come from the score by the rules that Attina (2005) measured on cuers
of French, or by those of Gibert, Bailly, Elisei (2004, section 5.1), with the constants of
`codec.cuer.movement`.
"""

import bisect
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from codec.compiled import lightly
from codec.cuer.movement import FLOWING, Movement
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import PLACEMENT_NUMBER, Key, Score
from codec.errors import CueError
from synth.motion.rules import _kernels

FloatArray = NDArray[np.float64]

ALIGNMENTS = ("attina", "paper")

FEW = 40
"""So few keys are not worth the time that loading compiled kernels takes, if these are not."""

_LOG_SIGMA = 0.45
"""Standard deviation of the logarithm of time in the lognormal law."""

_DAMPING = 9.0
"""Decay of the damped law over a movement, without unit."""


def _minimum_jerk(s: FloatArray) -> FloatArray:
    """Flash and Hogan 1985: the smoothest movement between two rests."""
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def _lognormal(s: FloatArray) -> FloatArray:
    """Plamondon 1995: early peak of speed, long approach; cut at three deviations."""
    from scipy.special import erf

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
    """

    shape: NDArray[np.int64]
    placement: NDArray[np.int64]
    leave: FloatArray
    reach: FloatArray


LONG_AGO_S = -1e6
"""A time in seconds before any that occurs."""

_REST = 0, 0
"""Numbers of shape and placement of the hand at rest."""

_TYPICAL_WAY_MM = 60.0
"""Way in mm of a stroke without known targets."""

Way = Callable[[tuple[int, int], tuple[int, int]], float]
Profile = Callable[[FloatArray], FloatArray]


def plan_gestures(
    score: Score,
    *,
    alignment: str = "attina",
    options: CueingOptions = DEFAULT_OPTIONS,
    movement: Movement = FLOWING,
    way: Way = lambda before, after: _TYPICAL_WAY_MM,
) -> Gestures:
    """Return when the hand leaves and reaches every target of `score`.

    Parameters
    ----------
    score : Score
    alignment : {"attina", "paper"}
        Target of a consonant-vowel key in the first part of the consonant (Attina 2005; where is
        the movement's `lag_share`), or in its middle (Gibert, Bailly, Elisei 2004, section 5.1).
    options : CueingOptions
        Which gaps send the hand to rest.
    movement : Movement
        Of the voice.
    way : callable
        Millimetres between two targets, each given as (shape, placement number).

    Raises
    ------
    CueError
        If `alignment` is unknown.
    """
    check_alignment(alignment)
    keys = score.keys
    target = [key.start + _lag(key, score, alignment, movement.lag_share) for key in keys]
    rested = [
        before is None or key.start - before.end >= options.rest_gap_s
        for before, key in zip((None, *keys), keys, strict=False)
    ]
    # shown: rest, key, key, ..., rest, with a rest wherever the hand has time for one.
    shown, ways = [_REST], list[float]()
    for key, from_rest in zip(keys, rested, strict=True):
        if from_rest and ways:
            shown.append(_REST)
        here = key.shape, PLACEMENT_NUMBER[key.placement]
        ways.append(way(shown[-1], here))
        shown.append(here)
    if keys:
        shown.append(_REST)
    start, end = (np.array([getattr(key, name) for key in keys]) for name in ("start", "end"))
    leave, reach = timed_strokes(
        start, end, np.array(target), np.array(rested, dtype=bool), np.array(ways), movement
    )
    shape, placement = np.array(shown, dtype=np.int64).T.copy()
    return Gestures(shape, placement, leave, reach)


def timed_strokes(
    start: FloatArray,
    end: FloatArray,
    target: FloatArray,
    rested: NDArray[np.bool_],
    way: FloatArray,
    movement: Movement = FLOWING,
) -> tuple[FloatArray, FloatArray]:
    """Return when the hand leaves for each target and reaches it, the rests' included.

    Parameters
    ----------
    start, end, target : ndarray, shape (N,)
        When each key sounds, and when the hand should be there, seconds.
    rested : ndarray of bool, shape (N,)
        Whether it comes from rest; the first one does.
    way : ndarray, shape (N,)
        From where it comes, mm.
    movement : Movement

    Returns
    -------
    leave, reach : ndarray, shape (G,)
        The rest before everything, each key after the rest before it if there is one, the rest.
    """
    most = 2 * len(start) + 2
    leave, reach = np.full(most, LONG_AGO_S), np.full(most, LONG_AGO_S)
    kernel = _kernels.strokes_into
    count = (lightly(kernel) if len(start) <= FEW else kernel)(
        start, end, target, rested, way, *stroke_rule(movement), leave, reach
    )
    return leave[:count], reach[:count]


@cache
def stroke_rule(movement: Movement) -> tuple[float, ...]:
    """Return the numbers of a movement that time its strokes, as the kernels take them."""
    m = movement
    return (
        m.lead_share, m.calm_share, m.hurried_s, m.least_lead_s, m.most_lead_s, m.lead_s_per_mm,
        m.overlap, m.shortest_s, m.peak_s_per_mm, m.late_s, m.first_lead_s, m.rest_delay_s,
        m.rest_move_s,
    )  # fmt: skip


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


def _lag(key: Key, score: Score, alignment: str, share: float) -> float:
    """Return how long after the key's acoustic start its target is reached, seconds."""
    if len(key.phones) < 2:
        return 0.0
    part = share if alignment == "attina" else 0.5
    return part * (_vowel_onset(key, score) - key.start)


def _vowel_onset(key: Key, score: Score) -> float:
    """Return the start of the key's vowel; the middle of the key if the score has no phones."""
    number = bisect.bisect_right(score.phones, key.start + 1e-6, key=lambda p: p.start)
    if number < len(score.phones) and score.phones[number].start < key.end:
        return score.phones[number].start
    return 0.5 * (key.start + key.end)


def moved(
    times: FloatArray,
    gestures: Gestures,
    values: FloatArray,
    profile: Profile,
    *,
    begins_s: FloatArray | None = None,
    ends_s: FloatArray | None = None,
    movement: Movement = FLOWING,
) -> FloatArray:
    """Return where strokes that add up have brought each channel.

    Parameters
    ----------
    times : ndarray, shape (T,)
        Ascending, seconds.
    gestures : Gestures
    values : ndarray, shape (G, C)
        Targets.
    profile : callable
        One of `LAWS`.
    begins_s, ends_s : ndarray, shape (C,), optional
        How much later than its gesture the stroke of a channel begins and ends; less in
        strokes shorter than the movement's.
    movement : Movement
        Its exponent is that of the elapsed part, before the profile.

    Returns
    -------
    ndarray, shape (T, C)
    """
    if len(times) == 0:
        return np.zeros((0, values.shape[1]))
    at_once = np.zeros(values.shape[1])
    begins_s = at_once if begins_s is None else begins_s
    ends_s = at_once if ends_s is None else ends_s
    slack = max(abs(begins_s).max(), abs(ends_s).max()) + 1e-6
    first = int(np.searchsorted(gestures.reach, times[0] - slack))
    last = int(np.searchsorted(gestures.leave, times[-1] + slack))
    out = np.zeros((len(times), values.shape[1]))
    done = np.zeros((len(times) + 1, values.shape[1]))
    done[0] = values[max(first - 1, 0)]
    strokes = slice(max(first, 1), max(first, 1, last))
    leave, reach = gestures.leave[strokes, None], gestures.reach[strokes, None]
    apart = np.minimum(1.0, (reach - leave) / max(movement.stroke_s, 1e-9))
    begin = leave + apart * begins_s
    length = np.maximum(reach + apart * ends_s - begin, 0.5 * (reach - leave))
    # x(t) = x0 + sum over strokes of (target - target before) * profile(share of the stroke's
    # time); strokes that are over are added by a running sum. All strokes' frames in one row.
    step = np.diff(values[strokes.start - 1 : strokes.stop], axis=0)
    begun, over = np.searchsorted(times, (begin.min(axis=1), (begin + length).max(axis=1)))
    frames = over - begun
    row = np.concatenate([[0], np.cumsum(frames)])
    stroke = np.repeat(np.arange(len(frames)), frames)
    now = times[np.arange(row[-1]) + (begun - row[:-1])[stroke], None]
    elapsed = np.clip((now - begin[stroke]) / length[stroke], 0.0, 1.0)
    part = profile(elapsed**movement.power) * step[stroke]
    for g in range(len(frames)):
        out[begun[g] : over[g]] += part[row[g] : row[g + 1]]
        done[over[g]] += step[g]
    return np.asarray(out + np.cumsum(done[:-1], axis=0))
