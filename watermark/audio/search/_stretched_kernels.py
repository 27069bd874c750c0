"""Compiled loops of the search for pilots in sound that was stretched at its pitch.

Contiguous arrays in, arrays filled in place out; no checks. Scores are 16 bit integers in `PARTS`
of a soft value: 128 pilots fit.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

BLOCK = 16
"""Places in a block; a jump comes from the best of them only."""

NEVER = np.int16(-16000)
"""Score of what cannot be; a superframe's pilots add less to it than would make it likely."""


@njit(cache=True, inline="always")
def _own(
    soft: NDArray[np.int8],
    slots: NDArray[np.int64],
    signs: NDArray[np.int16],
    first: int,
    segment: int,
    hop: int,
    own: NDArray[np.int16],
) -> None:
    """own[n] = sum of the pilots of frames `first` to `first + segment` that begin at place n."""
    own[:] = 0
    count = own.size
    for f in range(first, first + segment, 2):
        begin, after = (f - first) * hop, (f - first + 1) * hop
        a, b = soft[slots[0, f], begin : begin + count], soft[slots[1, f], begin : begin + count]
        c, d = soft[slots[0, f + 1], after : after + count], soft[slots[1, f + 1], after:]
        p, q, r, s = signs[0, f], signs[1, f], signs[0, f + 1], signs[1, f + 1]
        for n in range(count):
            own[n] += (
                p * np.int16(a[n]) + q * np.int16(b[n]) + r * np.int16(c[n]) + s * np.int16(d[n])
            )


@njit(cache=True, inner=True)
def _peaks(before: NDArray[np.int16], peak: NDArray[np.int16]) -> None:
    """peak[b] = the largest value of block b."""
    for b in range(peak.size):
        first = b * BLOCK
        highest = before[first]
        for i in range(1, BLOCK):
            highest = max(highest, before[np.uint64(first + i)])
        peak[b] = highest


@njit(cache=True, inner=True)
def _far(peak: NDArray[np.int16], doublings: int, far: NDArray[np.int16]) -> None:
    """far[b] = the largest peak less than 2**doublings blocks before b, or after it."""
    count = peak.size
    reach = 1 << doublings
    ahead = np.full(count + reach, NEVER)
    ahead[:count] = peak
    for k in range(doublings):
        step = 1 << k
        for b in range(count):
            ahead[np.uint64(b)] = max(ahead[np.uint64(b)], ahead[np.uint64(b + step)])
    for b in range(count):
        far[b] = max(ahead[np.uint64(b)], ahead[np.uint64(max(b - reach + 1, 0))])


@njit(cache=True, inner=True)
def _reach(
    before: NDArray[np.int16],
    own: NDArray[np.int16],
    jump: NDArray[np.int16],
    score: NDArray[np.int16],
) -> None:
    """score[n] = own[n] + the larger of before[n] and its block's jump."""
    for b in range(jump.size):
        least, first = jump[b], b * BLOCK
        for i in range(BLOCK):
            n = np.uint64(first + i)
            score[n] = own[n] + max(before[n], least)


@njit(cache=True)
def follow_pilots(
    soft: NDArray[np.int8],
    slots: NDArray[np.int64],
    signs: NDArray[np.int16],
    hop: int,
    segment: int,
    doublings: int,
    penalty: np.int16,
    score: NDArray[np.int16],
    origin: NDArray[np.int32],
) -> None:
    """Best path through a superframe's segments that ends in a segment at each place.

    soft[g, n] is the soft value of slot g at place n, slots[i, f] and signs[i, f] belong to pilot i
    of frame f. A segment of some frames lies as a whole, the next one begins where it ends or, for
    a penalty, less than 2**doublings blocks beside. score[n], of a multiple of `BLOCK` places, is
    that of the best path whose last segment begins at place n; origin[j, n] is the place where
    segment j - 1 begins if segment j does so at n, if there is room for that.
    """
    places, frames, length = score.size, slots.shape[1], segment * hop
    count = places // BLOCK
    own = np.empty(places, dtype=np.int16)
    peak, jump = np.empty(count, dtype=np.int16), np.empty(count, dtype=np.int16)
    reach = 1 << doublings
    # Scores of the segment before, moved on by its length.
    before = np.full(places + length, NEVER)
    for j in range(frames // segment):
        _own(soft, slots, signs, j * segment, segment, hop, own)
        if j == 0:
            score[:] = own
        else:
            _peaks(before, peak)
            _far(peak, doublings, jump)
            for b in range(count):
                jump[b] -= penalty
            _reach(before, own, jump, score)
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
                        origin[j, n] = (source if jump[b] > before[n] else n) - length
        before[length:] = score
