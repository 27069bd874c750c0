"""Landmarks of an image tracker become a motion of face and hand.

The face gives size and place: its median pose is the voice's head at rest, the distance across it
the voice's. A camera is taken to stand far away before the cuer. Face and hand models are fitted to
the visible landmarks (masked robust least squares on landmarks,
`synth.capture.tracker.landmark_model`), and the frames joined smoothly. Where the hand is out of
the picture for longer it rests.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.models.hand import HandModel
from codec.cuer.models.inversion import invert, linked
from codec.cuer.voice import Voice
from codec.errors import CueError
from synth.capture.cues.features import see
from synth.capture.cues.finish import finish, resting_when_away
from synth.capture.options import Captured, CaptureOptions
from synth.capture.points.adapt import lowest, resized
from synth.capture.points.solve import likely_postures, resting
from synth.capture.points.speaker import Speaker, moved_by
from synth.capture.sources.landmark_maps import FACE_LANDMARKS, SOFT_LANDMARKS, hand_map
from synth.capture.sources.landmark_table import LandmarkTable, read_landmarks
from synth.capture.sources.resample import evenly
from synth.capture.tracker.aspect import find_aspect
from synth.capture.tracker.closure import rescaled
from synth.capture.tracker.landmark_model import FACE_TRUST, HAND_TRUST, LandmarkModel
from synth.capture.tracker.own_map import (
    FACE_RIDGE_MM2,
    HAND_RIDGE_MM2,
    near_face,
    near_hand,
    own_map,
)
from synth.capture.tracker.picture import Picture, find_picture

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_LEAST_HAND = 12
"""Landmarks that a frame must show of the hand."""

_LIPS = [
    slot
    for slot, number in enumerate(FACE_LANDMARKS)
    if any(name[:2] in ("UL", "LL", "LC") for name in SOFT_LANDMARKS.get(number, ()))
]
_SIZES = np.linspace(0.7, 1.6, 7)

_OWN_FRAMES, _OWN_ROUNDS = 90, 2
"""Frames that a cuer's own map is learnt from, and rounds of it."""

_LEAST_FACE, _LEAST_FRAMES = 8, 30
"""Landmarks that such a frame must show of the face, and frames that are needed."""

LEAST_SEEN = 0.03
"""Share of the frames that must show a hand: below, the tracker's hands are none, or too
little is known of its movements."""

_SIZE_FRAMES = 20
"""Frames that the hand's size is found from."""

_AWAY_S = 0.4
"""Seconds for which a hand may be out of sight before it counts as at rest."""

_LIKELY_MM = 40.0
"""Distance in mm within which the hand's depth is likely about its usual one."""


def capture_landmarks(path: Path, voice: Voice, options: CaptureOptions) -> Captured:
    """Return the motion of a table of landmarks; time 0 is its first row.

    Raises
    ------
    CueError
        If the table is malformed, or shows too little of a face.
    """
    table = read_landmarks(path, rate_hz=options.frame_rate_hz)
    try:
        aspect = find_aspect(table, voice, told=options.aspect)
        picture = find_picture(table, voice, aspect=aspect.value)
    except CueError as error:
        raise CueError(f"{path}: {error}") from error
    face, hand, rate_hz = _steady(table, picture, path)
    rest = resting(Speaker(voice, voice.face, voice.hand))
    params = np.tile(rest, (len(face), 1))
    head = LandmarkModel(voice.face, picture.map, picture.offsets, FACE_TRUST)
    still = np.zeros((len(face), head.n_parameters))
    # A tracker's depth has no origin: the head stays at its distance.
    told = np.isfinite(face[..., 2]).any(1)
    gap = np.nanmedian((head.landmarks(still[:1]) - face[told])[..., 2], axis=1, keepdims=True)
    face[told, :, 2] += gap
    head = _own_face(head, face, still)
    params[:, voice.face_columns] = _solved(head, face, still, rate_hz)
    fit, seen = None, None
    if hand is not None:
        seen = see(face, hand, rate_hz=rate_hz)
        fit = _fit_hand(voice, hand, params[:, voice.face_columns], rate_hz)
    if fit is not None:
        params[:, voice.hand_columns] = resting_when_away(
            fit.parameters, fit.shown, rest[voice.hand_columns], away_s=_AWAY_S, rate_hz=rate_hz
        )
    options.progress(len(face) / rate_hz)
    report = _report(path, table, aspect.notes, picture, face, head, params, voice, fit, rate_hz)
    return finish(voice, params, rate_hz, 0.0, options, report, has_hand=fit is not None, seen=seen)


def _steady(
    table: LandmarkTable, picture: Picture, path: Path
) -> tuple[FloatArray, FloatArray | None, float]:
    """Return face and hand in the voice's coordinates at a steady rate; NaN where not seen."""
    face = picture.face(table)
    hand = picture.hand(table)
    parts = [face] if hand is None else [face, hand]
    flat = np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1)
    even, rate_hz = evenly(table.times, flat, name=str(path))
    face = even[:, : 3 * len(FACE_LANDMARKS)].reshape(len(even), -1, 3)
    if hand is None:
        return face, None, rate_hz
    return face, even[:, 3 * len(FACE_LANDMARKS) :].reshape(len(even), -1, 3), rate_hz


def _own_face(head: LandmarkModel, face: FloatArray, still: FloatArray) -> LandmarkModel:
    """Return the model with offsets and weights of the cuer's face."""
    shown = np.flatnonzero(np.isfinite(face[..., 0]).sum(1) >= _LEAST_FACE)
    few = shown[:: max(1, len(shown) // _OWN_FRAMES)]
    if len(few) < _LEAST_FRAMES:
        return head
    x, at = face[few], still[few]
    for _ in range(_OWN_ROUNDS):
        at = invert(head, *_masked(x), at)
        off = _median(x - head.landmarks(at))
        off[:, 2] = 0.0
        head = replace(head, offsets=head.offsets + off)
        head = own_map(head, x, at, near_face, FACE_RIDGE_MM2)
    return head


def _median(gaps: FloatArray) -> FloatArray:
    """Return the median displacement (L, 3) of gaps (T, L, 3); 0 if never visible."""
    out = np.zeros(gaps.shape[1:])
    seen = np.isfinite(gaps).all(-1).any(0)
    out[seen] = np.nanmedian(gaps[:, seen], axis=0)
    return out


def _solved(model: LandmarkModel, x: FloatArray, start: FloatArray, rate_hz: float) -> FloatArray:
    """Return the parameters that explain landmarks (T, L, 3) best, moving smoothly."""
    seen = np.asarray(np.isfinite(x).all(-1))
    filled = np.where(seen[..., None], x, 0.0)
    found = invert(model, filled, seen, start)
    return linked(model, filled, seen, found, rate_hz=rate_hz)


@dataclass(frozen=True, slots=True)
class _HandFit:
    parameters: FloatArray
    shown: BoolArray
    size: float
    error_mm: float


def _fit_hand(voice: Voice, x: FloatArray, face: FloatArray, rate_hz: float) -> _HandFit | None:
    """Return the hand's parameters for landmarks (T, 21, 3), or None if it is hardly seen."""
    shown = np.isfinite(x).all(-1).sum(1) >= _LEAST_HAND
    if shown.sum() < 2 or shown.mean() < LEAST_SEEN:
        return None
    likely = likely_postures(voice)
    plain = LandmarkModel(voice.hand, hand_map(), np.zeros((x.shape[1], 3)), HAND_TRUST)
    step = max(1, int(shown.sum()) // _SIZE_FRAMES)
    size = _hand_size(plain, voice, x[shown][::step], likely)
    model = replace(plain, model=resized(voice.hand, size))
    start = np.zeros((len(x), model.n_parameters))
    start[shown] = started(model, x[shown], likely)
    frames = np.arange(len(x))
    start = np.stack(
        [np.interp(frames, frames[shown], column[shown]) for column in start.T], axis=1
    )
    only = np.where(shown[:, None, None], x, np.nan)
    # Depth is told against the wrist alone: where that is, the likeliest posture says.
    only[..., 2] += (model.landmarks(start)[:, :1] - only[:, :1])[..., 2]
    few = np.flatnonzero(shown)[:: max(1, int(shown.sum()) // _OWN_FRAMES)]
    at = start[few]
    for _ in range(_OWN_ROUNDS):
        at = invert(model, *_masked(only[few]), at)
        model = own_map(model, only[few], at, near_hand, HAND_RIDGE_MM2)
    found = _solved(model, only, start, rate_hz)
    error = _error(model, x[shown], found[shown])
    found[:, : model.n_shape] = rescaled(voice, found[:, : model.n_shape], shown)
    speaker = Speaker(voice, voice.face, resized(voice.hand, size), hand_size=size)
    return _HandFit(speaker.to_voice(found, face), shown, size, error)


def _hand_size(plain: LandmarkModel, voice: Voice, x: FloatArray, likely: FloatArray) -> float:
    """Return the size of the hand against the voice's that explains some frames best."""
    errors = []
    for size in _SIZES:
        model = replace(plain, model=resized(voice.hand, float(size)))
        found = invert(model, *_masked(x), started(model, x, likely))
        errors.append(_error(model, x, found))
    return lowest(_SIZES, np.array(errors))


def _masked(x: FloatArray) -> tuple[FloatArray, BoolArray]:
    seen = np.asarray(np.isfinite(x).all(-1))
    return np.where(seen[..., None], x, 0.0), seen


def started(model: LandmarkModel, x: FloatArray, likely: FloatArray) -> FloatArray:
    """Return a start for each frame: the likely posture that looks most like it, moved there."""
    candidates = model.landmarks(likely)[..., :2]
    filled, seen = _masked(x)
    count = np.maximum(seen.sum(1), 1)[:, None]
    best = np.full(len(x), np.inf)
    chosen = np.zeros(len(x), dtype=int)
    shift = np.zeros((len(x), 2))
    for number, candidate in enumerate(candidates):
        gap = np.where(seen[..., None], filled[..., :2] - candidate, 0.0)
        middle = gap.sum(1) / count
        spread = np.where(seen[..., None], gap - middle[:, None], 0.0)
        # Being elsewhere costs too, but less than being another shape.
        error = (spread**2).sum((1, 2)) / count[:, 0] + 0.1 * (middle**2).sum(1)
        better = error < best
        best[better], chosen[better], shift[better] = error[better], number, middle[better]
    start = likely[chosen].copy()
    moved = np.concatenate([shift, np.zeros((len(x), 1))], axis=1)
    assert isinstance(model.model, HandModel)
    return moved_by(model.model, start, moved)


def _error(model: LandmarkModel, x: FloatArray, found: FloatArray) -> float:
    """Return the mean distance in the picture's plane, mm."""
    gap = np.linalg.norm((x - model.landmarks(found))[..., :2], axis=-1)
    gap = gap[np.isfinite(gap)]
    return float(np.mean(gap)) if len(gap) else float("nan")


def _lips_error(model: LandmarkModel, x: FloatArray, found: FloatArray) -> float | None:
    gap = np.linalg.norm((x - model.landmarks(found))[:, _LIPS, :2], axis=-1)
    gap = gap[np.isfinite(gap)]
    return round(float(gap.mean()), 3) if len(gap) else None


def _report(
    path: Path, table: LandmarkTable, told: tuple[str, ...], picture: Picture, face: FloatArray,
    head: LandmarkModel, params: FloatArray, voice: Voice, fit: _HandFit | None, rate_hz: float,
) -> dict[str, Any]:  # fmt: skip
    duration_s = len(params) / rate_hz
    notes = [*told, *picture.notes]
    if not table.timed:
        notes.append(f"frames are numbered, not timed: taken for {rate_hz:g} frames/s")
    if fit is None:
        notes.append(
            f"no hand is seen in {100 * LEAST_SEEN:g} % of the frames or more: it rests"
            if picture.hand_name
            else "no hand is seen: it rests"
        )
    elif fit.size <= _SIZES[0] or fit.size >= _SIZES[-1]:
        notes.append(
            f"the hand is {fit.size:.2f} times the voice's, as small or large as is looked for: "
            "is the aspect right?"
        )
    return {
        "input": {
            "file": path.name,
            "kind": "landmarks",
            "frames": len(table.times),
            "rate_hz": round(rate_hz, 4),
            "duration_s": round(duration_s, 3),
            "labels": int(np.isfinite(table.face[..., 0]).any(0).sum()),
        },
        "place": {
            "aspect": round(picture.aspect, 4),
            "mm_per_width": round(picture.mm_per_width, 2),
            "left_hand": None if fit is None else picture.mirrored,
        },
        "seen": {
            "face": round(float(np.isfinite(face[..., 0]).any(1).mean()), 4),
            "hand": 0.0 if fit is None else round(float(fit.shown.mean()), 4),
        },
        "speaker": {"hand_size": 1.0 if fit is None else round(fit.size, 4)},
        "residual_mm": {
            "face": round(_error(head, face, params[:, voice.face_columns]), 3),
            "lips": _lips_error(head, face, params[:, voice.face_columns]),
            "hand": None if fit is None else round(fit.error_mm, 3),
        },
        "notes": notes,
    }
