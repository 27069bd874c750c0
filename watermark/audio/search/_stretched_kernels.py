"""Compiled loops of the search for pilots in sound that was stretched at its pitch.

Contiguous arrays in, arrays filled in place out; no checks. Scores are 16 bit integers in `PARTS`
of a soft value: 128 pilots fit.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

BLOCK = 16
"""Places in a block; a jump comes from the best of them only."""

SEGMENT = 4
"""Frames that a jump may part."""

NEVER = np.int16(-16000)
"""Score of what cannot be; a superframe's pilots add less to it than would make it likely."""


Soft = NDArray[np.int8]


@njit(cache=True, inner=True)
def _add_four(
    values: Soft, starts: NDArray[np.int64], masks: Soft, before: Soft, total: Soft
) -> None:
    """total[n] = before[n] + values[starts[f] + n] for four f, or less it where masks[f] is -1."""
    a, b = values[starts[0] : starts[0] + total.size], values[starts[1] :]
    c, d = values[starts[2] :], values[starts[3] :]
    p, q, r, s = masks[0], masks[1], masks[2], masks[3]
    more = np.int8(-(p + q + r + s))
    for n in range(total.size):
        total[n] = np.int8(before[n] + more + (p ^ a[n]) + (q ^ b[n]) + (r ^ c[n]) + (s ^ d[n]))


@njit(cache=True)
def add_pilots(
    soft: Soft, slots: NDArray[np.int64], masks: Soft, hop: int, before: Soft, total: Soft
) -> None:
    """total[j, n] = before[j, n] + one pilot a frame of segment j where it begins at place n."""
    starts = np.empty(SEGMENT, dtype=np.int64)
    for j in range(total.shape[0]):
        for k in range(SEGMENT):
            starts[k] = slots[j * SEGMENT + k] * soft.shape[1] + k * hop
        own = masks[j * SEGMENT : (j + 1) * SEGMENT]
        _add_four(soft.reshape(-1), starts, own, before[j], total[j])


@njit(cache=True, inner=True)
def _peaks(values: NDArray[np.int16]) -> NDArray[np.int16]:
    """Return the largest value of each block."""
    peak, width = values, 1
    while width < BLOCK:
        # Halved again and again, out of place: loops without a branch are made vectors.
        higher = np.empty(peak.size // 2, dtype=np.int16)
        for b in range(higher.size):
            higher[b] = max(peak[2 * b], peak[2 * b + 1])
        peak, width = higher, 2 * width
    return peak


@njit(cache=True, inner=True)
def _far(peak: NDArray[np.int16], doublings: int, far: NDArray[np.int16]) -> None:
    """far[b] = the largest peak less than 2**doublings blocks before b, or after it."""
    count = peak.size
    reach = 1 << doublings
    ahead = np.empty(count + reach, dtype=np.int16)
    for b in range(count + reach):
        ahead[b] = peak[b] if b < count else NEVER
    for k in range(doublings):
        step = 1 << k
        for b in range(count):
            ahead[np.uint64(b)] = max(ahead[np.uint64(b)], ahead[np.uint64(b + step)])
    for b in range(count):
        far[b] = max(ahead[np.uint64(b)], ahead[np.uint64(max(b - reach + 1, 0))])


@njit(cache=True, inner=True)
def _widen(jump: NDArray[np.int16], penalty: np.int16, wide: NDArray[np.uint64]) -> None:
    """Write jump[b], less a penalty, for all places of block b, four of them as a word."""
    for b in range(jump.size):
        word = np.uint64(np.uint16(jump[b] - penalty)) * np.uint64(0x0001000100010001)
        for i in range(BLOCK // 4):
            wide[np.uint64(b * (BLOCK // 4) + i)] = word


@njit(cache=True, inner=True)
def _reach(own: Soft, wide: NDArray[np.int16], score: NDArray[np.int16]) -> None:
    """Replace score[n] by own[n] + the larger of it and wide[n], its block's jump."""
    for n in range(own.size):
        score[n] = np.int16(own[n] + max(score[n], wide[n]))


@njit(cache=True)
def follow_pilots(
    own: Soft,
    length: int,
    doublings: int,
    penalty: np.int16,
    score: NDArray[np.int16],
    origin: NDArray[np.int32],
) -> None:
    """Best path through a superframe's segments that ends in a segment at each place.

    own[j, n] is the correlation of segment j where it begins at place n, `length` places long. A
    segment lies as a whole, the next one begins where it ends or, for a penalty, less than
    2**doublings blocks beside. score has room for `length` places more for each segment but the
    first; score[n], below a multiple of `BLOCK` places, is that of the best path whose last segment
    begins at place n; origin[j, n] is the place where
    segment j - 1 begins if segment j does so at n, if there is room for that.
    """
    segments, places = own.shape
    count = places // BLOCK
    jump = np.empty(count, dtype=np.int16)
    reach, wide = 1 << doublings, np.empty(places // 4, dtype=np.uint64)
    jumps = wide.view(np.int16)
    # Each segment's scores replace those of the one before, `length` places earlier in the store.
    for n in range(score.size):
        score[n] = NEVER
    first = score[(segments - 1) * length :]
    for n in range(places):
        first[n] = own[0, n]
    for j in range(1, segments):
        before = score[(segments - 1 - j) * length :][:places]
        peak = _peaks(before)
        _far(peak, doublings, jump)
        _widen(jump, penalty, wide)
        if origin.size:
            for b in range(count):
                best = b
                for near in range(max(b - reach + 1, 0), min(b + reach, count)):
                    if peak[near] > peak[best]:
                        best = near
                source = best * BLOCK
                while before[source] != peak[best]:
                    source += 1
                for n in range(b * BLOCK, (b + 1) * BLOCK):
                    origin[j, n] = (source if jumps[n] > before[n] else n) - length
        _reach(own[j], jumps, before)
