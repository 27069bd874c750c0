"""When she sets out and arrives, and where to: the second cuer's plan of a score.

Her hand is aimed by the sounds: it arrives as a key's first one begins. Lag, durations and
curvature are drawn key by key from the distributions measured on real cuers; each of her joints
takes its own time.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import HAND_MARKERS, longest_finger_tip
from codec.cues.cueing import DEFAULT_OPTIONS
from codec.cues.score import PLACEMENT_NUMBER, PLACEMENTS, Key, Phone, Score
from synth.motion.body.body import Body
from synth.motion.body.reach import placement_target
from synth.motion.body.shapes import all_shapes
from synth.motion.body.skeleton import HAND_ANGLES
from synth.motion.measured.drift_noise import DriftNoise, normals_of
from synth.motion.measured.strokes import Strokes

FloatArray = NDArray[np.float64]

KEYS_PER_S = 3.4
"""Her pace; real cuers 3.0 to 3.9. From arrival to arrival it is 0.31 s, on 64 real takes 0.32."""

_EVENNESS = 0.3
"""Power of a key's length in the sound that is left in hers."""

_STAYS = 0.75
"""Length of a key at the place of the one before against that of others. From arrival to arrival
real ones take 0.28 s there, 0.31 to 0.35 s to another place."""

_ARRIVES_S = (0.053, 0.12, 0.06)
"""How long after its first sound begins the hand shows a key: mean, and spreads of what changes
over phrases and from key to key, seconds. It is there 0.17 s before a vowel's lips.
Real hands keep to the begin: their next key comes 0.04 s later after one with a vowel; aimed at the
vowels, hers came 0.016 s earlier."""

_SLOW_KEYS = 5.0
"""Keys over which the slow part of her lag changes."""

_LEAST_APART_S = 0.15
"""Seconds between arrivals at least."""

# Of strokes from rest to rest: see below.
_STROKE_S = 0.36
_STROKE_SPREAD = 0.27
"""Median duration from rest to rest, and its spread in natural logarithms. What an analysis finds
above a seventh of the peak speed is shorter by a fifth."""

_PER_AMPLITUDE = 0.33
"""Durations grow with this power of the amplitude against 56 mm."""

_USUAL_MM = 56.0
"""Median amplitude of a stroke in mm, as measured on real cuers."""

_LIMITS_S = (0.16, 0.62)
"""Shortest and longest stroke in seconds."""

_USED = 0.85
"""Part of an idle time that the next stroke takes in: real hands hold few keys for 40 ms."""

_OVERLAP = 0.15
"""Greatest part of a stroke before the arrival of the last one: the hand has gone a twentieth of
its way by then. With a half, as before, it was 20 to 27 mm from its targets in the mean."""

_PEAK = (0.47, 0.13)
"""Share of a stroke at which it is fastest: mean, and spread from key to key."""

_LATE = (0.16, 0.08)
"""Lag of a stroke's second component as a share of the stroke: mean and spread."""

_ARC_RAD = (0.35, 1.3)
"""Angle in radians that the path turns by: mean and spread."""

_FINGERS_S = ((0.06, 0.03), (-0.11, 0.04))
"""Fingers against hand: start and end, mean and spread from key to key."""

_JOINT_S = 0.02
"""Spread in seconds of each joint's start and end about the hand's."""

_LEAST_FINGERS_S = 0.12
"""Seconds that a change of shape takes at least."""

_TURN_SCATTER = 0.03
"""Spread in radians of the arm's turn from key to key."""

_SCATTER = {
    "rest": (25.0, 25.0, 25.0),
    "side": (24.0, 17.0, 14.0),
    "mouth": (3.5, 3.5, 3.5),
    "chin": (5.0, 5.0, 5.0),
    "cheek": (6.0, 6.0, 6.0),
    "throat": (10.0, 18.0, 10.0),
}
"""Of the pointing tip from key to key, mm across, up and forward. With the small motion of
arm and fingers it scatters by 6 to 8 mm at mouth and chin, as real tips do: the arm makes up for
wrong angles of wrist and fingers. Sides and throats of real ones spread by 20 mm and more: 424
sides of one by 25 mm across and 19 up (slow ones 23 and 15) about the mean of their finger and of
the place before."""

_SIDE_CORRELATION = -0.6
"""Correlation of across and up at the side, of slow middle fingers: near the face a hand is lower
than the mouth."""

_SIDE_MM = {"F2T": np.array([-28.0, 20.0]), "F3T": np.array([10.0, 3.0])}
"""From her place at the side to that of the index and of the middle finger: the hand has a place
there, and the index of a closed hand stands farther out. Medians of one real cuer are 50 mm apart
and 19 mm high; in the mean she stays where four groups of takes have the side."""

_OFF_MOUTH_MM = np.array([30.0, 24.0])
"""Half axes of the ellipse about the mouth's place that sides keep out of. Of real sides 10 of 100
lie within 22 mm across and 18 up of it, of hers, scattered freely, 17, with this 11."""

_TO_REST_S = (0.12, 0.75)
"""Seconds after the last key at which the hand sets out for rest, and that it takes."""

_WRIST = 3
"""Angles of the wrist, which come first."""

_REST_BEFORE_S = 0.55
"""Latest end of a rest, in seconds before the next key."""


@dataclass(frozen=True, slots=True)
class MovementPlan:
    """Aims of a score, rest included; G of them.

    Attributes
    ----------
    keys : tuple of Key or None
        None for a rest.
    shape, placement : ndarray of int64, shape (G,)
        The first is the rest before everything.
    arrive, leave : ndarray of float64, shape (G,)
        When the hand's stroke ends, and when the next one begins, seconds.
    arm, fingers : Strokes
        Forearm, six channels; the hand's angles, 31.
    """

    keys: tuple[Key | None, ...]
    shape: NDArray[np.int64]
    placement: NDArray[np.int64]
    arrive: FloatArray
    leave: FloatArray
    arm: Strokes
    fingers: Strokes


def paced(score: Score, keys_per_s: float = KEYS_PER_S) -> Score:
    """Return a score at the pace of real cuers, who speak as slowly as they cue.

    Parameters
    ----------
    score : Score
    keys_per_s : float
        Mean pace inside phrases. Keys differ less in length than the sounds did: a consonant
        alone asks for a gesture too. A key at another place than the one before takes longer.
        Gaps between keys keep their length.
    """
    if not score.keys:
        return score
    spoken = np.array([key.end - key.start for key in score.keys])
    asked = (spoken / max(float(spoken.mean()), 1e-3)) ** _EVENNESS
    places = [key.placement for key in score.keys]
    stays = np.array([False, *(a == b for a, b in itertools.pairwise(places))])
    share = np.where(stays, _STAYS, 1.0)
    lengths = asked * share / (share.mean() * keys_per_s)
    before, after = [0.0], [0.0]
    # Time is mapped piece by piece: pauses keep their length, a key gets its own.
    for key, own_s in zip(score.keys, lengths.tolist(), strict=True):
        for at, length in ((key.start, key.start - before[-1]), (key.end, own_s)):
            if at > before[-1]:
                before.append(at)
                after.append(after[-1] + length)
    before.append(before[-1] + 1e4)
    after.append(after[-1] + 1e4)

    def moved(at: float) -> float:
        return float(np.interp(at, before, after))

    return Score(
        tuple(Phone(p.symbol, moved(p.start), moved(p.end)) for p in score.phones),
        tuple(
            Key(moved(k.start), moved(k.end), k.phones, k.shape, k.placement) for k in score.keys
        ),
    )


def make_plan(
    score: Score, body: Body, wrist: FloatArray, forearm: FloatArray, seed: int
) -> MovementPlan:
    """Return the plan of a score.

    Parameters
    ----------
    score : Score
    body : Body
    wrist, forearm : ndarray of float64, shapes (9, 6, 3) and (9, 6, 6)
        Postures at all shapes and placements.
    seed : int
        Random seed.
    """
    keys, arrive = _aims(score, seed)
    shape = np.array([0 if key is None else key.shape for key in keys], dtype=np.int64)
    placement = np.array(
        [0 if key is None else PLACEMENT_NUMBER[key.placement] for key in keys], dtype=np.int64
    )
    drawn = np.stack([normals_of(seed + 3, n, 48) for n in range(len(keys))])
    arms = forearm[shape, placement].copy()
    angles = all_shapes()[shape]
    angles[:, :_WRIST] = wrist[shape, placement]
    aims = _tips(body, angles, arms, shape)
    moving = placement > 0
    arms[moving, :3] += _TURN_SCATTER * drawn[moving, 8:11]
    angles[:, _WRIST:] += body.habits.scatter_deg * drawn[:, 14 : 14 + len(HAND_ANGLES) - _WRIST]
    # Targets scatter; at the side across and down together: y' = r x + sqrt(1 - r^2) y.
    side = placement == PLACEMENT_NUMBER["side"]
    away = drawn[:, 11:14].copy()
    away[side, 1] *= np.sqrt(1.0 - _SIDE_CORRELATION**2)
    away[side, 1] += _SIDE_CORRELATION * away[side, 0]
    aims += np.array([_SCATTER[n] for n in PLACEMENTS])[placement] * away
    mouth = placement_target(body, "mouth")[:2]
    for number in np.flatnonzero(side):
        aims[number, :2] += _SIDE_MM[longest_finger_tip(int(shape[number]))]
        off = (aims[number, :2] - mouth) / _OFF_MOUTH_MM
        aims[number, :2] += max(1.0 / np.linalg.norm(off) - 1.0, 0.0) * off * _OFF_MOUTH_MM
    arms[:, 3:] += aims - _tips(body, angles, arms, shape)
    begin, span = _times(arms, arrive, drawn)
    leave = np.append(begin[1:], np.inf)
    return MovementPlan(
        tuple(keys),
        shape,
        placement,
        arrive,
        leave,
        _arm(arms, begin, span, drawn),
        _fingers(angles, begin, span, drawn, seed),
    )


def _tips(body: Body, angles: FloatArray, arms: FloatArray, shape: NDArray[np.int64]) -> FloatArray:
    """Return where the pointing fingers' tips are, (G, 3), mm."""
    tips = np.array([HAND_MARKERS.index(longest_finger_tip(int(one))) for one in shape])
    return np.asarray(body.hand(angles, arms)[np.arange(len(shape)), tips])


def _aims(score: Score, seed: int) -> tuple[list[Key | None], FloatArray]:
    """Return targets, rests included, and their times of arrival; the first is long past."""
    keys: list[Key | None] = [None]
    arrive = [-1e6]
    slow = DriftNoise(np.array([_ARRIVES_S[1]]), _SLOW_KEYS, seed + 4)
    lag = slow.at(np.arange(float(len(score.keys))))[:, 0]
    lag += _ARRIVES_S[2] * np.array([normals_of(seed + 4, -n - 2, 1)[0] for n, _ in enumerate(lag)])
    gap_s = DEFAULT_OPTIONS.rest_gap_s
    for number, key in enumerate(score.keys):
        before = score.keys[number - 1] if number else None
        at = key.start + _ARRIVES_S[0] - lag[number]
        if before is not None and key.start - before.end >= gap_s:
            keys.append(None)
            latest = max(at - _REST_BEFORE_S, arrive[-1] + 0.2)
            arrive.append(min(max(before.end + sum(_TO_REST_S), arrive[-1] + 0.2), latest))
        keys.append(key)
        arrive.append(max(at, arrive[-1] + _LEAST_APART_S))
    if score.keys:
        keys.append(None)
        arrive.append(max(score.keys[-1].end, arrive[-1]) + sum(_TO_REST_S))
    return keys, np.array(arrive)


def _times(
    arms: FloatArray, arrive: FloatArray, drawn: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return start and duration of the hand's strokes; the first is long past."""
    amplitude = np.linalg.norm(np.diff(arms[:, 3:5], axis=0, prepend=arms[:1, 3:5]), axis=1)
    usual = _STROKE_S * np.maximum(amplitude / _USUAL_MM, 0.15) ** _PER_AMPLITUDE
    span = np.clip(usual * np.exp(_STROKE_SPREAD * drawn[:, 0]), *_LIMITS_S)
    # She takes part of the time that is left: few holds, slow strokes.
    gap = np.diff(arrive, prepend=-np.inf)
    idle = np.clip(gap - span, 0.0, _LIMITS_S[1])
    span = np.minimum(span + _USED * idle, np.minimum(gap / (1.0 - _OVERLAP), _LIMITS_S[1]))
    return arrive - span, span


def _arm(arms: FloatArray, begin: FloatArray, span: FloatArray, drawn: FloatArray) -> Strokes:
    carries = np.diff(arms, axis=0)
    arc = np.clip(_ARC_RAD[0] + _ARC_RAD[1] * drawn[1:, 1], -2.6, 2.6)
    across = np.zeros_like(carries)
    across[:, 3], across[:, 4] = -carries[:, 4], carries[:, 3]
    across[:, 5] = 0.3 * np.linalg.norm(carries[:, 3:], axis=1)
    return Strokes(
        arms[0], carries, begin[1:], span[1:], _peak(drawn[1:, 2]),
        np.clip(_LATE[0] + _LATE[1] * drawn[1:, 3], 0.0, 0.4), arc, across,
    )  # fmt: skip


def _fingers(
    angles: FloatArray, begin: FloatArray, span: FloatArray, drawn: FloatArray, seed: int
) -> Strokes:
    """Return the strokes of the hand's angles; wrist with the arm, fingers each in its time."""
    count, width = len(angles) - 1, angles.shape[1]
    own = np.zeros((count, 2, width))
    for number in range(count):
        own[number] = _JOINT_S * normals_of(seed + 5, number, 2 * width).reshape(2, width)
    start, end = begin[1:, None] + own[:, 0], (begin + span)[1:, None] + own[:, 1]
    fingers = slice(_WRIST, None)
    start[:, fingers] += _FINGERS_S[0][0] + _FINGERS_S[0][1] * drawn[1:, 4:5]
    end[:, fingers] += _FINGERS_S[1][0] + _FINGERS_S[1][1] * drawn[1:, 5:6]
    return Strokes(
        angles[0], np.diff(angles, axis=0), start, np.maximum(end - start, _LEAST_FINGERS_S),
        _peak(drawn[1:, 6]), np.full(count, 0.08), np.zeros(count), np.zeros((count, width)),
    )  # fmt: skip


def _peak(normal: FloatArray) -> FloatArray:
    return np.clip(_PEAK[0] + _PEAK[1] * normal, 0.28, 0.68)
