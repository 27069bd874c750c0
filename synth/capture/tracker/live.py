"""Landmarks of an image tracker become parameters while she cues, at most a quarter second late.

Each frame is solved from the last one and joined smoothly with the few that followed; knowledge
about the picture, the face and the hand grows in small steps between frames from the last
seconds, so that no frame waits for it. Memory does not grow. The same frames give the same
parameters, however they arrive.
"""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cuer.models.inversion import invert, linearised, smoothed, stiffness_at
from codec.cuer.models.threads import one_thread
from codec.cuer.voice import Voice
from codec.errors import CueError
from synth.capture.cues.features import points_of
from synth.capture.points.adapt import lowest, resized
from synth.capture.points.solve import likely_postures, resting
from synth.capture.points.speaker import Speaker
from synth.capture.sources.landmark_maps import N_HAND_LANDMARKS, hand_map
from synth.capture.sources.landmark_table import LandmarkTable
from synth.capture.tracker.landmark_model import FACE_TRUST, HAND_TRUST, LandmarkModel
from synth.capture.tracker.landmarks import started
from synth.capture.tracker.own_map import HAND_RIDGE_MM2, near_hand, own_map
from synth.capture.tracker.picture import Picture, find_picture

FloatArray = NDArray[np.float64]
Equations = tuple[FloatArray, FloatArray]

LATE_S = 0.15
"""How much later than its frame a parameter comes; a long table's frame ends one frame later."""

_WINDOW_S = 0.7
"""Seconds of landmarks that are kept for smoothing."""

_LEARNT_FROM_S = 20.0
"""Seconds of the past that a cuer's own map is learnt from."""

_LEARN_AT_S = (0.3, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Seconds after the start at which it is learnt anew."""

_LEARN_EVERY_S = 20.0
"""Seconds between later lessons."""

_LEAST_HAND = 12
"""Landmarks that a frame must show of the hand."""

_FEW, _SOME = 12, 40
"""Frames that a lesson needs at least, and takes."""

_SIZES = np.linspace(0.7, 1.6, 7)

_FIRST_STEPS, _STEPS = 6, 2
"""Gauss-Newton steps of a frame at most, from a likely posture and from the frame before; joining
it with the frames about it is one more."""

_AWAY_S, _TO_REST_S = 0.4, 0.25
"""Seconds after which a hand out of sight counts as at rest, and that it takes to get there."""


@dataclass(frozen=True, slots=True)
class LiveFrame:
    """Parameters `params` (P,) of the frame at `time_s`, and the features of keys.

    `points` (25, 2) are landmarks of `synth.capture.cues.features.POINTS` and the hand, mm.
    """

    time_s: float
    params: FloatArray
    points: FloatArray


@dataclass(frozen=True, slots=True)
class _Shot:
    time_s: float
    face: FloatArray
    hands: Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True)
class _Solved:
    """A frame in the voice's coordinates, and its parameters; no `of_hand` if none is seen.

    `face_equations` and `hand_equations` are those that join it with the frames about it
    (`codec.cuer.models.inversion.linearised`).
    """

    time_s: float
    face: FloatArray
    hand: FloatArray
    of_face: FloatArray
    of_hand: FloatArray | None
    face_equations: Equations
    hand_equations: Equations


class LiveLandmarks:
    """Frames of landmarks in, parameters of a voice out.

    Parameters
    ----------
    voice : Voice
    aspect : float
        Width of the picture over its height; 1 for pixels.
    rate_hz : float
        Of the frames.

    Raises
    ------
    CueError
        If the rate is not within 5..240 Hz.
    """

    def __init__(self, voice: Voice, *, aspect: float = 16 / 9, rate_hz: float = 30.0) -> None:
        if not 5 <= rate_hz <= 240:
            raise CueError(f"rate {rate_hz} Hz is not within 5..240")
        self._voice, self._aspect, self._rate_hz = voice, aspect, rate_hz
        self._late = int(LATE_S * rate_hz)
        self._shots: deque[_Shot] = deque(maxlen=round(_LEARNT_FROM_S * rate_hz))
        self._window: deque[_Solved] = deque(
            maxlen=max(2 * self._late + 2, round(_WINDOW_S * rate_hz))
        )
        self._count = 0
        self._picture: Picture | None = None
        self._head: LandmarkModel | None = None
        self._hand = LandmarkModel(
            voice.hand, hand_map(), np.zeros((N_HAND_LANDMARKS, 3)), HAND_TRUST
        )
        self._size = 1.0
        self._rest = resting(Speaker(voice, voice.face, voice.hand))
        self._likely = likely_postures(voice)
        self._unseen = 10**9
        self._last = self._rest.copy()
        self._learning: Iterator[None] = iter(())

    def process(
        self, time_s: float, face: FloatArray, hands: Mapping[str, FloatArray]
    ) -> list[LiveFrame]:
        """Return the results that a frame completes.

        Parameters
        ----------
        time_s : float
            Rising.
        face : ndarray of float64, shape (L, 3)
            Landmarks `synth.capture.sources.landmark_maps.FACE_LANDMARKS`; NaN if not seen.
        hands : mapping of str to ndarray of float64, shape (21, 3)
            By name; NaN if not seen.
        """
        self._shots.append(_Shot(time_s, face, dict(hands)))
        self._count += 1
        if self._is_time_to_learn():
            self._learning = self._learn()
        next(self._learning, None)
        if self._picture is None or self._head is None:
            return []
        self._window.append(self._seen(self._shots[-1], self._picture, self._head))
        if len(self._window) <= self._late:
            return []
        return [self._joined(len(self._window) - 1 - self._late)]

    def flush(self) -> list[LiveFrame]:
        """Return the last frames."""
        first = max(0, len(self._window) - self._late)
        return [self._joined(number) for number in range(first, len(self._window))]

    def _is_time_to_learn(self) -> bool:
        every = round(_LEARN_EVERY_S * self._rate_hz)
        first = {max(2, round(at * self._rate_hz)) for at in _LEARN_AT_S}
        return self._count in first or self._count % every == 0

    def _placed(self, shot: _Shot, picture: Picture) -> tuple[FloatArray, FloatArray]:
        name = picture.hand_name
        hand = shot.hands.get(name) if name is not None else None
        if hand is None:
            hand = np.full((N_HAND_LANDMARKS, 3), np.nan)
        names = {} if name is None else {name: hand[None]}
        table = LandmarkTable(np.zeros(1), shot.face[None], names, True)
        placed = picture.hand(table)
        return picture.face(table)[0], hand if placed is None else placed[0]

    def _seen(self, shot: _Shot, picture: Picture, head: LandmarkModel) -> _Solved:
        """Return a frame solved by itself, begun from the one before."""
        face, hand = self._placed(shot, picture)
        face = _told(head, face[None])[0]
        before = self._window[-1] if self._window else None
        start = np.zeros(head.n_parameters) if before is None else before.of_face
        steps = _FIRST_STEPS if before is None else _STEPS
        of_face = _fit(head, face[None], start[None], steps)[0]
        equations = _equations(head, face, of_face)
        if np.isfinite(hand).all(-1).sum() < _LEAST_HAND:
            count = self._hand.n_parameters
            nothing = np.zeros((count, count)), np.zeros(count)
            unseen = np.full_like(hand, np.nan)
            return _Solved(shot.time_s, face, unseen, of_face, None, equations, nothing)
        own = self._hand
        last = None if before is None else before.of_hand
        # A hand that just appeared starts at the likeliest posture and takes more steps.
        first = started(own, hand[None], self._likely) if last is None else last[None]
        hand = hand.copy()
        # Trackers give a hand's depth relative to its wrist: put the wrist where the model has it.
        hand[:, 2] += (own.landmarks(first)[0, 0] - hand[0])[2]
        of_hand = _fit(own, hand[None], first, _FIRST_STEPS if last is None else _STEPS)[0]
        of = _equations(own, hand, of_hand)
        return _Solved(shot.time_s, face, hand, of_face, of_hand, equations, of)

    @one_thread
    def _joined(self, number: int) -> LiveFrame:
        """Return the parameters of a frame of the window, joined with those about it."""
        assert self._head is not None
        frames = list(self._window)
        found = _linked([one.face_equations for one in frames], self._rate_hz)
        params = self._rest.copy()
        params[self._voice.face_columns] = found[number]
        params[self._voice.hand_columns] = self._hand_of(frames, number, found)
        self._last = params
        one = frames[number]
        return LiveFrame(one.time_s, params, points_of(one.face, one.hand))

    def _hand_of(self, frames: list[_Solved], number: int, face: FloatArray) -> FloatArray:
        columns = self._voice.hand_columns
        if frames[number].of_hand is None:
            self._unseen += 1
            if self._unseen <= _AWAY_S * self._rate_hz:
                return self._last[columns]
            step = 1.0 / (_TO_REST_S * self._rate_hz)
            return np.asarray(self._last[columns] + step * (self._rest - self._last)[columns])
        self._unseen = 0
        found = _linked([one.hand_equations for one in frames], self._rate_hz)
        speaker = Speaker(
            self._voice,
            self._voice.face,
            resized(self._voice.hand, self._size),
            hand_size=self._size,
        )
        near = slice(number, number + 1)
        return np.asarray(speaker.to_voice(found[near], face[near])[0])

    def _learn(self) -> Iterator[None]:
        """Learn from the last seconds, a step at a time: picture, size of the hand, its own map."""
        shots = list(self._shots)
        names = {name for shot in shots for name in shot.hands}
        missing = np.full((N_HAND_LANDMARKS, 3), np.nan)
        table = LandmarkTable(
            np.array([shot.time_s for shot in shots]),
            np.stack([shot.face for shot in shots]),
            {n: np.stack([shot.hands.get(n, missing) for shot in shots]) for n in sorted(names)},
            True,
        )
        try:
            picture = find_picture(table, self._voice, aspect=self._aspect)
        except CueError:
            # Too little of a face so far: the next time, perhaps.
            return
        if self._picture is None or self._picture.hand_name != picture.hand_name:
            self._window.clear()
        self._picture = picture
        self._head = LandmarkModel(self._voice.face, picture.map, picture.offsets, FACE_TRUST)
        yield
        hand = picture.hand(table)
        if hand is None:
            return
        at = np.flatnonzero(np.isfinite(hand).all(-1).sum(1) >= _LEAST_HAND)
        if len(at) < _FEW:
            return
        few = hand[at[:: max(1, len(at) // _FEW)]]
        plain = LandmarkModel(self._voice.hand, hand_map(), np.zeros_like(missing), HAND_TRUST)
        errors = []
        for tried in _SIZES:
            model = replace(plain, model=resized(self._voice.hand, float(tried)))
            errors.append(_error(model, few, _fit(model, few, started(model, few, self._likely))))
            yield
        size = lowest(_SIZES, np.array(errors))
        model = replace(plain, model=resized(self._voice.hand, size))
        some = hand[at[:: max(1, len(at) // _SOME)]]
        found = _fit(model, some, started(model, some, self._likely))
        yield
        self._hand = own_map(model, some, found, near_hand, HAND_RIDGE_MM2)
        self._size = size


def _told(head: LandmarkModel, faces: FloatArray) -> FloatArray:
    """Return faces (T, L, 3) at the distance of the head: a tracker's depth has no origin."""
    out = faces.copy()
    told = np.isfinite(faces[..., 2]).any(1)
    still = head.landmarks(np.zeros((1, head.n_parameters)))
    if told.any():
        gap = np.nanmedian((still - faces[told])[..., 2], axis=1, keepdims=True)
        out[told, :, 2] += gap
    return out


def _masked(x: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    seen = np.asarray(np.isfinite(x).all(-1))
    return np.where(seen[..., None], x, 0.0), seen


def _fit(
    model: LandmarkModel, x: FloatArray, start: FloatArray, steps: int = _FIRST_STEPS
) -> FloatArray:
    return invert(model, *_masked(x), start, steps=steps)


def _equations(model: LandmarkModel, x: FloatArray, found: FloatArray) -> Equations:
    """Return the equations of a frame (L, 3) about its parameters (P,)."""
    normal, right = linearised(model, *_masked(x[None]), found[None])
    return normal[0], right[0]


def _linked(equations: Sequence[Equations], rate_hz: float) -> FloatArray:
    """Return the parameters of consecutive frames that move smoothly, shape (T, P)."""
    normal, right = (np.stack(part) for part in zip(*equations, strict=True))
    return smoothed(normal, right, stiffness_at(rate_hz))


def _error(model: LandmarkModel, x: FloatArray, found: FloatArray) -> float:
    return float(np.nanmean(np.linalg.norm((x - model.landmarks(found))[..., :2], axis=-1)))
