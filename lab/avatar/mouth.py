"""The inside of the mouth: the rings of the lips, teeth one by one with gums, the tongue.

The base mesh comes in, parts and the arrays of `receiver.drawing.mouth.Mouth` go out. Teeth are
drawn along an arch behind the lips, fitted to the mesh's own row; sizes are means of adults
(Ash and Nelson, Dental Anatomy, 8th ed.), scaled to the width of this jaw.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from lab.avatar.parts import FloatArray, IntArray, Part, join, plain, take, triangulate
from receiver.drawing.mouth import EDGE

# Red, green, blue, chosen by eye.
TEETH = (232, 224, 208)
GUM = (168, 84, 82)
TONGUE = (168, 80, 80)

_INNERMOST, _N_RINGS, _N_COLUMNS = 605, 13, 38
"""Vertex of hm08 in the middle of the innermost ring of the upper lip; size of the rings' grid."""

_LEFT_CORNER = 12
"""Column of the corner at x > 0; the other lies as far before the last."""

_ROUNDING = 2
"""Rounds of averaging along the lips, each with weights 1/4, 1/2, 1/4."""

# Width and height in mm of the crowns from the middle to the side.
_UPPER = ((8.5, 10.0), (6.6, 9.0), (7.6, 9.8), (7.0, 8.6), (6.8, 8.2), (10.0, 7.4))
_LOWER = ((5.2, 8.8), (5.8, 9.2), (6.8, 10.0), (7.0, 8.8), (7.0, 8.2), (10.6, 7.6))

_SETBACK_MM = 2.2
"""Distance in mm of the teeth behind the mesh's own row, which touches the lips."""

_BEND, _STEEP = 0.0165, 2.0e-5
"""The arch is ``z = front - bend x**2 - steep x**4``, mm."""

_TIPS_MM = (659.2, 659.6)
"""Height in mm of the cutting edges at rest."""

_N = 6
"""Vertices along each side of a tooth's face."""


def lip_rings(quads: IntArray, points: FloatArray) -> IntArray:
    """Return the rings of the lips (13, 38), from the lining to the outer edge of the red.

    Columns begin in the middle of the upper lip and run over x > 0.

    Raises
    ------
    CueError
        If the mesh is not hm08.
    """
    beside: dict[int, list[IntArray]] = {}
    for quad in quads:
        for corner in quad:
            beside.setdefault(int(corner), []).append(quad)

    def next_of(before: int, at: int) -> int:
        """Return the vertex across a crossing of four edges."""
        near = {int(v) for quad in beside[at] for v in _neighbours(quad, at)}
        shared = {int(v) for quad in beside[at] if before in quad for v in quad}
        ahead = near - shared
        if len(near) != 4 or len(ahead) != 1:
            raise CueError(f"vertex {at} is not inside the lips of hm08")
        return ahead.pop()

    def ring_of(start: int) -> list[int]:
        side = [int(v) for quad in beside[start] for v in _neighbours(quad, start)]
        ring = [start, max(side, key=lambda v: points[v, 0])]
        while (following := next_of(ring[-2], ring[-1])) != start:
            ring.append(following)
            if len(ring) > _N_COLUMNS:
                break
        if len(ring) != _N_COLUMNS:
            raise CueError(f"the ring of vertex {start} is not one of hm08's lips")
        return ring

    rings = [ring_of(_INNERMOST)]
    while len(rings) < _N_RINGS:
        last = rings[-1][0]
        if len(rings) == 1:
            column = [int(v) for quad in beside[last] for v in _neighbours(quad, last)]
            middle = {v for v in column if abs(points[v, 0]) < 1e-3}
            start = min(middle, key=lambda v: points[v, 1])
        else:
            start = next_of(rings[-2][0], last)
        rings.append(ring_of(start))
    return np.array(rings)


def rounded_units(units: dict[str, FloatArray], rings: IntArray) -> dict[str, FloatArray]:
    """Return face units whose movement varies smoothly along the lips.

    The mesh's own funnel dents the middle of the lower lip to a point; corners stay.

    Parameters
    ----------
    units : dict of str to ndarray, shape (V, 3)
    rings : ndarray of int, shape (13, 38)
        From `lip_rings`.
    """
    corners = {_LEFT_CORNER, _N_COLUMNS - _LEFT_CORNER}
    free = np.array([column for column in range(_N_COLUMNS) if column not in corners])
    found = {}
    for name, moved in units.items():
        lips = moved[rings]
        for _ in range(_ROUNDING):
            beside = np.roll(lips, 1, axis=1) + np.roll(lips, -1, axis=1)
            lips[:, free] = 0.5 * lips[:, free] + 0.25 * beside[:, free]
        found[name] = moved.copy()
        found[name][rings] = lips
    return found


def _neighbours(quad: IntArray, corner: int) -> tuple[int, int]:
    at = int(np.flatnonzero(quad == corner)[0])
    return int(quad[at - 1]), int(quad[(at + 1) % 4])


def mouth_arrays(
    rings: IntArray, place: FloatArray, jaw: int, frame: tuple[FloatArray, FloatArray, FloatArray]
) -> dict[str, NDArray[Any]]:
    """Return the arrays of `receiver.drawing.mouth.Mouth`.

    Parameters
    ----------
    rings : ndarray of int, shape (13, 38)
        Control vertices.
    place : ndarray, shape (M, 3)
        The neutral control mesh in the frame of the asset.
    jaw : int
        Control vertex of the lower front teeth.
    frame : tuple of ndarray, shapes (3,), (3, 3) and (3,)
        Scale, turn and shift from the mesh's millimetres to the asset's.
    """
    edge = place[rings[EDGE]]
    left, right = int(edge[:, 0].argmax()), int(edge[:, 0].argmin())
    upper = np.array([*range(right, len(edge)), *range(left + 1)])
    lower = np.arange(right, left - 1, -1)
    at = np.interp(edge[upper, 0], edge[lower, 0], np.arange(len(lower)))
    beside = np.minimum(at.astype(int), len(lower) - 2)
    lining = place[rings[:EDGE]] - edge
    depth = np.arange(EDGE, 0, -1)[:, None]
    inside = np.ones(rings.shape[1])
    inside[lower] = -1
    inside[[left, right]] = 0
    lining[..., 1] = inside * np.maximum(inside * lining[..., 1], 0.2 * depth)
    lining[..., 2] = np.minimum(lining[..., 2], -0.7 * depth)
    scale, turn, shift = frame
    arch = []
    for row in (0, 1):
        middle = (np.array([0.0, _TIPS_MM[row], _front(row)]) * scale) @ turn + shift
        bends = _BEND / scale[0] ** 2, _STEEP / scale[0] ** 4
        arch.append([middle[2], *(scale[2] * np.array(bends)), middle[1], middle[0]])
    return {
        "mouth_rings": rings.astype(np.uint16),
        "mouth_upper": upper.astype(np.uint8),
        "mouth_lower": lower.astype(np.uint8),
        "mouth_beside": beside.astype(np.uint8),
        "mouth_between": (at - beside).astype(np.float32),
        "mouth_lining": lining.astype(np.float32),
        "mouth_arch": np.array(arch, dtype=np.float32),
        "mouth_jaw": np.array([jaw], dtype=np.uint16),
        "mouth_jaw_rest": place[jaw].astype(np.float32),
    }


_FRONTS_MM = (149.2, 146.9)
"""Depth in mm of the mesh's own rows at their middle."""


def _front(row: int) -> float:
    return _FRONTS_MM[row] - _SETBACK_MM


def teeth(points: FloatArray, quads: IntArray, row: int) -> Part:
    """Return a row of teeth and its gum; `row` is 0 for the upper, 1 for the lower.

    Each vertex follows the nearest three vertices of the mesh's own row in `quads`.
    """
    sizes = _UPPER if row == 0 else _LOWER
    up = 1.0 if row == 0 else -1.0
    grids: list[tuple[FloatArray, FloatArray]] = []
    length = _along()
    for side in (-1, 1):
        start = 0.0
        for number, (width, height) in enumerate(sizes):
            grids.append(_tooth(length, start, width, height, row, number, side))
            start += width
    total = sum(width for width, _ in sizes)
    gum = _gum(length, total, sizes, row)
    faces = []
    for (at, colours), shape in (*((grid, (_N, _N)) for grid in grids), (gum, (41, 4))):
        n = shape[1]
        i, j = np.meshgrid(np.arange(shape[0] - 1), np.arange(n - 1), indexing="ij")
        a = (i * n + j).ravel()
        quad = np.stack([a, a + n, a + n + 1, a + 1], axis=1)
        if up < 0:
            quad = quad[:, ::-1]
        faces.append(_carried(points, np.unique(quads), at, triangulate(quad), colours))
    return join(faces)


def _along() -> tuple[FloatArray, FloatArray]:
    """Return lengths along the arch and the x that they reach."""
    x = np.linspace(0, 34, 400)
    slope = 2 * _BEND * x + 4 * _STEEP * x**3
    step = np.diff(x) * np.hypot(1, 0.5 * (slope[1:] + slope[:-1]))
    return np.concatenate([[0], np.cumsum(step)]), x


def _on_arch(length: tuple[FloatArray, FloatArray], s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places (N, 2) in x and z on the arch, and the outward normals there."""
    x = np.sign(s) * np.interp(np.abs(s), *length)
    z = -_BEND * x**2 - _STEEP * x**4
    out = np.stack([2 * _BEND * x + 4 * _STEEP * x**3, np.ones_like(x)], axis=1)
    return np.stack([x, z], axis=1), out / np.linalg.norm(out, axis=1, keepdims=True)


def _tip(x: FloatArray, row: int) -> FloatArray:
    """Return the height of the cutting edges: the rows curve upwards to the sides."""
    return np.asarray(_TIPS_MM[row] + 0.0042 * x**2)


def _tooth(
    length: tuple[FloatArray, FloatArray],
    start: float,
    width: float,
    height: float,
    row: int,
    number: int,
    side: int,
) -> tuple[FloatArray, FloatArray]:
    """Return the vertices (36, 3) and colours (36, 5) of the face of one tooth."""
    up = 1.0 if row == 0 else -1.0
    across = np.linspace(-1, 1, _N)
    rise = np.array([0.0, 0.1, 0.3, 0.55, 0.8, 1.0])
    u, v = (g.ravel() for g in np.meshgrid(across, rise, indexing="ij"))
    # The neck is narrower than the cutting edge, whose corners are round.
    narrow = 1 - 0.14 * v**2
    s = side * (start + width * (0.5 + 0.487 * side * u * narrow))
    on, out = _on_arch(length, s)
    corner = 0.5 * np.abs(u) ** 5 * (1 - v) ** 6
    if number == 2:
        corner = 1.5 * np.abs(u) ** 1.3 * (1 - v) ** 2 - 0.4 * (1 - v) ** 2
    bulge = 0.4 * (1 - u**2) - 0.8 * u**4 + 0.5 * np.sin(np.pi * np.minimum(v + 0.15, 1))
    bulge -= 0.7 * (1 - np.minimum(v / 0.12, 1))
    y = _tip(on[:, 0], row) + up * (corner + (0.3 if number in (1, 3) else 0.0) + height * v)
    # Upper teeth lean forwards a little from neck to edge.
    at = np.stack([on[:, 0] + bulge * out[:, 0], y, _front(row) + on[:, 1] + bulge * out[:, 1]], 1)
    colours = plain(TEETH, 150, len(at))
    gap = np.clip(1 - 0.42 * np.abs(u) ** 5, 0, 1)
    aside = np.clip(1.02 - 0.0011 * on[:, 0] ** 2, 0.3, 1) * (0.86 if row else 1.0)
    warm = np.array([0.0, -6.0, -22.0])
    colours[:, :3] = (colours[:, :3] + np.outer(v, warm)) * (gap * aside)[:, None]
    colours[:, 3] *= aside
    return at, colours


def _gum(
    length: tuple[FloatArray, FloatArray], total: float, sizes: Any, row: int
) -> tuple[FloatArray, FloatArray]:
    """Return the gum's vertices (41 * 4, 3) and colours: a band that covers the teeth's necks."""
    up = 1.0 if row == 0 else -1.0
    s = np.linspace(-total, total, 41)
    edges = np.concatenate([[0.0], np.cumsum([w for w, _ in sizes])])
    tooth = np.clip(np.searchsorted(edges, np.abs(s), side="right") - 1, 0, len(sizes) - 1)
    inside = (np.abs(s) - edges[tooth]) / np.array([w for w, _ in sizes])[tooth]
    height = np.interp(np.abs(s), 0.5 * (edges[1:] + edges[:-1]), [h for _, h in sizes])
    on, out = _on_arch(length, s)
    below = -1.6 * np.abs(2 * inside - 1) ** 2
    rows = []
    for lift, forward in ((below - 0.6, 0.3), (below + 0.5, 0.9), (3.0, 1.2), (9.0, 0.4)):
        y = _tip(on[:, 0], row) + up * (height + lift)
        rows.append(
            np.stack(
                [on[:, 0] + forward * out[:, 0], y, _front(row) + on[:, 1] + forward * out[:, 1]], 1
            )
        )
    at = np.stack(rows, axis=1).reshape(-1, 3)
    colours = plain(GUM, 130, len(at))
    aside = np.clip(1 - 0.0011 * at[:, 0] ** 2, 0.25, 1) * (0.8 if row else 0.95)
    colours[:, :3] *= aside[:, None]
    return at, colours


def _carried(
    points: FloatArray, row: IntArray, at: FloatArray, triangles: IntArray, colours: FloatArray
) -> Part:
    distance = np.linalg.norm(at[:, None] - points[row][None], axis=2)
    near = np.argsort(distance, axis=1)[:, :3]
    weight = 1 / (np.take_along_axis(distance, near, axis=1) + 1.0)
    shares = np.rint(252 * weight / weight.sum(axis=1, keepdims=True)) / 252
    shares[:, 0] += 1 - shares.sum(axis=1)
    sources = row[near]
    carried = (points[sources] * shares[..., None]).sum(axis=1)
    painted = np.clip(colours, 0, 255).astype(np.uint8)
    return Part(sources, shares, at - carried, triangles, painted)


_TONGUE_DOWN, _TONGUE_BACK = 6.5, 5.0
"""Distance in mm of the resting tongue from the mesh's: behind the lower teeth."""


def tongue(points: FloatArray, quads: IntArray) -> Part:
    """Return the tongue with its furrow, darker towards the throat."""
    used = np.unique(quads)
    colours = plain(TONGUE, 120, len(points))
    depth = np.clip((points[used, 2].max() - points[:, 2]) / 55, 0, 1)
    furrow = 0.2 * np.exp(-((points[:, 0] / 2.2) ** 2))
    aside = np.clip((np.abs(points[:, 0]) - 12) / 16, 0, 1)
    light = (1 - 0.85 * depth) * (1 - furrow) * (1 - 0.5 * aside)
    colours[:, :3] *= light[:, None]
    colours[:, 3] *= light
    part = take(quads, colours)
    inwards = np.tile([0.0, -_TONGUE_DOWN, -_TONGUE_BACK], (len(part.sources), 1))
    return Part(part.sources, part.shares, inwards, part.triangles, part.colours)
