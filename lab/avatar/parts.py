"""The parts of the avatar's head: skin, eyes, lids, brows, teeth, tongue, hair.

A `Part` is triangles over vertices that are known by their *sources*: each vertex is a weighted
mean of three vertices of the base mesh plus an offset, so that whatever moves the mesh moves it.
Colours are painted here; all lengths are millimetres in the frame of the mesh.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from codec.errors import CueError
from lab.avatar.looks import Look

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Colours are red, green, blue, chosen by eye under the page's light.
MOUTH = (58, 18, 20)
SCLERA = (226, 221, 214)
SHADED = ((214, 206, 198), (172, 156, 146))  # the white towards its corners, shaded by the lids
LIMBUS = (52, 52, 48)
IRIS = (98, 92, 62)
PUPIL = (10, 9, 10)


@dataclass(frozen=True, slots=True)
class Part:
    """A piece of surface.

    Attributes
    ----------
    sources : ndarray of int, shape (V, 3)
        Vertices of the base mesh that carry each vertex.
    shares : ndarray, shape (V, 3)
        Their weights; rows sum to one.
    offsets : ndarray, shape (V, 3)
        Added to the weighted mean.
    triangles : ndarray of int, shape (F, 3)
        Anticlockwise seen from outside.
    colours : ndarray of uint8, shape (V, 5)
        Red, green, blue (sRGB), gloss and opacity.
    """

    sources: IntArray
    shares: FloatArray
    offsets: FloatArray
    triangles: IntArray
    colours: NDArray[np.uint8]

    def place(self, vertices: FloatArray) -> FloatArray:
        """Return the part's vertices (..., V, 3) for those of the mesh (..., M, 3)."""
        carried = vertices[..., self.sources, :] * self.shares[..., None]
        return np.asarray(carried.sum(axis=-2) + self.offsets)


def triangulate(quads: IntArray) -> IntArray:
    """Return the triangles (2F', 3) of quads (F, 4) whose last corner may be repeated."""
    both = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return np.asarray(both[both[:, 1] != both[:, 2]])


def take(quads: IntArray, colours: FloatArray) -> Part:
    """Return the mesh's own quads as a part; `colours` (M, 5) are those of its vertices."""
    used, inverse = np.unique(quads, return_inverse=True)
    n = len(used)
    return Part(
        np.repeat(used[:, None], 3, axis=1),
        np.full((n, 3), 1 / 3),
        np.zeros((n, 3)),
        triangulate(inverse.reshape(quads.shape)),
        colours[used].round().astype(np.uint8),
    )


def join(parts: list[Part]) -> Part:
    """Return several parts as one."""
    starts = np.cumsum([0, *(len(part.sources) for part in parts)])
    return Part(
        np.concatenate([part.sources for part in parts]),
        np.concatenate([part.shares for part in parts]),
        np.concatenate([part.offsets for part in parts]),
        np.concatenate([p.triangles + at for p, at in zip(parts, starts, strict=False)]),
        np.concatenate([part.colours for part in parts]),
    )


def without(part: Part, hidden: NDArray[np.bool_]) -> Part:
    """Return a part without some of its triangles (F,) and the vertices that only they have."""
    left = part.triangles[~hidden]
    used, inverse = np.unique(left, return_inverse=True)
    return Part(
        part.sources[used],
        part.shares[used],
        part.offsets[used],
        inverse.reshape(left.shape),
        part.colours[used],
    )


def plain(colour: tuple[int, int, int], gloss: int, count: int) -> FloatArray:
    """Return one opaque colour for `count` vertices, shape (count, 5)."""
    return np.tile(np.array([*colour, gloss, 255], dtype=np.float64), (count, 1))


_EYE_RINGS = (
    (0.0, PUPIL), (9.5, PUPIL), (10.5, IRIS), (20.0, IRIS), (24.5, LIMBUS), (27.0, LIMBUS),
    (29.0, SCLERA), (45.0, SHADED[0]), (62.0, SHADED[1]), (90.0, SHADED[1]),
)  # fmt: skip

_EYE_SHARE = 0.975
"""Part of the mesh's own radius of an eye: lids that close move straight, not round the eye."""

_EYE_SECTORS = 24
"""Sectors of an eyeball: round at the size of a television's inset."""


def eyeball(vertices: FloatArray, ball: IntArray, look: Look) -> Part:
    """Return a smooth eye in place of the mesh's `ball` of vertices (n,).

    The rings around the axis of sight are dense where iris and white meet. The eye looks at the
    viewer.
    """
    middle = (vertices[ball].min(axis=0) + vertices[ball].max(axis=0)) / 2
    radius = _EYE_SHARE * np.ptp(vertices[ball], axis=0)[:2].max() / 2
    ring, colours = [], []
    for degrees, colour in _EYE_RINGS:
        polar = np.radians(degrees)
        around = 2 * np.pi * np.arange(_EYE_SECTORS) / _EYE_SECTORS
        bulge = radius * (1.0 + 0.02 * np.exp(-((degrees / 22.0) ** 2)))
        ring.append(bulge * np.stack([
            np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around),
            np.full(_EYE_SECTORS, np.cos(polar)),
        ], axis=1))  # fmt: skip
        iris = np.array(look.iris) * (1.25 if degrees < 16 else 0.9)
        colours.append(plain(tuple(iris) if colour is IRIS else colour, 255, _EYE_SECTORS))
        if colour is IRIS:  # fibres
            colours[-1][:, :3] *= (1 + 0.16 * np.sin(7 * around) * np.sin(3 * around))[:, None]
    points = np.concatenate(ring) + middle
    painted = np.concatenate(colours)
    # The upper lid and its lashes keep light from the top of the eye.
    below_lid = np.clip((points[:, 1] - middle[1]) / radius - 0.12, 0, 0.5)
    painted[:, :3] *= (1 - 1.1 * below_lid)[:, None]
    n = _EYE_SECTORS
    i, j = np.meshgrid(np.arange(len(_EYE_RINGS) - 1), np.arange(n), indexing="ij")
    a, b = i * n + j, i * n + (j + 1) % n
    quads = np.stack([a, a + n, b + n, b], axis=-1).reshape(-1, 4)
    anchor = np.full((len(points), 3), ball[0])
    return Part(
        anchor,
        np.full((len(points), 3), 1 / 3),
        points - vertices[ball[0]],
        triangulate(quads),
        painted.astype(np.uint8),
    )


_BROW_STEPS = 30
"""Places along a brow."""


def brow(
    vertices: FloatArray,
    triangles: IntArray,
    side: int,
    line: FloatArray,
    width: FloatArray,
    look: Look,
) -> Part:
    """Return an eyebrow lying on the skin.

    Parameters
    ----------
    vertices : ndarray, shape (M, 3)
    triangles : ndarray, shape (F, 3)
        Of the skin.
    side : int
        -1 for the cuer's right brow, 1 for the left.
    line : ndarray, shape (N, 2)
        Its middle as x (positive) and y.
    width : ndarray, shape (N,)
        Height of the brow along the line.
    look : Look
    """
    rows = np.linspace(-0.5, 0.5, 7)
    knots, along = np.arange(len(line)), np.linspace(0, 1, _BROW_STEPS)
    line = PchipInterpolator(knots, line)(along * knots[-1])
    width = PchipInterpolator(knots, width)(along * knots[-1])
    x = np.repeat(side * line[:, 0], len(rows))
    y = (line[:, 1, None] + width[:, None] * rows).ravel()
    corners, shares = on_skin(vertices, triangles, np.stack([x, y], axis=1))
    points = (vertices[corners] * shares[..., None]).sum(axis=1)
    n = len(rows)
    i, j = np.meshgrid(np.arange(len(line) - 1), np.arange(n - 1), indexing="ij")
    a = i * n + j
    quads = np.stack([a, a + n, a + n + 1, a + 1], axis=-1).reshape(-1, 4)
    if side < 0:
        quads = quads[:, ::-1]
    lift = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    colours = plain(look.brows, 20, len(x))
    across = 1 - (np.abs(np.tile(rows, len(line))) / 0.5) ** 2
    # Thin where it begins, and a hair wide at its end.
    soft = np.clip(along / 0.22, 0, 1) ** 1.3 * np.clip((1 - along) / 0.12, 0, 1)
    hairs = np.random.default_rng(5).uniform(0.72, 1, len(x))
    colours[:, 4] = 255 * np.clip(1.5 * across * look.brow_width, 0, 1) * np.repeat(soft, n) * hairs
    return Part(corners, shares, lift, triangulate(quads), colours.astype(np.uint8))


def tessellate(triangles: IntArray, n: int) -> tuple[IntArray, FloatArray, IntArray]:
    """Divide every triangle into n² smaller ones.

    Returns
    -------
    sources : ndarray of int, shape (V, 3)
    shares : ndarray, shape (V, 3)
        Barycentric places of the new vertices, each once.
    triangles : ndarray of int, shape (F n², 3)
    """
    steps = [(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)]
    number = {step[:2]: k for k, step in enumerate(steps)}
    small = []
    for i in range(n):
        for j in range(n - i):
            small.append((number[i, j], number[i + 1, j], number[i, j + 1]))
            if i + j < n - 1:
                small.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    sources = np.repeat(triangles, len(steps), axis=0)
    shares = np.tile(np.array(steps)[:, [2, 0, 1]], (len(triangles), 1))
    # The same place on a common edge has the same corners with the same weights: make it one.
    order = np.argsort(np.where(shares > 0, sources, -1), axis=1)
    names = np.concatenate(
        [
            np.take_along_axis(np.where(shares > 0, sources, -1), order, axis=1),
            np.take_along_axis(shares, order, axis=1),
        ],
        axis=1,
    )
    _, first, inverse = np.unique(names, axis=0, return_index=True, return_inverse=True)
    starts = np.arange(len(triangles))[:, None, None] * len(steps)
    fine = (starts + np.array(small)[None]).reshape(-1, 3)
    return sources[first], shares[first] / n, inverse.reshape(-1)[fine]


def cut(
    triangles: IntArray, vertices: FloatArray, level: Callable[[FloatArray], FloatArray]
) -> tuple[IntArray, FloatArray, IntArray]:
    """Return the part of a surface where a level is positive, with a clean edge.

    Parameters
    ----------
    triangles : ndarray of int, shape (F, 3)
    vertices : ndarray, shape (M, 3)
    level : callable
        From points (N, 3) to (N,).

    Returns
    -------
    sources : ndarray of int, shape (V, 3)
    shares : ndarray, shape (V, 3)
    triangles : ndarray of int, shape (F', 3)
    """
    at = level(vertices)
    sides = at[triangles] > 0
    whole = triangles[sides.all(axis=1)]
    crossed = triangles[sides.any(axis=1) & ~sides.all(axis=1)]
    found: list[tuple[IntArray, FloatArray]] = []  # per triangle: its sources, shares of corners
    found += [(corners, np.eye(3)) for corners in whole]
    for parent in crossed:
        found += [(parent, piece) for piece in _clipped(np.eye(3), at[parent])]
    sources = np.repeat([parent for parent, _ in found], 3, axis=0)
    shares = np.concatenate([corners for _, corners in found])
    shares = np.where(shares < 1e-9, 0, shares)
    order = np.argsort(np.where(shares > 0, sources, -1), axis=1)
    named = np.concatenate(
        [
            np.take_along_axis(np.where(shares > 0, sources, -1), order, axis=1),
            np.take_along_axis(shares, order, axis=1).round(4),
        ],
        axis=1,
    )
    _, first, inverse = np.unique(named, axis=0, return_index=True, return_inverse=True)
    return sources[first], shares[first], inverse.reshape(-1, 3)


def _clipped(corners: FloatArray, level: FloatArray) -> list[FloatArray]:
    """Return the rest of a triangle (3, 3) where `level` (3,) of its corners is positive."""
    kept: list[FloatArray] = []
    for k in range(3):
        a, b = level[k], level[(k + 1) % 3]
        if a > 0:
            kept.append(corners[k])
        if (a > 0) != (b > 0):
            share = a / (a - b)
            kept.append(corners[k] + share * (corners[(k + 1) % 3] - corners[k]))
    return [np.array([kept[0], kept[k], kept[k + 1]]) for k in range(1, len(kept) - 1)]


def on_skin(
    vertices: FloatArray, triangles: IntArray, points: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return, for points (N, 2), the foremost triangle's corners (N, 3) and its shares there.

    Raises
    ------
    CueError
        If a point lies beside the skin.
    """
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    u, w = (b - a)[:, :2], (c - a)[:, :2]
    area = u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]
    facing = area > 1e-9
    corners, shares = [], []
    for point in points:
        d = point - a[:, :2]
        s = (d[:, 0] * w[:, 1] - d[:, 1] * w[:, 0]) / np.where(facing, area, 1)
        t = (u[:, 0] * d[:, 1] - u[:, 1] * d[:, 0]) / np.where(facing, area, 1)
        inside = facing & (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9)
        if not inside.any():
            raise CueError(f"point {point} lies beside the skin")
        depth = np.where(inside, a[:, 2] + s * (b - a)[:, 2] + t * (c - a)[:, 2], -np.inf)
        best = int(depth.argmax())
        corners.append(triangles[best])
        shares.append([1 - s[best] - t[best], s[best], t[best]])
    return np.array(corners), np.array(shares)
