"""A rolled collar along the neckline and lashes hair by hair: fine edges of the bust."""

from collections.abc import Callable

import numpy as np

from lab.avatar.looks import Look
from lab.avatar.parts import FloatArray, IntArray, Part, plain, triangulate
from lab.avatar.rays import outermost

_AXIS_Z_MM = 22.0
"""Depth in mm of the vertical axis about which the neckline runs."""

_RADII_MM = (3.4, 2.2)
"""Half of the collar's width along the skin and of its thickness, mm."""

_AZIMUTHS_DEG = np.linspace(-118, 118, 141)


def collar(
    points: FloatArray, triangles: IntArray, level: Callable[[FloatArray], FloatArray], look: Look
) -> Part:
    """Return a roll of cloth over the line where `level` of the skin is zero."""
    near = triangles[np.abs(points[triangles][..., 1] - 570).max(axis=1) < 110]
    turn = np.radians(_AZIMUTHS_DEG)
    rays = np.stack([np.sin(turn), np.zeros_like(turn), np.cos(turn)], axis=1)
    heights = np.arange(636.0, 480.0, -3.0)
    line = np.full((len(rays), 3), np.nan)
    before, over = np.zeros_like(line), np.zeros(len(rays))
    for height in heights:
        open_ = np.isnan(line[:, 0])
        if not open_.any():
            break
        origin = np.array([0.0, height, _AXIS_Z_MM])
        at = origin + rays * outermost(points, near, origin, rays)[:, None]
        now = level(at)
        crossed = open_ & (now <= 0) & (height < heights[0])
        share = over / np.maximum(over - now, 1e-9)
        line[crossed] = (before + share[:, None] * (at - before))[crossed]
        before, over = at, now
    line = line[np.isfinite(line[:, 0])]
    for k in range(3):
        line[:, k] = np.convolve(np.pad(line[:, k], 2, mode="edge"), np.ones(5) / 5, mode="valid")
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    out = line - [0.0, 0.0, _AXIS_Z_MM]
    out[:, 1] = 0.55 * np.linalg.norm(out[:, [0, 2]], axis=1)
    out -= (out * along).sum(axis=1, keepdims=True) * along
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    down = np.cross(along, out)
    angles = 2 * np.pi * np.arange(8) / 8
    wide, thick = _RADII_MM
    rim = line[:, None] + 0.8 * out[:, None]
    rim = rim + thick * np.cos(angles)[:, None] * out[:, None]
    rim = rim + wide * np.sin(angles)[:, None] * down[:, None]
    n = len(angles)
    i, j = np.meshgrid(np.arange(len(line) - 1), np.arange(n), indexing="ij")
    a, b = (i * n + j).ravel(), (i * n + (j + 1) % n).ravel()
    flat = rim.reshape(-1, 3)
    colours = plain(look.hem, 14, len(flat))
    colours[:, :3] *= np.tile(0.86 + 0.2 * np.cos(angles), len(line))[:, None]
    sources, shares = nearest_on(points, near, line)
    carriers = (points[sources] * shares[..., None]).sum(axis=1)
    return Part(
        np.repeat(sources, n, axis=0),
        np.repeat(shares, n, axis=0),
        flat - np.repeat(carriers, n, axis=0),
        triangulate(np.stack([a, b, b + n, a + n], 1)),
        np.clip(colours, 0, 255).astype(np.uint8),
    )


def nearest_on(
    points: FloatArray, triangles: IntArray, places: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return the triangle's corners (N, 3) nearest to each place (N, 3) and its shares there."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    u, w = b - a, c - a
    uu, uw, ww = (u * u).sum(1), (u * w).sum(1), (w * w).sum(1)
    size = np.maximum(uu * ww - uw**2, 1e-9)
    sources, shares = [], []
    for place in places:
        d = place - a
        du, dw = (d * u).sum(1), (d * w).sum(1)
        inside = np.stack([(ww * du - uw * dw) / size, (uu * dw - uw * du) / size], axis=1)
        # Beside a triangle the nearest of its places is only estimated: neighbours are nearer.
        inside = np.clip(inside, 0, 1)
        inside /= np.maximum(inside.sum(axis=1, keepdims=True), 1)
        away = np.linalg.norm(a + inside[:, :1] * u + inside[:, 1:] * w - place, axis=1)
        best = int(away.argmin())
        s, t = inside[best]
        sources.append(triangles[best])
        shares.append([1 - s - t, s, t])
    return np.array(sources), np.array(shares)


def carried(
    points: FloatArray, carriers: IntArray, at: FloatArray, triangles: IntArray, colours: FloatArray
) -> Part:
    """Return a part whose vertices (N, 3) follow the nearest three of the `carriers`."""
    sources = np.empty((len(at), 3), dtype=np.int64)
    shares = np.empty((len(at), 3))
    for row, place in enumerate(at):
        distance = np.linalg.norm(points[carriers] - place, axis=1)
        best = np.argsort(distance)[:3]
        weight = 1 / (distance[best] + 1.0)
        shares[row] = np.rint(252 * weight / weight.sum()) / 252
        sources[row] = carriers[best]
    shares[:, 0] += 1 - shares.sum(axis=1)
    moved = (points[sources] * shares[..., None]).sum(axis=1)
    painted = np.clip(colours, 0, 255).astype(np.uint8)
    return Part(sources, shares, at - moved, triangles, painted)


_LASHES = {"2": (60, 6.6, 2.4, 0.85), "1": (24, 3.4, -0.6, 0.35)}
"""Of the upper and lower lids: number, length in mm outwards, rise in mm, opacity."""

_BEFORE_LID = np.array([0.0, 0.2, 1.0])
"""Where a lash begins beside the lid's edge, mm: clear of the lids of every look."""

_ROOT_MM = 0.24
"""Half of a lash's width at its root, mm."""


def lashes(points: FloatArray, quads: IntArray, lid: str, ball: IntArray, look: Look) -> Part:
    """Return the lashes of one lid, each a curved blade that both sides show.

    Parameters
    ----------
    points : ndarray, shape (M, 3)
    quads : ndarray of int, shape (F, 4)
        The mesh's own strip of lashes, whose inner edge is the lid's.
    lid : str
        "2" for the upper, "1" for the lower.
    ball : ndarray of int
        The eye.
    look : Look
    """
    count, length, rise, opacity = _LASHES[lid]
    used = np.unique(quads)
    middle = points[ball].mean(axis=0)
    away = np.linalg.norm(points[used] - middle, axis=1)
    edge = used[away < away.min() + 0.32 * np.ptp(away)]
    edge = edge[np.argsort(points[edge, 0])]
    x = np.linspace(points[edge, 0].min(), points[edge, 0].max(), count)
    roots = np.stack([x, *(
        np.polyval(np.polyfit(points[edge, 0] - middle[0], points[edge, k], 4), x - middle[0])
        for k in (1, 2)
    )], axis=1)  # fmt: skip
    roots += _BEFORE_LID
    random = np.random.default_rng(3)
    part = (x - middle[0]) / np.ptp(x)
    outward = np.abs(part + 0.5 * np.sign(middle[0]))
    long = length * (0.6 + 0.5 * outward) * random.uniform(0.85, 1.1, count)
    fan = 0.9 * part + random.normal(0, 0.06, count)
    ahead = np.stack([fan, np.full(count, 0.12 if rise > 0 else -0.35), np.ones(count)], axis=1)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    bow = np.array([0.0, rise, 0.0])
    steps = np.array([0.0, 0.35, 0.7, 1.0])
    spine = roots[:, None] + (0.62 * long[:, None] * steps)[..., None] * ahead[:, None]
    spine = spine + (steps**2)[:, None] * bow
    wide = np.stack([np.ones(count), np.zeros(count), -ahead[:, 0]], axis=1)
    half = _ROOT_MM * np.array([1.0, 0.8, 0.5, 0.08])
    both = np.stack(
        [spine - half[:, None] * wide[:, None], spine + half[:, None] * wide[:, None]], 2
    )
    flat = both.reshape(-1, 3)
    start = 8 * np.arange(count)[:, None] + 2 * np.arange(3)
    a = start.ravel()
    front = np.stack([a, a + 1, a + 3, a + 2], axis=1)
    colours = plain(look.lashes, 10, len(flat))
    colours[:, 4] = 255 * opacity * np.tile(np.repeat([1.0, 0.95, 0.8, 0.35], 2), count)
    return carried(
        points, used, flat, triangulate(np.concatenate([front, front[:, ::-1]])), colours
    )
