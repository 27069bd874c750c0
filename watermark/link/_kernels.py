"""Compiled loops of the link: the polar code.

Contiguous arrays in, arrays filled in place out; no checks.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def polar_transform(x: NDArray[np.int64]) -> None:
    """Multiply the bits x, in place, with the polar generator matrix in natural order."""
    half = 1
    while half < x.size:
        for start in range(0, x.size, 2 * half):
            for i in range(start, start + half):
                x[i] ^= x[i + half]
        half *= 2


@njit(cache=True)
def _update_llr(
    alpha: NDArray[np.float64],
    alpha_row: NDArray[np.int64],
    left: NDArray[np.int64],
    left_row: NDArray[np.int64],
    phase: int,
    n: int,
    paths: int,
) -> None:
    """Bring the log-likelihood ratios of all paths to leaf `phase` (section 6.3).

    Level v holds blocks of size 2**v at alpha[:, 2**v : 2**(v+1)]; level n is the channel.
    """
    level = 0
    while level < n - 1 and (phase >> level) & 1 == 0:
        level += 1
    for v in range(level, -1, -1):
        size = 1 << v
        odd = (phase >> v) & 1
        for p in range(paths):
            source = alpha_row[p, v + 1]
            bits = left_row[p, v]
            for i in range(size):
                a = alpha[source, 2 * size + i]
                b = alpha[source, 3 * size + i]
                if odd:
                    u = left[bits, size + i]
                    alpha[p, size + i] = b - a if u else b + a
                else:
                    small = min(abs(a), abs(b))
                    alpha[p, size + i] = small if (a < 0) == (b < 0) else -small
        for p in range(paths):
            alpha_row[p, v] = p


@njit(cache=True)
def _update_bits(
    left: NDArray[np.int64],
    left_row: NDArray[np.int64],
    work: NDArray[np.int64],
    decided: NDArray[np.int64],
    phase: int,
    n: int,
    paths: int,
) -> None:
    """Carry the decided bits up to the highest block that `phase` completes."""
    top = 0
    while top < n and (phase >> top) & 1:
        top += 1
    for p in range(paths):
        work[0] = decided[p]
        for v in range(top):
            size = 1 << v
            row = left_row[p, v]
            for i in range(size):
                bit = work[i]
                work[i] = left[row, size + i] ^ bit
                work[size + i] = bit
        if top < n:
            size = 1 << top
            for i in range(size):
                left[paths + p, size + i] = work[i]
    if top < n:
        size = 1 << top
        for p in range(paths):
            for i in range(size):
                left[p, size + i] = left[paths + p, size + i]
            left_row[p, top] = p


@njit(cache=True)
def scl_decode(
    llr: NDArray[np.float64],
    frozen: NDArray[np.int64],
    list_size: int,
    words: NDArray[np.int64],
    metrics: NDArray[np.float64],
) -> int:
    """Successive-cancellation list decoding of one polar codeword.

    Fills words (list_size, N) with the decided input bits and metrics (list_size,) with the path
    metrics, best path first; returns the number of paths. Positive llr means bit 0.
    Source: Tal and Vardy 2015; metric of Balatsoukas-Stimming, Parizi and Burg 2015.
    """
    size = llr.size
    n = 0
    while (1 << n) < size:
        n += 1
    alpha = np.zeros((list_size, 2 * size))
    alpha_row = np.zeros((list_size, n + 1), dtype=np.int64)
    left = np.zeros((2 * list_size, size), dtype=np.int64)
    left_row = np.zeros((list_size, n + 1), dtype=np.int64)
    work = np.zeros(size, dtype=np.int64)
    decided = np.zeros(list_size, dtype=np.int64)
    trace_bit = np.zeros((list_size, size), dtype=np.int64)
    trace_path = np.zeros((list_size, size), dtype=np.int64)
    new_alpha_row = np.zeros_like(alpha_row)
    new_left_row = np.zeros_like(left_row)
    candidate = np.zeros(2 * list_size)
    metric = np.zeros(list_size)
    new_metric = np.zeros(list_size)
    for i in range(size):
        alpha[0, size + i] = llr[i]
    paths = 1
    for phase in range(size):
        _update_llr(alpha, alpha_row, left, left_row, phase, n, paths)
        if frozen[phase]:
            for p in range(paths):
                leaf = alpha[p, 1]
                if leaf < 0:
                    metric[p] -= leaf
                decided[p] = 0
                trace_path[p, phase] = p
                trace_bit[p, phase] = 0
        else:
            for p in range(paths):
                leaf = alpha[p, 1]
                candidate[2 * p] = metric[p] + (-leaf if leaf < 0 else 0.0)
                candidate[2 * p + 1] = metric[p] + (leaf if leaf > 0 else 0.0)
            order = np.argsort(candidate[: 2 * paths], kind="mergesort")
            kept = min(2 * paths, list_size)
            for q in range(kept):
                parent = order[q] // 2
                bit = order[q] & 1
                new_metric[q] = candidate[order[q]]
                decided[q] = bit
                trace_path[q, phase] = parent
                trace_bit[q, phase] = bit
                for v in range(n + 1):
                    new_alpha_row[q, v] = alpha_row[parent, v]
                    new_left_row[q, v] = left_row[parent, v]
            paths = kept
            for q in range(paths):
                metric[q] = new_metric[q]
                for v in range(n + 1):
                    alpha_row[q, v] = new_alpha_row[q, v]
                    left_row[q, v] = new_left_row[q, v]
        _update_bits(left, left_row, work, decided, phase, n, paths)
    order = np.argsort(metric[:paths], kind="mergesort")
    for q in range(paths):
        p = order[q]
        metrics[q] = metric[p]
        for phase in range(size - 1, -1, -1):
            words[q, phase] = trace_bit[p, phase]
            p = trace_path[p, phase]
    return paths
