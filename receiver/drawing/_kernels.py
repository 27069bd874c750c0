"""Compiled loops of the receiver: drawing the avatar's triangles.

A picture is drawn in bands of a few rows. The opaque triangles of a band go into a visibility
buffer, four samples a pixel; each pixel is then lit once where its samples see one smooth surface.
Triangles with a transparent corner are mixed over that. Colours are mixed as they are shown
(gamma 2.2), which WebGL does as well.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

FloatArray = NDArray[np.float32]
IntArray = NDArray[np.int32]

_BAND = 16
"""Rows of a band: its buffers stay in the processor's cache."""

# Samples of a pixel, from its middle: the pattern of graphics processors.
_SAMPLE_X = np.array([-0.125, 0.375, -0.375, 0.125])
_SAMPLE_Y = np.array([-0.375, -0.125, 0.125, 0.375])

_TIE = 2.0**-17
"""Half of the smallest step of an edge function of corners on a grid of 1/256 pixel."""

_NEAR_EDGE = 1e-10
"""Pixels by which a rounded crossing may be beside its edge: less than `_TIE` can make of it."""

_ZERO, _ONE, _HALF = np.float32(0), np.float32(1), np.float32(0.5)
_GAMMA_STEPS = np.float32(1024)
_GAMMA = ((np.arange(1026) / 1024) ** (2 / 2.2)).astype(np.float32)
"""Shown brightness, over the square root of linear light times `_GAMMA_STEPS`."""

BLENDED, CASTS = 1, 2
"""Kinds of triangles: a corner is transparent; it throws the shadow and receives none."""


@njit(cache=True)
def add_normals(points: FloatArray, triangles: IntArray, values: FloatArray) -> None:
    """Write the unit normals of a surface into the first three columns of `values`, (V, 3 ...)."""
    values[:, :3] = _ZERO
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


@njit(cache=True)
def _edge(x0: float, y0: float, x1: float, y1: float) -> tuple[float, float, float]:
    """Edge function ``a x + b y + c``, not negative inside; a place on the edge has one side."""
    dx, dy = x1 - x0, y1 - y0
    tie = 0.0 if dy < 0 or (dy == 0 and dx > 0) else _TIE
    return -dy, dx, dy * x0 - dx * y0 - tie


@njit(cache=True)
def _bounds(
    points: FloatArray, triangles: IntArray, width: int, height: int, spread: float
) -> IntArray:
    """First and last row and column (F, 4) of each triangle; none of one seen from behind."""
    found = np.empty((len(triangles), 4), np.int32)
    for f in range(len(triangles)):
        i, j, k = triangles[f, 0], triangles[f, 1], triangles[f, 2]
        ax, bx, cx = points[i, 0], points[j, 0], points[k, 0]
        ay, by, cy = points[i, 1], points[j, 1], points[k, 1]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        found[f, 0], found[f, 1], found[f, 2], found[f, 3] = _BAND, -1, 0, -1
        if area < 0:
            found[f, 0] = max(0, int(np.ceil(min(ay, by, cy) - 0.5 - spread)))
            found[f, 1] = min(height - 1, int(np.floor(max(ay, by, cy) - 0.5 + spread)))
            found[f, 2] = max(0, int(np.ceil(min(ax, bx, cx) - 0.5 - spread)))
            found[f, 3] = min(width - 1, int(np.floor(max(ax, bx, cx) - 0.5 + spread)))
    return found


@njit(cache=True)
def _sort(bounds: IntArray, kinds: NDArray[np.uint8], bands: int) -> tuple[IntArray, IntArray]:
    """List the triangles of each band, opaque ones before the others, in their order.

    Returns the list and where in it the parts begin: ``2 * bands + 1`` numbers.
    """
    starts = np.zeros(2 * bands + 1, np.int32)
    for f in range(len(bounds)):
        for band in range(bounds[f, 0] // _BAND, bounds[f, 1] // _BAND + 1):
            starts[2 * band + (kinds[f] & BLENDED) + 1] += 1
    starts = np.cumsum(starts).astype(np.int32)
    ends, found = starts.copy(), np.empty(starts[-1], np.int32)
    for f in range(len(bounds)):
        for band in range(bounds[f, 0] // _BAND, bounds[f, 1] // _BAND + 1):
            part = 2 * band + (kinds[f] & BLENDED)
            found[ends[part]] = f
            ends[part] += 1
    return found, starts


@njit(cache=True, error_model="numpy")
def _see(
    points: FloatArray, triangles: IntArray, f: int, bounds: IntArray, top: int,
    depth: FloatArray, seen: IntArray,
) -> None:  # fmt: skip
    """Enter an opaque triangle into a band's visibility buffer, (rows, 4, width)."""
    ia, ic, ib = triangles[f, 0], triangles[f, 1], triangles[f, 2]
    ax, ay, az = np.float64(points[ia, 0]), np.float64(points[ia, 1]), np.float64(points[ia, 2])
    bx, by, bz = np.float64(points[ib, 0]), np.float64(points[ib, 1]), np.float64(points[ib, 2])
    cx, cy, cz = np.float64(points[ic, 0]), np.float64(points[ic, 1]), np.float64(points[ic, 2])
    a0, b0, c0 = _edge(ax, ay, bx, by)
    a1, b1, c1 = _edge(bx, by, cx, cy)
    a2, b2, c2 = _edge(cx, cy, ax, ay)
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    across = ((bz - az) * (cy - ay) - (cz - az) * (by - ay)) / area
    down = ((cz - az) * (bx - ax) - (bz - az) * (cx - ax)) / area
    r0, r1, r2 = -1.0 / a0, -1.0 / a1, -1.0 / a2
    step = np.float32(across)
    for row in range(max(top, bounds[f, 0]), min(top + len(depth) - 1, bounds[f, 1]) + 1):
        line = row - top
        for s in range(4):
            y, shift = row + 0.5 + _SAMPLE_Y[s], 0.5 + _SAMPLE_X[s]
            left, right = np.float64(bounds[f, 2]), np.float64(bounds[f, 3])
            left, right = _clip(left, right, a0, r0, b0 * y + c0, shift)
            left, right = _clip(left, right, a1, r1, b1 * y + c1, shift)
            left, right = _clip(left, right, a2, r2, b2 * y + c2, shift)
            if left > right:
                continue
            first = int(left) + (int(left) < left)
            near = np.float32(az + (first + shift - ax) * across + (y - ay) * down)
            for column in range(first, int(right) + 1):
                if near > depth[line, s, column]:
                    depth[line, s, column] = near
                    seen[line, s, column] = f
                near += step


@njit(cache=True)
def _clip(
    left: float, right: float, a: float, r: float, rest: float, shift: float
) -> tuple[float, float]:
    """Keep columns where ``a (column + shift) + rest`` is not negative; ``r = -1 / a``."""
    if a > 0:
        return max(left, rest * r - shift - _NEAR_EDGE), right
    if a < 0:
        return left, min(right, rest * r - shift + _NEAR_EDGE)
    return (left, right) if rest >= 0 else (1.0, 0.0)


@njit(cache=True, error_model="numpy", fastmath=True)
def _light(
    n: int, owners: IntArray, places: FloatArray, points: FloatArray, triangles: IntArray,
    values: FloatArray, kinds: NDArray[np.uint8], light: FloatArray, shadow: FloatArray,
    to_light: FloatArray, lit: FloatArray,
) -> None:  # fmt: skip
    """Light `n` places (2, N) of triangles `owners`: shown red, green, blue, opacity (8, N)."""
    for i in range(n):
        f = owners[i]
        ia, ib, ic = triangles[f, 0], triangles[f, 1], triangles[f, 2]
        x, y = places[0, i], places[1, i]
        ax, ay = x - points[ia, 0], y - points[ia, 1]
        bx, by = points[ib, 0] - points[ia, 0], points[ib, 1] - points[ia, 1]
        cx, cy = points[ic, 0] - points[ia, 0], points[ic, 1] - points[ia, 1]
        area = _ONE / (bx * cy - cx * by)
        wb = min(_ONE, max(_ZERO, (ax * cy - cx * ay) * area))
        wc = min(_ONE, max(_ZERO, (bx * ay - ax * by) * area))
        wa = max(_ZERO, _ONE - wb - wc)
        total = _ONE / (wa + wb + wc)
        wa, wb, wc = wa * total, wb * total, wc * total
        for k in range(8):
            lit[k, i] = wa * values[ia, k] + wb * values[ib, k] + wc * values[ic, k]
        lit[8, i] = wa * points[ia, 2] + wb * points[ib, 2] + wc * points[ic, 2]
    _shade(n, owners, places, kinds, light, shadow, to_light, lit)
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


@njit(cache=True, error_model="numpy", fastmath=True)
def _shade(
    n: int, owners: IntArray, places: FloatArray, kinds: NDArray[np.uint8], light: FloatArray,
    shadow: FloatArray, to_light: FloatArray, lit: FloatArray,
) -> None:  # fmt: skip
    """Turn the nearness of lit places, ``lit[8]``, into the share of the key light they receive."""
    m00, m01, m02, m03 = to_light[0, 0], to_light[0, 1], to_light[0, 2], to_light[0, 3]
    m10, m11, m12, m13 = to_light[1, 0], to_light[1, 1], to_light[1, 2], to_light[1, 3]
    width, height = np.float32(shadow.shape[1] - 1), np.float32(shadow.shape[0] - 1)
    for i in range(n):
        x, y, far = places[0, i], places[1, i], _ONE / lit[8, i]
        lit[8, i] = _ONE
        u = (m00 * x + m01 * y + m02) * far + m03
        v = (m10 * x + m11 * y + m12) * far + m13
        if u < _ZERO or v < _ZERO or u >= width or v >= height or kinds[owners[i]] & CASTS:
            continue
        column, row = np.uint32(u), np.uint32(v)
        p, q = u - np.float32(column), v - np.float32(row)
        a, b, c, d = (_ONE - p) * (_ONE - q), p * (_ONE - q), (_ONE - p) * q, p * q
        cover = a * shadow[row, column, 0] + b * shadow[row, column + 1, 0]
        cover += c * shadow[row + 1, column, 0] + d * shadow[row + 1, column + 1, 0]
        if cover < np.float32(0.004):
            continue
        depth = a * shadow[row, column, 1] + b * shadow[row, column + 1, 1]
        depth += c * shadow[row + 1, column, 1] + d * shadow[row + 1, column + 1, 1]
        gap = to_light[2, 0] * x + to_light[2, 1] * y + to_light[2, 2]
        gap = depth / cover - gap * far - to_light[2, 3]
        contact = min(_ONE, max(_ZERO, gap / light[8, 1]))
        lit[8, i] -= light[8, 0] * cover * contact / (_ONE + max(_ZERO, gap) / light[8, 2])


@njit(cache=True)
def _find(
    row: int, seen: IntArray, triangles: IntArray, owners: IntArray, places: FloatArray,
    members: IntArray,
) -> int:  # fmt: skip
    """Find what to light in a row of the visibility buffer (4, width); return how many places.

    Samples of triangles that share a corner are one smooth surface, lit once. `members` holds the
    column times 16 and a bit for each sample.
    """
    n = 0
    for x in range(seen.shape[1]):
        f = seen[0, x]
        if f == seen[1, x] and f == seen[2, x] and f == seen[3, x]:
            if f >= 0:
                owners[n], members[n] = f, x << 4 | 15
                places[0, n], places[1, n] = x + 0.5, row + 0.5
                n += 1
            continue
        done = 0
        for s in range(4):
            f = seen[s, x]
            if f < 0 or done >> s & 1:
                continue
            mine, count, at_x, at_y = 1 << s, 1, _SAMPLE_X[s], _SAMPLE_Y[s]
            i, j, k = triangles[f, 0], triangles[f, 1], triangles[f, 2]
            for t in range(s + 1, 4):
                g = seen[t, x]
                if g != f:
                    if g < 0 or done >> t & 1:
                        continue
                    a, b, c = triangles[g, 0], triangles[g, 1], triangles[g, 2]
                    if (
                        a != i and a != j and a != k and b != i and b != j and b != k
                        and c != i and c != j and c != k
                    ):  # fmt: skip
                        continue
                mine |= 1 << t
                count += 1
                at_x += _SAMPLE_X[t]
                at_y += _SAMPLE_Y[t]
            done |= mine
            owners[n], members[n] = f, x << 4 | mine
            places[0, n], places[1, n] = x + 0.5 + at_x / count, row + 0.5 + at_y / count
            n += 1
    return n


@njit(cache=True)
def _cover(
    row: int, points: FloatArray, triangles: IntArray, f: int, bounds: IntArray,
    depth: FloatArray, owners: IntArray, places: FloatArray, members: IntArray,
) -> int:  # fmt: skip
    """Find the pixels of a row, depth (4, width), that a transparent triangle covers; as `_find`.

    Its depth is entered.
    """
    ia, ic, ib = triangles[f, 0], triangles[f, 1], triangles[f, 2]
    ax, ay, az = np.float64(points[ia, 0]), np.float64(points[ia, 1]), points[ia, 2]
    bx, by, bz = np.float64(points[ib, 0]), np.float64(points[ib, 1]), points[ib, 2]
    cx, cy, cz = np.float64(points[ic, 0]), np.float64(points[ic, 1]), points[ic, 2]
    a0, b0, c0 = _edge(ax, ay, bx, by)
    a1, b1, c1 = _edge(bx, by, cx, cy)
    a2, b2, c2 = _edge(cx, cy, ax, ay)
    n = 0
    for column in range(bounds[f, 2], bounds[f, 3] + 1):
        mine = 0
        for s in range(4):
            x, y = column + 0.5 + _SAMPLE_X[s], row + 0.5 + _SAMPLE_Y[s]
            wc, wa, wb = a0 * x + b0 * y + c0, a1 * x + b1 * y + c1, a2 * x + b2 * y + c2
            total = wa + wb + wc
            if wa < 0 or wb < 0 or wc < 0 or total <= 0:  # a triangle may shrink to a line
                continue
            near = (wa * az + wb * bz + wc * cz) / total
            if near > depth[s, column]:
                depth[s, column] = near
                mine |= 1 << s
        if mine:
            owners[n], members[n] = f, column << 4 | mine
            places[0, n], places[1, n] = column + 0.5, row + 0.5
            n += 1
    return n


@njit(cache=True)
def _mix(
    n: int, members: IntArray, lit: FloatArray, mixed: NDArray[np.bool_], samples: FloatArray,
    pixels: FloatArray,
) -> None:  # fmt: skip
    """Lay lit places over pixels (width, 4), or over their samples where those are mixed."""
    for i in range(n):
        x = members[i] >> 4
        if not mixed[x]:
            if members[i] & 15 == 15:
                pixels[x, 0], pixels[x, 1], pixels[x, 2] = lit[3, i], lit[4, i], lit[5, i]
                pixels[x, 3] = _ONE
                continue
            for s in range(4):
                share = np.float32(members[i] >> s & 1) * np.float32(0.25)
                for k in range(3):
                    pixels[x, k] += share * lit[3 + k, i]
                pixels[x, 3] += share
            continue
        alpha = lit[7, i]
        for s in range(4):
            if members[i] >> s & 1:
                for k in range(3):
                    samples[x, s, k] += alpha * (lit[3 + k, i] - samples[x, s, k])
                samples[x, s, 3] += alpha * (_ONE - samples[x, s, 3])


@njit(cache=True)
def draw_triangles(
    points: FloatArray, triangles: IntArray, values: FloatArray, kinds: NDArray[np.uint8],
    light: FloatArray, shadow: FloatArray, to_light: FloatArray, picture: NDArray[np.uint8],
) -> None:  # fmt: skip
    """Draw lit triangles over a picture.

    Parameters
    ----------
    points : (V, 3)
        Pixels to the right and down, in whole 1/256; nearness (linear over the picture).
    triangles : (F, 3)
        Those seen from behind are left out; transparent ones are drawn in this order.
    values : (V, 8)
        Normal, linear red, green, blue, gloss and opacity, 0..1.
    kinds : (F,)
        Sums of `BLENDED` and `CASTS`.
    light : (9, 3)
        As `receiver.drawing.portrait.LIGHT`.
    shadow : (N, N, 2)
        From `blur_shadow`.
    to_light : (3, 4)
        With it ``(x, y, 1) / nearness, 1`` becomes column, row and depth of the shadow.
    picture : (H, W, 3)
        Updated.
    """
    height, width = picture.shape[:2]
    bounds = _bounds(points, triangles, width, height, 0.375)
    listed, starts = _sort(bounds, kinds, (height + _BAND - 1) // _BAND)
    depth = np.empty((_BAND, 4, width), np.float32)
    seen = np.empty((_BAND, 4, width), np.int32)
    samples = np.empty((_BAND, width, 4, 4), np.float32)
    pixels = np.empty((_BAND, width, 4), np.float32)
    mixed = np.empty((_BAND, width), np.bool_)
    owners, members = np.empty(4 * width, np.int32), np.empty(4 * width, np.int32)
    places, lit = np.empty((2, 4 * width), np.float32), np.empty((9, 4 * width), np.float32)
    for top in range(0, height, _BAND):
        first, middle, end = starts[2 * (top // _BAND) :][:3]
        if first == end:
            continue
        last = min(top + _BAND, height) - 1
        depth[:], seen[:], pixels[:], mixed[:] = _ZERO, -1, _ZERO, False
        for f in listed[first:middle]:
            _see(points, triangles, f, bounds, top, depth, seen)
        for f in listed[middle:end]:
            for row in range(max(top, bounds[f, 0]), min(last, bounds[f, 1]) + 1):
                mixed[row - top, bounds[f, 2] : bounds[f, 3] + 1] = True
        for row in range(last - top + 1):
            for x in range(width):
                if mixed[row, x]:
                    samples[row, x] = _ZERO
            n = _find(top + row, seen[row], triangles, owners, places, members)
            _light(
                n, owners, places, points, triangles, values, kinds, light, shadow, to_light, lit
            )
            _mix(n, members, lit, mixed[row], samples[row], pixels[row])
        for f in listed[middle:end]:
            for row in range(max(top, bounds[f, 0]), min(last, bounds[f, 1]) + 1):
                n = _cover(
                    row, points, triangles, f, bounds, depth[row - top], owners, places, members
                )
                _light(
                    n, owners, places, points, triangles, values, kinds, light, shadow, to_light,
                    lit,
                )  # fmt: skip
                _mix(n, members, lit, mixed[row - top], samples[row - top], pixels[row - top])
        for row in range(last - top + 1):
            _show(pixels[row], mixed[row], samples[row], picture[top + row])


@njit(cache=True)
def _show(
    pixels: FloatArray, mixed: NDArray[np.bool_], samples: FloatArray, line: NDArray[np.uint8]
) -> None:
    """Lay pixels (width, 4), or samples where they are mixed, over a line of the picture."""
    quarter = np.float32(0.25)
    for x in range(len(pixels)):
        if mixed[x]:
            for k in range(4):
                a, b = samples[x, 0, k] + samples[x, 1, k], samples[x, 2, k] + samples[x, 3, k]
                pixels[x, k] = (a + b) * quarter
        if pixels[x, 3] > _ZERO:
            through = _ONE - pixels[x, 3]
            for k in range(3):
                value = pixels[x, k] * np.float32(255) + through * np.float32(line[x, k])
                line[x, k] = np.uint8(min(np.float32(255), value) + _HALF)


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
    bounds = _bounds(points, triangles, cover.shape[1], cover.shape[0], 0.0)
    for f in range(len(triangles)):
        ia, ic, ib = triangles[f]
        a, b, c = points[ia], points[ib], points[ic]
        a0, b0, c0 = _edge(np.float64(a[0]), np.float64(a[1]), np.float64(b[0]), np.float64(b[1]))
        a1, b1, c1 = _edge(np.float64(b[0]), np.float64(b[1]), np.float64(c[0]), np.float64(c[1]))
        a2, b2, c2 = _edge(np.float64(c[0]), np.float64(c[1]), np.float64(a[0]), np.float64(a[1]))
        for row in range(bounds[f, 0], bounds[f, 1] + 1):
            for column in range(bounds[f, 2], bounds[f, 3] + 1):
                x, y = column + 0.5, row + 0.5
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
            line[2 * column + 1] = cover[row, column, 0] * cover[row, column, 1]
        found = across[row].reshape(2 * width)
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
