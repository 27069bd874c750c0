"""Compiled loops of the receiver: drawing the avatar's triangles.

A picture is drawn in bands of a few rows. The opaque triangles of a band go into a visibility
buffer, four samples a pixel; each pixel is then lit once where its samples see one smooth surface.
Triangles with a transparent corner are mixed over that. Colours are mixed as they are shown
(gamma 2.2), which WebGL does as well.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit
from receiver.drawing._light_kernels import light_places
from receiver.drawing._shadow_kernels import shadow_reach
from receiver.drawing._visibility_kernels import BAND, bounds_of, cover_row, find, see, sort_by_band

FloatArray = NDArray[np.float32]
IntArray = NDArray[np.int32]

_ZERO, _ONE, _HALF = np.float32(0), np.float32(1), np.float32(0.5)


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
    bounds = bounds_of(points, triangles, width, height, 0.375)
    listed, starts = sort_by_band(bounds, kinds, (height + BAND - 1) // BAND)
    depth = np.empty((BAND, 4, width), np.float32)
    seen = np.empty((BAND, 4, width), np.int32)
    samples = np.empty((BAND, width, 4, 4), np.float32)
    pixels = np.empty((BAND, width, 4), np.float32)
    mixed = np.empty((BAND, width), np.bool_)
    firsts, ends = np.empty(4 * BAND, np.int32), np.empty(4 * BAND, np.int32)
    nears = np.empty(4 * BAND, np.float32)
    owners, members = np.empty(4 * width, np.int32), np.empty(4 * width, np.int32)
    places, lit = np.empty((2, 4 * width), np.float32), np.empty((9, 4 * width), np.float32)
    corners, reach = np.empty((3, 9), np.float32), shadow_reach(shadow)
    # In bands of rows: depths of the opaque triangles; light for what is seen of them; then the
    # transparent ones in front of that, in their order.
    for top in range(0, height, BAND):
        first, middle, end = starts[2 * (top // BAND) :][:3]
        if first == end:
            continue
        last = min(top + BAND, height) - 1
        depth[:], seen[:], pixels[:], mixed[:] = _ZERO, -1, _ZERO, False
        left, right = width, 0
        for f in listed[first:middle]:
            see(points, triangles, f, bounds, top, depth, seen, firsts, ends, nears)
            left, right = min(left, bounds[f, 2]), max(right, bounds[f, 3] + 1)
        for f in listed[middle:end]:
            for row in range(max(top, bounds[f, 0]), min(last, bounds[f, 1]) + 1):
                mixed[row - top, bounds[f, 2] : bounds[f, 3] + 1] = True
        for row in range(last - top + 1):
            for x in range(width):
                if mixed[row, x]:
                    samples[row, x] = _ZERO
            n = find(top + row, row, left, right, seen[row], triangles, owners, places, members)
            light_places(
                n, owners, places, points, triangles, values, kinds, light, shadow, reach,
                to_light, corners, lit,
            )  # fmt: skip
            mix(n, members, lit, mixed, samples, pixels)
        n = 0
        for f in listed[middle:end]:
            for row in range(max(top, bounds[f, 0]), min(last, bounds[f, 1]) + 1):
                if n + bounds[f, 3] - bounds[f, 2] >= len(owners):
                    light_places(
                        n, owners, places, points, triangles, values, kinds, light, shadow, reach,
                        to_light, corners, lit,
                    )  # fmt: skip
                    mix(n, members, lit, mixed, samples, pixels)
                    n = 0
                n = cover_row(
                    n, row, row - top, points, triangles, f, bounds, depth, owners, places, members
                )
        light_places(
            n, owners, places, points, triangles, values, kinds, light, shadow, reach,
            to_light, corners, lit,
        )  # fmt: skip
        mix(n, members, lit, mixed, samples, pixels)
        for row in range(last - top + 1):
            show(pixels[row], mixed[row], samples[row], picture[top + row])


@njit(cache=True, inner=True)
def mix(
    n: int,
    members: IntArray,
    lit: FloatArray,
    mixed: NDArray[np.bool_],
    samples: FloatArray,
    pixels: FloatArray,
) -> None:
    """Lay lit places over pixels (rows, width, 4) of a band, or over samples where they mix."""
    for i in range(n):
        # A member packs row, column (12 bits) and which of the four samples it covers.
        row, x = members[i] >> 16, members[i] >> 4 & 4095
        # One surface alone: its share of the pixel. Several: sample by sample, blended by alpha.
        if not mixed[row, x]:
            if members[i] & 15 == 15:
                for k in range(3):
                    pixels[row, x, k] = lit[3 + k, i]
                pixels[row, x, 3] = _ONE
                continue
            for s in range(4):
                share = np.float32(members[i] >> s & 1) * np.float32(0.25)
                for k in range(3):
                    pixels[row, x, k] += share * lit[3 + k, i]
                pixels[row, x, 3] += share
            continue
        alpha = lit[7, i]
        for s in range(4):
            if members[i] >> s & 1:
                for k in range(3):
                    samples[row, x, s, k] += alpha * (lit[3 + k, i] - samples[row, x, s, k])
                samples[row, x, s, 3] += alpha * (_ONE - samples[row, x, s, 3])


@njit(cache=True, inner=True)
def show(
    pixels: FloatArray, mixed: NDArray[np.bool_], samples: FloatArray, line: NDArray[np.uint8]
) -> None:
    """Lay pixels (width, 4), or samples where they are mixed, over a line of the picture."""
    quarter = np.float32(0.25)
    for x in range(len(pixels)):
        if mixed[x]:
            for k in range(4):
                a, b = samples[x, 0, k] + samples[x, 1, k], samples[x, 2, k] + samples[x, 3, k]
                pixels[x, k] = (a + b) * quarter
        if pixels[x, 3] == _ONE:
            for k in range(3):
                line[x, k] = np.uint8(pixels[x, k] * np.float32(255) + _HALF)
        elif pixels[x, 3] > _ZERO:
            through = _ONE - pixels[x, 3]
            for k in range(3):
                value = pixels[x, k] * np.float32(255) + through * np.float32(line[x, k])
                line[x, k] = np.uint8(min(np.float32(255), value) + _HALF)
