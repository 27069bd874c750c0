"""The avatar's head and bust out of the base mesh: surfaces and colours."""

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from lab.avatar.collar import collar, lashes
from lab.avatar.hair import depth_deg
from lab.avatar.limbs import Limbs
from lab.avatar.looks import Look
from lab.avatar.mouth import lip_rings, teeth, tongue
from lab.avatar.paint import skin_colours
from lab.avatar.parts import (
    FloatArray,
    IntArray,
    Part,
    brow,
    cut,
    eyeball,
    join,
    plain,
    tessellate,
    triangulate,
    without,
)
from lab.avatar.smoothing import divided, rounded

_LIFT_MM = 0.2
"""Distance in mm of the fine surface from the coarse one, so that they do not flicker."""

_BUST_BOTTOM_MM = 330.0
"""Height in mm, in the mesh's coordinates, at which the bust is cut: below the picture."""

_BUST_HALF_MM = 290.0
"""Half width in mm at which the shoulders are cut: beside the picture."""

_AWAY = -0.45
"""Part of a triangle's normal towards the viewer below which head and trunk never turn it to
him: 27 degrees."""

_TRUNK_HALF_MM = 140.0
"""Half width in mm of the trunk without the arms."""

_DEEP_DEG = 12.0
"""Degrees behind the hairline at which hair covers the skin in every look."""

SLEEVE_MM = 54.0
"""Distance in mm from the right wrist to the sleeve's edge."""

_CUFF_MM = 5.0
"""Width in mm of the sleeve's hem."""

_BROW_LINE = np.array([
    (12, 742.2), (18, 743.4), (24, 744.8), (30, 745.8), (36, 746), (42, 744.6), (47, 742),
    (52, 738),
])  # fmt: skip
"""Points in mm of the middle of a brow, from the nose outwards; drawn by eye."""

_BROW_WIDTH = np.array([5.0, 6.6, 7.0, 6.6, 5.8, 4.8, 3.6, 2.2])
"""Width in mm of a brow at these points."""


def read_groups(path: Path) -> dict[str, IntArray]:
    """Return the quads of every group of an OBJ file.

    Raises
    ------
    CueError
        If the file cannot be read.
    """
    groups: dict[str, list[list[int]]] = defaultdict(list)
    name = ""
    try:
        for line in path.read_text().splitlines():
            kind, *fields = line.split() or [""]
            if kind == "g":
                name = fields[0]
            elif kind == "f":
                corners = [int(field.split("/")[0]) - 1 for field in fields]
                groups[name].append((corners + corners[-1:])[:4])
    except (OSError, ValueError) as error:
        raise CueError(f"{path}: not the hm08 mesh: {error}") from error
    return {name: np.array(quads) for name, quads in groups.items()}


def head_part(
    limbs: Limbs, groups: dict[str, IntArray], face: FloatArray, arm: FloatArray, look: Look
) -> Part:
    """Return head, neck and bust with everything on them but the hair.

    Parameters
    ----------
    limbs : Limbs
        The mesh in the cuer's pose.
    groups : dict of str to ndarray
        Quads by group, from `read_groups`.
    face : ndarray, shape (63, 3)
        The face markers on the mesh.
    arm : ndarray, shape (M,)
        Share of each vertex that the arms below the elbow hold.
    look : Look
    """
    points = limbs.mesh.vertices
    wanted = (points[:, 1] > _BUST_BOTTOM_MM) & (np.abs(points[:, 0]) < _BUST_HALF_MM)
    wanted &= arm < 0.5
    wanted |= limbs.right & ~(limbs.lower & (_above_wrist(limbs, points) < SLEEVE_MM - 25))
    quads = groups["body"]
    triangles = triangulate(quads[wanted[quads].all(axis=1)])
    rings = lip_rings(quads, points)
    parts = [_skin(limbs, face, triangles, rings, look)]
    for side, letter in ((-1, "r"), (1, "l")):
        ball = np.unique(groups[f"helper-{letter}-eye"])
        parts.append(eyeball(points, ball, look))
        parts.append(brow(points, triangles, side, _BROW_LINE, _BROW_WIDTH, look))
        for lid in "12":
            strip = groups[f"helper-{letter}-eyelashes-{lid}"]
            parts.append(lashes(points, strip, lid, ball, look))
    parts += [
        teeth(points, groups["helper-upper-teeth"], 0),
        teeth(points, groups["helper-lower-teeth"], 1),
        tongue(points, groups["helper-tongue"]),
    ]
    parts.append(collar(points, triangles, lambda p: p[:, 1] - _neckline(p) + 4.5, look))
    whole = join(parts)
    return without(whole, _hidden(whole.place(points), whole.triangles))


def _hidden(at: FloatArray, triangles: IntArray) -> NDArray[np.bool_]:
    """Return which triangles no pose shows: backs of head and trunk, skin deep under the hair."""
    a, b, c = (at[triangles[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    facing = across[:, 2] / np.maximum(np.linalg.norm(across, axis=1), 1e-9)
    middle = (a + b + c) / 3
    aside = np.abs(middle[:, 0])
    ear = (aside > 64) & (middle[:, 1] < 764) & (middle[:, 1] > 670) & (middle[:, 2] < 84)
    back = (facing < _AWAY) & (middle[:, 2] < 60) & (aside < _TRUNK_HALF_MM)
    return np.asarray((back | (depth_deg(middle) > _DEEP_DEG)) & ~ear)


def _above_wrist(limbs: Limbs, points: FloatArray) -> FloatArray:
    """Return how far points are above the right wrist, along the forearm, mm."""
    elbow, wrist = limbs.forearm[:2]
    along: FloatArray = (points - wrist) @ (elbow - wrist) / np.linalg.norm(elbow - wrist)
    return along


def _skin(limbs: Limbs, face: FloatArray, triangles: IntArray, rings: IntArray, look: Look) -> Part:
    """Return the skin, finer at the lips, and the clothes over it."""
    points = limbs.mesh.vertices
    y = points[:, 1]
    lips = np.zeros(len(points), dtype=bool)
    lips[rings[1:]] = True
    of_lips = lips[triangles].all(axis=1)
    hollow = hollowness(points, triangles)
    hollow *= np.where(y < 650, 0.35, 1.0)  # a neck is no cave
    normals = vertex_normals(points, triangles)

    def above(line_mm: float) -> Callable[[FloatArray], FloatArray]:
        return lambda p: p[:, 1] - _neckline(p) - line_mm

    def below(line_mm: float) -> Callable[[FloatArray], FloatArray]:
        return lambda p: _neckline(p) + line_mm - p[:, 1]

    bare = cut(triangles[~of_lips], points, above(-9))
    fine = tessellate(triangles[lips[triangles].any(axis=1)], 3)
    of_arm = limbs.right[triangles].all(axis=1)
    shirt = cut(triangles[~of_arm], points, below(-5))

    def up(line_mm: float) -> Callable[[FloatArray], FloatArray]:
        return lambda p: _above_wrist(limbs, p) - SLEEVE_MM - line_mm

    near_cuff = limbs.lower & (up(_CUFF_MM + 12)(points) < 0)
    at_cuff = of_arm & near_cuff[triangles].any(axis=1)
    cuff = cut(triangles[at_cuff], points, up(0))
    above_cuff = cut(triangles[at_cuff], points, up(_CUFF_MM))
    sleeve = cut(triangles[of_arm & ~at_cuff], points, lambda p: np.ones(len(p)))
    parts = []
    for cloth, lift_mm, colour in (
        (bare, 0.0, None),
        (fine, _LIFT_MM, None),
        (shirt, 1.4, look.cloth),
        (sleeve, 3.2, look.cloth),
        (above_cuff, 3.2, look.cloth),
        (cuff, 2.6, look.hem),
    ):
        # The hem lies close under the sleeve's end: neither of them is divided.
        sources, shares, small = (
            cloth if cloth is cuff or cloth is above_cuff else divided(points, normals, *cloth)
        )
        at = (points[sources] * shares[..., None]).sum(axis=1)
        shade = (hollow[sources] * shares).sum(axis=1)
        if colour is None:
            colours = skin_colours(at, face, shade, look)
        else:
            colours = plain(colour, 10, len(at))
            colours[:, :3] *= (1 - shade)[:, None]
        edge = np.minimum(
            (at[:, 1] - _BUST_BOTTOM_MM - 4) / 12, (_BUST_HALF_MM - 4 - np.abs(at[:, 0])) / 12
        )
        if all(cloth is not own for own in (sleeve, above_cuff, cuff)):
            colours[:, 4] = 255 * np.clip(edge, 0, 1)
        lift = lift_mm * np.ones(len(at))
        if cloth is sleeve:  # at the shoulder it goes over into the shirt
            held = (limbs.weights[sources, 2] * shares).sum(axis=1)
            lift = 1.4 + (lift_mm - 1.4) * np.clip(held / 0.5, 0, 1)
        offsets = lift[:, None] * (normals[sources] * shares[..., None]).sum(axis=1)
        smooth = slice(0 if cloth is fine else len(cloth[0]), None)
        offsets[smooth] += rounded(points, normals, sources[smooth], shares[smooth])
        parts.append(Part(sources, shares, offsets, small, colours.astype(np.uint8)))
    return join(parts)


def _neckline(points: FloatArray) -> FloatArray:
    """Return the height at which cloth begins below each point."""
    behind = 60 - points[:, 2]
    rise = 0.25 * (behind + np.sqrt(behind**2 + 30**2))
    line: FloatArray = 512 + 0.014 * points[:, 0] ** 2 + rise - 3.5
    return line


def hollowness(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return a shade for hollows of the surface, 0..0.45: what light reaches badly.

    The mean of a vertex's neighbours lies above a hollow, along the normal; two rounds of
    averaging widen the shade.
    """
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    edges = np.concatenate([edges, edges[:, ::-1]])

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        total = np.zeros_like(values)
        np.add.at(total, edges[:, 0], values[edges[:, 1]])
        degree = np.bincount(edges[:, 0], minlength=len(values))
        shape = (-1,) + (1,) * (values.ndim - 1)
        return np.asarray(total / np.maximum(degree, 1).reshape(shape))

    normals = vertex_normals(points, triangles)
    size = mean(np.linalg.norm(points - mean(points), axis=1)) + 1.0
    bend = ((mean(points) - points) * normals).sum(axis=1) / size
    for _ in range(2):
        bend = 0.5 * (bend + mean(bend))
    return np.asarray(np.clip(bend * 0.9, 0, 0.45))


def vertex_normals(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the area-weighted normals of vertices, shape (M, 3)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, triangles[:, k], across)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.maximum(length, 1e-9))
