"""Learning the hand model from frames with every marker of the hand visible.

The four steps of Gibert, Bailly, Elisei 2004, section 3.2: the forearm's rigid motion and its
principal components; the angles of every segment; their principal components; the regression of
the markers on cosines and sines of the predicted angles. Then the joint estimation of section
3.3: parameters are found anew from the markers and the regression is repeated.
"""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.models.angles import angle_frames, measure_angles
from codec.cuer.models.hand import N_HAND_PARAMETERS, HandModel, regressors
from codec.cuer.models.inversion import FOREARM_COLUMNS, invert, invert_hand
from codec.cuer.models.pca import (
    Components,
    deviation_components,
    motion_components,
    principal_components,
    single,
)
from codec.cuer.models.threads import one_thread
from codec.errors import CueError
from codec.training.pruning import prune

Regressors = Literal["angles", "parameters", "linear"]

LEAST_FRAMES = 200
"""Complete frames that a fit needs."""

_MOST_FRAMES = 20_000
"""Frames that are used at most, evenly spread: a bound on time and memory."""

_RIDGE = 1e-3
"""Weight of the ridge, of the regressors' unit variance."""

_LINEAR_ANGLE = 1e-3
"""Angle in radians so small that sines are linear: the control without them."""

_PARAMETER_ANGLE = 0.5
"""Radians that a parameter of unit variance stands for in the paper's regression."""


@one_thread
def fit_hand(
    markers: NDArray[np.float64],
    forearm: NDArray[np.float64],
    *,
    n_parameters: int = N_HAND_PARAMETERS,
    regress_on: Regressors = "angles",
    joint_rounds: int = 3,
) -> HandModel:
    """Learn a hand model.

    Parameters
    ----------
    markers : ndarray of float64, shape (N, 50, 3)
        Frames of moving shapes, world coordinates, millimetres; NaN where hidden. Frames that
        show every marker give the angles, all frames the regression.
    forearm : ndarray of float64, shape (M, 12, 3)
        Forearm markers of frames whose motion is to be covered (corpus 3), every one seen.
    n_parameters : int
        naH; other than 12 for comparison only.
    regress_on : {"angles", "parameters", "linear"}
        The paper's formula, its sentence, or a plain linear model for comparison.
    joint_rounds : int
        Rounds of joint estimation of motion and shape.

    Returns
    -------
    HandModel

    Raises
    ------
    CueError
        If hardly any frame shows every marker.
    """
    seen = np.asarray(np.isfinite(markers).all(-1))
    complete = markers[seen.all(1)]
    if len(complete) < LEAST_FRAMES:
        raise CueError(f"{len(complete)} complete frames of the hand, {LEAST_FRAMES} needed")
    _, motion = rigid.mean_body(np.concatenate([complete[:, FOREARM_COLUMNS], forearm]))
    pivot = motion[len(complete) :, 3:].mean(0)
    motion[:, 3:] -= pivot
    motion, motion_of_lines = motion[: len(complete)], motion[len(complete) :]
    still = rigid.inverse_rigid_motion(complete - pivot, motion)
    lever = float(np.sqrt((still.mean(0) ** 2).sum(-1).mean()))
    carrier = motion_components(motion_of_lines, lever)
    still = still[prune(still)]
    angles, scores = _angle_components(still, n_parameters, regress_on)
    model = _regressed(still, np.ones(still.shape[:2], dtype=bool), scores, angles, pivot, carrier)
    return _jointly(model, markers, seen, carrier, rounds=joint_rounds)


def _jointly(
    model: HandModel,
    markers: NDArray[np.float64],
    seen: NDArray[np.bool_],
    carrier: Components,
    *,
    rounds: int,
) -> HandModel:
    """Find parameters from the markers and the regression from the parameters, in turn."""
    pivot, n = model.pivot.astype(np.float64), model.n_shape
    stride = -(-len(markers) // _MOST_FRAMES)
    world, seen = np.where(seen[..., None], markers, 0.0)[::stride], seen[::stride]
    parameters = invert_hand(model, world, seen)
    kept = prune(model.shape(parameters[:, :n]))
    world, seen, parameters = world[kept], seen[kept], parameters[kept]
    for _ in range(rounds):
        # Without this the scales of weak parameters would drift from round to round.
        model, parameters = _standardised(model, parameters)
        still = rigid.inverse_rigid_motion(world - pivot, model.motion(parameters[:, n:]))
        angles = Components(
            model.angle_mean.astype(np.float64),
            model.angle_directions.astype(np.float64),
            np.zeros(n),
        )
        model = _regressed(still, seen, parameters[:, :n], angles, pivot, carrier)
        parameters = invert(model, world, seen, parameters)
    model, parameters = _standardised(model, parameters)
    shown = seen.all(1)
    left = model.residual(parameters[shown], world[shown])
    return replace(model, deviations=single(deviation_components(left))[0])


def _angle_components(
    still: NDArray[np.float64], n_parameters: int, regress_on: Regressors
) -> tuple[Components, NDArray[np.float64]]:
    """Return the model of the angles in `n_parameters`, and the parameters of each frame."""
    angles = measure_angles(still, angle_frames(still))
    components, scores = principal_components(angles, scale=_levers(angles, still))
    components, scores = components.truncated(n_parameters), scores[:, :n_parameters]
    if regress_on != "angles":
        # A small multiple of the parameters makes the sine linear; `_regressed` drops the cosine.
        size = _PARAMETER_ANGLE if regress_on == "parameters" else _LINEAR_ANGLE
        directions = size * np.eye(n_parameters)
        components = Components(np.zeros(n_parameters), directions, components.explained)
    return components, scores


def _levers(angles: NDArray[np.float64], still: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far the markers move per radian of each angle, on average.

    Angles of short segments are noisy and move little: they must not take components from the
    angles that move the whole hand.
    """
    centred = angles - angles.mean(0)
    moved = (still - still.mean(0)).reshape(len(still), -1)
    covariance = centred.T @ moved / len(still)
    power = (centred**2).mean(0)
    return np.asarray(np.sqrt((covariance**2).sum(1)) / np.maximum(power, 1e-12))


def _regressed(
    still: NDArray[np.float64],
    seen: NDArray[np.bool_],
    scores: NDArray[np.float64],
    angles: Components,
    pivot: NDArray[np.float64],
    carrier: Components,
) -> HandModel:
    """Regress each marker, where it is seen, on cosines and sines of the predicted angles."""
    design = regressors(angles.mean + scores @ angles.directions)
    n = angles.mean.size
    penalty = np.full(1 + 2 * n, _RIDGE)
    penalty[0] = 1e-12
    # Tiny angles: cosines are constant, so only sines count.
    if np.abs(angles.directions).max() <= 10 * _LINEAR_ANGLE:
        design[:, 1 : 1 + n] = 0.0
        penalty[1 + n :] = 1e-12
    regression = np.empty((1 + 2 * n, layout.N_HAND, 3))
    # Normal equations per marker: those of all frames less those of the frames that hide it.
    whole = design.T @ design
    for marker in range(layout.N_HAND):
        shown = seen[:, marker]
        unseen = design[~shown]
        count = max(int(shown.sum()), 1)
        normal = (whole - unseen.T @ unseen) / count + np.diag(penalty)
        moment = design[shown].T @ still[shown, marker] / count
        regression[:, marker] = np.linalg.solve(normal, moment)
    none = np.zeros((0, layout.N_HAND, 3))
    return HandModel(
        *single(angles.mean, angles.directions, regression, pivot),
        *single(carrier.mean, carrier.directions, none),
    )


def _standardised(
    model: HandModel, parameters: NDArray[np.float64]
) -> tuple[HandModel, NDArray[np.float64]]:
    """Return the same model in uncorrelated shape parameters of unit variance, mightiest first.

    Might is the distance that a parameter moves the markers. The change of basis is exact: the
    angles are linear in the parameters.

    Parameters
    ----------
    model : HandModel
    parameters : ndarray of float64, shape (N, naH + nmH)
        Of the frames whose variance counts.

    Returns
    -------
    model : HandModel
    parameters : ndarray of float64, shape (N, naH + nmH)
        The same frames in the new basis.
    """
    shape = parameters[:, : model.n_shape]
    mean = shape.mean(0)
    factor = np.linalg.cholesky(np.cov(shape.T) + 1e-9 * np.eye(len(mean)))
    white = np.linalg.solve(factor, (shape - mean).T).T
    moved = model.shape(shape).reshape(len(shape), -1)
    _, _, turn = np.linalg.svd((moved - moved.mean(0)).T @ white, full_matrices=False)
    turn *= np.where(turn.sum(1) < 0, -1.0, 1.0)[:, None]
    changed = replace(
        model,
        angle_mean=single(model.angles(mean[None])[0])[0],
        angle_directions=single(turn @ factor.T @ model.angle_directions)[0],
    )
    return changed, np.concatenate([white @ turn.T, parameters[:, model.n_shape :]], axis=1)
