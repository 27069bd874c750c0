"""When a recorded cuer held what her labels say: frames for the means of a voice's targets.

Labels give the times of sounds; the hand is elsewhere in time, by how much differs from cuer to
cuer. Sentences give it by following the hand (`synth.capture.cues.follow`); takes of the hand
alone by the stillest moment of the fingers near each label, after the lag that makes frames of one
shape look most alike.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cues.phonology import PAUSE, PHONE_NUMBER
from codec.cues.score import PLACEMENT_NUMBER, Score
from codec.training.fit import UNLABELLED, TrainingSet
from synth.capture.cues.appearance import KeyAppearance
from synth.capture.cues.features import HandFeatures, see
from synth.capture.cues.follow import Followed, follow_keys
from synth.capture.sources.landmark_maps import LandmarkMap, face_map, hand_map
from synth.voices.takes import FACE, HAND, MarkerTake

FloatArray = NDArray[np.float64]

_LAGS_S = np.arange(-0.3, 0.41, 0.02)
"""Seconds after their labels at which a session's shapes may stand."""

_NEAR = 0.35
"""Greatest deviation of a shape from the session's lag, as a part of the label's length."""

_HELD_S = 0.02
"""Seconds before and after the stillest moment that count as held."""

_MIDDLE = 0.3
"""Middle part of a sound: the lips are taken to be on target there."""

_QUIET_S = 0.15
"""Seconds from any sound after which the lips are taken to rest."""

_RESTS_S = (0.7, 1.0)
"""Seconds before the first and after the last key beyond which the hand rests."""

_TIPS = np.array([layout.HAND_MARKERS.index(finger[3]) for finger in layout.FINGERS])
_BACK = np.array([layout.HAND_MARKERS.index(name) for name in (*layout.KNUCKLES, *layout.PALM)])


@dataclass(frozen=True, slots=True)
class Labelled:
    """A take's frames with labels, and the keys found in them.

    Attributes
    ----------
    take : MarkerTake
    frames : TrainingSet
    followed : Followed or None
        Of a take of sentences; None of others.
    """

    take: MarkerTake
    frames: TrainingSet
    followed: Followed | None = None

    @property
    def believed(self) -> bool:
        """Whether the hand shows the labels' keys, as far as that is known."""
        return self.followed is None or self.followed.believed


def labelled(take: MarkerTake, looks: KeyAppearance) -> Labelled:
    """Return the frames of a take with labels where something is held.

    Parameters
    ----------
    take : MarkerTake
    looks : KeyAppearance
        The prior for the speaker: a voice with the same markers.
    """
    shape = np.full(len(take.markers), UNLABELLED, dtype=np.int64)
    place, phone = shape.copy(), shape.copy()
    if take.has_face:
        _label_phones(phone, take.score, take.rate_hz)
    followed = None
    if take.has_face and take.has_hand and take.score.keys:
        seen = seen_of(take)
        followed = follow_keys(seen, take.score.keys, looks=looks)
        if followed.believed:
            _label_keys(shape, place, seen, followed)
            _label_rests(shape, place, seen, followed)
    elif take.has_hand and take.score.keys:
        _label_shapes(shape, take)
    return Labelled(take, TrainingSet(take.markers, shape, place, phone), followed)


def seen_of(take: MarkerTake) -> HandFeatures:
    """Return the features of keys from a take of face and hand."""
    faces = _landmarks(face_map(), take.markers[:, FACE])
    hands = _landmarks(hand_map(), take.markers[:, HAND])
    return see(faces, hands, rate_hz=take.rate_hz)


def _landmarks(of: LandmarkMap, markers: NDArray[np.float32]) -> FloatArray:
    """Return landmarks (T, L, 3); markers that are hidden do not count."""
    seen = np.isfinite(markers[..., 0])
    filled = np.where(seen[..., None], markers, 0.0).astype(np.float64)
    weight = np.einsum("lk,tk->tl", of.weights, seen.astype(np.float64))
    sums = np.einsum("lk,tkc->tlc", of.weights, filled)
    sums[weight < _LEAST_WEIGHT] = np.nan
    return np.asarray(sums / weight[..., None].clip(_LEAST_WEIGHT))


_LEAST_WEIGHT = 0.9
"""Weight of its markers that must be seen for a landmark to be known."""


def _label_phones(phone: NDArray[np.int64], score: Score, rate_hz: float) -> None:
    times = np.arange(len(phone)) / rate_hz
    quiet = np.ones(len(phone), dtype=np.bool_)
    for one in score.phones:
        quiet &= (times < one.start - _QUIET_S) | (times > one.end + _QUIET_S)
        middle = np.abs(times - 0.5 * (one.start + one.end))
        phone[middle < 0.5 * _MIDDLE * (one.end - one.start)] = PHONE_NUMBER[one.symbol]
    phone[quiet] = PHONE_NUMBER[PAUSE]


def _label_keys(
    shape: NDArray[np.int64], place: NDArray[np.int64], seen: HandFeatures, followed: Followed
) -> None:
    spread = round(_HELD_S * seen.rate_hz)
    for one in followed.held:
        if one is None:
            continue
        first = round(one.reach_s * seen.rate_hz)
        held = np.arange(first, min(len(seen), max(first, round(one.leave_s * seen.rate_hz)) + 1))
        held = held[seen.shown[held]]
        if len(held):
            still = int(held[seen.speed[held].argmin()])
            at = slice(max(0, still - spread), still + spread + 1)
            shape[at], place[at] = one.shape, one.placement


def _label_rests(
    shape: NDArray[np.int64], place: NDArray[np.int64], seen: HandFeatures, followed: Followed
) -> None:
    held = [one for one in followed.held if one is not None]
    if not held:
        return
    times = np.arange(len(seen)) / seen.rate_hz
    away = (times < held[0].reach_s - _RESTS_S[0]) | (times > held[-1].leave_s + _RESTS_S[1])
    shape[away], place[away] = 0, PLACEMENT_NUMBER["rest"]


def _label_shapes(shape: NDArray[np.int64], take: MarkerTake) -> None:
    """Label a take of the hand alone by the stillest moments of the fingers."""
    reach = _reach(take)
    known = np.isfinite(reach).all(1)
    if not known.any():
        return
    flow = np.where(known, _pace(reach, take.rate_hz), np.inf)
    starts = np.array([key.start for key in take.score.keys])
    shapes = np.array([key.shape for key in take.score.keys])

    def at(times: FloatArray) -> NDArray[np.int64]:
        return np.clip(np.rint(times * take.rate_hz).astype(np.int64), 0, len(flow) - 1)

    # How far the hand runs before or after the TextGrid is unknown: choose the lag at which frames
    # of one shape look most alike.
    unlike = [_unlike(reach[at(starts + one)], shapes) for one in _LAGS_S]
    lag = _LAGS_S[int(np.argmin(unlike))]
    spread = round(_HELD_S * take.rate_hz)
    for key in take.score.keys:
        beside = _NEAR * (key.end - key.start)
        first, last = at(np.array([key.start + lag - beside, key.start + lag + beside]))
        if not np.isfinite(flow[first : last + 1]).any():
            continue
        still = int(first) + int(flow[first : last + 1].argmin())
        shape[max(0, still - spread) : still + spread + 1] = key.shape


def _reach(take: MarkerTake) -> FloatArray:
    """Return how far the tips are from the back of the hand, (T, 45), mm; NaN if one is hidden."""
    hand = take.markers[:, HAND].astype(np.float64)
    reach = np.linalg.norm(hand[:, _TIPS, None] - hand[:, None, _BACK], axis=-1)
    return np.asarray(reach.reshape(len(hand), -1))


def _unlike(reach: FloatArray, shapes: NDArray[np.int64]) -> float:
    """Return how far frames that should show the same shape differ, mm²."""
    known = np.isfinite(reach).all(1)
    squares = [
        np.square(own - np.median(own, axis=0)).mean(1)
        for shape in np.unique(shapes[known])
        if len(own := reach[known & (shapes == shape)])
    ]
    return float(np.median(np.concatenate(squares))) if squares else np.inf


def _pace(reach: FloatArray, rate_hz: float) -> FloatArray:
    """Return how fast the fingers move against the hand, smoothed, (T,), mm/s."""
    window = max(1, round(_PACE_S * rate_hz))
    change = np.gradient(reach, axis=0) * rate_hz
    known = np.asarray(np.isfinite(change).all(1))
    speed = np.where(known, np.sqrt((np.where(known[:, None], change, 0.0) ** 2).mean(1)), 0.0)
    share = np.convolve(known.astype(np.float64), np.ones(window), "same")
    smooth = np.convolve(speed, np.ones(window), "same") / np.maximum(share, 1.0)
    return np.where(share > 0, smooth, np.inf)


_PACE_S = 0.05
"""Seconds over which the fingers' speed is taken."""
