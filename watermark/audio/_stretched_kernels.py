"""Compiled loops of the search for pilots in sound that was stretched at its pitch.

Contiguous arrays in, arrays filled in place out; no checks. Scores are in `PARTS` of a soft value.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

BLOCK = 16
"""Places of which only the best is looked at where a jump may come from."""

NEVER = np.int32(-(2**30))
"""Score of what cannot be."""


@njit(cache=True)
def follow_pilots(
    soft: NDArray[np.int8],
    slots: NDArray[np.int64],
    signs: NDArray[np.int16],
    hop: int,
    segment: int,
    reach: int,
    penalty: int,
    score: NDArray[np.int32],
    origin: NDArray[np.int32],
) -> None:
    """Best path through a superframe's segments that ends in a segment at each place.

    soft[g, n] is the soft value of slot g at place n, slots[i, f] and signs[i, f] belong to pilot i
    of frame f. A segment of some frames lies as a whole, the next one begins where it ends or, for
    a penalty, up to `reach` blocks beside. score[n] is that of the best path whose last segment
    begins at place n, origin[j, n] the place where segment j - 1 begins if segment j does so at n.
    """
    places, frames = score.size, slots.shape[1]
    own = np.empty(places, dtype=np.int16)
    length = segment * hop
    count = -(-places // BLOCK)
    peak, where = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)
    far, source = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)
    before = np.empty(places, dtype=np.int32)
    queue = np.empty(count, dtype=np.int64)
    for j in range(frames // segment):
        own[:] = 0
        for f in range(segment):
            for i in range(slots.shape[0]):
                sign, row = signs[i, j * segment + f], soft[slots[i, j * segment + f]]
                first = f * hop
                for n in range(places):
                    own[n] += sign * np.int16(row[first + n])
        if j == 0:
            for n in range(places):
                score[n] = own[n]
            continue
        for n in range(places):
            before[n] = score[n - length] if n >= length else NEVER
        for b in range(count):
            peak[b] = NEVER
            where[b] = b * BLOCK
            for n in range(b * BLOCK, min((b + 1) * BLOCK, places)):
                if before[n] > peak[b]:
                    peak[b], where[b] = before[n], n
        head, tail, entered = 0, 0, 0
        for b in range(count):
            while entered < min(b + reach + 1, count):
                while tail > head and peak[queue[tail - 1]] <= peak[entered]:
                    tail -= 1
                queue[tail] = entered
                tail += 1
                entered += 1
            while queue[head] < b - reach:
                head += 1
            far[b], source[b] = peak[queue[head]] - penalty, where[queue[head]]
        for n in range(places):
            b = n // BLOCK
            jumps = far[b] > before[n]
            score[n] = own[n] + (far[b] if jumps else before[n])
            origin[j, n] = (source[b] if jumps else n) - length
