"""Compiled loops of the video carrier.

Luma frames of any integer type in, float arrays filled in place out; no checks.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

FloatArray = NDArray[np.float64]
PixelArray = NDArray[np.float32]
IntArray = NDArray[np.int64]


@njit(cache=True)
def project_into(
    luma: NDArray[Any],
    across: PixelArray,
    down: PixelArray,
    column_start: IntArray,
    row_start: IntArray,
    out: FloatArray,
) -> None:
    """Project each cell of a frame onto the templates.

    across : (templates, width), down : (templates, height), factors of the separable templates;
    column_start : (columns + 1,), row_start : (rows + 1,); out : (templates, rows, columns).
    """
    width = luma.shape[1]
    sums = np.empty(width, dtype=np.float32)
    for t in range(out.shape[0]):
        for r in range(out.shape[1]):
            sums[:] = 0.0
            for y in range(row_start[r], row_start[r + 1]):
                weight = down[t, y]
                for x in range(width):
                    sums[x] += weight * np.float32(luma[y, x])
            for c in range(out.shape[2]):
                total = 0.0
                for x in range(column_start[c], column_start[c + 1]):
                    total += across[t, x] * sums[x]
                out[t, r, c] = total


@njit(cache=True)
def paint_into(
    amplitude: FloatArray,
    across: PixelArray,
    down: PixelArray,
    column_start: IntArray,
    row_start: IntArray,
    out: PixelArray,
) -> None:
    """Paint the sum of the templates with an amplitude per cell; out : (height, width)."""
    for r in range(amplitude.shape[1]):
        for y in range(row_start[r], row_start[r + 1]):
            for c in range(amplitude.shape[2]):
                for x in range(column_start[c], column_start[c + 1]):
                    total = 0.0
                    for t in range(amplitude.shape[0]):
                        total += amplitude[t, r, c] * down[t, y] * across[t, x]
                    out[y, x] = total


@njit(cache=True)
def add_into(
    luma: NDArray[Any],
    first: PixelArray,
    second: PixelArray,
    weight: float,
    black: float,
    white: float,
    out: NDArray[Any],
) -> None:
    """Add (1 - weight) * first + weight * second to luma, rounded up from a threshold of the pixel.

    Rounding to nearest would leave nothing of a weak pattern but a dot in each cell: a grid. The
    thresholds are evenly spread over every few pixels (interleaved gradient noise, Jimenez 2014)
    and do not change in time. No value leaves black..white that was in that range, and none outside
    goes further away.
    """
    w1, w0 = np.float32(weight), np.float32(1.0 - weight)
    least, most = np.float32(black), np.float32(white)
    for y in range(luma.shape[0]):
        for x in range(luma.shape[1]):
            own = np.float32(luma[y, x])
            threshold = np.float32(52.9829189 * ((0.06711056 * x + 0.00583715 * y) % 1.0) % 1.0)
            value = own + w0 * first[y, x] + w1 * second[y, x] + threshold
            out[y, x] = int(min(max(value, min(own, least)), max(own, most)))


@njit(cache=True)
def texture_into(
    luma: NDArray[Any], column_start: IntArray, row_start: IntArray, out: FloatArray
) -> None:
    """Least standard deviation of the four means in a quarter of each cell; out : (rows, columns).

    column_start : (4 * columns + 1,), row_start : (4 * rows + 1,), borders of sixteenths of cells.
    A cell with an empty sixteenth has none.
    """
    means = np.empty((4, 4))
    for r in range(out.shape[0]):
        for c in range(out.shape[1]):
            empty = False
            for i in range(4):
                y0, y1 = row_start[4 * r + i], row_start[4 * r + i + 1]
                for j in range(4):
                    x0, x1 = column_start[4 * c + j], column_start[4 * c + j + 1]
                    total = 0.0
                    for y in range(y0, y1):
                        for x in range(x0, x1):
                            total += luma[y, x]
                    count = (y1 - y0) * (x1 - x0)
                    empty = empty or count == 0
                    means[i, j] = total / max(1, count)
            least = np.inf
            for i in range(0, 4, 2):
                for j in range(0, 4, 2):
                    centre = 0.0
                    for k in range(4):
                        centre += means[i + k // 2, j + k % 2] / 4
                    variance = 0.0
                    for k in range(4):
                        variance += (means[i + k // 2, j + k % 2] - centre) ** 2 / 4
                    least = min(least, variance)
            out[r, c] = 0.0 if empty else np.sqrt(least)


@njit(cache=True)
def reduce_into(luma: NDArray[Any], factor: int, scale: float, out: NDArray[np.uint16]) -> None:
    """Scaled mean of each square of factor x factor pixels.

    out : (height // factor, width // factor); a mean becomes `scale` times itself, rounded.
    """
    weight = np.float32(scale / (factor * factor))
    width = factor * out.shape[1]
    sums = np.empty(width, dtype=np.int32)
    for y in range(out.shape[0]):
        sums[:] = 0
        for i in range(factor):
            for x in range(width):
                sums[x] += luma[factor * y + i, x]
        for x in range(out.shape[1]):
            total = np.int32(0)
            for j in range(factor):
                total += sums[factor * x + j]
            out[y, x] = int(np.float32(total) * weight + np.float32(0.5))


@njit(cache=True)
def resample_into(
    picture: PixelArray, left: float, top: float, width: float, height: float, out: PixelArray
) -> None:
    """Show a part of a picture, given in its pixels, at another size; linear interpolation."""
    last_x, last_y = picture.shape[1] - 1, picture.shape[0] - 1
    for y in range(out.shape[0]):
        v = min(max(top + (y + 0.5) * height / out.shape[0] - 0.5, 0.0), float(last_y))
        y0 = min(int(v), last_y - 1)
        wy = np.float32(v - y0)
        for x in range(out.shape[1]):
            u = min(max(left + (x + 0.5) * width / out.shape[1] - 0.5, 0.0), float(last_x))
            x0 = min(int(u), last_x - 1)
            wx = np.float32(u - x0)
            upper = picture[y0, x0] + wx * (picture[y0, x0 + 1] - picture[y0, x0])
            lower = picture[y0 + 1, x0] + wx * (picture[y0 + 1, x0 + 1] - picture[y0 + 1, x0])
            out[y, x] = upper + wy * (lower - upper)


@njit(cache=True)
def fine_amplitudes_into(
    picture: PixelArray, across: PixelArray, down: PixelArray, norm: float, out: PixelArray
) -> None:
    """Amplitudes of cells of 8 x 8 pixels that start at every second pixel.

    across, down : (templates, 8); out : (templates, rows, columns).
    """
    width = picture.shape[1]
    line = np.empty(width, dtype=np.float32)
    for t in range(out.shape[0]):
        for i in range(out.shape[1]):
            line[:] = 0.0
            for k in range(8):
                weight = down[t, k] / np.float32(norm)
                for x in range(width):
                    line[x] += weight * picture[2 * i + k, x]
            for j in range(out.shape[2]):
                total = np.float32(0.0)
                for k in range(8):
                    total += across[t, k] * line[2 * j + k]
                out[t, i, j] = total


@njit(cache=True)
def fine_texture_into(picture: PixelArray, out: PixelArray) -> None:
    """Texture of cells of 8 x 8 pixels that start at every second pixel; out : (rows, columns)."""
    half = np.empty((picture.shape[0] // 2, picture.shape[1] // 2), dtype=np.float32)
    for i in range(half.shape[0]):
        for j in range(half.shape[1]):
            upper = picture[2 * i, 2 * j] + picture[2 * i, 2 * j + 1]
            half[i, j] = (upper + picture[2 * i + 1, 2 * j] + picture[2 * i + 1, 2 * j + 1]) / 4
    quarter = np.empty((half.shape[0] - 1, half.shape[1] - 1), dtype=np.float32)
    for i in range(quarter.shape[0]):
        for j in range(quarter.shape[1]):
            a, b = half[i, j], half[i, j + 1]
            c, d = half[i + 1, j], half[i + 1, j + 1]
            mean = (a + b + c + d) / 4
            total = (a - mean) ** 2 + (b - mean) ** 2 + (c - mean) ** 2 + (d - mean) ** 2
            quarter[i, j] = total / 4
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            first = min(quarter[i, j], quarter[i, j + 2])
            second = min(quarter[i + 2, j], quarter[i + 2, j + 2])
            out[i, j] = np.sqrt(min(first, second))


@njit(cache=True)
def local_waves_into(
    amplitude: PixelArray, texture: PixelArray, pilots: IntArray, dither: FloatArray,
    steps: FloatArray, lattice: IntArray, signs: PixelArray,
    limits: FloatArray, cosine: PixelArray, across: IntArray, down: IntArray, out: PixelArray,
) -> float:  # fmt: skip
    """Votes of the pilots for every displacement; the return is the sum of squared weights.

    A value far from 0 comes from a textured cell, where a small error of place moves it: it has
    little weight.

    amplitude, texture : of cells that start at every second pixel; pilots : (count, 3) template,
    row, column;
    steps : (lattices,); lattice : (modes,); signs : (modes, count); limits : textures
    from which a cell may and must have the coarse step; cosine : a turn in 512 steps; across :
    (2, columns) and down : (2, rows), first displacement in use and end, others are left alone;
    out : (count, displacements across, down, 8), each a step of two pixels, modes last.
    """
    reach_x, reach_y = out.shape[1] // 2, out.shape[2] // 2
    rows, columns = texture.shape
    votes = np.zeros(steps.shape[0], dtype=np.float32)
    squares = 0.0
    seen = 0
    for p in range(out.shape[0]):
        t, r, c = pilots[p, 0], pilots[p, 1], pilots[p, 2]
        for dx in range(across[0, c], across[1, c]):
            j = 4 * c + dx - reach_x
            for dy in range(down[0, r], down[1, r]):
                i = 4 * r + dy - reach_y
                if i < 0 or j < 0 or i >= rows or j >= columns:
                    out[p, dx, dy] = 0.0
                    continue
                share = (texture[i, j] - limits[0]) / (limits[1] - limits[0])
                share = min(max(share, 0.0), 1.0)
                for n in range(steps.shape[0]):
                    place = amplitude[t, i, j] / steps[n]
                    weight = 1 / (1 + place * place)
                    place -= dither[p]
                    value = weight * cosine[int((place + 1024.0) * 512) & 511]
                    if share > 0:
                        other = cosine[int((place / 3 + 1024.0) * 512) & 511]
                        value += share * (other - value)
                        weight += share * (1 - weight)
                    votes[n] = value
                squares += weight * weight
                seen += 1
                for m in range(lattice.shape[0]):
                    out[p, dx, dy, m] = signs[m, p] * votes[lattice[m]]
    return float(squares * out.shape[0] / max(1, seen))


@njit(cache=True)
def place_scores_into(
    waves: PixelArray, pilots: IntArray, across: IntArray, down: IntArray, out: PixelArray
) -> None:
    """Sum the pilots' votes for every place and mode: in each row over columns, then over rows.

    waves : of `local_waves_into`; pilots : (count, 3), in ascending order of rows; across :
    (places across, columns) and down : (places down, rows), displacements as indices of `waves`;
    out : (places across, places down, 8).
    """
    length = waves.shape[2] * 8
    flat = waves.reshape(waves.shape[0], waves.shape[1], length)
    sums = np.empty(length, dtype=np.float32)
    out[:] = 0.0
    first = 0
    for r in range(down.shape[1]):
        last = first
        while last < pilots.shape[0] and pilots[last, 1] == r:
            last += 1
        for x in range(across.shape[0]):
            sums[:] = 0.0
            for p in range(first, last):
                votes = flat[p, across[x, pilots[p, 2]]]
                for k in range(length):
                    sums[k] += votes[k]
            for y in range(down.shape[0]):
                start = 8 * down[y, r]
                for m in range(8):
                    out[x, y, m] += sums[start + m]
        first = last


@njit(cache=True)
def vote(
    values: FloatArray, shares: FloatArray, dither: FloatArray, signs: PixelArray, step: float,
    cosine: PixelArray,
) -> float:  # fmt: skip
    """Score of pilots in standard deviations of noise; values that are NaN do not count.

    shares : probabilities of the coarse step; the weights are those of `local_waves_into`.
    """
    total = 0.0
    squares = 1e-9
    for p in range(values.shape[0]):
        if np.isnan(values[p]):
            continue
        place = values[p] / step
        weight = 1 / (1 + place * place)
        place -= dither[p]
        value = weight * cosine[int((place + 1024.0) * 512) & 511]
        other = cosine[int((place / 3 + 1024.0) * 512) & 511]
        value += shares[p] * (other - value)
        weight += shares[p] * (1 - weight)
        total += signs[p] * value
        squares += weight * weight
    return float(abs(total) / np.sqrt(squares / 2))


@njit(cache=True)
def pilot_values_into(
    picture: PixelArray, left: float, top: float, width: float, height: float, pilots: IntArray,
    rows: int, columns: int, sine: PixelArray, out: FloatArray,
) -> None:  # fmt: skip
    """Amplitudes of the pilots at a place in pixels; NaN for cells not whole in the picture.

    pilots : (count, 3) template, row, column; sine : a turn in 512 steps.
    """
    factors = np.empty((2, 64))
    cell = (width / columns, height / rows)
    origin = (left, top)
    for p in range(pilots.shape[0]):
        norm = 1.0
        start = (0, 0)
        count = (0, 0)
        for axis in range(2):
            edge = origin[axis] + cell[axis] * pilots[p, 2 - axis]
            first = int(np.ceil(edge - 0.5))
            last = int(np.ceil(edge + cell[axis] - 0.5))
            if first < 0 or last > picture.shape[1 - axis] or last - first > 64:
                norm = -1.0
                break
            dipole = axis == pilots[p, 0]
            mean = 0.0
            for k in range(first, last):
                turn = (k + 0.5 - edge) / cell[axis]
                if dipole:
                    factors[axis, k - first] = sine[int(turn * 512) & 511]
                    mean += factors[axis, k - first]
                else:
                    factors[axis, k - first] = sine[int(turn * 256) & 511] ** 2
            mean /= max(1, last - first)
            square = 0.0
            for k in range(last - first):
                if dipole:
                    factors[axis, k] -= mean
                square += factors[axis, k] ** 2
            norm *= square
            if axis == 0:
                start, count = (first, 0), (last - first, 0)
            else:
                start, count = (start[0], first), (count[0], last - first)
        if norm <= 0:
            out[p] = np.nan
            continue
        total = 0.0
        for i in range(count[1]):
            part = 0.0
            for k in range(count[0]):
                part += factors[0, k] * picture[start[1] + i, start[0] + k]
            total += factors[1, i] * part
        out[p] = total / norm
