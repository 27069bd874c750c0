"""Inversion: model parameters from the markers that are seen, and so the hidden ones too.

Masked nonlinear least squares, all frames at once (Gauss-Newton). A weak prior (parameters have
unit variance) holds parameters that the markers leave free; markers far from the fit lose weight
(Geman-McClure), so that swapped markers and ghosts do not pull. The residual of the model is not
white: neighbouring markers slide together. Where markers are hidden these deviations count as
correlated noise, so that the visible ones are not trusted beyond their worth; if all are seen,
plain least squares draws them most closely. Undetermined parameters are bridged: single
frames are linearised about their result, and all frames of a passage are then solved together.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.models.face import N_FACE_PARAMETERS, FaceModel
from codec.cuer.models.hand import HandModel
from codec.cuer.models.threads import one_thread

RIGID_FACE_COLUMNS = np.array([layout.FACE_MARKERS.index(name) for name in layout.RIGID_FACE])
FOREARM_COLUMNS = np.array([layout.HAND_MARKERS.index(name) for name in layout.FOREARM])

Confidence = NDArray[np.bool_] | NDArray[np.float64]

_BLOCK = 256
"""Frames that are inverted at once: their matrices stay in the processor's cache."""

_STEPS = 6
"""Gauss-Newton steps at most; frames that are done leave earlier."""

_PLAIN_STEPS = 1
"""Steps before residuals begin to cost markers their weight."""

LONGEST_STEP = 3.0
"""Longest step in units of a parameter's standard deviation."""

_TOLERANCE = 0.02
"""Step below which a frame is done, in standard deviations."""

NOISE_MM2 = 0.3
"""Variance in mm2 that the prior is weighed against: that of a marker's noise."""

_SUSPECT_MM = 8.0
"""Residual in mm at which a marker has a quarter of its weight (Geman-McClure)."""


class MarkerModel(Protocol):
    """What inversion needs of a model."""

    @property
    def deviations(self) -> NDArray[np.float32]:
        """Correlated noise, shape (S, K, 3)."""

    @property
    def n_parameters(self) -> int:
        """Number of parameters."""

    def residual(
        self, parameters: NDArray[np.float64], markers: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return markers minus model in resting frames, shape (T, K, 3)."""

    def slopes(self, parameters: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the model's derivatives in resting frames, shape (T, P, K, 3)."""


@one_thread
def invert(
    model: MarkerModel,
    markers: NDArray[np.float64],
    visible: Confidence,
    start: NDArray[np.float64],
    *,
    steps: int = _STEPS,
    near: bool = False,
) -> NDArray[np.float64]:
    """Return the parameters that explain the visible markers best.

    Parameters
    ----------
    model : FaceModel or HandModel
    markers : ndarray of float64, shape (T, K, 3)
        Millimetres; hidden markers may hold anything finite.
    visible : ndarray of bool or float, shape (T, K)
        How much each marker is to be trusted, 0 (hidden) to 1.
    start : ndarray of float64, shape (T, P)
        First guess, for example from `starting_motion`.
    steps : int
        Gauss-Newton steps at most: few are enough from a near start.
    near : bool
        Whether the start is so near that residuals cost markers their weight at once.

    Returns
    -------
    ndarray of float64, shape (T, P)
    """
    out = np.array(start, dtype=np.float64)
    plain = 0 if near else _PLAIN_STEPS
    whole = visible.all(1)
    for kind, deviations in ((whole, model.deviations[:0]), (~whole, model.deviations)):
        frames = np.flatnonzero(kind)
        for begin in range(0, len(frames), _BLOCK):
            block = frames[begin : begin + _BLOCK]
            out[block] = _solve(
                model, markers[block], visible[block], out[block], deviations, steps, plain
            )
    return out


def invert_face(
    model: FaceModel, markers: NDArray[np.float64], visible: Confidence
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
    model: HandModel, markers: NDArray[np.float64], visible: Confidence
) -> NDArray[np.float64]:
    """Return hand and forearm parameters (T, naH + nmH) of hand markers (T, 50, 3)."""
    return invert(model, markers, visible, hand_start(model, markers, visible))


def hand_start(
    model: HandModel, markers: NDArray[np.float64], visible: Confidence
) -> NDArray[np.float64]:
    """Return parameters (T, naH + nmH) that fit the forearm's markers alone, the mean hand's."""
    start = np.zeros((len(markers), model.n_parameters))
    start[:, model.n_shape :] = starting_motion(
        model.shape(np.zeros((1, model.n_shape)))[0, FOREARM_COLUMNS],
        markers[:, FOREARM_COLUMNS] - model.pivot,
        visible[:, FOREARM_COLUMNS],
        model.motion_mean,
        model.motion_directions,
    )
    return start


def starting_motion(
    reference: NDArray[np.float64],
    markers: NDArray[np.float64],
    visible: Confidence,
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
    visible: Confidence,
    parameters: NDArray[np.float64],
    deviations: NDArray[np.float32],
    steps: int,
    plain: int,
) -> NDArray[np.float64]:
    """Return better `parameters`, until no frame moves by more than the tolerance.

    Slopes are costly and change slowly: each serves for two steps (the chord method).
    """
    active = np.arange(len(parameters))
    for step in range(steps):
        now, seen, at = markers[active], visible[active], parameters[active]
        weight = marker_weights(model.residual(at, now), seen, robust=step >= plain)
        projection, inverse = gauss_newton(model, at, weight, deviations)
        for _ in range(2):
            residual = model.residual(at, now).reshape(len(at), -1, 1).astype(np.float32)
            gradient = (projection @ residual)[..., 0] - NOISE_MM2 * at
            update = (inverse @ gradient[..., None])[..., 0]
            # Longer steps leave the range in which the slopes hold.
            longest = np.abs(update).max(1, keepdims=True)
            at = at + update * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, 1e-12))
        parameters[active] = at
        moving = longest[:, 0] > _TOLERANCE
        # Outliers are distinguished from the model's own error only after the plain steps.
        active = active[moving] if step >= plain else active
        if not len(active):
            break
    return parameters


def gauss_newton(
    model: MarkerModel,
    parameters: NDArray[np.float64],
    weight: NDArray[np.float32],
    deviations: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Return the projection of `normal_equations` and the inverse of its matrix with the prior."""
    projection, normal = normal_equations(model, parameters, weight, deviations)
    inverse = np.linalg.inv(normal + NOISE_MM2 * np.eye(parameters.shape[1]))
    return projection, np.asarray(inverse, dtype=np.float64)


def normal_equations(
    model: MarkerModel,
    parameters: NDArray[np.float64],
    weight: NDArray[np.float32],
    deviations: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Return what projects residuals onto the parameters, and the normal matrix.

    The amplitudes of the deviations are eliminated (Schur complement): with J the slopes, B the
    deviations, W the weights and λ the white noise, the projection is
    JᵀW - JᵀWB (BᵀWB + λ)⁻¹ BᵀW and the normal matrix is the projection times J.

    Parameters
    ----------
    model : MarkerModel
    parameters : ndarray of float64, shape (T, P)
    weight : ndarray of float32, shape (T, K)
    deviations : ndarray of float32, shape (S, K, 3)

    Returns
    -------
    projection : ndarray of float32, shape (T, P, 3 K)
    normal : ndarray of float64, shape (T, P, P)
    """
    frames = len(parameters)
    slopes = model.slopes(parameters).reshape(frames, parameters.shape[1], -1)
    per_coordinate = np.repeat(weight, 3, axis=1)[:, None]
    projection = slopes * per_coordinate
    if len(deviations):
        flat = deviations.reshape(len(deviations), -1)
        weighted = flat * per_coordinate
        inner = weighted @ flat.T + np.float32(NOISE_MM2) * np.eye(len(flat), dtype=np.float32)
        projection -= projection @ flat.T @ np.linalg.inv(inner) @ weighted
    return projection, (projection @ np.swapaxes(slopes, 1, 2)).astype(np.float64)


def marker_weights(
    residual: NDArray[np.float64], visible: Confidence, *, robust: bool
) -> NDArray[np.float32]:
    """Return how much each marker counts, shape (T, K): 0 if hidden, little if far off."""
    weight = visible.astype(np.float32)
    if robust:
        weight /= (1 + (residual**2).sum(-1).astype(np.float32) / _SUSPECT_MM**2) ** 2
    return weight


STIFFNESS_MM2_S3 = 1.7e-3
"""Price of acceleration: mm² of marker error per (unit / s²)² and second."""

_PULL_MM2 = 0.1
"""Weight in mm2 of the pull to the single frames' results in a passage."""

_PASSAGE = 1024
"""Frames that are bridged together."""

_MARGIN = 96
"""Frames on either side of a passage that are solved with it and not kept."""


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
        As for `codec.cuer.models.inversion.invert`.
    parameters : ndarray of float64, shape (T, P)
        Result of `codec.cuer.models.inversion.invert`.
    rate_hz : float

    Returns
    -------
    ndarray of float64, shape (T, P)
    """
    if visible.all():
        return parameters
    return linked(model, markers, visible, parameters, rate_hz=rate_hz)


@one_thread
def linked(
    model: MarkerModel,
    markers: NDArray[np.float64],
    visible: Confidence,
    parameters: NDArray[np.float64],
    *,
    rate_hz: float,
) -> NDArray[np.float64]:
    """Return parameters that agree with the visible markers and move smoothly, in every frame.

    Points of an image tracker jump from frame to frame where all of them are visible, too. On a
    film of a virtual cuer (3 mm of noise) the hand's motion above 8 Hz is .14 mm, 1.2 mm without
    the link, and its depth is 12 mm off instead of 17.

    Parameters
    ----------
    model, markers, visible, parameters, rate_hz
        As for `bridge`.

    Returns
    -------
    ndarray of float64, shape (T, P)
    """
    out = np.empty_like(parameters)
    stiffness = stiffness_at(rate_hz)
    for begin in range(0, len(out), _PASSAGE):
        end = min(begin + _PASSAGE, len(out))
        wide = slice(max(0, begin - _MARGIN), min(len(out), end + _MARGIN))
        equations = linearised(model, markers[wide], visible[wide], parameters[wide])
        solved = smoothed(*equations, stiffness)
        out[begin:end] = solved[begin - wide.start : end - wide.start]
    return out


def stiffness_at(rate_hz: float) -> float:
    """Return the price of second differences between frames of a rate, mm²."""
    return STIFFNESS_MM2_S3 * rate_hz**3


def linearised(
    model: MarkerModel,
    markers: NDArray[np.float64],
    visible: Confidence,
    parameters: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the normal equations of frames about their own parameters.

    Parameters
    ----------
    model, markers, visible, parameters
        As for `bridge`; the frames need not follow each other.

    Returns
    -------
    normal : ndarray of float64, shape (T, P, P)
    right : ndarray of float64, shape (T, P)
        Zeros, both, where no marker is visible.
    """
    frames = len(parameters)
    residual = model.residual(parameters, markers)
    weights = marker_weights(residual, visible, robust=True)
    projection, normal = normal_equations(model, parameters, weights, model.deviations)
    residual[visible == 0] = 0.0
    explained = (projection @ residual.reshape(frames, -1, 1).astype(np.float32))[..., 0]
    return normal, explained + (normal @ parameters[..., None])[..., 0]


def smoothed(
    normal: NDArray[np.float64], right: NDArray[np.float64], stiffness: float
) -> NDArray[np.float64]:
    """Return the parameters (T, P) of consecutive frames with given normal equations.

    Parameters
    ----------
    normal, right
        See `linearised`.
    stiffness : float
        See `stiffness_at`.
    """
    from scipy.linalg import solveh_banded

    frames, n = right.shape
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
