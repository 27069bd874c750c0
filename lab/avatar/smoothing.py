"""Smooth outlines: coarse triangles are divided where the surface between them bends."""

import numpy as np

from lab.avatar.parts import FloatArray, IntArray

_LEAST_MM = 0.4
"""Least height in mm of the curve over the middle of an edge that is divided."""


def rounded(
    points: FloatArray, normals: FloatArray, sources: IntArray, shares: FloatArray
) -> FloatArray:
    """Return offsets (V, 3) that bulge flat triangles to a smooth surface.

    Cubic edges that are normal to the surface at their ends (Vlachos et al. 2001, PN triangles).
    """
    offsets = np.zeros((len(sources), 3))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, b = sources[:, i], sources[:, j]
        edge = points[b] - points[a]
        rise = (edge * normals[b]).sum(axis=1)[:, None] * normals[b]
        rise -= (edge * normals[a]).sum(axis=1)[:, None] * normals[a]
        offsets += (0.5 * shares[:, i] * shares[:, j])[:, None] * rise
    return offsets


def divided(
    points: FloatArray,
    normals: FloatArray,
    sources: IntArray,
    shares: FloatArray,
    triangles: IntArray,
) -> tuple[IntArray, FloatArray, IntArray]:
    """Return a surface whose bent edges have a vertex in the middle; `rounded` bulges it.

    An edge is divided if it joins two vertices of the mesh and two triangles share it: no gaps
    open beside triangles that are divided otherwise.

    Parameters
    ----------
    points, normals : ndarray, shape (M, 3)
        Of the mesh.
    sources : ndarray of int, shape (V, 3)
    shares : ndarray, shape (V, 3)
    triangles : ndarray of int, shape (F, 3)

    Returns
    -------
    sources, shares, triangles : ndarray
        The vertices that came in, then the new ones.
    """
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, of_edge, counts = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    corner = np.take_along_axis(sources, shares.argmax(axis=1)[:, None], axis=1)[:, 0]
    own = shares.max(axis=1) > 1 - 1e-9
    ends = corner[edges]
    middles = np.concatenate([ends, ends[:, :1]], axis=1)
    half = np.tile([0.5, 0.5, 0.0], (len(edges), 1))
    height = np.linalg.norm(rounded(points, normals, middles, half), axis=1)
    bent = own[edges].all(axis=1) & (counts == 2) & (height > _LEAST_MM)
    number = np.full(len(edges), -1)
    number[bent] = len(sources) + np.arange(bent.sum())
    small = []
    for corners, between in zip(triangles, number[of_edge.reshape(-1, 3)], strict=True):
        small += _pieces(list(corners), list(between))
    return (
        np.concatenate([sources, middles[bent]]),
        np.concatenate([shares, half[bent]]),
        np.array(small),
    )


def _pieces(corners: list[int], between: list[int]) -> list[tuple[int, int, int]]:
    """Return the triangles of one whose sides have new vertices; -1 where they have none."""
    new = [k for k in range(3) if between[k] >= 0]
    if not new:
        return [(corners[0], corners[1], corners[2])]
    first = new[0] if len(new) != 2 else (3 - sum(new) + 1) % 3
    a, b, c = (corners[(first + k) % 3] for k in range(3))
    ab, bc, ca = (between[(first + k) % 3] for k in range(3))
    if len(new) == 1:
        return [(a, ab, c), (ab, b, c)]
    if len(new) == 2:
        return [(ab, b, bc), (a, ab, bc), (a, bc, c)]
    return [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
