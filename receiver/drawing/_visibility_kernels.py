"""Which triangle is seen where: a visibility buffer of four samples a pixel, band by band.

Triangles and their corners in the picture go in; for each row the places to be lit come out.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

FloatArray = NDArray[np.float32]
IntArray = NDArray[np.int32]

BAND = 16
"""Rows of a band: its buffers stay in the processor's cache."""

# Samples of a pixel, from its middle: the pattern of graphics processors.
SAMPLE_X = np.array([-0.125, 0.375, -0.375, 0.125])
SAMPLE_Y = np.array([-0.375, -0.125, 0.125, 0.375])

_SHIFTS = np.tile(0.5 + SAMPLE_X, BAND)
"""From a pixel's column to its samples, line by line of samples: these lie a quarter apart."""

_TIE = 2.0**-17
"""Half of the smallest step of an edge function of corners on a grid of 1/256 pixel."""

_NEAR_EDGE = 1e-10
"""Most pixels between a rounded crossing and its edge: less than `_TIE` can make of it."""

_ZERO = np.float32(0)

_FAR = 1e6
"""Pixels beyond every picture."""

BLENDED, CASTS = 1, 2
"""Kinds of triangles: a corner is transparent; it throws the shadow and receives none."""


@njit(cache=True, inner=True)
def edge(x0: float, y0: float, x1: float, y1: float) -> tuple[float, float, float]:
    """Edge function ``a x + b y + c``, not negative inside; a place on the edge has one side."""
    dx, dy = x1 - x0, y1 - y0
    tie = 0.0 if dy < 0 or (dy == 0 and dx > 0) else _TIE
    return -dy, dx, dy * x0 - dx * y0 - tie


@njit(cache=True, inner=True)
def bounds_of(
    points: FloatArray, triangles: IntArray, width: int, height: int, spread: float
) -> IntArray:
    """First and last row and column (F, 4) of each triangle; none of one seen from behind."""
    found = np.empty((len(triangles), 4), np.int32)
    for f in range(len(triangles)):
        i, j, k = triangles[f, 0], triangles[f, 1], triangles[f, 2]
        ax, bx, cx = points[i, 0], points[j, 0], points[k, 0]
        ay, by, cy = points[i, 1], points[j, 1], points[k, 1]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        found[f, 0], found[f, 1], found[f, 2], found[f, 3] = BAND, -1, 0, -1
        if area < 0:
            found[f, 0] = max(0, int(np.ceil(min(ay, by, cy) - 0.5 - spread)))
            found[f, 1] = min(height - 1, int(np.floor(max(ay, by, cy) - 0.5 + spread)))
            found[f, 2] = max(0, int(np.ceil(min(ax, bx, cx) - 0.5 - spread)))
            found[f, 3] = min(width - 1, int(np.floor(max(ax, bx, cx) - 0.5 + spread)))
    return found


@njit(cache=True, inner=True)
def sort_by_band(
    bounds: IntArray, kinds: NDArray[np.uint8], bands: int
) -> tuple[IntArray, IntArray]:
    """List the triangles of each band, opaque ones before the others, in their order.

    Returns the list and where in it the parts begin: ``2 * bands + 1`` numbers.
    """
    starts = np.empty(2 * bands + 1, np.int32)
    for part in range(2 * bands + 1):
        starts[part] = 0
    for f in range(len(bounds)):
        for band in range(bounds[f, 0] // BAND, bounds[f, 1] // BAND + 1):
            starts[2 * band + (kinds[f] & BLENDED) + 1] += 1
    ends = np.empty(2 * bands, np.int32)
    for part in range(2 * bands):
        ends[part] = starts[part]
        starts[part + 1] += starts[part]
    found = np.empty(starts[2 * bands], np.int32)
    for f in range(len(bounds)):
        for band in range(bounds[f, 0] // BAND, bounds[f, 1] // BAND + 1):
            part = 2 * band + (kinds[f] & BLENDED)
            found[ends[part]] = f
            ends[part] += 1
    return found, starts


@njit(cache=True, inner=True, error_model="numpy")
def see(
    points: FloatArray, triangles: IntArray, f: int, bounds: IntArray, top: int,
    depth: FloatArray, seen: IntArray, firsts: IntArray, ends: IntArray, nears: FloatArray,
) -> None:  # fmt: skip
    """Enter an opaque triangle into a band's visibility buffer, (rows, 4, width).

    The last three arrays, of `4 * BAND`, are for use here: where each line of samples begins and
    ends, and how near it begins.
    """
    ia, ic, ib = triangles[f, 0], triangles[f, 1], triangles[f, 2]
    ax, ay, az = np.float64(points[ia, 0]), np.float64(points[ia, 1]), np.float64(points[ia, 2])
    bx, by, bz = np.float64(points[ib, 0]), np.float64(points[ib, 1]), np.float64(points[ib, 2])
    cx, cy, cz = np.float64(points[ic, 0]), np.float64(points[ic, 1]), np.float64(points[ic, 2])
    a0, b0, c0 = edge(ax, ay, bx, by)
    a1, b1, c1 = edge(bx, by, cx, cy)
    a2, b2, c2 = edge(cx, cy, ax, ay)
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    across = ((bz - az) * (cy - ay) - (cz - az) * (by - ay)) / area
    down = ((cz - az) * (bx - ax) - (bz - az) * (cx - ax)) / area
    # Edge functions a x + b y + c (Pineda 1988), not negative inside: each bounds a line of samples
    # at the left or at the right.
    l0, m0, r0, s0 = _sides(a0, b0, c0)
    l1, m1, r1, s1 = _sides(a1, b1, c1)
    l2, m2, r2, s2 = _sides(a2, b2, c2)
    low, high = np.float64(bounds[f, 2]), np.float64(bounds[f, 3])
    row, line = max(top, bounds[f, 0]), max(top, bounds[f, 0]) - top
    n = 4 * (min(top + BAND - 1, bounds[f, 1]) + 1 - row)
    start = row + 0.5 + SAMPLE_Y[0]
    for i in range(n):
        y, shift = start + 0.25 * i, _SHIFTS[i]
        left = max(max(l0 * y + m0, l1 * y + m1), l2 * y + m2) - shift
        right = min(min(r0 * y + s0, r1 * y + s1), r2 * y + s2) - shift
        left = np.ceil(max(left, low))
        firsts[i], ends[i] = np.int32(left), np.int32(np.floor(min(right, high))) + 1
        nears[i] = np.float32(az + (left + shift - ax) * across + (y - ay) * down)
    if a0 == 0 or a1 == 0 or a2 == 0:
        for i in range(n):
            y = start + 0.25 * i
            if (
                (a0 == 0 and b0 * y + c0 < 0)
                or (a1 == 0 and b1 * y + c1 < 0)
                or (a2 == 0 and b2 * y + c2 < 0)
            ):
                ends[i] = firsts[i]
    step = np.float32(across)
    for i in range(n):
        near = nears[i]
        for column in range(firsts[i], ends[i]):
            if near > depth[line + (i >> 2), i & 3, column]:
                depth[line + (i >> 2), i & 3, column] = near
                seen[line + (i >> 2), i & 3, column] = f
            near += step


@njit(cache=True, inner=True, error_model="numpy")
def _sides(a: float, b: float, c: float) -> tuple[float, float, float, float]:
    """Return where a line begins and ends that an edge bounds: both as ``slope * y + start``."""
    if a > 0:
        return -b / a, -c / a - _NEAR_EDGE, 0.0, _FAR
    if a < 0:
        return 0.0, -_FAR, -b / a, -c / a + _NEAR_EDGE
    return 0.0, -_FAR, 0.0, _FAR


@njit(cache=True, inner=True)
def _touch(triangles: IntArray, f: int, g: int) -> bool:
    """Return whether two triangles share a corner."""
    i, j, k = triangles[f, 0], triangles[f, 1], triangles[f, 2]
    a, b, c = triangles[g, 0], triangles[g, 1], triangles[g, 2]
    return a in (i, j, k) or b in (i, j, k) or c in (i, j, k)


@njit(cache=True, inner=True)
def find(
    row: int, line: int, first: int, end: int, seen: IntArray, triangles: IntArray,
    owners: IntArray, places: FloatArray, members: IntArray,
) -> int:  # fmt: skip
    """Find what to light in a row of the visibility buffer (4, width); return how many places.

    The row is the `line` of a band's; columns before `first` and from `end` on are empty.

    Samples of triangles that share a corner are one smooth surface, lit once. `members` holds
    line, column and a bit for each sample.
    """
    n = 0
    for x in range(first, end):
        f, g, h, e = seen[0, x], seen[1, x], seen[2, x], seen[3, x]
        if f < 0 and g < 0 and h < 0 and e < 0:
            continue
        # One surface in all four samples: lit once, at the pixel's middle.
        if (f == g and f == h and f == e) or (
            min(min(f, g), min(h, e)) >= 0
            and (g == f or _touch(triangles, f, g))
            and (h in (f, g) or _touch(triangles, f, h))
            and (e in (f, g, h) or _touch(triangles, f, e))
        ):
            owners[n], members[n] = f, line << 16 | x << 4 | 15
            places[0, n], places[1, n] = x + 0.5, row + 0.5
            n += 1
            continue
        done = 0
        for s in range(4):
            f = seen[s, x]
            if f < 0 or done >> s & 1:
                continue
            mine, count, at_x, at_y = 1 << s, 1, SAMPLE_X[s], SAMPLE_Y[s]
            for t in range(s + 1, 4):
                g = seen[t, x]
                if g != f and (g < 0 or done >> t & 1 or not _touch(triangles, f, g)):
                    continue
                mine |= 1 << t
                count += 1
                at_x += SAMPLE_X[t]
                at_y += SAMPLE_Y[t]
            done |= mine
            owners[n], members[n] = f, line << 16 | x << 4 | mine
            places[0, n], places[1, n] = x + 0.5 + at_x / count, row + 0.5 + at_y / count
            n += 1
    return n


@njit(cache=True, inner=True)
def cover_row(
    n: int, row: int, line: int, points: FloatArray, triangles: IntArray, f: int,
    bounds: IntArray, depth: FloatArray, owners: IntArray, places: FloatArray, members: IntArray,
) -> int:  # fmt: skip
    """Add the pixels of a row that a transparent triangle covers to `n` places; as `find`.

    Its depth is entered: the row is the `line` of a band's, (rows, 4, width).
    """
    ia, ic, ib = triangles[f, 0], triangles[f, 1], triangles[f, 2]
    ax, ay, az = np.float64(points[ia, 0]), np.float64(points[ia, 1]), points[ia, 2]
    bx, by, bz = np.float64(points[ib, 0]), np.float64(points[ib, 1]), points[ib, 2]
    cx, cy, cz = np.float64(points[ic, 0]), np.float64(points[ic, 1]), points[ic, 2]
    a0, b0, c0 = edge(ax, ay, bx, by)
    a1, b1, c1 = edge(bx, by, cx, cy)
    a2, b2, c2 = edge(cx, cy, ax, ay)
    for column in range(bounds[f, 2], bounds[f, 3] + 1):
        mine = 0
        for s in range(4):
            x, y = column + 0.5 + SAMPLE_X[s], row + 0.5 + SAMPLE_Y[s]
            wc, wa, wb = a0 * x + b0 * y + c0, a1 * x + b1 * y + c1, a2 * x + b2 * y + c2
            total = wa + wb + wc
            if wa < 0 or wb < 0 or wc < 0 or total <= 0:  # a triangle may shrink to a line
                continue
            near = (wa * az + wb * bz + wc * cz) / total
            if near > depth[line, s, column]:
                depth[line, s, column] = near
                mine |= 1 << s
        if mine:
            owners[n], members[n] = f, line << 16 | column << 4 | mine
            places[0, n], places[1, n] = column + 0.5, row + 0.5
            n += 1
    return n
