"""Rigid motion: six parameters to and from moved points, and its robust estimation.

A motion is a row of six numbers, a rotation vector (axis times angle, radians) and a translation
(millimetres); rotation is about the origin of the points given. Estimation is the weighted
orthogonal Procrustes problem (Kabsch 1976; reflections excluded after Umeyama 1991), iterated
without the markers that lie too far from the fit.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.compiled import is_loaded
from codec.cuer.models import _kernels
from codec.errors import CueError

OUTLIER_MM = 3.0
"""A marker farther than this from the rigid fit does not belong to the rigid body."""

_FEW = 500
"""Frames that are not worth the time that loading compiled kernels takes, if these are not."""

_SMALL_ANGLE = 1e-4
"""Angle in radians below which series stand for sines: their error is that of rounding."""


def _rotation_factors(
    squared_angle: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return sin(θ)/θ, (1 - cos θ)/θ² and (θ - sin θ)/θ³, with their series near zero."""
    angle = np.sqrt(squared_angle)
    small = angle < _SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    sine, cosine = np.sin(safe), np.cos(safe)
    return (
        np.where(small, 1 - squared_angle / 6, sine / safe),
        np.where(small, 0.5 - squared_angle / 24, (1 - cosine) / safe**2),
        np.where(small, 1 / 6 - squared_angle / 120, (safe - sine) / safe**3),
    )


def cross_matrices(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrices [v]ₓ with [v]ₓ p = v × p, shape (..., 3, 3)."""
    out = np.zeros((*vectors.shape, 3))
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


def rotation_matrices(rotation_vectors: ArrayLike) -> NDArray[np.float64]:
    """Return the matrices of rotation vectors (Rodrigues' formula).

    Parameters
    ----------
    rotation_vectors : array_like, shape (..., 3)
        Axis times angle, radians.

    Returns
    -------
    ndarray of float64, shape (..., 3, 3)

    Examples
    --------
    >>> rotation_matrices([0, 0, np.pi / 2]).round(6).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    r = np.asarray(rotation_vectors, dtype=np.float64)
    a, b, _ = _rotation_factors((r * r).sum(-1))
    cross = cross_matrices(r)
    return np.eye(3) + a[..., None, None] * cross + b[..., None, None] * (cross @ cross)


def right_jacobians(rotation_vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return J with d(R(r) p) = R ((J dr) × p), shape (..., 3, 3).

    The right Jacobian of SO(3), for example Chirikjian 2011, section 10.8.
    """
    r = rotation_vectors
    _, b, c = _rotation_factors((r * r).sum(-1))
    cross = cross_matrices(r)
    return np.eye(3) - b[..., None, None] * cross + c[..., None, None] * (cross @ cross)


def motion_slopes(
    points: NDArray[np.float64], motion: NDArray[np.float64], directions: NDArray[Any]
) -> NDArray[np.float32]:
    """Return how moved points change with the parameters of their motion, in the resting frame.

    Parameters
    ----------
    points : ndarray of float64, shape (T, K, 3)
        About the pivot, at rest.
    motion : ndarray of float64, shape (T, K or 1, 6)
    directions : ndarray, shape (n, K or 1, 6)
        Motion per unit of each parameter.

    Returns
    -------
    ndarray of float32, shape (T, n, K, 3)
        d(R p + t) / d parameter, turned back by R.
    """
    from codec.cuer.models import _kernels

    back = np.swapaxes(rotation_matrices(motion[..., :3]), -1, -2)
    by_direction = np.moveaxis(directions.astype(np.float64), 0, -1)
    turn = right_jacobians(motion[..., :3]) @ by_direction[:, :3]
    shift = back @ by_direction[:, 3:]
    out = np.empty((len(points), len(directions), *points.shape[1:]), dtype=np.float32)
    _kernels.turn_into(np.ascontiguousarray(points), turn, shift, out)
    return out


def rotation_vectors(matrices: ArrayLike) -> NDArray[np.float64]:
    """Return the rotation vectors of rotation matrices, angle within 0..π.

    Goes through the quaternion of largest component, so that angles near π stay exact.

    Parameters
    ----------
    matrices : array_like, shape (..., 3, 3)
        Proper rotations.

    Examples
    --------
    >>> rotation_vectors(rotation_matrices([0.1, -0.2, 3.0])).round(6).tolist()
    [0.1, -0.2, 3.0]
    """
    m = np.asarray(matrices, dtype=np.float64)
    diagonal = np.diagonal(m, axis1=-2, axis2=-1)
    trace = diagonal.sum(-1)
    # Row k of the symmetric 4 x 4 matrix 4 q qᵀ; the row of the largest q_k divides safely.
    rows = np.empty((*trace.shape, 4, 4))
    rows[..., 3, 3] = 1 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        rows[..., i, i] = 1 + 2 * diagonal[..., i] - trace
        rows[..., i, j] = rows[..., j, i] = m[..., i, j] + m[..., j, i]
        rows[..., i, 3] = rows[..., 3, i] = m[..., k, j] - m[..., j, k]
    largest = np.diagonal(rows, axis1=-2, axis2=-1).argmax(-1)
    q = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1)
    half_angle = np.arctan2(sine, q[..., 3])
    scale = np.where(sine < _SMALL_ANGLE, 2.0, 2 * half_angle / np.where(sine == 0, 1.0, sine))
    return np.asarray(q[..., :3] * scale[..., None])


def rigid_motion(points: ArrayLike, motion: ArrayLike) -> NDArray[np.float64]:
    """Move points: rotate about the origin, then translate (the paper's ``Rigid_Motion``).

    Parameters
    ----------
    points : array_like, shape (..., K, 3)
        Millimetres.
    motion : array_like, shape (..., 6)
        Rotation vector and translation, one row for all K points.

    Returns
    -------
    ndarray of float64, shape (..., K, 3)
    """
    p, m = np.asarray(points, dtype=np.float64), np.asarray(motion, dtype=np.float64)
    rotated = p @ np.swapaxes(rotation_matrices(m[..., :3]), -1, -2)
    return np.asarray(rotated + m[..., None, 3:])


def weighted_rigid_motion(points: ArrayLike, motion: ArrayLike) -> NDArray[np.float64]:
    """Move each point by a motion of its own.

    Parameters
    ----------
    points : array_like, shape (..., K, 3)
    motion : array_like, shape (..., K, 6)

    Examples
    --------
    >>> weighted_rigid_motion([[1, 0, 0]], [[0, 0, np.pi / 2, 0, 0, 5]]).round(6).tolist()
    [[0.0, 1.0, 5.0]]
    """
    p, m = np.asarray(points, dtype=np.float64), np.asarray(motion, dtype=np.float64)
    r = m[..., :3]
    a, b, _ = _rotation_factors((r * r).sum(-1))
    once = np.cross(r, p)
    return np.asarray(p + a[..., None] * once + b[..., None] * np.cross(r, once) + m[..., 3:])


def shared_motion(
    points: NDArray[np.float64], motion: ArrayLike, shares: ArrayLike, pivot: ArrayLike
) -> NDArray[np.float64]:
    """Move points about a pivot, each by its share of a motion that all have in common.

    Parameters
    ----------
    points : ndarray of float64, shape (T, K, 3)
        From the pivot.
    motion : array_like, shape (T, 6)
    shares : array_like, shape (K, 6)
        Factors of rotation vector and translation.
    pivot : array_like, shape (3,)

    Returns
    -------
    ndarray of float64, shape (T, K, 3)
        From the origin.

    Examples
    --------
    >>> turn = [[0, 0, np.pi, 0, 0, 4]]
    >>> shared_motion(np.array([[[1.0, 0, 0]]]), turn, 0.5 * np.ones((1, 6)), [0, 0, 1]).round(6)
    array([[[0., 1., 3.]]])
    """
    moved, factors, centre = (np.asarray(a, dtype=np.float64) for a in (motion, shares, pivot))
    if len(points) <= _FEW and not is_loaded():
        return weighted_rigid_motion(points, moved[:, None] * factors) + centre
    out = np.empty_like(points)
    _kernels.move_into(np.ascontiguousarray(points), moved, factors, centre, out)
    return out


def inverse_rigid_motion(points: ArrayLike, motion: ArrayLike) -> NDArray[np.float64]:
    """Undo `rigid_motion`."""
    p, m = np.asarray(points, dtype=np.float64), np.asarray(motion, dtype=np.float64)
    return np.asarray((p - m[..., None, 3:]) @ rotation_matrices(m[..., :3]))


def compose(after: ArrayLike, before: ArrayLike) -> NDArray[np.float64]:
    """Return the motion that does `before`, then `after`; shape (..., 6) each.

    Examples
    --------
    >>> compose([0, 0, np.pi / 2, 0, 0, 0], [0, 0, 0, 1, 0, 0]).round(6).tolist()
    [0.0, 0.0, 1.570796, 0.0, 1.0, 0.0]
    """
    a, b = np.asarray(after, dtype=np.float64), np.asarray(before, dtype=np.float64)
    turn = rotation_matrices(a[..., :3])
    vector = rotation_vectors(turn @ rotation_matrices(b[..., :3]))
    shift = (turn @ b[..., 3:, None])[..., 0] + a[..., 3:]
    return np.concatenate([vector, shift], axis=-1)


def inverse(motion: ArrayLike) -> NDArray[np.float64]:
    """Return the motion that undoes `motion`, shape (..., 6)."""
    m = np.asarray(motion, dtype=np.float64)
    shift = -(rotation_matrices(-m[..., :3]) @ m[..., 3:, None])[..., 0]
    return np.concatenate([-m[..., :3], shift], axis=-1)


def about(pivot: ArrayLike, motion: ArrayLike) -> NDArray[np.float64]:
    """Return, for a motion whose rotation is about `pivot`, the same about the origin."""
    m = np.asarray(motion, dtype=np.float64)
    centre = np.asarray(pivot, dtype=np.float64)
    shift = m[..., 3:] + centre - rotation_matrices(m[..., :3]) @ centre
    return np.concatenate([m[..., :3], shift], axis=-1)


def mean_body(
    frames: ArrayLike, *, rounds: int = 4
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean shape of a rigid body in its mean pose, and its motion in each frame.

    Parameters
    ----------
    frames : array_like, shape (T, K, 3)
        All markers seen.

    Returns
    -------
    body : ndarray of float64, shape (K, 3)
        Its motions average to (nearly) nothing, its centroid is the origin.
    motion : ndarray of float64, shape (T, 6)
        About the centroid of the body; translations lead to the world.
    """
    x = np.asarray(frames, dtype=np.float64)
    body = x[0] - x[0].mean(0)
    for _ in range(rounds):
        motion, solved = estimate_motion(body, x)
        body = inverse_rigid_motion(x[solved], motion[solved]).mean(0)
        body = rigid_motion(body - body.mean(0), [*motion[solved, :3].mean(0), 0, 0, 0])
    return body, estimate_motion(body, x)[0]


def estimate_motion(
    reference: ArrayLike,
    points: ArrayLike,
    weights: ArrayLike | None = None,
    *,
    outlier_mm: float = OUTLIER_MM,
    rounds: int = 3,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Estimate the rigid motions that carry a reference onto frames of points.

    Parameters
    ----------
    reference : array_like, shape (K, 3)
        Markers of the rigid body at rest.
    points : array_like, shape (T, K, 3)
        The same markers in T frames; values of markers with weight 0 are not looked at.
    weights : array_like, shape (T, K), optional
        Visibility or confidence, >= 0.
    outlier_mm : float
        After each round, markers farther from the fit are left out of the next one; at least
        three markers always stay.
    rounds : int
        Number of fits, at least 1.

    Returns
    -------
    motion : ndarray of float64, shape (T, 6)
        Zero where a frame has no solution.
    solved : ndarray of bool, shape (T,)
        Whether at least three markers had weight and do not lie on a line.

    Notes
    -----
    Umeyama 1991 (IEEE PAMI 13:376) for the sign correction that excludes reflections.
    """
    a = np.asarray(reference, dtype=np.float64)
    b = np.asarray(points, dtype=np.float64)
    if a.ndim != 2 or b.ndim != 3 or b.shape[1:] != a.shape or rounds < 1:
        raise CueError(f"points of shape {b.shape} do not match a reference of shape {a.shape}")
    w = np.ones(b.shape[:2]) if weights is None else np.asarray(weights, dtype=np.float64)
    b = np.where(w[..., None] > 0, b, 0.0)
    motion, solved = _procrustes(a, b, w)
    used = w
    for _ in range(rounds - 1):
        distance = np.linalg.norm(rigid_motion(a, motion) - b, axis=-1)
        ordered = np.sort(np.where(w > 0, distance, np.inf), axis=1)
        middle = np.maximum((w > 0).sum(1) - 1, 0) // 2
        median = np.take_along_axis(ordered, middle[:, None], axis=1)
        # A gross outlier drags the first fit away from every marker; the median lets it recover.
        limit = np.maximum(np.maximum(outlier_mm, 2 * median), ordered[:, 2:3])
        kept = np.where(distance <= limit, w, 0.0)
        if np.array_equal(kept, used):
            break  # the same markers have the same fit
        motion, solved = _procrustes(a, b, kept)
        used = kept
    return motion, solved


def _procrustes(
    a: NDArray[np.float64], b: NDArray[np.float64], w: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    total = np.maximum(w.sum(1), 1e-12)[:, None]
    centre_a = (w @ a) / total
    centre_b = np.einsum("tk,tkc->tc", w, b) / total
    covariance = np.einsum(
        "tk,tki,tkj->tij", w, a - centre_a[:, None], b - centre_b[:, None], optimize=True
    )
    u, s, vt = np.linalg.svd(covariance)
    sign = np.where(np.linalg.det(u @ vt) < 0, -1.0, 1.0)
    vt[:, 2] *= sign[:, None]
    rotation = np.swapaxes(u @ vt, 1, 2)
    solved = ((w > 0).sum(1) >= 3) & (s[:, 1] > 1e-9 * np.maximum(s[:, 0], 1e-12))
    motion = np.empty((len(b), 6))
    motion[:, :3] = rotation_vectors(rotation)
    motion[:, 3:] = centre_b - np.einsum("tij,tj->ti", rotation, centre_a)
    return np.where(solved[:, None], motion, 0.0), solved
