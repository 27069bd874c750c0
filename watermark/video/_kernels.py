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


@njit(cache=True, nogil=True)
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
    amplitude: FloatArray, wide: FloatArray, across: PixelArray, down: PixelArray,
    wide_across: PixelArray, wide_down: PixelArray, column_start: IntArray, row_start: IntArray,
    out: PixelArray,
) -> None:  # fmt: skip
    """Paint the sum of the templates and the blurred templates with an amplitude each per cell.

    amplitude : (templates, rows, columns); wide : of blurred templates, with a cell more on each
    side; across : (templates, width), down : (templates, height), as in `project_into`;
    wide_across : (templates, 3, width), wide_down : (templates, 3, height), of the cell before, of
    the pixel's own and of the next; out : (height, width).
    """
    templates, rows, columns = amplitude.shape
    own = np.empty((templates, columns), dtype=np.float32)
    sums = np.empty((templates, columns + 2), dtype=np.float32)
    for r in range(rows):
        for y in range(row_start[r], row_start[r + 1]):
            for t in range(templates):
                for c in range(columns):
                    own[t, c] = down[t, y] * amplitude[t, r, c]
                for c in range(columns + 2):
                    total = 0.0
                    for i in range(3):
                        total += wide_down[t, i, y] * wide[t, r + i, c]
                    sums[t, c] = total
            for c in range(columns):
                for x in range(column_start[c], column_start[c + 1]):
                    value = np.float32(0.0)
                    for t in range(templates):
                        value += own[t, c] * across[t, x]
                        for i in range(3):
                            value += sums[t, c + i] * wide_across[t, i, x]
                    out[y, x] = value


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


@njit(cache=True, nogil=True)
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
            # Means of the sixteen parts of a cell.
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
            # Of its four quarters, the one whose four means differ least: an edge through a cell
            # spoils some quarters, texture all of them.
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
def reduce_into(
    luma: NDArray[Any], factor: int, scale: float, line: NDArray[Any], out: NDArray[np.uint16]
) -> None:
    """Scaled mean of each square of factor x factor pixels.

    line : (factor * (width // factor),), of a type that holds a sum of `factor` samples; out :
    (height // factor, width // factor); a mean becomes `scale` times itself, rounded.
    """
    weight, half = np.float32(scale / (factor * factor)), np.float32(0.5)
    for y in range(out.shape[0]):
        first, small = luma[factor * y], out[y]
        if factor == 3:  # 1080 lines: known factors are faster
            second, third = luma[3 * y + 1], luma[3 * y + 2]
            for x in range(line.shape[0]):
                line[x] = np.int32(first[x]) + np.int32(second[x]) + np.int32(third[x])
            for x in range(small.shape[0]):
                total = (
                    np.int32(line[3 * x]) + np.int32(line[3 * x + 1]) + np.int32(line[3 * x + 2])
                )
                small[x] = np.int32(np.float32(total) * weight + half)
            continue
        for x in range(line.shape[0]):
            line[x] = first[x]
        for i in range(1, factor):
            more = luma[factor * y + i]
            for x in range(line.shape[0]):
                line[x] += more[x]
        for x in range(small.shape[0]):
            total = np.int32(0)
            for j in range(factor):
                total += np.int32(line[factor * x + j])
            small[x] = np.int32(np.float32(total) * weight + half)


@njit(cache=True)
def waves_into(
    values: FloatArray,
    shares: FloatArray,
    dither: FloatArray,
    step: float,
    cosine: PixelArray,
    out: FloatArray,
) -> float:
    """How far each pilot speaks for bit 0; the return is the standard deviation of their sum.

    A value far from 0 comes from a textured cell, where a small error of place moves it: it has
    little weight. Values that are NaN have none.

    shares : (3, count), probabilities of the steps; cosine : a turn in 512 steps.
    """
    squares = 1e-9
    for p in range(values.shape[0]):
        if np.isnan(values[p]):
            out[p] = 0.0
            continue
        place = values[p] / step
        weight = 1 / (1 + place * place)
        place -= dither[p]
        weight *= shares[0, p]
        out[p] = (
            weight * cosine[int((place + 1024.0) * 512) & 511]
            + shares[1, p] * cosine[int((place / 3 + 1024.0) * 512) & 511]
            + shares[2, p] * cosine[int((place / 5 + 1024.0) * 512) & 511]
        )
        weight += shares[1, p] + shares[2, p]
        squares += weight * weight
    return float(np.sqrt(squares / 2))


@njit(cache=True)
def accumulate_into(frame: NDArray[np.uint16], factor: int, out: NDArray[np.int32]) -> None:
    """Add a small frame `factor` times; out : (rows, columns)."""
    times = np.int32(factor)
    for y in range(out.shape[0]):
        line, total = frame[y], out[y]
        for x in range(total.shape[0]):
            total[x] += times * np.int32(line[x])


@njit(cache=True)
def scale_into(frame: NDArray[Any], factor: float, out: PixelArray) -> None:
    """Multiply a small frame or a sum of them; out : (rows, columns)."""
    unit = np.float32(factor)
    for y in range(out.shape[0]):
        line, scaled = frame[y], out[y]
        for x in range(scaled.shape[0]):
            scaled[x] = unit * np.float32(line[x])


@njit(cache=True)
def shares_into(
    texture: PixelArray, left: float, top: float, width: float, height: float, pilots: IntArray,
    cell: int, limits: FloatArray, blur: float, out: FloatArray,
) -> None:  # fmt: skip
    """Probabilities of the pilots' lattices at a place, as `watermark.video.lattices` has them.

    texture : of cells of `cell` pixels that start at every second pixel; left, top : of the place
    in pixels; width, height : of its cells; pilots : (count, 3); limits : (2,), logarithms of the
    seen textures from which the next lattice is likelier; out : (3, count).
    """
    rows, columns = texture.shape
    for p in range(pilots.shape[0]):
        x = left + width * (pilots[p, 2] + 0.5)
        y = top + height * (pilots[p, 1] + 0.5)
        i = int(min(max((y - cell / 2) / 2 + 0.5, 0.0), rows - 1.0))
        j = int(min(max((x - cell / 2) / 2 + 0.5, 0.0), columns - 1.0))
        seen = np.log(max(float(texture[i, j]), 1e-3))
        rest = 1.0
        for k in range(limits.shape[0]):
            above = 1 / (1 + np.exp(-min(max((seen - limits[k]) / blur, -30.0), 30.0)))
            out[k, p] = rest - above
            rest = above
        out[limits.shape[0], p] = rest


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
    # Amplitude = <pattern, picture> / <pattern, pattern>. The pattern is separable: a turn of a
    # sine without its mean along one axis, sin^2 along the other.
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
