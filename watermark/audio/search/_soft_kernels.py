"""Compiled loops of pilots' soft values at all places.

Contiguous arrays in, arrays filled in place out; no checks. Soft values are 8 bit integers in
`PARTS`.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit
from watermark.audio.search.pilot_scan import PARTS

COSINE = (
    np.float32(PARTS * 0.9985258),
    np.float32(PARTS * -19.54981647),
    np.float32(PARTS * 61.07633166),
    np.float32(PARTS * -59.49797175),
)
"""Polynomial in the square of a phase, -1/2 to 1/2, that is `PARTS` of its cosine within a
hundredth: interpolation at Chebyshev's points."""

WHOLE = np.float32(1.5 * 2**23)
"""Added to a number of up to 2**22 and taken off again, it leaves the nearest whole number."""

RAISED = 2 * PARTS
"""Added to soft values in `PARTS` to make them positive."""

WORD = 8
"""Turns of a row's phases: their soft values are written as one word, the first one lowest."""

Soft = NDArray[np.int8]


@njit(cache=True, fastmath={"contract"})
def pilot_soft(
    projections: NDArray[np.complex64],
    alive: NDArray[np.float32],
    turn: NDArray[np.complex64],
    dither: NDArray[np.float32],
    steps: NDArray[np.float32],
    first: int,
    soft: Soft,
) -> None:
    """soft[s, g, first + i * turns + t] = soft value of cell g in row i, turned by turn[t, g].

    The step is steps[s]; there are `WORD` turns. See `watermark.audio.signal.dither`.
    """
    turns, count = turn.shape[0], alive.shape[1]
    one = np.float32(1)
    real, imaginary = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    turned = np.empty(count, dtype=np.float32)
    value = np.empty((steps.size, WORD, count), dtype=np.int8)
    for g in range(dither.size):
        for i in range(count):
            real[i], imaginary[i] = projections[g, i].real, projections[g, i].imag
        for t in range(turns):
            a, z = turn[t, g].real, turn[t, g].imag
            for i in range(count):
                turned[i] = real[i] * a - imaginary[i] * z
            for s in range(steps.size):
                soft_row(turned, alive[g], one / steps[s], dither[g], value[s, t])
        for s in range(steps.size):
            interleave(value[s], soft[s, g, first : first + count * turns].view(np.uint64))


@njit(cache=True, inner=True)
def interleave(value: Soft, words: NDArray[np.uint64]) -> None:
    """words[i] = bytes value[0, i] to value[7, i], the first of them lowest."""
    a, b, c, d = value[0], value[1], value[2], value[3]
    e, f, g, h = value[4], value[5], value[6], value[7]
    for i in range(words.size):
        words[i] = (
            np.uint64(np.uint8(a[i]))
            | np.uint64(np.uint8(b[i])) << np.uint64(8)
            | np.uint64(np.uint8(c[i])) << np.uint64(16)
            | np.uint64(np.uint8(d[i])) << np.uint64(24)
            | np.uint64(np.uint8(e[i])) << np.uint64(32)
            | np.uint64(np.uint8(f[i])) << np.uint64(40)
            | np.uint64(np.uint8(g[i])) << np.uint64(48)
            | np.uint64(np.uint8(h[i])) << np.uint64(56)
        )


@njit(cache=True, inner=True, fastmath={"contract"})
def soft_row(
    turned: NDArray[np.float32],
    alive: NDArray[np.float32],
    pace: np.float32,
    dither: np.float32,
    out: Soft,
) -> None:
    """out[i] = `PARTS` of alive[i] cos 2 pi (pace turned[i] - dither), rounded."""
    c0, c1, c2, c3 = COSINE
    raised = np.float32(RAISED + 0.5)
    for i in range(out.size):
        phase = turned[i] * pace - dither
        phase -= (phase + WHOLE) - WHOLE
        u = phase * phase
        # Numbers above 0 are rounded down as they are cut off.
        cosine = c0 + u * (c1 + u * (c2 + u * c3))
        out[i] = np.int8(np.int32(alive[i] * cosine + raised) - np.int32(RAISED))
