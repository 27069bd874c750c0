"""Compiled loops of the link: the polar code.

Contiguous arrays in, arrays filled in place out; no checks.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

FEW = 64
"""Values up to which those that are kept are sorted by insertion."""

BUCKETS = 1024
"""Buckets of equal width among which many values are counted to find the least."""

_SURE = 1 - 1e-9
"""Largest belief."""


@njit(cache=True)
def polar_transform(x: NDArray[np.int64]) -> None:
    """Multiply the bits x, in place, with the polar generator matrix in natural order."""
    half = 1
    while half < x.size:
        for start in range(0, x.size, 2 * half):
            for i in range(start, start + half):
                x[i] ^= x[i + half]
        half *= 2


@njit(cache=True, inner=True)
def _next_node(frozen: NDArray[np.int64], phase: int, n: int) -> int:
    """Return the level of the largest block at `phase` with no input free but the last one."""
    level = 0
    while level < n and phase & ((2 << level) - 1) == 0:
        for i in range(phase + (1 << level) - 1, phase + (2 << level) - 1):
            if not frozen[i]:
                return level
        level += 1
    return level


@njit(cache=True, inner=True)
def _update_llr(
    channel: NDArray[np.float32],
    alpha: NDArray[np.float32],
    alpha_row: NDArray[np.int64],
    left: NDArray[np.uint8],
    left_row: NDArray[np.int64],
    phase: int,
    lowest: int,
    n: int,
    paths: int,
) -> None:
    """Bring the log-likelihood ratios of all paths to the block of level `lowest` at `phase`.

    Level v holds blocks of size 2**v at alpha[:, 2**v : 2**(v+1)]; level n is the channel, whose
    ratios begin at channel[2**n].
    Specification: spec/audio-carrier.md, W31 to W33.
    """
    level = lowest
    while level < n - 1 and (phase >> level) & 1 == 0:
        level += 1
    own_ratios, bits, width = alpha.reshape(-1), left.reshape(-1), alpha.shape[1]
    for v in range(min(level, n - 1), lowest - 1, -1):
        size = 1 << v
        odd = (phase >> v) & 1
        top = v + 1 == n
        ratios = channel if top else own_ratios
        for p in range(paths):
            # Unsigned indices let the compiler see that none is negative, and vectorise.
            low = np.uint64((0 if top else alpha_row[p, v + 1] * width) + 2 * size)
            high, out = low + np.uint64(size), np.uint64(p * width + size)
            if odd:
                own = np.uint64(left_row[p, v] * left.shape[1] + size)
                for j in range(size):
                    i = np.uint64(j)
                    a, b = ratios[low + i], ratios[high + i]
                    own_ratios[out + i] = b - a if bits[own + i] else b + a
            else:
                for j in range(size):
                    i = np.uint64(j)
                    a, b = ratios[low + i], ratios[high + i]
                    small = min(abs(a), abs(b))
                    own_ratios[out + i] = small if (a < 0) == (b < 0) else -small
        for p in range(paths):
            alpha_row[p, v] = p


@njit(cache=True, inner=True, fastmath={"reassoc", "contract"})
def _block_costs(
    ratios: NDArray[np.float32],
    width: int,
    metric: NDArray[np.float64],
    block: int,
    paths: int,
    candidate: NDArray[np.float64],
) -> None:
    """Metrics of each path after a block of zeros, and of ones."""
    for p in range(paths):
        begin = np.uint64(p * width + block)
        total, positive = np.float32(0.0), np.float32(0.0)
        for j in range(block):
            ratio = ratios[begin + np.uint64(j)]
            total += ratio
            positive += max(ratio, np.float32(0.0))
        candidate[2 * p] = metric[p] + (positive - total)
        candidate[2 * p + 1] = metric[p] + positive


@njit(cache=True, inner=True)
def _update_bits(
    left: NDArray[np.uint8],
    left_row: NDArray[np.int64],
    work: NDArray[np.uint8],
    decided: NDArray[np.uint8],
    phase: int,
    level: int,
    n: int,
    paths: int,
) -> None:
    """Carry the decided bits of a block of a level up to the highest block that it completes."""
    top = level
    while top < n and (phase >> top) & 1:
        top += 1
    if top == n:
        return
    bits, width, whole = left.reshape(-1), left.shape[1], 1 << top
    if top == 0:
        for p in range(paths):
            bits[np.uint64(p * width + 1)] = decided[p]
            left_row[p, 0] = p
        return
    for p in range(paths):
        for j in range(1 << level):
            work[np.uint64(j)] = decided[p]
        for v in range(level, top):
            size = np.uint64(1 << v)
            own = np.uint64(left_row[p, v] * width) + size
            for j in range(1 << v):
                i = np.uint64(j)
                low = work[i]
                work[size + i] = low
                work[i] = low ^ bits[own + i]
        # Rows that are read above hold lower levels, in other columns.
        begin = np.uint64(p * width + whole)
        for j in range(whole):
            bits[begin + np.uint64(j)] = work[np.uint64(j)]
        left_row[p, top] = p


@njit(cache=True, inner=True)
def _ranked(values: NDArray[np.float64], rank: int) -> float:
    """Return the value that would be at this place in ascending order; reorder the values.

    Hoare's selection: numpy's partition and sorts take seconds to compile.
    """
    low, high = 0, values.size - 1
    # Invariant: the wanted value lies within values[low : high + 1].
    while low < high:
        pivot = values[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if rank <= j:
            high = j
        elif rank >= i:
            low = i
        else:
            break
    return float(values[rank])


@njit(cache=True, inner=True)
def _limit(candidate: NDArray[np.float64], kept: int) -> tuple[float, int]:
    """Return the largest of the `kept` least values, and how many of its equals are among them."""
    low = high = candidate[0]
    for value in candidate:
        low, high = min(low, value), max(high, value)
    if low == high:
        return low, kept
    # A histogram names the bucket that holds the limit; only its values are ranked.
    counts = np.empty(BUCKETS + 1, dtype=np.int64)
    for bucket in range(BUCKETS + 1):
        counts[bucket] = 0
    scale = BUCKETS / (high - low)
    for value in candidate:
        counts[np.uint64((value - low) * scale)] += 1
    bucket, below = 0, 0
    while below + counts[bucket] < kept:
        below += counts[bucket]
        bucket += 1
    inside = np.empty(counts[bucket])
    count = 0
    for value in candidate:
        if np.uint64((value - low) * scale) == np.uint64(bucket):
            inside[count] = value
            count += 1
    limit = _ranked(inside, kept - below - 1)
    room = kept - below
    for value in inside:
        room -= value < limit
    return limit, room


@njit(cache=True, inner=True)
def _least(candidate: NDArray[np.float64], kept: int) -> NDArray[np.int64]:
    """Return the places of the `kept` least values; of equal ones the first count.

    Few are in ascending order, many in that of their places.
    """
    order = np.empty(kept, dtype=np.int64)
    count = 0
    if candidate.size > FEW:
        limit, room = _limit(candidate, kept)
        for i in range(candidate.size):
            equal = candidate[i] == limit and room > 0
            if equal or candidate[i] < limit:
                order[count] = i
                count += 1
            room -= equal
        return order
    # Insertion: order[:count] holds the least values so far, in ascending order.
    for i in range(candidate.size):
        if count == kept and candidate[i] >= candidate[order[count - 1]]:
            continue
        place = min(count, kept - 1)
        while place and candidate[order[place - 1]] > candidate[i]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = i
        count = min(count + 1, kept)
    return order


@njit(cache=True)
def scl_decode(
    llr: NDArray[np.float64],
    frozen: NDArray[np.int64],
    list_size: int,
    largest: float,
    words: NDArray[np.int64],
    metrics: NDArray[np.float64],
) -> int:
    """Successive-cancellation list decoding of one polar codeword.

    Fills words (list_size, K) with the bits of the inputs that are not frozen and metrics
    (list_size,) with the path metrics, best path first; returns the number of paths. Positive llr
    means bit 0. Blocks with one input at most that is not frozen are decided as a whole: their
    metric is the sum over their ratios. Paths whose metric, which never falls, exceeds `largest`
    are dropped; without any the count is 0. Sources: Tal and Vardy 2015; metric of
    Balatsoukas-Stimming, Parizi and Burg 2015; blocks of Hashemi, Condo and Gross, "Fast simplified
    successive-cancellation list decoding of polar codes", WCNC workshops 2017.
    """
    size = llr.size
    n = 0
    while (1 << n) < size:
        n += 1
    alpha = np.empty((list_size, size), dtype=np.float32)
    channel = np.empty(2 * size, dtype=np.float32)
    alpha_row = np.empty((list_size, n + 1), dtype=np.int64)
    left = np.empty((list_size, size), dtype=np.uint8)
    left_row = np.empty((list_size, n + 1), dtype=np.int64)
    work = np.empty(size, dtype=np.uint8)
    decided = np.empty(list_size, dtype=np.uint8)
    trace_bit = np.empty((list_size, size), dtype=np.uint8)
    trace_path = np.empty((list_size, size), dtype=np.int64)
    new_alpha_row = np.empty((list_size, n + 1), dtype=np.int64)
    new_left_row = np.empty((list_size, n + 1), dtype=np.int64)
    candidate = np.empty(2 * list_size)
    metric = np.empty(list_size)
    ranks = np.empty(list_size, dtype=np.int64)
    # Zeros where they count: `np.zeros` is compiled for each type once more.
    for p in range(list_size):
        metric[p], ranks[p], decided[p] = 0.0, 0, 0
        for v in range(n + 1):
            alpha_row[p, v], left_row[p, v] = 0, 0
    for i in range(size):
        channel[size + i] = llr[i]
    free = 0
    phase = free * size  # numba would compile the steps for literals as well
    paths = phase + 1
    while phase < size:
        level = _next_node(frozen, phase, n)
        block = 1 << level
        _update_llr(channel, alpha, alpha_row, left, left_row, phase, level, n, paths)
        phase += block
        ratios = channel if level == n else alpha.reshape(-1)
        _block_costs(ratios, size, metric, block, paths, candidate)
        if frozen[phase - 1]:
            for p in range(paths):
                metric[p], decided[p] = candidate[2 * p], 0
        else:
            likely = 0
            for i in range(2 * paths):
                likely += candidate[i] <= largest
            if likely == 0:
                return 0
            kept = min(likely, list_size)
            order = _least(candidate[: 2 * paths], kept)
            for q in range(kept):
                parent = order[q] // 2
                metric[q], decided[q] = candidate[order[q]], order[q] & 1
                trace_path[q, free], trace_bit[q, free] = parent, order[q] & 1
                for v in range(n + 1):
                    new_alpha_row[q, v] = alpha_row[parent, v]
                    new_left_row[q, v] = left_row[parent, v]
            alpha_row, new_alpha_row = new_alpha_row, alpha_row
            left_row, new_left_row = new_left_row, left_row
            paths, free = kept, free + 1
        _update_bits(left, left_row, work, decided, phase - 1, level, n, paths)
    for p in range(paths):  # the best first, of equal ones the first
        place = p
        while place and metric[ranks[place - 1]] > metric[p]:
            ranks[place] = ranks[place - 1]
            place -= 1
        ranks[place] = p
    for q in range(paths):
        p = ranks[q]
        metrics[q] = metric[p]
        for i in range(free - 1, -1, -1):
            words[q, i] = trace_bit[p, i]
            p = trace_path[p, i]
    return paths


@njit(cache=True, inline="always")
def _join(a: float, b: float) -> float:
    """Belief of two that are independent, short of certainty."""
    return min(max((a + b) / (1.0 + a * b), -_SURE), _SURE)


@njit(cache=True)
def polar_beliefs(
    told: NDArray[np.float64], frozen: NDArray[np.int64], rounds: int, out: NDArray[np.float64]
) -> None:
    """Fill out (N,) with the code's expectation of each coded bit, -1 for 1 to 1 for 0.

    told (N,) is the channel's value of each, in the same terms, less than 1; its own value is left
    out of a bit's belief. Belief propagation on the butterflies of the encoder, to and fro.
    Source: Arikan, IEEE Com. Letters 12(6), 2008.
    """
    size = told.size
    n = 0
    while (1 << n) < size:
        n += 1
    # Loops compile in a quarter of the time that expressions with arrays take.
    down, up = np.empty((n + 1, size)), np.empty((n + 1, size))
    for layer in range(n + 1):
        for a in range(size):
            down[layer, a], up[layer, a] = 0.0, 0.0
    for a in range(size):
        down[n, a] = told[a]
        up[0, a] = _SURE if frozen[a] != 0 else 0.0
    # One butterfly of the encoder: a ---(+)--- a + b      Belief of a sum is the product,
    #                                      |              belief of one bit from two
    #                               b -----+--- b         sources is _join.
    # `down` runs from the channel (layer n) to the inputs (layer 0), `up` the way back.
    for _ in range(rounds):
        for layer in range(n - 1, -1, -1):
            half = 1 << layer
            for start in range(0, size, 2 * half):
                for a in range(start, start + half):
                    b = a + half
                    x, y = down[layer + 1, a], down[layer + 1, b]
                    down[layer, a] = x * _join(y, up[layer, b])
                    down[layer, b] = _join(y, up[layer, a] * x)
        for layer in range(n):
            half = 1 << layer
            for start in range(0, size, 2 * half):
                for a in range(start, start + half):
                    b = a + half
                    x, y = down[layer + 1, a], down[layer + 1, b]
                    up[layer + 1, a] = up[layer, a] * _join(y, up[layer, b])
                    up[layer + 1, b] = _join(up[layer, b], up[layer, a] * x)
    for a in range(size):
        out[a] = up[n, a]


@njit(cache=True)
def remainders(
    messages: NDArray[np.int64], weights: NDArray[np.int64], out: NDArray[np.int64]
) -> None:
    """out[n] = exclusive or of weights[i] over the ones i of message n."""
    for n in range(out.size):
        found = 0
        for i in range(weights.size):
            found ^= weights[i] & -messages[n, i]
        out[n] = found
