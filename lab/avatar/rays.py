"""Rays from a point to a surface: where hair, collars and the like find the skin."""

import numpy as np

from codec.compiled import njit
from lab.avatar.parts import FloatArray, IntArray


def outermost(
    points: FloatArray, triangles: IntArray, origin: FloatArray, directions: FloatArray
) -> FloatArray:
    """Return the distance at which each ray leaves the surface, shape (N,); 0 if it never does.

    Parameters
    ----------
    points : ndarray, shape (M, 3)
    triangles : ndarray of int, shape (F, 3)
    origin : ndarray, shape (3,)
    directions : ndarray, shape (N, 3)
        Of length one.
    """
    return np.asarray(_outermost(points[triangles] - origin, np.ascontiguousarray(directions)))


@njit(cache=True)
def _outermost(corners: FloatArray, directions: FloatArray) -> FloatArray:
    """As `outermost`, for corners (F, 3, 3) from the origin (Moeller and Trumbore 1997)."""
    found = np.zeros(len(directions))
    for f in range(len(corners)):
        ax, ay, az = corners[f, 0]
        ux, uy, uz = corners[f, 1] - corners[f, 0]
        wx, wy, wz = corners[f, 2] - corners[f, 0]
        # The turned start is the same for all rays: minus the corner, across u.
        tx, ty, tz = az * uy - ay * uz, ax * uz - az * ux, ay * ux - ax * uy
        reach = wx * tx + wy * ty + wz * tz
        for n in range(len(directions)):
            x, y, z = directions[n]
            cx, cy, cz = y * wz - z * wy, z * wx - x * wz, x * wy - y * wx
            size = ux * cx + uy * cy + uz * cz
            if abs(size) < 1e-12:
                continue
            s = -(ax * cx + ay * cy + az * cz) / size
            t = (x * tx + y * ty + z * tz) / size
            if s >= -1e-9 and t >= -1e-9 and s + t <= 1 + 1e-9:
                found[n] = max(found[n], reach / size)
    return found
