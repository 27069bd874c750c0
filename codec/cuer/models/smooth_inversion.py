"""Inversion of markers that a model has made: all are seen, and they move without noise.

Every fourth frame is inverted by itself; those between take few steps with the slopes of the
nearest of these (chord method), and where these lead far, one with their own. The face begins at
interpolated parameters. The hand's shape is known nearly, from the shapes that it moves between:
its frames begin there, each at the interpolated distance that the fourth frames turned out to have,
so that they stay on one side of solutions that lie close together. Frames with a poor result begin
anew at their neighbours', and the better one stays. The result of a frame depends on the frames
within `SIDE` of it alone.
"""

import numpy as np
from numpy.typing import NDArray

from codec.cuer.models.face import FaceModel
from codec.cuer.models.hand import HandModel
from codec.cuer.models.inversion import (
    LONGEST_STEP,
    NOISE_MM2,
    MarkerModel,
    gauss_newton,
    hand_start,
    invert,
    invert_face,
    marker_weights,
)
from codec.cuer.models.threads import one_thread

ANCHORED = 4
"""Frames from one that is inverted by itself to the next."""

SIDE = 2 * ANCHORED
"""Frames on either side that the result of a frame may depend on."""

_FACE_CHORDS, _HAND_CHORDS = 2, 1
"""Steps of a frame with another one's slopes. More move no marker of a face; frames of a hand would
jump."""

_HAND_STEPS = 3
"""Gauss-Newton steps of a hand, which begins near: with 2, 3 and 4 steps 20 sentences have a mean
residual of .970, .968 and .967 mm."""

_FAR = 0.4
"""Step with another frame's slopes, in standard deviations, after which a frame of the hand takes
one with its own: a third of the frames. The mean residual is that of plain inversion so."""

_POOR_MM = 2.0
"""Root mean square residual in mm from which a frame of the hand begins anew."""


def smooth_face(model: FaceModel, markers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the parameters of face markers that are all seen and move smoothly.

    Parameters
    ----------
    model : FaceModel
    markers : ndarray of float64, shape (T, 63, 3)
        Consecutive frames, T one more than a multiple of `ANCHORED`, millimetres.

    Returns
    -------
    ndarray of float64, shape (T, P)
    """
    near = markers[::ANCHORED]
    out = _interpolated(invert_face(model, near, _all_seen(near)))
    _refine(model, markers, out, _FACE_CHORDS)
    return out


def smooth_hand(
    model: HandModel, markers: NDArray[np.float64], shape: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the parameters of hand markers that are all seen and move smoothly.

    Parameters
    ----------
    model : HandModel
    markers : ndarray of float64, shape (T, 50, 3)
        As of `smooth_face`.
    shape : ndarray of float64, shape (T, naH)
        Shape parameters nearby, moving smoothly too.

    Returns
    -------
    ndarray of float64, shape (T, P)
    """
    out = hand_start(model, markers, _all_seen(markers))
    out[:, : model.n_shape] = shape
    start, near = out[::ANCHORED], markers[::ANCHORED]
    anchors = invert(model, near, _all_seen(near), start, steps=_HAND_STEPS, near=True)
    out += _interpolated(anchors - start)
    before = out.copy()
    _refine(model, markers, out, _HAND_CHORDS)
    far = np.abs(out - before).max(axis=1) > _FAR
    again = markers[far]
    out[far] = invert(model, again, _all_seen(again), out[far], steps=1, near=True)
    _repair(model, markers, out)
    return out


def _all_seen(markers: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.ones(markers.shape[:2], dtype=np.bool_)


def _interpolated(anchors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values of every fourth frame for every frame."""
    frames = np.arange(ANCHORED * (len(anchors) - 1) + 1)
    return np.stack([np.interp(frames, frames[::ANCHORED], x) for x in anchors.T], axis=1)


@one_thread
def _refine(
    model: MarkerModel, markers: NDArray[np.float64], parameters: NDArray[np.float64], chords: int
) -> None:
    """Improve the frames between every fourth one by the latter's slopes, in place."""
    anchors, near = parameters[::ANCHORED], markers[::ANCHORED]
    weight = marker_weights(model.residual(anchors, near), _all_seen(near), robust=True)
    # Gauss-Newton at the anchors: step = (J'WJ)^-1 J'W r - NOISE (J'WJ)^-1 x, the latter pulling to
    # the mean.
    projection, inverse = gauss_newton(model, anchors, weight, model.deviations[:0])
    gain = (inverse @ projection).astype(np.float32)
    pull = NOISE_MM2 * inverse
    between = np.arange(len(markers)) % ANCHORED != 0
    # Each frame between takes the slopes of the nearer anchor (chord method: they stay the same).
    nearest = [slice(0, -1)] * (ANCHORED // 2) + [slice(1, None)] * (ANCHORED - 1 - ANCHORED // 2)
    now = markers[between]
    at = parameters[between].reshape(-1, ANCHORED - 1, anchors.shape[1])
    for _ in range(chords):
        flat = at.reshape(len(now), anchors.shape[1])
        residual = model.residual(flat, now).astype(np.float32)
        residual = residual.reshape(*at.shape[:2], gain.shape[2], 1)
        step = np.stack(
            [
                (gain[which] @ residual[:, n] - pull[which] @ at[:, n, :, None])[..., 0]
                for n, which in enumerate(nearest)
            ],
            axis=1,
        )
        longest = np.abs(step).max(axis=-1, keepdims=True)
        at = at + step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, 1e-12))
    parameters[between] = at.reshape(len(now), anchors.shape[1])


def _repair(
    model: MarkerModel, markers: NDArray[np.float64], parameters: NDArray[np.float64]
) -> None:
    """Begin anew, from their neighbours' parameters, where frames with poor ones gain by it."""
    residual = _rms_mm(model, parameters, markers)
    good, poor = (np.flatnonzero(which) for which in (residual <= _POOR_MM, residual > _POOR_MM))
    if not len(poor) or not len(good):
        return
    after = np.searchsorted(good, poor)
    sides = good[np.stack([np.maximum(after - 1, 0), np.minimum(after, len(good) - 1)])]
    nearness = np.maximum(ANCHORED + 1 - np.abs(sides - poor), 0)
    whole = nearness.sum(axis=0)
    poor, sides, nearness = poor[whole > 0], sides[:, whole > 0], nearness[:, whole > 0]
    share = (nearness / nearness.sum(axis=0))[..., None]
    start = (share * parameters[sides]).sum(axis=0)
    again = markers[poor]
    found = invert(model, again, _all_seen(again), start, steps=_HAND_STEPS, near=True)
    better = _rms_mm(model, found, again) < residual[poor]
    parameters[poor[better]] = found[better]


def _rms_mm(
    model: MarkerModel, parameters: NDArray[np.float64], markers: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the root mean square residual of each frame, shape (T,), mm."""
    squares = (model.residual(parameters, markers) ** 2).sum(axis=-1)
    return np.asarray(np.sqrt(squares.mean(axis=-1)))
