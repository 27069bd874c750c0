"""Inversion: model parameters from the markers that are seen, and so the hidden ones too.

Masked nonlinear least squares, all frames at once (Gauss-Newton). A weak prior (parameters have
unit variance) holds what the visible markers do not determine; markers far from the fit lose
weight (Geman-McClure), so that swapped markers and ghosts do not pull.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from codec import layout
from codec.models import rigid
from codec.models.face import N_FACE_PARAMETERS, FaceModel
from codec.models.hand import HandModel

RIGID_FACE_COLUMNS = np.array([layout.FACE_MARKERS.index(name) for name in layout.RIGID_FACE])
FOREARM_COLUMNS = np.array([layout.HAND_MARKERS.index(name) for name in layout.FOREARM])

_BLOCK = 256
_STEPS = 8
_PLAIN_STEPS = 1
_LONGEST_STEP = 3.0
_TOLERANCE = 0.01
_NOISE_MM = 1.0
_SUSPECT_MM = 8.0


class MarkerModel(Protocol):
    """What inversion needs of a model."""

    @property
    def n_parameters(self) -> int:
        """Number of parameters."""

    def residual(
        self, parameters: NDArray[np.float64], markers: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return markers minus model in resting frames, shape (T, K, 3)."""

    def slopes(self, parameters: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the model's derivatives in resting frames, shape (T, P, K, 3)."""


def invert(
    model: MarkerModel,
    markers: NDArray[np.float64],
    visible: NDArray[np.bool_],
    start: NDArray[np.float64],
    *,
    prior: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the parameters that explain the visible markers best.

    Parameters
    ----------
    model : FaceModel or HandModel
    markers : ndarray of float64, shape (T, K, 3)
        Millimetres; hidden markers may hold anything finite.
    visible : ndarray of bool, shape (T, K)
    start : ndarray of float64, shape (T, P)
        First guess, for example from `starting_motion`.
    prior : ndarray of float64, shape (P,), optional
        Strength of the pull of each parameter towards 0, in units of 1 mm² of one coordinate.

    Returns
    -------
    ndarray of float64, shape (T, P)
    """
    pull = np.full(model.n_parameters, _NOISE_MM**2) if prior is None else prior
    out = np.array(start, dtype=np.float64)
    for begin in range(0, len(out), _BLOCK):
        block = slice(begin, begin + _BLOCK)
        _solve(model, markers[block], visible[block], out[block], pull)
    return out


def invert_face(
    model: FaceModel, markers: NDArray[np.float64], visible: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return face and head parameters (T, 7 + nmF) of face markers (T, 63, 3)."""
    start = np.zeros((len(markers), model.n_parameters))
    start[:, N_FACE_PARAMETERS:] = starting_motion(
        (model.mean - model.pivot)[RIGID_FACE_COLUMNS],
        markers[:, RIGID_FACE_COLUMNS] - model.pivot,
        visible[:, RIGID_FACE_COLUMNS],
        model.motion_mean,
        model.motion_directions,
    )
    return invert(model, markers, visible, start)


def invert_hand(
    model: HandModel, markers: NDArray[np.float64], visible: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return hand and forearm parameters (T, naH + nmH) of hand markers (T, 50, 3)."""
    start = np.zeros((len(markers), model.n_parameters))
    start[:, model.n_shape :] = starting_motion(
        model.shape(np.zeros((1, model.n_shape)))[0, FOREARM_COLUMNS],
        markers[:, FOREARM_COLUMNS] - model.pivot,
        visible[:, FOREARM_COLUMNS],
        model.motion_mean,
        model.motion_directions,
    )
    return invert(model, markers, visible, start)


def starting_motion(
    reference: NDArray[np.float64],
    markers: NDArray[np.float64],
    visible: NDArray[np.bool_],
    mean: NDArray[np.float32],
    directions: NDArray[np.float32],
) -> NDArray[np.float64]:
    """Return the motion parameters of the rigid markers alone, bridging unsolved frames.

    Parameters
    ----------
    reference : ndarray of float64, shape (K, 3)
        Rigid markers at rest, about the pivot.
    markers, visible : ndarray, shapes (T, K, 3) and (T, K)
        The rigid markers of the recording, about the pivot.
    mean, directions : ndarray of float32, shapes (6,) and (n, 6)
        Model of the motion.

    Returns
    -------
    ndarray of float64, shape (T, n)
        Zero throughout if no frame could be solved.
    """
    motion, solved = rigid.estimate_motion(reference, markers, visible)
    if not solved.any():
        return np.zeros((len(markers), len(directions)))
    # Rotations count by the distance they move the markers.
    lever = float(np.sqrt((reference**2).sum(-1).mean()))
    scale = np.array([lever] * 3 + [1.0] * 3)
    inverse = np.linalg.pinv(directions * scale)
    parameters = ((motion - mean) * scale) @ inverse
    frames = np.arange(len(markers))
    return np.stack(
        [np.interp(frames, frames[solved], column[solved]) for column in parameters.T], axis=1
    )


def _solve(
    model: MarkerModel,
    markers: NDArray[np.float64],
    visible: NDArray[np.bool_],
    parameters: NDArray[np.float64],
    pull: NDArray[np.float64],
) -> None:
    """Improve `parameters` in place until no frame moves by more than the tolerance.

    Slopes are costly and change slowly: each serves for two steps (the chord method).
    """
    active = np.arange(len(parameters))
    for step in range(_STEPS):
        now, seen, at = markers[active], visible[active], parameters[active]
        slopes = model.slopes(at).reshape(len(active), len(pull), -1)
        weight = _weights(model.residual(at, now), seen, robust=step >= _PLAIN_STEPS)
        weighted = slopes * np.repeat(weight, 3, axis=1)[:, None]
        normal = (weighted @ np.swapaxes(slopes, 1, 2)).astype(np.float64)
        inverse = np.linalg.inv(normal + np.diag(pull))
        for _ in range(2):
            residual = model.residual(at, now)
            projected = weighted @ residual.reshape(len(at), -1, 1).astype(np.float32)
            update = (inverse @ (projected - (pull * at)[..., None]))[..., 0]
            # Longer steps leave the range in which the slopes hold.
            longest = np.abs(update).max(1, keepdims=True)
            at = at + update * np.minimum(1.0, _LONGEST_STEP / np.maximum(longest, 1e-12))
        parameters[active] = at
        moving = longest[:, 0] > _TOLERANCE
        # Outliers are told from the model's own error only after the plain steps.
        active = active[moving] if step >= _PLAIN_STEPS else active
        if not len(active):
            return


def _weights(
    residual: NDArray[np.float64], visible: NDArray[np.bool_], *, robust: bool
) -> NDArray[np.float32]:
    weight = visible.astype(np.float32)
    if robust:
        weight /= (1 + (residual**2).sum(-1).astype(np.float32) / _SUSPECT_MM**2) ** 2
    return weight
