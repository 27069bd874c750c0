"""Learning the face model from frames with every marker of the face visible.

The three steps of Gibert, Bailly, Elisei 2004, section 3.1: the head's rigid motion from ears,
nose and forehead and its principal components; guided components of the face under a head at
rest; then, for the throat, the joint optimisation of the share of the head's motion that each
marker follows and of its face directions, the predictors staying what they are.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.models.face import THROAT_COLUMNS, FaceModel
from codec.cuer.models.inversion import RIGID_FACE_COLUMNS
from codec.cuer.models.pca import guided_components, motion_components, single
from codec.cuer.models.threads import one_thread
from codec.training.pruning import prune

_MAX_WEIGHT = 0.99
"""Largest share of the jaw's motion that a marker follows."""

_THROAT_FRAMES = 1500
"""Frames that the throat's weights are learnt from: a bound on time."""

_ROUNDS = 3
"""Rounds; each finds components and the throat's weights in turn."""


def _coordinates(names: tuple[str, ...], axes: str) -> NDArray[np.intp]:
    columns = np.array([layout.FACE_MARKERS.index(name) for name in names])
    return (3 * columns[:, None] + ["xyz".index(axis) for axis in axes]).reshape(-1)


_LIPS = (*layout.UPPER_LIP, *layout.LIP_CORNERS, *layout.LOWER_LIP)
GUIDES = [
    _coordinates((*layout.CHIN, *layout.JAW), "xyz"),
    _coordinates(_LIPS, "xz"),
    _coordinates(layout.LOWER_LIP, "y"),
    _coordinates(layout.UPPER_LIP, "y"),
    _coordinates(layout.LIP_CORNERS, "xyz"),
    _coordinates(layout.THROAT, "xyz"),
    np.arange(3 * layout.N_FACE),
]
"""Coordinates whose first component defines each parameter: jaw, rounding and spreading, lower
lip, upper lip, corners, throat, and the rest."""


@one_thread
def fit_face(markers: NDArray[np.float64], skull: NDArray[np.float64]) -> FaceModel:
    """Learn a face model.

    Parameters
    ----------
    markers : ndarray of float64, shape (N, 63, 3)
        Frames of speech, world coordinates, millimetres, every marker seen.
    skull : ndarray of float64, shape (M, 10, 3)
        Ears, nose and forehead in frames whose motion is to be covered (corpus 3), all seen.

    Returns
    -------
    FaceModel
    """
    _, motion = rigid.mean_body(np.concatenate([markers[:, RIGID_FACE_COLUMNS], skull]))
    pivot = motion[:, 3:].mean(0)
    motion[:, 3:] -= pivot
    lever = float(np.sqrt(((markers.mean(0) - pivot) ** 2).sum(-1).mean()))
    head = motion_components(motion[len(markers) :], lever)
    motion = motion[: len(markers)]
    kept = prune(rigid.inverse_rigid_motion(markers - pivot, motion))
    points, motion = markers[kept] - pivot, motion[kept]
    weights = np.ones((layout.N_FACE, 6))
    weights[THROAT_COLUMNS] = 0.5
    for _ in range(_ROUNDS):
        still = _without_motion(points, motion, weights)
        face, scores = guided_components(still.reshape(len(still), -1), GUIDES)
        mean, directions = face.mean.reshape(-1, 3), face.directions.reshape(-1, layout.N_FACE, 3)
        _fit_throat(points, motion, scores, weights, mean, directions)
    signs = [-np.sign(direction[:, 1].sum()) or 1.0 for direction in directions]
    directions *= np.array(signs)[:, None, None]
    return FaceModel(*single(mean + pivot, directions, pivot, head.mean, head.directions, weights))


def _without_motion(
    points: NDArray[np.float64], motion: NDArray[np.float64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Undo the head's motion, of each marker its share."""
    shares = motion[:, None] * weights
    back = np.concatenate([-shares[..., :3], np.zeros_like(shares[..., 3:])], axis=-1)
    return rigid.weighted_rigid_motion(points - shares[..., 3:], back)


def _fit_throat(
    points: NDArray[np.float64],
    motion: NDArray[np.float64],
    scores: NDArray[np.float64],
    weights: NDArray[np.float64],
    mean: NDArray[np.float64],
    directions: NDArray[np.float64],
) -> None:
    """Optimise weights, mean and directions of each throat marker together, in place.

    For given weights mean and directions are a linear regression of the unmoved marker on the
    predictors (a rotation keeps distances), so only six weights are searched.
    """
    chosen = np.linspace(0, len(points) - 1, min(len(points), _THROAT_FRAMES)).astype(int)
    # Variable projection: subtracting the projection on the predictors leaves the misfit of the
    # best linear regression for these weights.
    basis, _ = np.linalg.qr(np.column_stack([np.ones(len(chosen)), scores[chosen]]))

    def misfit(weight: NDArray[np.float64], marker: int) -> NDArray[np.float64]:
        still = _without_motion(points[chosen, marker, None], motion[chosen], weight[None])[:, 0]
        return np.asarray((still - basis @ (basis.T @ still)).reshape(-1))

    full = np.column_stack([np.ones(len(points)), scores])
    for marker in THROAT_COLUMNS:
        found = least_squares(
            misfit,
            np.clip(weights[marker], 0.01, _MAX_WEIGHT - 0.01),
            bounds=(0.0, _MAX_WEIGHT),
            args=(marker,),
            max_nfev=30,
        )
        weights[marker] = found.x
        still = _without_motion(points[:, marker, None], motion, weights[None, marker])[:, 0]
        coefficients = np.linalg.lstsq(full, still, rcond=None)[0]
        mean[marker], directions[:, marker] = coefficients[0], coefficients[1:]
