"""Principal components with unit-variance scores, and the guided variant of the face model."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

EXPLAINED = 0.99
"""Share of the variance that components of motion keep."""

MOTION_LEFT_MM = 1.0
"""Largest residual of the components of motion, in mm."""

N_DEVIATIONS = 16
"""Directions kept of a model's residuals."""


@dataclass(frozen=True, slots=True)
class Components:
    """Linear model x = mean + scores @ directions, scores of unit variance.

    Attributes
    ----------
    mean : ndarray of float64, shape (D,)
    directions : ndarray of float64, shape (n, D)
        In the unit of the data: one standard deviation of each component.
    explained : ndarray of float64, shape (n,)
        Share of the variance that each component takes, in order.
    """

    mean: NDArray[np.float64]
    directions: NDArray[np.float64]
    explained: NDArray[np.float64]

    def truncated(self, n: int) -> "Components":
        """Return the model of the first `n` components."""
        return Components(self.mean, self.directions[:n], self.explained[:n])


def principal_components(
    data: NDArray[np.float64], *, scale: NDArray[np.float64] | None = None
) -> tuple[Components, NDArray[np.float64]]:
    """Return all principal components of `data` and the scores of its rows.

    Parameters
    ----------
    data : ndarray of float64, shape (N, D)
    scale : ndarray of float64, shape (D,), optional
        Columns are multiplied by it before variances are compared; brings columns of different
        units to one. The directions returned are in the original units.

    Returns
    -------
    components : Components
        Components without variance are left out.
    scores : ndarray of float64, shape (N, n)
    """
    if data.ndim != 2 or len(data) < 2:
        raise CueError(f"principal components of data of shape {data.shape}: 2 rows are needed")
    weight = np.ones(data.shape[1]) if scale is None else scale
    mean = data.mean(0)
    centred = (data - mean) * weight
    variance, axes = np.linalg.eigh(centred.T @ centred / len(data))
    variance, axes = variance[::-1], axes[:, ::-1]
    keep = variance > max(1e-12 * float(variance[0]), 1e-300)
    variance, axes = variance[keep], axes[:, keep]
    deviation = np.sqrt(variance)
    explained = variance / variance.sum() if keep.any() else variance
    components = Components(mean, (axes * deviation).T / weight, explained)
    return components, centred @ axes / deviation


def components_for(explained: NDArray[np.float64], share: float) -> int:
    """Return the least number of components that explain `share` of the variance.

    Examples
    --------
    >>> components_for(np.array([0.9, 0.08, 0.015, 0.005]), 0.99)
    3
    """
    return min(int(np.searchsorted(np.cumsum(explained), share - 1e-12)) + 1, len(explained))


def single(*arrays: NDArray[Any]) -> tuple[NDArray[np.float32], ...]:
    """Return the arrays in single precision, as models keep them."""
    return tuple(array.astype(np.float32) for array in arrays)


def motion_components(motion: NDArray[np.float64], lever_mm: float) -> Components:
    """Return the control parameters of a rigid motion.

    As many components as explain 99 % of the distance that the motion moves its markers, and
    leave less than 1 mm of it (root mean square): the share alone would let a wide motion spoil
    every marker.

    Parameters
    ----------
    motion : ndarray of float64, shape (N, 6)
        Rotation vectors (radians) and translations (mm) about the pivot.
    lever_mm : float
        Root mean square distance of the carried markers from the pivot: makes radians millimetres.
    """
    scale = np.array([lever_mm] * 3 + [1.0] * 3)
    components, _ = principal_components(motion, scale=scale)
    power = float((((motion - components.mean) * scale) ** 2).sum(1).mean())
    share = max(EXPLAINED, 1 - MOTION_LEFT_MM**2 / max(power, MOTION_LEFT_MM**2))
    return components.truncated(max(1, components_for(components.explained, share)))


def deviation_components(
    residual: NDArray[np.float64], count: int = N_DEVIATIONS
) -> NDArray[np.float64]:
    """Return the principal directions of a model's residual, largest first.

    Parameters
    ----------
    residual : ndarray of float64, shape (N, K, 3)
        Millimetres.
    count : int

    Returns
    -------
    ndarray of float64, shape (S, K, 3), S <= count
        One standard deviation each.
    """
    components, _ = principal_components(residual.reshape(len(residual), -1))
    return components.directions[:count].reshape(-1, *residual.shape[1:])


def guided_components(
    data: NDArray[np.float64], guides: list[NDArray[Any]]
) -> tuple[Components, NDArray[np.float64]]:
    """Subtract, one after another, the first component of chosen columns from all columns.

    For each guide the predictor is the first principal component of the guide's columns of what
    is left; its directions are the regression of all that is left on the predictor.

    Parameters
    ----------
    data : ndarray of float64, shape (N, D)
    guides : list of index arrays
        Columns that define each predictor, in order.

    Returns
    -------
    components : Components
    scores : ndarray of float64, shape (N, len(guides))

    Notes
    -----
    Revéret, Bailly, Badin 2000; Gibert, Bailly, Elisei 2004, section 3.1.
    """
    mean = data.mean(0)
    left = data - mean
    total = max(float((left**2).sum()), 1e-300)
    directions, explained = np.zeros((len(guides), data.shape[1])), np.zeros(len(guides))
    scores = np.zeros((len(data), len(guides)))
    for k, columns in enumerate(guides):
        _, predictors = principal_components(left[:, columns])
        if predictors.shape[1] == 0:
            continue
        scores[:, k] = predictors[:, 0]
        directions[k] = scores[:, k] @ left / len(data)
        before = float((left**2).sum())
        left = left - np.outer(scores[:, k], directions[k])
        explained[k] = (before - float((left**2).sum())) / total
    return Components(mean, directions, explained), scores
