"""Rays from a point to a surface: where hair, collars and the like find the skin."""

import numpy as np

from lab.avatar.parts import FloatArray, IntArray


def outermost(
    points: FloatArray, triangles: IntArray, origin: FloatArray, directions: FloatArray
) -> FloatArray:
    """Return the distance at which each ray leaves the surface, shape (N,); 0 if it never does.

    Parameters
    ----------
    points : ndarray, shape (M, 3)
    triangles : ndarray of int, shape (F, 3)
    origin : ndarray, shape (3,) or (N, 3)
    directions : ndarray, shape (N, 3)
        Of length one.
    """
    a, b, c = (points[triangles[:, k]] for k in range(3))
    u, w = b - a, c - a
    found = np.zeros(len(directions))
    origins = np.broadcast_to(origin, directions.shape)
    for number, (start, ray) in enumerate(zip(origins, directions, strict=True)):
        # Moeller and Trumbore 1997.
        across = np.cross(ray, w)
        size = (u * across).sum(axis=1)
        size = np.where(np.abs(size) < 1e-12, np.inf, size)
        away = start - a
        s = (away * across).sum(axis=1) / size
        turned = np.cross(away, u)
        t = turned @ ray / size
        length = (w * turned).sum(axis=1) / size
        hit = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9) & (length > 0)
        found[number] = length[hit].max(initial=0.0)
    return found
