"""Compiled loops of the receiver: drawing the avatar's triangles."""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

Point = NDArray[np.float64]


@njit(cache=True)
def _front(
    a: Point, b: Point, c: Point, width: int, height: int
) -> tuple[float, int, int, int, int]:
    """Twice the area of a triangle, and first and last column and row of its pixels.

    A triangle seen from behind has no rows. With y downwards a front has a negative area.
    """
    area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    if area > -1e-12:
        return 1.0, 0, -1, 0, -1
    left = max(0, int(np.floor(min(a[0], b[0], c[0]) - 0.5)))
    right = min(width - 1, int(np.ceil(max(a[0], b[0], c[0]) - 0.5)))
    top = max(0, int(np.floor(min(a[1], b[1], c[1]) - 0.5)))
    bottom = min(height - 1, int(np.ceil(max(a[1], b[1], c[1]) - 0.5)))
    return area, left, right, top, bottom


@njit(cache=True)
def _weights(
    a: Point, b: Point, c: Point, area: float, x: float, y: float
) -> tuple[float, float, float]:
    """Barycentric coordinates of a place in the picture."""
    wb = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area
    wc = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area
    return 1.0 - wb - wc, wb, wc


@njit(cache=True)
def draw_triangles(
    points: NDArray[np.float64],
    triangles: NDArray[np.int64],
    values: NDArray[np.float64],
    light: NDArray[np.float64],
    depth: NDArray[np.float64],
    picture: NDArray[np.float64],
) -> None:
    """Draw lit triangles over a picture; nearer ones win, half transparent ones mix.

    Parameters
    ----------
    points : (V, 3)
        Pixels to the right, pixels down, nearness (larger is nearer).
    triangles : (F, 3)
        Those seen from behind are left out. Later ones are drawn over earlier ones.
    values : (V, 8)
        Normal, linear red, green, blue, gloss and opacity, 0..1.
    light : (4, 3)
        Direction of the key light; half way to the viewer; its wrap and its strength per colour.
    depth : (H, W)
        Nearness so far; start with -inf. Updated.
    picture : (H, W, 4)
        Red, green, blue times opacity, opacity; linear. Updated.
    """
    height, width = depth.shape
    value = np.empty(8)
    for f in range(triangles.shape[0]):
        ia, ib, ic = triangles[f, 0], triangles[f, 1], triangles[f, 2]
        a, b, c = points[ia], points[ib], points[ic]
        area, left, right, top, bottom = _front(a, b, c, width, height)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                wa, wb, wc = _weights(a, b, c, area, column + 0.5, row + 0.5)
                if wa < 0.0 or wb < 0.0 or wc < 0.0:
                    continue
                near = wa * a[2] + wb * b[2] + wc * c[2]
                if near <= depth[row, column]:
                    continue
                for k in range(8):
                    value[k] = wa * values[ia, k] + wb * values[ib, k] + wc * values[ic, k]
                alpha = value[7]
                if alpha <= 0.004:
                    continue
                depth[row, column] = near
                size = np.sqrt(value[0] ** 2 + value[1] ** 2 + value[2] ** 2) + 1e-9
                nx, ny, nz = value[0] / size, value[1] / size, value[2] / size
                key = nx * light[0, 0] + ny * light[0, 1] + nz * light[0, 2]
                half = max(0.0, nx * light[1, 0] + ny * light[1, 1] + nz * light[1, 2])
                sky = 0.20 + 0.22 * (0.5 + 0.5 * ny)
                shine = value[6] * 0.5 * half**28
                rim = 0.36 * max(0.0, 1.0 - nz) ** 3
                for k in range(3):
                    wrap = light[2, k]
                    lit = min(1.0, max(0.0, (key + wrap) / (1.0 + wrap))) ** 1.3
                    colour = lit * light[3, k] + sky * (0.85 + 0.125 * k)
                    colour = value[3 + k] * (colour + rim * (0.8 + 0.1 * k)) + shine
                    old = picture[row, column, k]
                    picture[row, column, k] = colour * alpha + old * (1.0 - alpha)
                old = picture[row, column, 3]
                picture[row, column, 3] = alpha + old * (1.0 - alpha)


@njit(cache=True)
def cover_triangles(
    points: NDArray[np.float64],
    triangles: NDArray[np.int64],
    opacity: NDArray[np.float64],
    depth: NDArray[np.float64],
    mask: NDArray[np.float64],
) -> None:
    """Note where triangles stand in front of a picture.

    Parameters
    ----------
    points : (V, 3)
        Pixels to the right, pixels down, nearness (larger is nearer).
    triangles : (F, 3)
        Those seen from behind are left out.
    opacity : (V,)
        0..1.
    depth : (H, W)
        Nearness of the picture.
    mask : (H, W)
        Raised to the opacity of what covers a pixel.
    """
    height, width = depth.shape
    for f in range(triangles.shape[0]):
        ia, ib, ic = triangles[f, 0], triangles[f, 1], triangles[f, 2]
        a, b, c = points[ia], points[ib], points[ic]
        area, left, right, top, bottom = _front(a, b, c, width, height)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                wa, wb, wc = _weights(a, b, c, area, column + 0.5, row + 0.5)
                if wa < 0.0 or wb < 0.0 or wc < 0.0:
                    continue
                near = wa * a[2] + wb * b[2] + wc * c[2]
                if near > depth[row, column]:
                    alpha = wa * opacity[ia] + wb * opacity[ib] + wc * opacity[ic]
                    mask[row, column] = max(mask[row, column], alpha)
