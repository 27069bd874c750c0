"""Compiled loops of the codec: range coder and coefficient coding.

Contiguous int64 arrays in, arrays filled in place out; no checks, no globals of other modules
(numba's cache would not see them change). All coding arithmetic is on integers below 2**48.

The range coder keeps ``low`` below 2**32 and carries into bytes already written, so that its
output is the plain base-256 expansion of a point of the final interval (spec/bitstream.md,
paragraphs R1 to R6).
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

# The range coder: bits of a frequency, and bounds of the interval (R1 to R4).
PRECISION = 15
TOP = 1 << 32
BOTTOM = 1 << 24
MASK = TOP - 1

RANGE, CODE, SLACK, POSITION, TAIL = 0, 1, 2, 3, 4
"""Fields of a decoder's state: interval width, code minus low, unknown part, bytes read, and the
mask of those low bits of the last byte that are no code."""

# Magnitudes: the symbol of the escape, and the longest prefix behind it (C4).
ESCAPE = 15
MAX_PREFIX = 20


@njit(cache=True, inner=True)
def _carry(out: NDArray[np.uint8], length: int) -> None:
    """Add one to the number in ``out[:length]``."""
    i = length - 1
    while out[i] == 255:
        out[i] = 0
        i -= 1
    out[i] += 1


@njit(cache=True)
def range_encode(
    starts: NDArray[np.int64],
    freqs: NDArray[np.int64],
    count: int,
    certain: bool,
    out: NDArray[np.uint8],
) -> int:
    """Code ``count`` intervals; return the number of bytes written to ``out``.

    ``certain`` ends the code such that every continuation decodes alike; without it only a
    continuation by zero bytes does.
    """
    low, width, length = 0, MASK, 0
    for i in range(count):
        # Subdivide [low, low + width): start and frequency in units of width / 2**PRECISION.
        # The last symbol also takes the rest of the division.
        unit = width >> PRECISION
        low += unit * starts[i]
        if starts[i] + freqs[i] == 1 << PRECISION:
            width -= unit * starts[i]
        else:
            width = unit * freqs[i]
        if low >= TOP:
            _carry(out, length)
            low &= MASK
        # Renormalise: bytes leave once the width has fallen below 2**24.
        while width < BOTTOM:
            out[length] = low >> 24
            length += 1
            low = (low << 8) & MASK
            width <<= 8
    # End: the fewest bytes whose point (and all its continuations) lies in the interval.
    for size in range(5):
        cell = 1 << (32 - 8 * size)
        point = (low + cell - 1) & -cell
        if point + (cell if certain else 1) <= low + width:
            if point >= TOP:
                _carry(out, length)
                point -= TOP
            for j in range(size):
                out[length] = (point >> (24 - 8 * j)) & 255
                length += 1
            break
    return length


@njit(cache=True)
def start_decoding(data: NDArray[np.uint8], state: NDArray[np.int64]) -> None:
    """Set ``state`` before the first symbol of ``data``."""
    state[RANGE], state[CODE], state[SLACK], state[POSITION] = MASK, 0, 0, 0
    for _ in range(4):
        _next_byte(data, state)
    # No encoder writes this one value, and code stays below the interval's width ever after.
    state[CODE] = min(state[CODE], MASK - 1)


@njit(cache=True, inner=True)
def _next_byte(data: NDArray[np.uint8], state: NDArray[np.int64]) -> None:
    position = state[POSITION]
    state[CODE] <<= 8
    # Unknown beyond the whole interval is as unknown as can be.
    state[SLACK] = min(state[SLACK] << 8, MASK - 255)
    if position < data.size:
        state[CODE] |= data[position]
        if position == data.size - 1:
            state[CODE] &= ~state[TAIL]
            state[SLACK] |= state[TAIL]
    else:
        state[SLACK] |= 255
    state[POSITION] = position + 1


@njit(cache=True)
def decode_symbol(
    data: NDArray[np.uint8],
    state: NDArray[np.int64],
    cdf: NDArray[np.int64],
    limit: int,
    certain: bool,
) -> int:
    """Return the next symbol, ``limit`` for all from there on; -1 if it is not certain.

    ``cdf[s]`` is the lower end of symbol ``s``; everything from ``cdf[limit]`` on is one symbol.
    """
    unit = state[RANGE] >> PRECISION
    value = min(state[CODE] // unit, (1 << PRECISION) - 1)
    symbol = 0
    while symbol < limit and value >= cdf[symbol + 1]:
        symbol += 1
    start = cdf[symbol]
    if symbol == limit or cdf[symbol + 1] == 1 << PRECISION:
        width = state[RANGE] - unit * start
    else:
        width = unit * (cdf[symbol + 1] - start)
    if certain and state[CODE] + state[SLACK] >= unit * start + width:
        return -1
    state[CODE] -= unit * start
    state[RANGE] = width
    while state[RANGE] < BOTTOM:
        state[RANGE] <<= 8
        _next_byte(data, state)
    return symbol


@njit(cache=True)
def coefficient_class(scale: int, step: int) -> tuple[int, int]:
    """Return the class of a coefficient, 0..24 or negative if it is never coded, and its shift."""
    ratio = scale - step + 16
    shift = max(0, (ratio - 21) >> 2)
    return ratio - 4 * shift, shift


@njit(cache=True, inner=True)
def _context(q: NDArray[np.int64], before: NDArray[np.int64], i: int, shift: int) -> int:
    """Return 0..3 from the magnitudes of up to three coefficients coded before number ``i``."""
    activity = 0
    for j in range(before.shape[1]):
        if before[i, j] >= 0:
            activity += min(abs(q[before[i, j]]) >> shift, 2)
    return min(activity, 3)


@njit(cache=True)
def encode_coefficients(
    q: NDArray[np.int64],
    first: int,
    scales: NDArray[np.int64],
    before: NDArray[np.int64],
    step: int,
    cdfs: NDArray[np.int64],
    starts: NDArray[np.int64],
    freqs: NDArray[np.int64],
    ends: NDArray[np.int64],
) -> int:
    """Turn coefficients ``q[first:]`` into intervals; return how many.

    ``ends[i]`` receives the number of intervals after coefficient ``i``.
    """
    n = 0
    half = 1 << (PRECISION - 1)
    for i in range(first, q.size):
        kind, shift = coefficient_class(scales[i], step)
        if kind >= 0:
            cdf = cdfs[kind, _context(q, before, i, shift)]
            # magnitude = high * 2**shift + raw bits; high by the context's table up to ESCAPE.
            magnitude = abs(q[i])
            high = magnitude >> shift
            symbol = min(high, ESCAPE)
            starts[n] = cdf[symbol]
            freqs[n] = cdf[symbol + 1] - cdf[symbol]
            n += 1
            if symbol == ESCAPE:
                # Exp-Golomb: as many ones as bits follow, a zero, then the bits below the first 1.
                rest = high - ESCAPE + 1
                bits = 0
                while rest >> (bits + 1) > 0:
                    bits += 1
                for _ in range(bits):
                    starts[n], freqs[n] = half, half
                    n += 1
                if bits < MAX_PREFIX:
                    starts[n], freqs[n] = 0, half
                    n += 1
                for b in range(bits - 1, -1, -1):
                    starts[n], freqs[n] = half * ((rest >> b) & 1), half
                    n += 1
            for b in range(shift - 1, -1, -1):
                starts[n], freqs[n] = half * ((magnitude >> b) & 1), half
                n += 1
            if magnitude > 0:
                starts[n], freqs[n] = half * (1 if q[i] < 0 else 0), half
                n += 1
        ends[i] = n
    return n


@njit(cache=True, inner=True)
def _decode_magnitude(
    data: NDArray[np.uint8],
    state: NDArray[np.int64],
    cdf: NDArray[np.int64],
    flip: NDArray[np.int64],
    shift: int,
) -> int:
    """Return a magnitude, -1 where the data end."""
    magnitude = decode_symbol(data, state, cdf, ESCAPE, True)
    if magnitude < 0:
        return -1
    if magnitude == ESCAPE:
        # Exp-Golomb: ones count the bits that follow the zero; a leading 1 is implied.
        bits = 0
        while bits < MAX_PREFIX:
            bit = decode_symbol(data, state, flip, 1, True)
            if bit < 0:
                return -1
            if bit == 0:
                break
            bits += 1
        rest = 1
        for _ in range(bits):
            bit = decode_symbol(data, state, flip, 1, True)
            if bit < 0:
                return -1
            rest = 2 * rest + bit
        magnitude = rest - 1 + ESCAPE
    for _ in range(shift):
        bit = decode_symbol(data, state, flip, 1, True)
        if bit < 0:
            return -1
        magnitude = 2 * magnitude + bit
    return int(magnitude)


@njit(cache=True)
def decode_coefficients(
    data: NDArray[np.uint8],
    state: NDArray[np.int64],
    q: NDArray[np.int64],
    first: int,
    scales: NDArray[np.int64],
    before: NDArray[np.int64],
    step: int,
    cdfs: NDArray[np.int64],
    flip: NDArray[np.int64],
) -> int:
    """Fill ``q[first:]`` as far as the data are certain; return the index of the first one not.

    A coefficient that is only partly certain counts as missing and stays zero.
    """
    for i in range(first, q.size):
        kind, shift = coefficient_class(scales[i], step)
        if kind < 0:
            continue
        cdf = cdfs[kind, _context(q, before, i, shift)]
        magnitude = _decode_magnitude(data, state, cdf, flip, shift)
        if magnitude < 0:
            return i
        if magnitude > 0:
            sign = decode_symbol(data, state, flip, 1, True)
            if sign < 0:
                return i
            q[i] = -magnitude if sign else magnitude
    return q.size


@njit(cache=True)
def dequantise(
    q: NDArray[np.int64],
    scales: NDArray[np.int64],
    step: int,
    width: int,
    points: NDArray[np.int64],
    out: NDArray[np.int64],
) -> None:
    """Write the value of every index to ``out``, in units of 2**-16 (paragraphs Q3 and Q4).

    ``width`` is the step in those units; ``points[kind, min(|q|, 3) - 1]`` says how far inside
    its cell, in 1/256 of a step, the value lies below the cell's middle.
    """
    for i in range(q.size):
        magnitude = abs(q[i])
        out[i] = 0
        if magnitude > 0:
            kind, shift = coefficient_class(scales[i], step)
            inset = points[max(kind, 0), min(magnitude, 3) - 1] if shift == 0 else 0
            value = ((magnitude * 256 - inset) * width) >> 8
            out[i] = -value if q[i] < 0 else value


@njit(cache=True)
def count_coefficients(
    values: NDArray[np.float64],
    q: NDArray[np.int64],
    scales: NDArray[np.int64],
    before: NDArray[np.int64],
    step: int,
    width: float,
    counts: NDArray[np.int64],
    insets: NDArray[np.float64],
) -> None:
    """Add the symbols of ``q`` to ``counts[kind, context]`` and their insets to ``insets``.

    ``insets[kind, min(|q|, 3) - 1]`` are sum and number of ``|q| - |value| / width``.
    """
    for i in range(q.size):
        kind, shift = coefficient_class(scales[i], step)
        if kind < 0:
            continue
        magnitude = abs(q[i])
        symbol = min(magnitude >> shift, ESCAPE)
        counts[kind, _context(q, before, i, shift), symbol] += 1
        if magnitude > 0 and shift == 0:
            cell = insets[kind, min(magnitude, 3) - 1]
            cell[0] += magnitude - abs(values[i]) / width
            cell[1] += 1


@njit(cache=True, inner=True)
def _cost(magnitude: int, cost: NDArray[np.float64], shift: int) -> float:
    """Return the bits of a magnitude with its sign; ``cost`` are those of the symbols."""
    high = magnitude >> shift
    bits = float(cost[min(high, ESCAPE)]) + shift
    if high >= ESCAPE:
        rest = high - ESCAPE + 1
        while rest > 1:
            bits += 2.0
            rest >>= 1
        bits += 1.0
    if magnitude > 0:
        bits += 1.0
    return bits


@njit(cache=True)
def coefficient_cost(
    q: NDArray[np.int64],
    scales: NDArray[np.int64],
    before: NDArray[np.int64],
    step: int,
    costs: NDArray[np.float64],
) -> float:
    """Return the ideal length of all coefficients in bits."""
    bits = 0.0
    for i in range(q.size):
        kind, shift = coefficient_class(scales[i], step)
        if kind >= 0:
            bits += _cost(abs(q[i]), costs[kind, _context(q, before, i, shift)], shift)
    return bits


@njit(cache=True)
def quantise_rd(
    values: NDArray[np.float64],
    scales: NDArray[np.int64],
    before: NDArray[np.int64],
    step: int,
    width: float,
    weight: float,
    costs: NDArray[np.float64],
    points: NDArray[np.int64],
    q: NDArray[np.int64],
) -> tuple[float, float]:
    """Quantise in scan order, each index such that error plus ``weight`` times bits is least.

    Errors are counted in squared steps. An index's influence on later contexts is not seen.
    Returns the bits and errors of all.
    """
    bits, squares = 0.0, 0.0
    for i in range(values.size):
        q[i] = 0
        kind, shift = coefficient_class(scales[i], step)
        x = abs(values[i]) / width
        if kind < 0:
            squares += x * x
            continue
        top = int(x + 0.5)
        cost = costs[kind, _context(q, before, i, shift)]
        told, error = _cost(0, cost, shift), x
        best, least = 0, x * x + weight * told
        # Besides 0, only the nearest index and the one below can be the best of d**2 + weight * R.
        for magnitude in range(max(1, top - 1), top + 1):
            inset = points[kind, min(magnitude, 3) - 1] / 256.0 if shift == 0 else 0.0
            off, cells = x - magnitude + inset, _cost(magnitude, cost, shift)
            value = off * off + weight * cells
            if value < least:
                best, least, told, error = magnitude, value, cells, off
        q[i] = -best if values[i] < 0 else best
        bits += told
        squares += error * error
    return bits, squares


@njit(cache=True)
def descend(
    q: NDArray[np.int64],
    scales: NDArray[np.int64],
    neighbours: tuple[NDArray[np.int64], NDArray[np.int64]],
    step: int,
    width: float,
    weight: float,
    costs: NDArray[np.float64],
    points: NDArray[np.int64],
    grid: tuple[NDArray[np.int64], NDArray[np.int64]],
    waves: NDArray[np.float64],
    slopes: NDArray[np.float64],
    metric: NDArray[np.float64],
    curves: NDArray[np.float64],
) -> int:
    """Change each index to where error and ``weight`` times bits are least, the others as they are.

    ``neighbours`` are the coefficients coded before each one that its context counts, and those
    whose contexts count it; ``grid`` its channel and its frequency. ``waves`` (T, 32) are the
    courses over time, ``slopes`` (T, P) the error's slope by frame and channel, ``metric``
    (T, P, P) how one channel's change alters them, ``curves`` the error's curvature by index.
    ``q`` and ``slopes`` are changed. Returns how many indices were.
    """
    before, after = neighbours
    channel, frequency = grid
    changed = 0
    for i in range(q.size):
        kind, shift = coefficient_class(scales[i], step)
        if kind < 0:
            continue
        c, f, own = channel[i], frequency[i], q[i]
        # The error is quadratic in this one coefficient x: E(x) = E0 + curve * (x - lowest)**2,
        # with its minimum one Newton step away: lowest = x + slope / curve.
        at = _value(own, kind, shift, width, points)
        total = 0.0
        for t in range(waves.shape[0]):
            total += waves[t, f] * slopes[t, c]
        lowest = at + total / curves[i]
        sign, top = (-1 if lowest < 0 else 1), int(abs(lowest) / width + 0.5)
        context = _context(q, before, i, shift)
        best, least = own, np.inf
        for trial in range(-1, 3):
            magnitude = 0 if trial < 0 else top - 1 + trial
            if trial >= 0 and magnitude < 1:
                continue
            q[i] = sign * magnitude
            # Own bits, and those of later coefficients whose context this one changes.
            bits = _cost(magnitude, costs[kind, context], shift)
            for j in range(after.shape[1]):
                other = after[i, j]
                if other < 0:
                    continue
                its, up = coefficient_class(scales[other], step)
                if its >= 0:
                    seen = _context(q, before, other, up)
                    bits += _cost(abs(q[other]), costs[its, seen], up)
            off = _value(q[i], kind, shift, width, points) - lowest
            value = curves[i] * off * off + weight * bits
            if value < least:
                best, least = q[i], value
        q[i] = best
        if best != own:
            changed += 1
            # The slopes follow: slope(t, k) falls by moved * wave(t) * metric(t, c, k).
            moved = _value(best, kind, shift, width, points) - at
            for t in range(waves.shape[0]):
                for k in range(metric.shape[1]):
                    slopes[t, k] -= moved * waves[t, f] * metric[t, c, k]
    return changed


@njit(cache=True, inner=True)
def _value(index: int, kind: int, shift: int, width: float, points: NDArray[np.int64]) -> float:
    """Return the value in mm of an index."""
    magnitude = abs(index)
    inset = 0.0
    if shift == 0 and magnitude > 0:
        inset = points[kind, min(magnitude, 3) - 1] / 256.0
    return width * (magnitude - inset) * (-1.0 if index < 0 else 1.0)
