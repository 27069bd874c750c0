"""A speaker's own models: the voice's, adapted to her head, her hand and where her markers sit.

Parameters keep their meaning, so that the speaker's measurements move the voice. The head has
been brought to the voice's size (`synth.capture.points.place`); what remains of its proportions,
and where each marker was glued, is a displacement of the model's rest. The hand has a size of its
own, and each of its markers a displacement that moves with the part of the finger it sits on; both
are found by turns with the parameters of some frames of the take itself. A calibration take with a
still face says where the face's rest is; without one the middle of the take counts as the middle of
the voice.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.models.face import N_FACE_PARAMETERS, FaceModel
from codec.cuer.models.hand import HandModel, regressors
from codec.cuer.models.inversion import RIGID_FACE_COLUMNS, invert_hand, starting_motion
from codec.cuer.voice import Voice
from synth.capture.points.place import NO_CONTACT, Contact
from synth.capture.points.speaker import Speaker

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_SAME_FACE_MM = 0.8
"""Mean displacement in mm of the face's markers below which the voice's own face will do."""

_SAME_HAND_MM = 1.3
"""Mean error in mm of the voice's own hand below which it will do."""

_FACE_ROUNDS, _HAND_ROUNDS = 3, 4
"""Rounds; each finds parameters and displacements in turn."""

_FRAMES = 160
"""Frames that a speaker's displacements are learnt from: a bound on time."""

_SIZES = np.linspace(0.8, 1.25, 10)

_SIZE_FRAMES = 24
"""Frames that a hand's size is found from."""

_LEAST_VIEWS = 5
"""Frames that must show a marker for its displacement to be learnt."""

_FIRMNESS = 4.0
"""Frames that no displacement counts for: who is rarely seen is moved little."""

_NEIGHBOURS = 4
"""Markers nearby that lend theirs to one that is never seen."""

_RIDGE = 1e-4
"""Weight of the ridge per frame, for parameters of unit spread."""

_LEAST_SPREAD = 0.5
"""Standard deviation that a parameter has at least, in those of the voice."""


def adapt(voice: Voice, markers: FloatArray, *, still: FloatArray | None = None) -> Speaker:
    """Return the speaker's models.

    Parameters
    ----------
    voice : Voice
    markers : ndarray of float64, shape (T, 113, 3)
        Some frames from all over the take, in the voice's coordinates; NaN where hidden.
    still : ndarray of float64, shape (N, 113, 3), optional
        Frames of a calibration take, the face at rest.
    """
    x, seen = _filled(markers)
    faces, shown = _filled(markers if still is None else still)
    face, contact = _adapt_face(
        voice, faces[:, : layout.N_FACE], shown[:, : layout.N_FACE], still=still is not None
    )
    hand, size, off = _adapt_hand(voice.hand, x[:, layout.N_FACE :], seen[:, layout.N_FACE :])
    moved = float(np.linalg.norm(contact.gap, axis=1).mean()) if len(contact.gap) else 0.0
    return Speaker(voice, face, hand, contact, size, moved, off)


def _filled(markers: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return markers with zeros where hidden, and which are seen."""
    seen = np.asarray(np.isfinite(markers).all(-1))
    return np.where(seen[..., None], markers, 0.0), seen


def _adapt_face(
    voice: Voice, x: FloatArray, seen: BoolArray, *, still: bool
) -> tuple[FaceModel, Contact]:
    model = voice.face
    expected = np.zeros(model.n_parameters)
    if still:
        expected[:N_FACE_PARAMETERS] = voice.gestures.viseme_targets[0]
    viewed = seen.sum(0) >= _LEAST_VIEWS
    if not viewed[RIGID_FACE_COLUMNS].any():
        return model, NO_CONTACT
    offset = np.zeros((layout.N_FACE, 3))
    # In turns: the head's motion by its rigid markers; each marker's offset as the middle of what
    # is left of it.
    for step in range(_FACE_ROUNDS):
        moved = replace(model, mean=(model.mean + offset).astype(np.float32))
        parameters = np.tile(expected, (len(x), 1))
        parameters[:, N_FACE_PARAMETERS:] = starting_motion(
            (moved.mean - moved.pivot)[RIGID_FACE_COLUMNS].astype(np.float64),
            x[:, RIGID_FACE_COLUMNS] - moved.pivot,
            seen[:, RIGID_FACE_COLUMNS],
            moved.motion_mean,
            moved.motion_directions,
        )
        offset += _middle(moved.residual(parameters, x), seen, viewed)
        if step == 0 and not still:
            firm = RIGID_FACE_COLUMNS[viewed[RIGID_FACE_COLUMNS]]
            if firm.size and np.sqrt((offset[firm] ** 2).sum(-1).mean()) < _SAME_FACE_MM:
                return model, NO_CONTACT
    adapted = replace(model, mean=(model.mean + offset).astype(np.float32))
    return adapted, Contact(adapted.mean[viewed].astype(np.float64), offset[viewed])


def _middle(residual: FloatArray, seen: BoolArray, viewed: BoolArray) -> FloatArray:
    """Return the median residual of each marker that is viewed often enough, else 0."""
    out = np.zeros(residual.shape[1:])
    shown = np.where(seen[..., None], residual, np.nan)
    out[viewed] = np.nanmedian(shown[:, viewed], axis=0)
    return out


def _adapt_hand(model: HandModel, x: FloatArray, seen: BoolArray) -> tuple[HandModel, float, float]:
    count = seen.sum(1)
    order = np.argsort(-count, kind="stable")[: 2 * _FRAMES]
    chosen = np.sort(order[count[order] >= 0.6 * max(int(count.max(initial=0)), 8)])
    chosen = chosen[:: max(1, len(chosen) // _FRAMES)]
    if len(chosen) < _LEAST_VIEWS:
        return model, 1.0, 0.0
    x, seen = x[chosen], seen[chosen]
    if _error(model, x, seen) < _SAME_HAND_MM:
        return model, 1.0, 0.0
    few = slice(None, None, max(1, len(x) // _SIZE_FRAMES))
    errors = [_error(resized(model, size), x[few], seen[few]) for size in _SIZES]
    size = lowest(_SIZES, np.array(errors))
    adapted, offsets = resized(model, size), np.zeros((layout.N_HAND, 3))
    # In turns: poses of the hand so far; offsets in the axes of each bone, shrunk where few frames
    # show the marker.
    for _ in range(_HAND_ROUNDS):
        found = invert_hand(adapted, x, seen)
        residual = adapted.residual(found, x)
        frames = local_frames(model, found[:, : model.n_shape])
        turned = np.einsum("tkij,tki->tkj", frames, residual)
        offsets += _shrunk(turned, seen)
        adapted = _displaced(resized(model, size), offsets, found[:, : model.n_shape])
    viewed = seen.sum(0) >= _LEAST_VIEWS
    return adapted, size, float(np.linalg.norm(offsets[viewed], axis=1).mean())


def _error(model: HandModel, x: FloatArray, seen: BoolArray) -> float:
    """Return the median distance of seen markers from the model."""
    found = invert_hand(model, x, seen)
    gap = np.linalg.norm(model.residual(found, x), axis=-1)
    return float(np.median(gap[seen]))


def lowest(at: FloatArray, values: FloatArray) -> float:
    """Return where the parabola through the least value and its neighbours is least."""
    i = int(np.clip(values.argmin(), 1, len(at) - 2))
    left, least, right = values[i - 1 : i + 2]
    bend = left - 2 * least + right
    step = 0.5 * (left - right) / bend if bend > 0 else 0.0
    return float(at[i] + np.clip(step, -1, 1) * (at[1] - at[0]))


def resized(model: HandModel, size: float) -> HandModel:
    """Return the model of a hand `size` times as large."""
    return replace(model, regression=(size * model.regression).astype(np.float32))


def _shrunk(turned: FloatArray, seen: BoolArray) -> FloatArray:
    """Return the middle displacement of each marker; few views are believed little."""
    views = seen.sum(0)
    middle = _middle(turned, seen, views > 0)
    return np.asarray(middle * (views / (views + _FIRMNESS))[:, None])


def local_frames(model: HandModel, shape: FloatArray) -> FloatArray:
    """Return how the neighbourhood of each marker has turned, shape (T, 50, 3, 3).

    Against the hand at parameters 0, forearm at rest; the neighbourhood is the marker and those
    of its digit, or of palm, wrist and forearm, that are nearest.
    """
    rest = model.shape(np.zeros((1, model.n_shape)))[0]
    posed = model.shape(shape)
    groups = _groups()
    out = np.empty((len(shape), layout.N_HAND, 3, 3))
    for marker in range(layout.N_HAND):
        same = np.flatnonzero(groups == groups[marker])
        away = np.linalg.norm(rest[same] - rest[marker], axis=1)
        near = same[np.argsort(away, kind="stable")[: _NEIGHBOURS + 1]]
        motion, _ = rigid.estimate_motion(rest[near], posed[:, near], outlier_mm=1e3, rounds=1)
        out[:, marker] = rigid.rotation_matrices(motion[:, :3])
    return out


def _groups() -> NDArray[np.intp]:
    """Return the part of the hand that each marker belongs to."""
    group = np.zeros(layout.N_HAND, dtype=np.intp)
    for number, name in enumerate(layout.HAND_MARKERS):
        if name[0] in "FSK" and name[:2] != "K1":
            group[number] = int(name[1])
        elif name[0] == "A":
            group[number] = 6
        elif name == "K1":
            group[number] = 1
    return group


def _displaced(model: HandModel, offsets: FloatArray, seen_shapes: FloatArray) -> HandModel:
    """Return the model with each marker displaced in the frame of its neighbourhood.

    The displacements are regressed on the cosines and sines of the angles, as the model's markers
    are, over the shapes that occurred and random ones.
    """
    rng = np.random.default_rng(0)
    spread = np.maximum(seen_shapes.std(0), _LEAST_SPREAD)
    random = seen_shapes.mean(0) + spread * rng.normal(size=(400, model.n_shape))
    shapes = np.concatenate([seen_shapes, random])
    moved = np.einsum("tkij,kj->tki", local_frames(model, shapes), offsets)
    system = regressors(model.angles(shapes))
    gram = system.T @ system + _RIDGE * len(system) * np.eye(system.shape[1])
    weights = np.linalg.solve(gram, system.T @ moved.reshape(len(moved), -1))
    added = weights.reshape(-1, layout.N_HAND, 3)
    return replace(model, regression=(model.regression + added).astype(np.float32))
