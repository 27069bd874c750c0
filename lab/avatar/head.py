"""The avatar's head and bust out of the base mesh: surfaces and colours."""

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import FACE_MARKERS, LIP_CORNERS, LOWER_LIP, UPPER_LIP
from codec.errors import CueError
from lab.avatar.mouth import lip_rings, teeth, tongue
from lab.avatar.parts import (
    BLUSH,
    CLOTH,
    HAIR,
    HEM,
    LASHES,
    LIPS,
    MOUTH,
    SKIN,
    FloatArray,
    IntArray,
    Part,
    brow,
    cut,
    eyeball,
    join,
    plain,
    take,
    tessellate,
    triangulate,
)
from synth.motion.body.mesh import Mesh

_LIFT_MM = 0.06
"""Distance in mm of the fine surface from the coarse one, so that they do not flicker."""

_BUST_BOTTOM_MM = 330.0
"""Height in mm, in the mesh's coordinates, at which the bust is cut: below the picture."""

_BUST_HALF_MM = 290.0
"""Half width in mm at which the shoulders are cut: beside the picture."""

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


def head_part(mesh: Mesh, groups: dict[str, IntArray], face: FloatArray, arm: FloatArray) -> Part:
    """Return head, neck and bust with everything on them.

    Parameters
    ----------
    mesh : Mesh
    groups : dict of str to ndarray
        Quads by group, from `read_groups`.
    face : ndarray, shape (63, 3)
        The face markers on the mesh.
    arm : ndarray, shape (M,)
        Share of each vertex that the arms below the elbow hold.
    """
    points = mesh.vertices
    wanted = (points[:, 1] > _BUST_BOTTOM_MM) & (np.abs(points[:, 0]) < _BUST_HALF_MM)
    wanted &= arm < 0.5
    quads = groups["body"]
    triangles = triangulate(quads[wanted[quads].all(axis=1)])
    rings = lip_rings(quads, points)
    parts = [_skin(mesh, face, triangles, rings)]
    for side, letter in ((-1, "r"), (1, "l")):
        ball = np.unique(groups[f"helper-{letter}-eye"])
        parts.append(eyeball(points, ball))
        parts.append(brow(points, triangles, side, _BROW_LINE, _BROW_WIDTH))
        parts.append(_lashes(points, groups[f"helper-{letter}-eyelashes-2"], ball))
    parts += [
        teeth(points, groups["helper-upper-teeth"], 0),
        teeth(points, groups["helper-lower-teeth"], 1),
        tongue(points, groups["helper-tongue"]),
    ]
    parts += [hair(points, triangles), back_hair(points)]
    return join(parts)


def _lashes(points: FloatArray, quads: IntArray, ball: IntArray) -> Part:
    """Return the upper lashes: dark at their roots, fading towards their tips."""
    used = np.unique(quads)
    away = np.linalg.norm(points - points[ball].mean(axis=0), axis=1)
    near, far = away[used].min(), away[used].max()
    colours = plain(LASHES, 10, len(points))
    colours[:, 4] = 235 * np.clip(1 - 1.6 * (away - near) / (far - near), 0, 1)
    return take(quads, colours)


_HAIRLINE = np.array([
    (-60, 642), (-20, 646), (0, 656), (18, 690), (30, 742), (48, 750), (64, 740), (72, 716),
    (80, 714), (90, 742), (104, 762), (122, 778), (140, 786), (175, 789),
])  # fmt: skip
"""Height of the hairline over depth z: nape, behind and above the ear, temple, forehead."""

_HAIR_DIVISION = 2
"""Parts into which each edge of the scalp's triangles is divided."""


def hair(points: FloatArray, triangles: IntArray) -> Part:
    """Return hair combed back: the scalp, finer, raised and streaked along the combing."""
    x, y, z = points.T
    height = y - np.interp(z, *_HAIRLINE.T)
    ear = (np.abs(x) > 72) & (y > 682) & (y < 752) & (z > 22) & (z < 80)
    height = np.where(ear, -50.0, height)
    scalp = triangles[(height[triangles] > -14).any(axis=1) & (y[triangles] > 600).all(axis=1)]
    sources, shares, fine = tessellate(scalp, _HAIR_DIVISION)
    normals = vertex_normals(points, triangles)
    at = (points[sources] * shares[..., None]).sum(axis=1)
    up = (normals[sources] * shares[..., None]).sum(axis=1)
    level = (height[sources] * shares).sum(axis=1)
    across = np.degrees(np.arctan2(at[:, 0], np.hypot(at[:, 1] - 715, 0.35 * (at[:, 2] - 40))))
    strands = np.zeros(len(at))
    for rate, phase in ((0.9, 0.3), (1.7, 2.1), (3.1, 0.7), (4.3, 4.0)):
        strands += np.sin(across * rate + phase + 0.015 * at[:, 2])
    thickness = np.where(level > 0, 0.8 + 13 * (1 - np.exp(-np.maximum(level, 0) / 34)), level / 6)
    thickness = thickness + 0.2 * np.clip(level / 10, 0, 1) * strands
    colours = plain(HAIR, 12, len(at))
    colours[:, :3] *= (1 + 0.07 * strands)[:, None] * (0.8 + 0.2 * np.clip(level / 12, 0, 1))[
        :, None
    ]
    colours[:, 4] = 255 * np.clip(0.5 + (level + 1.5 * strands) / 9, 0, 1)
    return Part(
        sources, shares, up * thickness[:, None], fine, np.clip(colours, 0, 255).astype(np.uint8)
    )


_FALL = np.array([
    (712, 70), (690, 80), (668, 87), (646, 91), (626, 93), (606, 94), (588, 93),
])  # fmt: skip
"""Half of the width of the hair behind the neck over its height."""

_FALL_DEPTH_MM = 2.0
"""Distance in mm of the falling hair's edge from the neck."""


def back_hair(points: FloatArray) -> Part:
    """Return hair that falls behind ears and neck, as the viewer sees it: a panel, bulging."""
    height = np.linspace(_FALL[0, 0], _FALL[-1, 0], 15)
    half = np.interp(-height, -_FALL[:, 0], _FALL[:, 1])
    across = np.linspace(-1, 1, 25)
    x = (half[:, None] * across).ravel()
    y = np.repeat(height, len(across)) - 5 * np.tile(across**2, len(height))
    side = np.abs(np.tile(across, len(height)))
    z = _FALL_DEPTH_MM + 12 * np.sqrt(np.clip(1 - side**4, 0, 1))
    n = len(across)
    i, j = np.meshgrid(np.arange(len(height) - 1), np.arange(n - 1), indexing="ij")
    a = i * n + j
    quads = np.stack([a, a + n, a + n + 1, a + 1], axis=-1).reshape(-1, 4)
    strands = np.sin(23 * side + 0.6) + np.sin(41 * side + 1.9 + 0.01 * y) + np.sin(67 * side)
    colours = plain(HAIR, 12, len(x))
    # Behind the neck it is dark; what stands out at the sides catches the light.
    colours[:, :3] *= (0.45 + 0.45 * side**2 + 0.05 * strands)[:, None]
    colours[:, 4] = 255 * np.clip((y - _FALL[-1, 0] + 2 + 2.5 * strands) / 14, 0, 1)
    place = np.stack([x, y, z], axis=1)
    nape = int(np.argmin(np.linalg.norm(points - [0.0, 700.0, -60.0], axis=1)))
    return Part(
        np.full((len(x), 3), nape), np.full((len(x), 3), 1 / 3), place - points[nape],
        triangulate(quads), np.clip(colours, 0, 255).astype(np.uint8),
    )  # fmt: skip


def _skin(mesh: Mesh, face: FloatArray, triangles: IntArray, rings: IntArray) -> Part:
    """Return the skin, finer at the lips, and the clothes over it."""
    points = mesh.vertices
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

    bare = cut(triangles[~of_lips], points, above(-9), division=1)
    fine = tessellate(triangles[lips[triangles].any(axis=1)], 3)
    shirt = cut(triangles, points, below(-5), division=3)
    hem_some = cut(triangles, points, below(0.0), division=3)
    parts = []
    for (sources, shares, small), lift_mm, colour in (
        (bare, 0.0, None), (fine, _LIFT_MM, None), (shirt, 1.4, CLOTH), (hem_some, 0.9, HEM),
    ):  # fmt: skip
        at = (points[sources] * shares[..., None]).sum(axis=1)
        shade = (hollow[sources] * shares).sum(axis=1)
        if colour is None:
            colours = _skin_colours(at, face, shade)
        else:
            colours = plain(colour, 10, len(at))
            colours[:, :3] *= (1 - shade)[:, None]
        edge = np.minimum(
            (at[:, 1] - _BUST_BOTTOM_MM - 4) / 12, (_BUST_HALF_MM - 4 - np.abs(at[:, 0])) / 12
        )
        colours[:, 4] = 255 * np.clip(edge, 0, 1)
        offsets = lift_mm * (normals[sources] * shares[..., None]).sum(axis=1)
        if small is fine[2]:
            offsets += rounded(points, normals, sources, shares)
        parts.append(Part(sources, shares, offsets, small, colours.astype(np.uint8)))
    return join(parts)


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


def _neckline(points: FloatArray) -> FloatArray:
    """Return the height at which cloth begins below each point."""
    line: FloatArray = 512 + 0.014 * points[:, 0] ** 2 + 0.5 * np.maximum(0, 60 - points[:, 2])
    return line


def _skin_colours(points: FloatArray, face: FloatArray, hollow: FloatArray) -> FloatArray:
    """Return red, green, blue, gloss, opacity of points (N, 3) of the skin, shape (N, 5)."""
    x, y, z = points.T
    colours = plain(SKIN, 70, len(points))
    cheek = face[FACE_MARKERS.index("CK1_L")]
    for middle, size, share in (
        (cheek, 17, 0.5), (cheek * [-1, 1, 1], 17, 0.5), (np.array([0, 703, 168]), 12, 0.35),
    ):  # fmt: skip
        distance = np.linalg.norm(points - middle, axis=1)
        blend(colours, BLUSH, share * np.exp(-((distance / size) ** 2)))
    red = _inside_lips(points, face)
    blend(colours, LIPS, red)
    colours[:, 3] += 60 * red
    cavity = (np.abs(x) < 34) & (y > 634) & (y < 684) & (z < 141 - 0.012 * x**2) & (z > 50)
    blend(colours, MOUTH, cavity.astype(float))
    colours[:, :3] *= (1 - hollow)[:, None]
    return colours


def blend(colours: FloatArray, colour: tuple[int, int, int], share: FloatArray) -> None:
    """Move colours (N, 5) towards one colour by `share` (N,), in place."""
    colours[:, :3] += share[:, None] * (np.array(colour) - colours[:, :3])


def _inside_lips(points: FloatArray, face: FloatArray) -> FloatArray:
    """Return how far each point belongs to the red of the lips, 0..1."""

    def at(name: str) -> FloatArray:
        corner: FloatArray = face[FACE_MARKERS.index(name), :2]
        return corner

    upper = sorted((at(name) for name in (*UPPER_LIP, *LIP_CORNERS)), key=lambda p: p[0])
    lower = sorted((at(name) for name in (*LOWER_LIP, *LIP_CORNERS)), key=lambda p: p[0])
    top = np.interp(points[:, 0], *np.transpose(upper))
    bottom = np.interp(points[:, 0], *np.transpose(lower))
    margin = np.minimum(top + 0.6 - points[:, 1], points[:, 1] - bottom + 0.6)
    half = abs(at("LC_L")[0]) + 1
    margin = np.minimum(margin, (half - np.abs(points[:, 0])) * 0.5)
    return np.where(points[:, 2] > 130, np.clip(margin / 1.3, 0, 1), 0.0)


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
