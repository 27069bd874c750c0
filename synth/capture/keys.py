"""The keys that a motion shows: where the hand holds which shape at which placement.

A hidden Markov model runs over the frames: a key is held, or the hand is on its way. What a held
key looks like is known from the voice's own targets, with the spread that real cuers have, and
learnt further from the take; a hand that is quick holds nothing. The likeliest sequence is found
by dynamic programming (Viterbi 1967). A key that repeats its predecessor at the same place moves
nothing and cannot be told apart from it.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d
from scipy.signal import savgol_filter

from codec.analysis.recognise import Gaussians, pointing_tip
from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.models.face import N_FACE_PARAMETERS
from codec.cuer.models.hand import N_HAND_PARAMETERS
from codec.cuer.voice import Voice
from codec.cues.score import PLACEMENTS, SHAPES
from synth.capture.points.axes import fit_placements
from synth.capture.tracker.closure import N_FEATURES, closures

FloatArray = NDArray[np.float64]

_CLOSURE_SD = 0.2
_PLACEMENT_SD_MM = {
    "rest": 60.0,
    "side": 20.0,
    "mouth": 13.0,
    "chin": 14.0,
    "cheek": 14.0,
    "throat": 18.0,
}
"""How far the tip lies from its target, per axis: two cuers of French, and a little more."""

_NO_DEPTH_MM = 100.0
_STILL_MM_S = 160.0
_ON_THE_WAY_SD = (0.7, 70.0)
_CORRELATED = 0.4
"""Neighbouring frames tell the same: each counts as this part of an observation at 50 Hz."""

_CHANGE = 2.0
_CLOSURE_MM = 30.0
"""Way of a finger that opens and closes, as it counts beside that of the hand."""

_LEARNING_ROUNDS = 2
_BELIEF = 4.0
_SMOOTHING_S = 0.06
_APART_S = 0.08
_PIECE = 4096
_ARRIVED = 0.03

KEYS = ((0, 0), *((s, p) for s in SHAPES[1:] for p in range(1, len(PLACEMENTS))))
"""Shape and placement of each state; the first is rest."""

_SHAPE = np.array([shape for shape, _ in KEYS])
_PLACE = np.array([place for _, place in KEYS])
_KNUCKLES = layout.marker_indices(layout.KNUCKLES[1:])
_RIGID_FACE = layout.marker_indices(layout.RIGID_FACE)


@dataclass(frozen=True, slots=True)
class Held:
    """A key held by the hand.

    Attributes
    ----------
    shape, placement : int
        Numbers; 0 and 0 for rest.
    reach_s, leave_s : float
        When the hand arrives and sets out again, seconds from the first frame.
    confidence : float
        Probability of the key against all others in the frames that hold it, 0 to 1.
    """

    shape: int
    placement: int
    reach_s: float
    leave_s: float
    confidence: float


@dataclass(frozen=True, slots=True)
class Seen:
    """What keys are told from, frame by frame.

    `fingers` (T, 6) how far they are closed, `tips` (T, 2, 3) of index and middle finger against
    the head, mm, `speed` (T,) of hand and fingers, mm/s.
    """

    fingers: FloatArray
    tips: FloatArray
    speed: FloatArray


def observe(voice: Voice, params: FloatArray, *, rate_hz: float) -> Seen:
    """Return what keys are told from.

    Parameters
    ----------
    voice : Voice
    params : ndarray, shape (T, P)
    rate_hz : float
    """
    head = _resting_head(voice)
    tips, knuckles = [], []
    for begin in range(0, len(params), _PIECE):
        markers = voice.reconstruct(params[begin : begin + _PIECE])
        every = np.zeros(len(markers), dtype=np.int64)
        tips.append(
            np.stack([pointing_tip(markers, every + shape, head) for shape in (1, 5)], axis=1)
        )
        motion, _ = rigid.estimate_motion(head, markers[:, _RIGID_FACE])
        hand = rigid.inverse_rigid_motion(markers[:, _KNUCKLES], motion)
        knuckles.append(hand.mean(1))
    fingers = closures(voice, params[:, voice.hand_columns[:N_HAND_PARAMETERS]])
    carried = np.concatenate([np.concatenate(knuckles), _CLOSURE_MM * fingers], axis=1)
    speed = np.linalg.norm(_velocity(carried, rate_hz), axis=1)
    return Seen(fingers, np.concatenate(tips), speed)


def _velocity(x: FloatArray, rate_hz: float) -> FloatArray:
    window = max(5, 2 * round(0.5 * _SMOOTHING_S * rate_hz) + 1)
    if len(x) < window:
        return np.zeros_like(x)
    return np.asarray(savgol_filter(x, window, 2, deriv=1, delta=1 / rate_hz, axis=0))


def _resting_head(voice: Voice) -> FloatArray:
    row = np.zeros((1, len(voice.layout)))
    row[:, voice.face_columns[N_FACE_PARAMETERS:]] = voice.gestures.neutral_head
    return np.asarray(voice.reconstruct(row)[0, _RIGID_FACE], dtype=np.float64)


def _targets(voice: Voice) -> tuple[Gaussians, Gaussians]:
    """Return what shapes and placements look like at the voice's targets."""
    table = voice.gestures
    rows = np.zeros((len(KEYS), len(voice.layout)))
    rows[:, voice.face_columns[N_FACE_PARAMETERS:]] = table.neutral_head
    rows[:, voice.hand_columns[:N_HAND_PARAMETERS]] = table.shape_targets[_SHAPE]
    rows[:, voice.hand_columns[N_HAND_PARAMETERS:]] = table.placement_targets[_SHAPE, _PLACE]
    markers = voice.reconstruct(rows)
    tips = pointing_tip(markers, _SHAPE, _resting_head(voice))
    places = np.array([tips[p == _PLACE].mean(0) for p in range(len(PLACEMENTS))])
    spread = np.array([_PLACEMENT_SD_MM[name] for name in PLACEMENTS])
    return (
        Gaussians(
            closures(voice, table.shape_targets),
            np.tile(_CLOSURE_SD**2 * np.eye(N_FEATURES), (len(SHAPES), 1, 1)),
        ),
        Gaussians(places, spread[:, None, None] ** 2 * np.eye(3)),
    )


def recognise_keys(
    voice: Voice, params: FloatArray, *, rate_hz: float, depth: bool = True
) -> list[Held]:
    """Return the keys that the hand holds, rests too, in order of time.

    Parameters
    ----------
    voice : Voice
    params : ndarray, shape (T, P)
        Columns as in `Voice.layout`.
    rate_hz : float
    depth : bool
        Whether depth was measured; a single camera guesses it.
    """
    seen = observe(voice, params, rate_hz=rate_hz)
    shapes, places = _targets(voice)
    if not depth:
        places = Gaussians(places.means, places.covariances + np.diag([0.0, 0.0, _NO_DEPTH_MM**2]))
    places = fit_placements(_holds(seen, shapes, rate_hz), places)
    first = shapes, places
    for _ in range(_LEARNING_ROUNDS):
        held = _runs(_likeliest(seen, shapes, places, rate_hz))
        shapes, places = _learnt(seen, held, first)
    states = _likeliest(seen, shapes, places, rate_hz)
    posterior = _log_densities(seen, shapes, places)
    keys = []
    runs = _runs(states)
    for number, (state, begin, end) in enumerate(runs):
        before = runs[number - 1][2] if number else 0
        reach = _arrival(seen.speed, before, begin, end) if number else begin
        middle = posterior[begin:end].mean(0)
        share = np.exp(middle - middle.max())
        confidence = float(share[state] / share.sum())
        shape, place = KEYS[state]
        keys.append(Held(shape, place, reach / rate_hz, (end - 1) / rate_hz, confidence))
    return keys


def _holds(seen: Seen, shapes: Gaussians, rate_hz: float) -> FloatArray:
    """Return where the pointing finger is when the hand is slowest, shape (N, 3)."""
    apart = max(1, round(_APART_S * rate_hz))
    slowest = seen.speed <= minimum_filter1d(seen.speed, 2 * apart + 1)
    at = np.flatnonzero(slowest & (seen.speed < 2 * _STILL_MM_S))
    shape = _log_normal(seen.fingers[at], shapes).argmax(1)
    tip = np.array([layout.longest_finger_tip(s) != "F2T" for s in SHAPES], dtype=int)[shape]
    # A hand at rest lasts long and would count as many keys.
    return np.asarray(seen.tips[at, tip])


def _log_densities(seen: Seen, shapes: Gaussians, places: Gaussians) -> FloatArray:
    """Return the log density of each key in each frame, shape (T, 41)."""
    of_shape = _log_normal(seen.fingers, shapes)
    by_tip = np.stack([_log_normal(seen.tips[:, tip], places) for tip in range(2)], axis=1)
    tip = np.array([layout.longest_finger_tip(shape) != "F2T" for shape in _SHAPE], dtype=int)
    return np.asarray(of_shape[:, _SHAPE] + by_tip[:, tip, _PLACE])


def _log_normal(x: FloatArray, classes: Gaussians) -> FloatArray:
    away = x[:, None] - classes.means
    precision = np.linalg.inv(classes.covariances)
    _, volume = np.linalg.slogdet(classes.covariances)
    distance = np.einsum("tci,cij,tcj->tc", away, precision, away, optimize=True)
    return np.asarray(-0.5 * (distance + volume))


def _likeliest(
    seen: Seen, shapes: Gaussians, places: Gaussians, rate_hz: float
) -> NDArray[np.int64]:
    """Return the state of each frame: a key, or -1 on the way."""
    count = _CORRELATED * 50.0 / rate_hz
    hold = _log_densities(seen, shapes, places) - 0.5 * (seen.speed / _STILL_MM_S)[:, None] ** 2
    away = np.log(_ON_THE_WAY_SD)
    transit = -N_FEATURES * away[0] - 3.0 * away[1] - 2.0
    score = np.concatenate([count * hold, np.full((len(hold), 1), count * transit)], axis=1)
    way = len(KEYS)
    total, back = score[0].copy(), np.empty((len(score), way + 1), dtype=np.int16)
    own = np.arange(way + 1)
    for t in range(1, len(score)):
        from_way = total[way] - _CHANGE
        best = int(total[:way].argmax())
        origin = own.copy()
        enter = from_way > total[:way]
        origin[:way][enter] = way
        stay = np.where(enter, from_way, total[:way])
        on_way = total[way]
        if total[best] - _CHANGE > on_way:
            origin[way], on_way = best, total[best] - _CHANGE
        total = np.append(stay, on_way) + score[t]
        total -= total.max()
        back[t] = origin
    states = np.empty(len(score), dtype=np.int64)
    at = int(total.argmax())
    for t in range(len(score) - 1, -1, -1):
        states[t] = at
        at = int(back[t, at]) if t else at
    return np.where(states == way, -1, states)


def _runs(states: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """Return state, begin and end of each stretch that holds a key."""
    edges = np.flatnonzero(np.diff(states, prepend=-2, append=-2))
    return [
        (int(states[a]), int(a), int(b)) for a, b in itertools.pairwise(edges) if states[a] >= 0
    ]


def _learnt(
    seen: Seen, held: list[tuple[int, int, int]], first: tuple[Gaussians, Gaussians]
) -> tuple[Gaussians, Gaussians]:
    """Return classes whose means have moved to what was held; the voice's own count as some."""
    sums = [_BELIEF * classes.means.copy() for classes in first]
    counts = [np.full(len(classes.means), _BELIEF) for classes in first]
    for state, begin, end in held:
        shape, place = KEYS[state]
        still = begin + int(seen.speed[begin:end].argmin())
        tip = int(layout.longest_finger_tip(shape) != "F2T")
        for k, (label, value) in enumerate(
            ((shape, seen.fingers[still]), (place, seen.tips[still, tip]))
        ):
            sums[k][label] += value
            counts[k][label] += 1
    means = [total / count[:, None] for total, count in zip(sums, counts, strict=True)]
    return (
        Gaussians(means[0], first[0].covariances), Gaussians(means[1], first[1].covariances),
    )  # fmt: skip


def _arrival(speed: FloatArray, before: int, begin: int, end: int) -> int:
    """Return when the movement before a held key has ended: its speed has fallen, or turns."""
    low = min(before, begin)
    peak = low + int(speed[low : begin + 1].argmax())
    at = peak
    while at < end - 1:
        if speed[at] <= _ARRIVED * speed[peak]:
            break
        if at >= begin and speed[at + 1] > speed[at]:
            break
        at += 1
    return at
