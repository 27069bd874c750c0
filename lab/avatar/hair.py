"""Hair combed back: a smooth shell of strands over the skull, with a soft hairline.

Strands run from the hairline to a point at the back of the head, on great circles about the
middle of the skull; each has a shade and a height of its own. The shell ends where the head
hides it.
"""

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from lab.avatar.looks import Look
from lab.avatar.parts import FloatArray, IntArray, Part, plain, triangulate
from lab.avatar.rays import outermost

_MIDDLE = np.array([0.0, 735.0, 42.0])
"""Point inside the skull, mm, about which directions are meant."""

_HAIRLINE_DEG = np.array([
    (0, 33.0), (14, 33.2), (28, 32.5), (40, 30.5), (50, 27.0), (58, 21.0), (64, 13.0), (68, 4.0),
    (71, -6.0), (74.5, -6.0), (78, 6.0), (84, 17.0), (92, 20.0), (101, 15.0), (108, 3.0),
    (113, -12.0), (118, -26.0), (124, -36.0),
])  # fmt: skip
"""Azimuth from the front and elevation of the hairline: forehead, temple, before, above and
behind the ear, nape; drawn by eye."""

_TEMPLE_DEG = 46.0
"""Azimuth of the temple, where a hairline recedes."""

_CARRIERS = np.array([(0.0, 806.0, 136.0), (0.0, 750.0, -39.0), (0.0, 790.0, -33.0)])
"""Points of the skull that carry the hair; no strand is 128 mm from their mean, the longest
offset."""

_COLUMNS, _STEPS_MM = (
    300,
    (-3.0, -1.2, 0.6, 2.6, 6.0, 11.0, 18.0, 27.0, 38.0, 52.0, 68.0, 86.0, 106.0, 128.0),
)
"""Strands, and lengths in mm along each of them from the hairline."""

_BEHIND_MM = -14.0
"""Depth in mm behind which the head hides the hair."""

_EAR = ((70.0, 95.0), (676.0, 758.0), (14.0, 84.0))
"""Limits in mm of x, y and z that hold an ear."""


def hair(points: FloatArray, triangles: IntArray, carriers: IntArray, look: Look) -> Part:
    """Return the hair of a look, carried by the mean of three vertices of the skull."""
    skull = _skull(points, triangles)
    line = _HAIRLINE_DEG.copy()
    line[:, 1] += (
        look.recess_deg
        * (0.4 + np.exp(-(((line[:, 0] - _TEMPLE_DEG) / 14) ** 2)))
        * (line[:, 0] < 75)
    )
    both = np.concatenate([line[:0:-1] * [-1, 1], line])
    length = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(both, axis=0).T))])
    at = np.linspace(0, length[-1], _COLUMNS)
    azimuth, elevation = (gaussian_filter1d(np.interp(at, length, both[:, k]), 2) for k in (0, 1))
    starts = _direction(azimuth, elevation)
    pole = _direction(np.array([180.0]), np.array([look.pole_deg]))[0]
    random = np.random.default_rng(7)
    strands = _noise(random, _COLUMNS)
    jitter = gaussian_filter1d(random.normal(size=_COLUMNS), 1.2) * 1.6
    across = np.cross(starts, pole)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    reach = np.arccos(np.clip(starts @ pole, -1, 1))
    angles = (np.array(_STEPS_MM)[None] + jitter[:, None]) / 95.0
    angles = np.minimum(angles, 0.98 * reach[:, None])
    ahead = np.cross(across, starts)
    rays = starts[:, None] * np.cos(angles)[..., None] + ahead[:, None] * np.sin(angles)[..., None]
    run = np.maximum(np.array(_STEPS_MM), 0)
    top, side = look.lift_mm
    high = np.clip(rays[..., 1] / 0.75, 0, 1)
    # Hair before the ear lies flat, its roots in the skin: no ground shows between them.
    flat = (np.clip((24 - elevation) / 20, 0, 1) * (np.abs(azimuth) < 80))[:, None]
    lift = 0.9 + (side + (top - side) * high) * (1 - np.exp(-run / (16 + 44 * flat)))
    lift = lift - np.maximum(4.5 * flat, (np.abs(azimuth) > 44)[:, None]) * np.exp(-run / 15)
    relief = 0.55 * strands[:, None] * np.clip(run / 8, 0, 1)
    places = _MIDDLE + rays * (skull(rays) + lift + relief)[..., None]
    colours = plain(look.hair, 16, places.shape[0] * places.shape[1])
    shade = 1 + 0.3 * strands[:, None] + 0.05 * random.normal(size=places.shape[:2])
    shade = shade * (0.82 + 0.18 * np.clip(run / 12, 0, 1))
    white = look.grey * np.clip(0.5 + 0.8 * _noise(random, _COLUMNS), 0, 1)[:, None, None]
    painted = colours[:, :3].reshape(*places.shape) * shade[..., None]
    painted += white * (np.array([205.0, 204.0, 202.0]) - painted) * 0.7
    colours[:, :3] = painted.reshape(-1, 3)
    soft = np.interp(np.array(_STEPS_MM), [-3, -1.2, 0.6, 2.6], [0, 0.3, 0.75, 1.0])
    opacity = np.clip(soft[None] + 0.18 * strands[:, None] * (soft[None] % 1 > 0), 0, 1)
    colours[:, 4] = 255 * opacity.ravel()
    n = places.shape[1]
    i, j = np.meshgrid(np.arange(_COLUMNS - 1), np.arange(n - 1), indexing="ij")
    a = (i * n + j).ravel()
    quads = np.stack([a, a + n, a + n + 1, a + 1], axis=1)
    flat = places.reshape(-1, 3)
    quads = quads[(flat[quads][..., 2] > _BEHIND_MM).any(axis=1)]
    used, inverse = np.unique(quads, return_inverse=True)
    return Part(
        np.tile(carriers, (len(used), 1)),
        np.full((len(used), 3), 1 / 3),
        flat[used] - points[carriers].mean(axis=0),
        triangulate(inverse.reshape(quads.shape)),
        np.clip(colours[used], 0, 255).astype(np.uint8),
    )


def hair_carriers(points: FloatArray) -> IntArray:
    """Return the three vertices of the skull that carry the hair."""
    return np.array([np.linalg.norm(points - at, axis=1).argmin() for at in _CARRIERS])


def covered(points: FloatArray) -> FloatArray:
    """Return how far each point of the skin lies behind the hairline, degrees; less is bare."""
    away = points - _MIDDLE
    azimuth = np.degrees(np.arctan2(np.abs(away[:, 0]), away[:, 2]))
    elevation = np.degrees(np.arctan2(away[:, 1], np.hypot(away[:, 0], away[:, 2])))
    return np.asarray(elevation - np.interp(azimuth, *_HAIRLINE_DEG.T))


def depth_deg(points: FloatArray) -> FloatArray:
    """Return how far points under the hair lie from its line on all sides, degrees; else 0."""
    both = np.concatenate([_HAIRLINE_DEG[:0:-1] * [-1, 1], _HAIRLINE_DEG])
    dense = np.linspace(0, len(both) - 1, 10 * len(both))
    line = _direction(*(np.interp(dense, np.arange(len(both)), both[:, k]) for k in (0, 1)))
    away = points - _MIDDLE
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    distance = np.degrees(np.arccos(np.clip((away @ line.T).max(axis=1), -1, 1)))
    return np.where(covered(points) > 0, distance, 0)


def _direction(azimuth_deg: FloatArray, elevation_deg: FloatArray) -> FloatArray:
    """Return unit vectors (N, 3); azimuth zero faces the viewer."""
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    return np.stack(
        [
            np.sin(azimuth) * np.cos(elevation),
            np.sin(elevation),
            np.cos(azimuth) * np.cos(elevation),
        ],
        axis=-1,
    )


def _noise(random: np.random.Generator, count: int) -> FloatArray:
    """Return shades of strands, about -1..1: fine ones in thicker locks."""
    layers = [
        weight * gaussian_filter1d(random.normal(size=count), width) * np.sqrt(2 * width)
        for weight, width in ((0.35, 0.7), (0.4, 2.0), (0.35, 6.0))
    ]
    return np.asarray(np.clip(sum(layers), -1.6, 1.6))


def _skull(points: FloatArray, triangles: IntArray):  # type: ignore[no-untyped-def]
    """Return a function from directions (..., 3) to the skull's distance, without the ears."""
    (x0, x1), (y0, y1), (z0, z1) = _EAR
    ear = (np.abs(points[:, 0]) > x0) & (np.abs(points[:, 0]) < x1)
    ear &= (points[:, 1] > y0) & (points[:, 1] < y1) & (points[:, 2] > z0) & (points[:, 2] < z1)
    near = triangles[(points[triangles][..., 1] > 620).all(axis=1)]
    near = near[~ear[near].any(axis=1)]
    azimuth, elevation = np.arange(-180.0, 181.0, 4.0), np.arange(-52.0, 91.0, 4.0)
    grid = np.stack(np.meshgrid(azimuth, elevation, indexing="ij"), axis=-1)
    found = outermost(points, near, _MIDDLE, _direction(grid[..., 0].ravel(), grid[..., 1].ravel()))
    reach = found.reshape(grid.shape[:2])
    known = (reach > 0).astype(float)
    around = gaussian_filter(reach * known, 2.0, mode=("wrap", "nearest"))
    around /= np.maximum(gaussian_filter(known, 2.0, mode=("wrap", "nearest")), 1e-6)
    reach = gaussian_filter(np.where(known > 0, reach, around), 0.7, mode=("wrap", "nearest"))
    table = RegularGridInterpolator(
        (azimuth, elevation), reach, bounds_error=False, fill_value=None
    )

    def distance(rays: FloatArray) -> FloatArray:
        turn = np.degrees(np.arctan2(rays[..., 0], rays[..., 2]))
        rise = np.degrees(np.arcsin(np.clip(rays[..., 1], -1, 1)))
        return np.asarray(table(np.stack([turn, rise], axis=-1)))

    return distance
