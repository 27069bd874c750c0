"""The map of the shadow: triangles as the light sees them, blurred."""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit
from receiver.drawing._visibility_kernels import bounds_of, edge

FloatArray = NDArray[np.float32]
IntArray = NDArray[np.int32]

_ZERO = np.float32(0)


@njit(cache=True)
def cast(points: FloatArray, triangles: IntArray, opacity: FloatArray, cover: FloatArray) -> None:
    """Draw a surface as it is seen from the light.

    Parameters
    ----------
    points : (V, 3)
        Column, row, depth (larger is nearer to the light).
    triangles : (F, 3)
    opacity : (V,)
        0..1.
    cover : (N, M, 2)
        Opacity and depth of the nearest surface; start with zeros. Updated.
    """
    bounds = bounds_of(points, triangles, cover.shape[1], cover.shape[0], 0.0)
    for f in range(len(triangles)):
        ia, ic, ib = triangles[f]
        a, b, c = points[ia], points[ib], points[ic]
        a0, b0, c0 = edge(np.float64(a[0]), np.float64(a[1]), np.float64(b[0]), np.float64(b[1]))
        a1, b1, c1 = edge(np.float64(b[0]), np.float64(b[1]), np.float64(c[0]), np.float64(c[1]))
        a2, b2, c2 = edge(np.float64(c[0]), np.float64(c[1]), np.float64(a[0]), np.float64(a[1]))
        for row in range(bounds[f, 0], bounds[f, 1] + 1):
            for column in range(bounds[f, 2], bounds[f, 3] + 1):
                x, y = column + 0.5, row + 0.5
                # Edge functions: all positive inside, and in proportion to the corners' weights.
                wc, wa = a0 * x + b0 * y + c0, a1 * x + b1 * y + c1
                wb = a2 * x + b2 * y + c2
                if wa < 0 or wb < 0 or wc < 0:
                    continue
                total = 1.0 / (wa + wb + wc)
                near = (wa * a[2] + wb * b[2] + wc * c[2]) * total
                if cover[row, column, 0] == _ZERO or near > cover[row, column, 1]:
                    alpha = (wa * opacity[ia] + wb * opacity[ib] + wc * opacity[ic]) * total
                    cover[row, column, 0] = alpha
                    cover[row, column, 1] = near


@njit(cache=True)
def blur_shadow(cover: FloatArray, weights: FloatArray) -> FloatArray:
    """Return opacity, and opacity times depth, of `cast` blurred by weights (2 R + 1,)."""
    (size, width), reach = cover.shape[:2], len(weights) // 2
    across, whole = np.zeros_like(cover), np.zeros_like(cover)
    line = np.empty(2 * width, np.float32)
    for row in range(size):
        if not cover[row, :, 0].any():
            continue
        for column in range(width):
            line[2 * column] = cover[row, column, 0]
            # Premultiplied: depth counts as much as its texel is opaque.
            line[2 * column + 1] = cover[row, column, 0] * cover[row, column, 1]
        found = across[row].reshape(2 * width)
        # Separable: along the row, then added to the rows around.
        for k in range(len(weights)):
            for i in range(2 * reach, 2 * (width - reach)):
                found[i] += weights[k] * line[i + 2 * (k - reach)]
        for k in range(len(weights)):
            to = row - k + reach
            if reach <= to < size - reach:
                target = whole[to].reshape(2 * width)
                for i in range(2 * width):
                    target[i] += weights[k] * found[i]
    return whole


@njit(cache=True, inner=True)
def shadow_reach(shadow: FloatArray) -> FloatArray:
    """Return the first and last column, then row, between which `blur_shadow` left any shadow."""
    last_row, last_column = shadow.shape[0] - 1, shadow.shape[1] - 1
    left, right, top, bottom = last_column, 0, last_row, 0
    for row in range(last_row + 1):
        for column in range(last_column + 1):
            if shadow[row, column, 0] > _ZERO:
                left, right = min(left, column - 1), max(right, column + 1)
                top, bottom = min(top, row - 1), max(bottom, row + 1)
    found = np.empty(4, np.float32)
    found[0], found[1] = max(left, 0), min(right, last_column)
    found[2], found[3] = max(top, 0), min(bottom, last_row)
    return found
