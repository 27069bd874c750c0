"""List decoding of spec/hearing.md, section 4, in numpy: ratios of a class to its payload.

Written from that text and spec/audio-carrier.md. Ratios are positive for a bit of 0.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from spec.reference.audio_carrier import check, encode, information

Array = NDArray[np.float64]
Bits = NDArray[np.uint8]
LEAST_AGREEMENT = 0.97
"""(A16) Part of the agreement of a right codeword that is asked for."""


@lru_cache(maxsize=8)
def message_places(message: int, length: int) -> NDArray[np.bool_]:
    """(W31, W32) Return which inputs of the mother code take the message."""
    taken = np.zeros(1 << (length.bit_length() - 1), dtype=np.bool_)
    taken[information(message, length)] = True
    return taken


@lru_cache(maxsize=8)
def check_matrix(bits: int, width: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(W30) Return the check as an affine map: rows for single bits, and that of zeros."""
    zero = np.array(check(bits * [0], width))
    rows = []
    for i in range(bits):
        one = bits * [0]
        one[i] = 1
        rows.append(np.array(check(one, width)) ^ zero)
    return np.array(rows), zero


class Paths:
    """The paths of a list decoder: metrics, least is best, and message bits."""

    def __init__(self, taken: NDArray[np.bool_], most: int) -> None:
        self.taken, self.most = taken, most
        self.metrics = np.zeros(1)
        self.message = np.zeros((1, int(taken.sum())), dtype=np.uint8)
        self.count = 0

    def block(self, values: Array, first: int) -> tuple[Bits, NDArray[np.int64]]:
        """(A15) Decode the inputs from `first` on, one row of ratios for each path.

        Return the codewords of the paths that remain, and which paths they continue.
        """
        size = values.shape[1]
        taken = self.taken[first : first + size]
        if not taken.any():
            self.metrics = self.metrics + np.maximum(-values, 0).sum(axis=1)
            return np.zeros(values.shape, dtype=np.uint8), np.arange(len(values))
        if taken.sum() == 1 and taken[-1]:
            return self.fork(values)
        low, high = values[:, : size // 2], values[:, size // 2 :]
        less = np.minimum(np.abs(low), np.abs(high))
        left, first_parents = self.block(np.where((low < 0) == (high < 0), less, -less), first)
        low, high = low[first_parents], high[first_parents]
        right, parents = self.block(high + np.where(left > 0, -low, low), first + size // 2)
        left = left[parents]
        return np.concatenate([left ^ right, right], axis=1), first_parents[parents]

    def fork(self, values: Array) -> tuple[Bits, NDArray[np.int64]]:
        """(A15) Continue each path by a bit repeated over a block; keep the best paths."""
        zero = self.metrics + np.maximum(-values, 0).sum(axis=1)
        one = self.metrics + np.maximum(values, 0).sum(axis=1)
        metrics = np.concatenate([zero, one])
        kept = np.argsort(metrics, kind="stable")[: self.most]
        parents, bits = kept % len(values), (kept >= len(values)).astype(np.uint8)
        self.metrics, self.message = metrics[kept], self.message[parents]
        self.message[:, self.count] = bits
        self.count += 1
        return np.repeat(bits[:, None], values.shape[1], axis=1), parents


def decode(ratios: Array, size: int, width: int, paths: int, looked: int = 0) -> bytes | None:
    """(A14 to A16) Return the payload of `size` bytes behind ratios, None if no path has it.

    With `looked` only as many of the likeliest paths are looked at.
    """
    message, length = 8 * size + width, len(ratios)
    taken = message_places(message, length)
    mother = len(taken)
    folded = np.zeros(-(-length // mother) * mother)
    folded[:length] = ratios
    found = Paths(taken, paths)
    found.block(folded.reshape(-1, mother).sum(axis=0)[None, :], 0)
    best = np.argsort(found.metrics, kind="stable")[: looked or None]
    words = found.message[best].astype(np.int64)
    matrix, zero = check_matrix(8 * size, width)
    right = ((words[:, : 8 * size] @ matrix + zero) % 2 == words[:, 8 * size :]).all(axis=1)
    for word in words[right]:
        payload = np.packbits(word[: 8 * size].astype(np.uint8)).tobytes()
        if message > length / 3 or agreement(payload, width, ratios) >= LEAST_AGREEMENT:
            return payload
    return None


def agreement(payload: bytes, width: int, ratios: Array) -> float:
    """(A16) Return how well a codeword agrees with ratios, about 1 for a right one."""
    signs = 1.0 - 2.0 * np.array(encode(payload, width, len(ratios)))
    message = 8 * len(payload) + width
    largest = math.sqrt(2 * math.log(2) * message * float((ratios**2).sum()))
    return float((ratios * signs).sum()) / max(largest, 1e-12)
