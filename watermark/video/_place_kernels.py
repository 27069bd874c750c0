"""Compiled loops of the search for the place of a marked picture.

Arrays in, arrays filled in place out; no checks.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

FloatArray = NDArray[np.float64]
PixelArray = NDArray[np.float32]
IntArray = NDArray[np.int64]
IndexArray = NDArray[np.uint64]
VoteArray = NDArray[np.int16]


@njit(cache=True)
def even_lines(picture: PixelArray, axis: int, back: bool, even: float, same: float) -> int:
    """Count the lines at one end of a picture that are even and alike.

    axis : 0 for lines across, 1 for lines down; back : from the last one; even : standard deviation
    that no such line has; same : difference between its mean and that of the outermost line that no
    such line has.
    """
    count, length = int(picture.shape[axis]), int(picture.shape[1 - axis])
    outermost = 0.0
    for n in range(count):
        line = count - 1 - n if back else n
        total = squares = 0.0
        base = picture[line, 0] if axis == 0 else picture[0, line]
        for k in range(length):
            value = float((picture[line, k] if axis == 0 else picture[k, line]) - base)
            total += value
            squares += value * value
        mean = total / length
        deviation = np.sqrt(max(0.0, squares / length - mean * mean))
        mean += base
        if n == 0:
            outermost = mean
        if deviation >= even or abs(mean - outermost) >= same:
            return n
    return count


@njit(cache=True)
def resample_into(
    picture: PixelArray,
    rows: IntArray,
    row_weights: PixelArray,
    columns: IntArray,
    column_weights: PixelArray,
    margin: int,
    out: PixelArray,
) -> None:
    """Show a picture at another size inside a margin; four source lines and columns make one.

    rows : (height, 4) and columns : (width, 4), with weights of the same shapes; out : (height + 2
    margin, width + 2 margin).
    """
    line = np.empty(picture.shape[1], dtype=np.float32)
    for y in range(rows.shape[0]):
        # One expression of four terms takes a third less time than four passes over the line.
        first, second = picture[rows[y, 0]], picture[rows[y, 1]]
        third, fourth = picture[rows[y, 2]], picture[rows[y, 3]]
        w0, w1, w2, w3 = row_weights[y]
        for x in range(line.shape[0]):
            line[x] = w0 * first[x] + w1 * second[x] + w2 * third[x] + w3 * fourth[x]
        shown = out[margin + y]
        for x in range(columns.shape[0]):
            source, weights = columns[x], column_weights[x]
            total = np.float32(0.0)
            for k in range(4):
                total += weights[k] * line[np.uint64(source[k])]
            shown[margin + x] = total


@njit(cache=True)
def halve_into(picture: PixelArray, out: PixelArray) -> None:
    """Mean of each square of 2 x 2 pixels; out : (rows, columns)."""
    quarter = np.float32(0.25)
    for i in range(out.shape[0]):
        upper, lower = picture[2 * i], picture[2 * i + 1]
        line = out[i]
        for j in range(line.shape[0]):
            total = upper[2 * j] + upper[2 * j + 1] + lower[2 * j] + lower[2 * j + 1]
            line[j] = quarter * total


@njit(cache=True)
def fine_texture_into(half: PixelArray, out: PixelArray) -> None:
    """Texture of cells of 4 x 4 pixels of a halved picture, one at each; out : (rows, columns)."""
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
def pilot_fields_into(
    picture: PixelArray,
    pilots: IntArray,
    first_x: IntArray,
    first_y: IntArray,
    factors: PixelArray,
    out: PixelArray,
) -> None:
    """Amplitude of each pilot at every displacement of its cell by whole pixels.

    pilots : (count, 3) template, row, column; first_x : (columns,) and first_y : (rows,), first
    pixel of the cell at the least displacement; factors : (2, 8), dipole and hump; out :
    (count, displacements down, displacements across).
    """
    down, across = out.shape[1], out.shape[2]
    line = np.empty(across + 7, dtype=np.float32)
    for p in range(out.shape[0]):
        a0, a1, a2, a3, a4, a5, a6, a7 = factors[1 - pilots[p, 0]]
        b0, b1, b2, b3, b4, b5, b6, b7 = factors[pilots[p, 0]]
        x0, y0 = first_x[pilots[p, 2]], first_y[pilots[p, 1]]
        for i in range(down):
            # Eight terms in one expression: passes over so short lines would be mostly overhead.
            y, end = y0 + i, x0 + line.shape[0]
            s0, s1, s2 = picture[y, x0:end], picture[y + 1, x0:end], picture[y + 2, x0:end]
            s3, s4, s5 = picture[y + 3, x0:end], picture[y + 4, x0:end], picture[y + 5, x0:end]
            s6, s7 = picture[y + 6, x0:end], picture[y + 7, x0:end]
            for j in range(line.shape[0]):
                upper = a0 * s0[j] + a1 * s1[j] + a2 * s2[j] + a3 * s3[j]
                line[j] = upper + a4 * s4[j] + a5 * s5[j] + a6 * s6[j] + a7 * s7[j]
            values = out[p, i]
            for j in range(across):
                left = b0 * line[j] + b1 * line[j + 1] + b2 * line[j + 2] + b3 * line[j + 3]
                left += b4 * line[j + 4] + b5 * line[j + 5]
                values[j] = left + b6 * line[j + 6] + b7 * line[j + 7]


@njit(cache=True, inner=True)
def wave_of(place: Any) -> Any:
    """Cosine of an angle in turns within .002: its series up to the tenth power."""
    away = place - np.floor(place + np.float32(0.5))
    u = away * away
    value = np.float32(60.24464) - u * np.float32(26.42626)
    value = np.float32(-85.45682) + u * value
    value = np.float32(64.93939) + u * value
    value = np.float32(-19.739209) + u * value
    return np.float32(1.0) + u * value


@njit(cache=True, inner=True)
def lattice_waves(place: Any, above: Any, wider: Any, spread: Any) -> Any:
    """Mean wave of a pilot's three lattices and its weight, by their probabilities.

    place : amplitude less dither in fine steps; above, wider : probabilities of the second lattice
    or a wider one, and of the third; spread : twice the variance of the first one's phase.
    """
    one = np.float32(1.0)
    fine = (one - above) / (one + spread)
    coarse = (above - wider) / (one + spread * np.float32(1 / 9))
    widest = wider / (one + spread * np.float32(1 / 25))
    wave = fine * wave_of(place) + coarse * wave_of(place * np.float32(1 / 3))
    return wave + widest * wave_of(place * np.float32(1 / 5)), fine + coarse + widest


@njit(cache=True, error_model="numpy")
def pilot_votes_into(
    fields: PixelArray, texture: PixelArray, pilots: IntArray, first_x: IntArray,
    first_y: IntArray, bounds: IntArray, dither: PixelArray, step: float, signs: PixelArray,
    limits: PixelArray, error: float, scale: float, out: VoteArray,
) -> float:  # fmt: skip
    """Votes of the pilots for every displacement; the return is their mean square, summed.

    Where the amplitude changes with the place, a small error of place turns the vote: it then has
    little weight.

    fields : of `pilot_fields_into`, with one displacement more on each side than out; texture : of
    cells that start at every second pixel; bounds : last pixel down and across at which a cell may
    start, and the margin before the first; signs : (count,); limits : (2, 2), textures from which a
    cell may and must have the second lattice, and the third; error : of place in pixels that the
    weights allow for; scale : of the votes, and the vote that means nothing, so that none is below
    0; out : (count, displacements across, and down, more of these for whole words).
    """
    across, down = out.shape[1], fields.shape[1] - 2
    zero, one, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    unit = np.float32(1.0 / step)
    weight = unit * unit * np.float32(2 * np.pi**2 * error * error / 4)
    units = np.array([1 / (limits[0, 1] - limits[0, 0]), 1 / (limits[1, 1] - limits[1, 0])])
    units = units.astype(np.float32)
    line, seen = np.empty(across, dtype=np.float32), np.empty(across, dtype=np.float32)
    squares = 0.0
    for p in range(out.shape[0]):
        x0, y0 = first_x[pilots[p, 2]] + 1, first_y[pilots[p, 1]] + 1
        # A cell has to lie in the picture as a whole.
        begin, end = max(0, bounds[2] - x0), min(across, bounds[1] + 1 - x0)
        out[p] = np.int16(scale)
        factor = np.float32(scale) * signs[p]
        for i in range(max(0, bounds[2] - y0), min(down, bounds[0] + 1 - y0)):
            row = texture[(y0 + i) >> 1]
            for j in range(across):
                seen[j] = row[(x0 + j) >> 1]
            upper, here, lower = fields[p, i], fields[p, i + 1], fields[p, i + 2]
            for j in range(across):
                gx, gy = here[j + 2] - here[j], lower[j + 1] - upper[j + 1]
                above = min(max((seen[j] - limits[0, 0]) * units[0], zero), one)
                wider = min(max((seen[j] - limits[1, 0]) * units[1], zero), one)
                place = here[j + 1] * unit - dither[p]
                line[j], _ = lattice_waves(place, above, wider, (gx * gx + gy * gy) * weight)
            for j in range(begin, end):
                vote = np.floor(factor * line[j] + half)
                out[p, j, i] = np.int16(vote + np.float32(scale))
                squares += vote * vote
    return float(squares / (across * down))


@njit(cache=True)
def place_scores_into(
    votes: VoteArray, pilots: IntArray, across: IndexArray, down: IndexArray, none: int,
    unit: float, memory: float, table: PixelArray, best: PixelArray, choice: IntArray,
) -> None:  # fmt: skip
    """Add up the pilots' votes for every place: in each row over columns, then over rows.

    Only places with an even sum of indices count. Sums are parts of 16 bits of a word of 64: of
    four displacements down first, then of four places across, every second one.

    votes : of `pilot_votes_into`; pilots : (count, 3), in ascending order of the rows; across :
    (places across, columns) and down : (places down, rows), displacements as indices of `votes`;
    none : sum of the votes that mean nothing; unit : factor of a squared sum; memory
    : weight of the table so far; table : (places across, places down), the squared sum is added;
    best : (places across,), greatest value of the table; choice : (places across,), its place down.
    """
    words = votes.view(np.uint64)
    places, rows = down.shape
    part, low = np.uint64(16), np.uint64(0xFFFF)
    sums = np.empty((rows, votes.shape[2]), dtype=np.uint64)
    row_words = np.empty(words.shape[2], dtype=np.uint64)
    row_sums = row_words.view(np.uint16)
    keep, factor = np.float32(memory), np.float32(unit)
    for begin in range(across.shape[0]):
        if begin % 8 > 1:
            continue
        places_across = range(begin, min(begin + 8, across.shape[0]), 2)
        sums[:] = 0
        # Four places across share a word of 64 bits; `shift` leads to a place's 16 of them.
        for x in places_across:
            shift = np.uint64(8 * (x - begin))
            p = 0
            for r in range(rows):
                row_words[:] = 0
                while p < pilots.shape[0] and pilots[p, 1] == r:
                    four = words[p, across[x, pilots[p, 2]]]
                    for w in range(row_words.shape[0]):
                        row_words[w] += four[w]
                    p += 1
                line = sums[r]
                for k in range(line.shape[0]):
                    line[k] += np.uint64(row_sums[k]) << shift
            best[x] = -1.0
        for y in range(begin & 1, places, 2):
            total = np.uint64(0)
            shown = down[y]
            for r in range(rows):
                total += sums[r, shown[r]]
            for x in places_across:
                total_sum = np.float32(np.int64(total & low) - none)
                total >>= part
                value = keep * table[x, y] + factor * total_sum * total_sum
                table[x, y] = value
                if value > best[x]:
                    best[x], choice[x] = value, y


@njit(cache=True, inner=True, error_model="numpy")
def crop_score(
    fields: PixelArray, texture: PixelArray, pilots: IntArray, first: PixelArray,
    size: PixelArray, dither: PixelArray, step: float, signs: PixelArray, limits: PixelArray,
    error: float, crops: FloatArray, work: PixelArray,
) -> float:  # fmt: skip
    """Score of a place in standard deviations of noise, from `pilot_fields_into`.

    first : (count, 2), first displacement of each pilot's cell in pixels, across and down; size :
    width and height of the box in pixels, of the margin, and cells across and down; crops : cells
    that are missing left, right, at the top, at the bottom; work : (6, count), overwritten; others
    as in `pilot_votes_into`.
    """
    zero, one, two, half = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(0.5)
    three, five = np.float32(3.0), np.float32(5.0)
    unit = one / np.float32(step)
    # A place that is off by `error` pixels weakens the wave by exp(-2 pi^2 error^2 |gradient|^2 /
    # step^2).
    reach = np.float32(2 * np.pi**2 * error * error) * unit * unit
    cell_x = size[0] / np.float32(size[3] - crops[0] - crops[1])
    cell_y = size[1] / np.float32(size[4] - crops[2] - crops[3])
    left, top = np.float32(crops[0]) - half, np.float32(crops[2]) - half
    margin, right, bottom = size[2], size[0] - np.float32(8.0), size[1] - np.float32(8.0)
    last_row, last_column = fields.shape[1] - 3, fields.shape[2] - 3
    places, spreads, seen, mine = work[0], work[1], work[2], work[3]
    waves, squares = work[4], work[5]
    # 1. One pilot at a time: its amplitude, and how the field falls and rises around it.
    count = np.uint64(0)
    for p in range(pilots.shape[0]):
        # Corner of the pilot's cell in this crop; pilots in the cropped part do not count.
        x = cell_x * (np.float32(pilots[p, 2]) - left) - np.float32(4.0)
        y = cell_y * (np.float32(pilots[p, 1]) - top) - np.float32(4.0)
        if x < 0 or y < 0 or x > right or y > bottom:
            continue
        seen[count] = texture[np.int64(y + margin) >> 1, np.int64(x + margin) >> 1]
        x += margin - first[p, 0]
        y += margin - first[p, 1]
        i, j = np.int64(y), np.int64(x)
        if i < 1 or j < 1 or i > last_row or j > last_column:
            continue
        # Catmull-Rom interpolation, along rows and then across them.
        f = x - np.float32(j)
        w0, w3 = half * f * (f * (two - f) - one), half * f * f * (f - one)
        w1 = one + half * f * f * (three * f - five)
        w2 = one - w0 - w1 - w3
        field = fields[p]
        n0, n1, n2, n3 = np.uint64(j - 1), np.uint64(j), np.uint64(j + 1), np.uint64(j + 2)
        line = field[i - 1]
        above = w0 * line[n0] + w1 * line[n1] + w2 * line[n2] + w3 * line[n3]
        line = field[i]
        # Slope of the field: how much a small error of place would turn the wave.
        gx = line[n2] - line[n1]
        upper = w0 * line[n0] + w1 * line[n1] + w2 * line[n2] + w3 * line[n3]
        line = field[i + 1]
        lower = w0 * line[n0] + w1 * line[n1] + w2 * line[n2] + w3 * line[n3]
        line = field[i + 2]
        below = w0 * line[n0] + w1 * line[n1] + w2 * line[n2] + w3 * line[n3]
        gy = lower - upper
        f = y - np.float32(i)
        w0, w3 = half * f * (f * (two - f) - one), half * f * f * (f - one)
        w1 = one + half * f * f * (three * f - five)
        w2 = one - w0 - w1 - w3
        value = w0 * above + w1 * upper + w2 * lower + w3 * below
        places[count] = value * unit - dither[p]
        spreads[count] = (gx * gx + gy * gy) * reach
        mine[count] = signs[p]
        count += np.uint64(1)
    # 2. All together: their waves.
    wider_from, widest_from = limits[0, 0], limits[1, 0]
    scale, wide = one / (limits[0, 1] - wider_from), one / (limits[1, 1] - widest_from)
    for q in range(np.int64(count)):
        second = min(max((seen[q] - wider_from) * scale, zero), one)
        third = min(max((seen[q] - widest_from) * wide, zero), one)
        wave, weight = lattice_waves(places[q], second, third, spreads[q])
        waves[q] = mine[q] * wave
        squares[q] = weight * weight
    total = power = np.float32(0.0)
    for q in range(np.int64(count)):
        total += waves[q]
        power += squares[q]
    return float(abs(total) / np.sqrt(half * power + np.float32(1e-9)))


@njit(cache=True, error_model="numpy")
def climb_into(
    fields: PixelArray, texture: PixelArray, pilots: IntArray, first: PixelArray,
    size: PixelArray, dither: PixelArray, step: float, signs: PixelArray, limits: PixelArray,
    error: float, moves: FloatArray, rounds: int, crops: FloatArray, scores: FloatArray,
) -> None:  # fmt: skip
    """Move and stretch places as long as their scores grow.

    As `crop_score`; moves : (count, 4), changes of the crops; crops : (places, 4) and scores :
    (places,), changed.
    """
    trial = np.empty(4)
    work = np.empty((6, pilots.shape[0]), dtype=np.float32)
    for n in range(crops.shape[0]):
        scores[n] = crop_score(
            fields, texture, pilots, first, size, dither, step, signs, limits, error, crops[n], work
        )
        for _ in range(rounds):
            better = False
            for move in range(moves.shape[0]):
                for k in range(4):
                    trial[k] = crops[n, k] + moves[move, k]
                reached = crop_score(
                    fields, texture, pilots, first, size, dither, step, signs, limits, error, trial,
                    work,
                )  # fmt: skip
                if reached > scores[n]:
                    scores[n], better = reached, True
                    for k in range(4):
                        crops[n, k] = trial[k]
            if not better:
                break
