"""Light on places of triangles: linear colours, normals and shadow in, shown colours out."""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit
from receiver.drawing._visibility_kernels import CASTS

FloatArray = NDArray[np.float32]
IntArray = NDArray[np.int32]

_ZERO, _ONE, _HALF = np.float32(0), np.float32(1), np.float32(0.5)
_GAMMA_STEPS = np.float32(1024)
_GAMMA = ((np.arange(1026) / 1024) ** (2 / 2.2)).astype(np.float32)
"""Shown brightness, over the square root of linear light times `_GAMMA_STEPS`."""


@njit(cache=True)
def add_normals(points: FloatArray, triangles: IntArray, values: FloatArray) -> None:
    """Write the unit normals of a surface into the first three columns of `values`, (V, 3 ...)."""
    for v in range(len(values)):
        for c in range(3):
            values[v, c] = _ZERO
    for f in range(len(triangles)):
        i, j, k = triangles[f, 0], triangles[f, 1], triangles[f, 2]
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        ux, uy, uz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
        vx, vy, vz = points[k, 0] - x, points[k, 1] - y, points[k, 2] - z
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for corner in (i, j, k):
            values[corner, 0] += nx
            values[corner, 1] += ny
            values[corner, 2] += nz
    for v in range(len(values)):
        size = np.sqrt(values[v, 0] ** 2 + values[v, 1] ** 2 + values[v, 2] ** 2)
        for c in range(3):
            values[v, c] /= max(size, np.float32(1e-9))


@njit(cache=True, inner=True, error_model="numpy", fastmath=True)
def light_places(
    n: int, owners: IntArray, places: FloatArray, points: FloatArray, triangles: IntArray,
    values: FloatArray, kinds: NDArray[np.uint8], light: FloatArray, shadow: FloatArray,
    reach: FloatArray, to_light: FloatArray, corners: FloatArray, lit: FloatArray,
) -> None:  # fmt: skip
    """Light `n` places (2, N) of triangles `owners`: shown red, green, blue, opacity (9, N).

    reach holds the first and last column and row of the shadow, from `shadow_reach`; corners
    (3, 9) is for use here.
    """
    base, to_b, to_c = corners[0], corners[1], corners[2]
    last, x0, y0, bx, by, cx, cy, area = -1, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    for i in range(n):
        f = owners[i]
        if f != last:  # neighbours in a row are mostly of one triangle
            last = f
            ia, ib, ic = triangles[f, 0], triangles[f, 1], triangles[f, 2]
            x0, y0 = points[ia, 0], points[ia, 1]
            bx, by = points[ib, 0] - x0, points[ib, 1] - y0
            cx, cy = points[ic, 0] - x0, points[ic, 1] - y0
            area = _ONE / (bx * cy - cx * by)
            for k in range(8):
                base[k] = values[ia, k]
                to_b[k] = values[ib, k] - values[ia, k]
                to_c[k] = values[ic, k] - values[ia, k]
            base[8] = points[ia, 2]
            to_b[8] = points[ib, 2] - points[ia, 2]
            to_c[8] = points[ic, 2] - points[ia, 2]
        ax, ay = places[0, i] - x0, places[1, i] - y0
        wb = min(_ONE, max(_ZERO, (ax * cy - cx * ay) * area))
        wc = min(_ONE, max(_ZERO, (bx * ay - ax * by) * area))
        if wb + wc > _ONE:
            total = _ONE / (wb + wc)
            wb, wc = wb * total, wc * total
        for k in range(9):
            lit[k, i] = base[k] + wb * to_b[k] + wc * to_c[k]
    _shade(n, owners, places, kinds, light, shadow, reach, to_light, lit)
    for i in range(n):
        nx, ny, nz = lit[0, i], lit[1, i], lit[2, i]
        size = _ONE / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-12))
        nx, ny, nz = nx * size, ny * size, nz * size
        lit[0, i] = nx * light[0, 0] + ny * light[0, 1] + nz * light[0, 2]
        half = max(_ZERO, nx * light[1, 0] + ny * light[1, 1] + nz * light[1, 2])
        half = half * half
        half = half * half
        half = half * half
        half = half * half
        lit[6, i] *= half * half * lit[8, i]
        lit[1, i] = _HALF + _HALF * ny
        rim = min(_ONE, max(_ZERO, _ONE - nz))
        lit[2, i] = rim * rim * rim
    for k in range(3):
        share, wrap = light[3, k], light[2, k]
        low, high, rim, shine = light[4, k], light[5, k], light[6, k], light[7, k]
        scale = _ONE / (_ONE + wrap)
        for i in range(n):
            key = min(_ONE, max(_ZERO, (lit[0, i] + wrap) * scale))
            key = key * np.sqrt(np.sqrt(key)) * lit[8, i] * share
            key += (low + high * lit[1, i]) * (_HALF + _HALF * lit[8, i]) + rim * lit[2, i]
            colour = lit[3 + k, i] * key + shine * lit[6, i]
            lit[3 + k, i] = np.sqrt(min(_ONE, colour)) * _GAMMA_STEPS
    for k in range(3, 6):
        for i in range(n):
            step = int(lit[k, i])
            share = lit[k, i] - np.float32(step)
            lit[k, i] = _GAMMA[step] + share * (_GAMMA[step + 1] - _GAMMA[step])


@njit(cache=True, inner=True, error_model="numpy", fastmath=True)
def _shade(
    n: int, owners: IntArray, places: FloatArray, kinds: NDArray[np.uint8], light: FloatArray,
    shadow: FloatArray, reach: FloatArray, to_light: FloatArray, lit: FloatArray,
) -> None:  # fmt: skip
    """Turn the nearness of lit places, ``lit[8]``, into the share of the key light they receive."""
    m00, m01, m02, m03 = to_light[0, 0], to_light[0, 1], to_light[0, 2], to_light[0, 3]
    m10, m11, m12, m13 = to_light[1, 0], to_light[1, 1], to_light[1, 2], to_light[1, 3]
    left, right, top, bottom = reach[0], reach[1], reach[2], reach[3]
    for i in range(n):
        x, y, far = places[0, i], places[1, i], _ONE / lit[8, i]
        lit[8, i] = _ONE
        # Perspective: places are in pixels, and depth is 1 / nearness; (u, v) in texels of the
        # shadow map.
        u = (m00 * x + m01 * y + m02) * far + m03
        v = (m10 * x + m11 * y + m12) * far + m13
        if u < left or v < top or u >= right or v >= bottom or kinds[owners[i]] & CASTS:
            continue
        column, row = np.uint32(u), np.uint32(v)
        p, q = u - np.float32(column), v - np.float32(row)
        a, b, c, d = (_ONE - p) * (_ONE - q), p * (_ONE - q), (_ONE - p) * q, p * q
        # Bilinear; channel 1 is depth times opacity, so their quotient is the depth of what casts.
        cover = a * shadow[row, column, 0] + b * shadow[row, column + 1, 0]
        cover += c * shadow[row + 1, column, 0] + d * shadow[row + 1, column + 1, 0]
        if cover < np.float32(0.004):
            continue
        depth = a * shadow[row, column, 1] + b * shadow[row, column + 1, 1]
        depth += c * shadow[row + 1, column, 1] + d * shadow[row + 1, column + 1, 1]
        gap = to_light[2, 0] * x + to_light[2, 1] * y + to_light[2, 2]
        gap = depth / cover - gap * far - to_light[2, 3]
        # No shadow of a surface on itself; the farther its caster, the weaker.
        contact = min(_ONE, max(_ZERO, gap / light[8, 1]))
        lit[8, i] -= light[8, 0] * cover * contact / (_ONE + max(_ZERO, gap) / light[8, 2])
