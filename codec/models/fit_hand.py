"""Learning the hand model from frames in which every marker of the hand is seen.

The four steps of Gibert, Bailly, Elisei 2004, section 3.2: the forearm's rigid motion and its
principal components; the angles of every segment; their principal components; the regression of
the markers on cosines and sines of the predicted angles. Then the joint estimation of section
3.3: parameters are found anew from the markers and the regression is repeated.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from codec import layout
from codec.models import rigid
from codec.models.angles import angle_frames, measure_angles
from codec.models.hand import N_HAND_PARAMETERS, HandModel, regressors
from codec.models.inversion import FOREARM_COLUMNS, invert_hand
from codec.models.pca import Components, motion_components, principal_components, single
from codec.models.pruning import prune

Regressors = Literal["angles", "parameters", "linear"]
_RIDGE = 1e-3
_LINEAR_ANGLE = 1e-3
_PARAMETER_ANGLE = 0.5


def fit_hand(
    markers: NDArray[np.float64],
    motion_frames: NDArray[np.float64],
    *,
    n_parameters: int = N_HAND_PARAMETERS,
    regress_on: Regressors = "angles",
    joint_rounds: int = 4,
) -> HandModel:
    """Learn a hand model.

    Parameters
    ----------
    markers : ndarray of float64, shape (N, 50, 3)
        Frames of moving shapes, world coordinates, millimetres, every marker seen.
    motion_frames : ndarray of float64, shape (M, 50, 3)
        Frames whose forearm motion is to be covered (corpus 3).
    n_parameters : int
        naH; other than 12 for comparison only.
    regress_on : {"angles", "parameters", "linear"}
        The paper's formula, its sentence, or a plain linear model for comparison.
    joint_rounds : int
        Rounds of joint estimation of motion and shape.

    Returns
    -------
    HandModel
    """
    _, motion = rigid.mean_body(np.concatenate([markers, motion_frames])[:, FOREARM_COLUMNS])
    pivot = motion[len(markers) :, 3:].mean(0)
    motion[:, 3:] -= pivot
    motion, motion_of_lines = motion[: len(markers)], motion[len(markers) :]
    still = rigid.inverse_rigid_motion(markers - pivot, motion)
    lever = float(np.sqrt((still.mean(0) ** 2).sum(-1).mean()))
    carrier = motion_components(motion_of_lines, lever)
    kept = prune(still)
    still, chosen = still[kept], markers[kept]
    angles, scores = _angle_components(still, n_parameters, regress_on)
    model = _regressed(still, scores, angles, pivot, carrier)
    for _ in range(joint_rounds):
        parameters = invert_hand(model, chosen, np.ones(chosen.shape[:2], dtype=bool))
        moved = model.motion(parameters[:, n_parameters:])
        still = rigid.inverse_rigid_motion(chosen - pivot, moved)
        model = _regressed(still, parameters[:, :n_parameters], angles, pivot, carrier)
    return model


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
    scores: NDArray[np.float64],
    angles: Components,
    pivot: NDArray[np.float64],
    carrier: Components,
) -> HandModel:
    """Regress the markers on cosines and sines of the predicted angles."""
    design = regressors(angles.mean + scores @ angles.directions)
    n = angles.mean.size
    penalty = np.full(1 + 2 * n, _RIDGE)
    penalty[0] = 0.0
    if np.abs(angles.directions).max() <= _LINEAR_ANGLE:
        design[:, 1 : 1 + n] = 0.0
        penalty[1 + n :] = 0.0
    normal = design.T @ design / len(design) + np.diag(np.maximum(penalty, 1e-12))
    moment = design.T @ still.reshape(len(still), -1) / len(design)
    regression = np.linalg.solve(normal, moment).reshape(-1, layout.N_HAND, 3)
    return HandModel(
        *single(angles.mean, angles.directions, regression, pivot, carrier.mean, carrier.directions)
    )
