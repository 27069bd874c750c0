"""Bridging: what the visible markers leave open is taken from the moments before and after.

The inversion of single frames is linearised about its result; all frames of a passage are then
solved together under a penalty on the acceleration of the parameters, a smoothing spline in the
metric of the markers (Wahba 1990). Directions that many markers show hardly change; a finger that
is hidden follows a smooth path between the frames that show it.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from codec.models.inversion import Confidence, MarkerModel, marker_weights, normal_equations
from codec.models.threads import one_thread

STIFFNESS_MM2_S3 = 1.7e-3
"""Price of acceleration: mm² of marker error per (unit / s²)² and second."""

_PULL_MM2 = 0.1
_PASSAGE = 1024
_MARGIN = 96


@one_thread
def bridge(
    model: MarkerModel,
    markers: NDArray[np.float64],
    visible: Confidence,
    parameters: NDArray[np.float64],
    *,
    rate_hz: float,
) -> NDArray[np.float64]:
    """Return parameters that agree with the visible markers and move smoothly.

    Nothing changes if every marker is seen in every frame.

    Parameters
    ----------
    model : FaceModel or HandModel
    markers : ndarray of float64, shape (T, K, 3)
        Consecutive frames, millimetres; hidden markers may hold anything finite.
    visible : ndarray of bool or float, shape (T, K)
        As for `codec.models.inversion.invert`.
    parameters : ndarray of float64, shape (T, P)
        Result of `codec.models.inversion.invert`.
    rate_hz : float

    Returns
    -------
    ndarray of float64, shape (T, P)
    """
    if visible.all():
        return parameters
    out = np.empty_like(parameters)
    stiffness = STIFFNESS_MM2_S3 * rate_hz**3
    for begin in range(0, len(out), _PASSAGE):
        end = min(begin + _PASSAGE, len(out))
        wide = slice(max(0, begin - _MARGIN), min(len(out), end + _MARGIN))
        solved = _passage(model, markers[wide], visible[wide], parameters[wide], stiffness)
        out[begin:end] = solved[begin - wide.start : end - wide.start]
    return out


def _passage(
    model: MarkerModel,
    markers: NDArray[np.float64],
    visible: Confidence,
    parameters: NDArray[np.float64],
    stiffness: float,
) -> NDArray[np.float64]:
    frames, n = parameters.shape
    residual = model.residual(parameters, markers)
    weights = marker_weights(residual, visible, robust=True)
    projection, normal = normal_equations(model, parameters, weights, model.deviations)
    residual[visible == 0] = 0.0
    explained = (projection @ residual.reshape(frames, -1, 1).astype(np.float32))[..., 0]
    right = explained + (normal @ parameters[..., None])[..., 0]
    banded = _banded(normal + _PULL_MM2 * np.eye(n), stiffness)
    solution = solveh_banded(banded, right.reshape(-1), lower=True, check_finite=False)
    return np.asarray(solution.reshape(frames, n))


def _banded(blocks: NDArray[np.float64], stiffness: float) -> NDArray[np.float64]:
    """Return the normal matrix of all frames in the lower banded form of LAPACK.

    Its diagonal blocks are `blocks` (T, n, n); the penalty on second differences couples each
    frame with its two neighbours on either side, parameter by parameter.
    """
    frames, n, _ = blocks.shape
    banded = np.zeros((2 * n + 1, frames, n))
    for offset in range(n):
        banded[offset, :, : n - offset] = np.diagonal(blocks, -offset, axis1=1, axis2=2)
    coupling = _second_difference_penalty(frames)
    for step, values in enumerate(coupling):
        banded[step * n, : len(values)] += stiffness * values[:, None]
    return banded.reshape(2 * n + 1, frames * n)


def _second_difference_penalty(frames: int) -> list[NDArray[np.float64]]:
    """Return the diagonals 0, 1 and 2 of DᵀD, D the matrix of second differences.

    Examples
    --------
    >>> [d.tolist() for d in _second_difference_penalty(4)]
    [[1.0, 5.0, 5.0, 1.0], [-2.0, -4.0, -2.0], [1.0, 1.0]]
    """
    rows = max(frames - 2, 0)
    diagonals = [np.zeros(max(frames - step, 0)) for step in range(3)]
    pattern = (1.0, -2.0, 1.0)
    for i, first in enumerate(pattern):
        for j, second in enumerate(pattern[: i + 1]):
            diagonals[i - j][j : j + rows] += first * second
    return diagonals
