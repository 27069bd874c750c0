"""The BCH(127, 50) code of VP1 messages: up to 13 wrong bits of 127 are put right.

Systematic, parity first on air; field of 128 elements with x^7 + x^6 + 1. Decoding by syndromes,
Berlekamp-Massey and trial of all positions (Lin and Costello, "Error Control Coding", chapter 6).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError

N, K, T = 127, 50, 13
"""Bits of a code word, bits of its payload, and wrong bits that it puts right."""

PARITY = N - K

_GENERATOR = (
    77, 76, 75, 74, 72, 71, 68, 67, 66, 64, 63, 62, 60, 59, 51, 50, 49, 44, 42, 41, 40, 39, 35,
    34, 32, 30, 29, 26, 21, 20, 19, 18, 17, 13, 12, 9, 5, 2, 0,
)  # fmt: skip
"""Powers of x in the generator polynomial: the product of the minimal polynomials of the first 2 T
powers of the field's primitive element."""


def _tables() -> tuple[list[int], list[int]]:
    power, log = [1] * (2 * N), [0] * (N + 1)
    x = 1
    for i in range(N):
        power[i] = power[i + N] = x
        log[x] = i
        x <<= 1
        if x & 128:
            x ^= 0b11000001
    return power, log


_POWER, _LOG = _tables()


def _multiply(a: int, b: int) -> int:
    return _POWER[_LOG[a] + _LOG[b]] if a and b else 0


def encode(payload: ArrayLike) -> NDArray[np.int64]:
    """Codeword of 50 payload bits: 77 parity bits, then the payload.

    Parameters
    ----------
    payload : array_like of int, shape (50,)
        0 or 1.

    Returns
    -------
    ndarray of int64, shape (127,)

    Raises
    ------
    CueError
        If there are not 50 bits.

    Examples
    --------
    >>> int(encode([0] * 49 + [1]).sum())
    39
    """
    bits = np.asarray(payload, dtype=np.int64)
    if bits.shape != (K,):
        raise CueError(f"payload of shape {bits.shape}: must be ({K},)")
    generator = np.zeros(PARITY + 1, dtype=np.int64)
    generator[PARITY - np.array(_GENERATOR)] = 1  # highest power first
    remainder = np.concatenate([bits, np.zeros(PARITY, dtype=np.int64)])
    for i in range(K):
        if remainder[i]:
            remainder[i : i + PARITY + 1] ^= generator
    return np.concatenate([remainder[K:], bits])


def decode(word: ArrayLike) -> tuple[NDArray[np.int64], int] | None:
    """Payload of a received word and the number of bits put right.

    Parameters
    ----------
    word : array_like of int, shape (127,)
        Parity, then payload.

    Returns
    -------
    (ndarray of int64, shape (50,), int) or None
        None where more than 13 bits are wrong.

    Examples
    --------
    >>> word = encode([1, 0] * 25)
    >>> word[:13] ^= 1
    >>> payload, wrong = decode(word)
    >>> payload.tolist() == [1, 0] * 25, wrong
    (True, 13)
    """
    bits = np.asarray(word, dtype=np.int64).copy()
    if bits.shape != (N,):
        raise CueError(f"word of shape {bits.shape}: must be ({N},)")
    # Power of x of each position: the payload holds the highest ones, first bit first.
    powers = np.concatenate([np.arange(PARITY)[::-1], np.arange(PARITY, N)[::-1]])
    syndromes = _syndromes(powers[bits == 1])
    if not any(syndromes):
        return bits[PARITY:], 0
    locator = _berlekamp_massey(syndromes)
    wrong = [p for p in range(N) if _evaluate(locator, (N - p) % N) == 0]
    if len(wrong) != len(locator) - 1:
        return None
    bits[np.isin(powers, wrong)] ^= 1
    return bits[PARITY:], len(wrong)


def _syndromes(ones: NDArray[np.int64]) -> list[int]:
    values = []
    for j in range(1, 2 * T + 1):
        total = 0
        for power in ones:
            total ^= _POWER[int(power) * j % N]
        values.append(total)
    return values


def _berlekamp_massey(syndromes: list[int]) -> list[int]:
    """Error locator polynomial, lowest power first."""
    current, previous = [1], [1]
    length, gap, last = 0, 1, 1
    for n, syndrome in enumerate(syndromes):
        # Discrepancy: d = S[n] + sum over i of c[i] S[n - i], with XOR as the sum.
        delta = syndrome
        for i in range(1, min(length, len(current) - 1) + 1):
            delta ^= _multiply(current[i], syndromes[n - i])
        if delta == 0:
            gap += 1
            continue
        # c(x) += d / d' * x^gap * c'(x), where c' and d' are those before the last change of
        # length.
        scale = _multiply(delta, _POWER[(N - _LOG[last]) % N])
        update = [0] * gap + [_multiply(scale, c) for c in previous]
        size = max(len(current), len(update))
        summed = [
            (current[i] if i < len(current) else 0) ^ (update[i] if i < len(update) else 0)
            for i in range(size)
        ]
        if 2 * length <= n:
            length, previous, last, gap = n + 1 - length, current, delta, 1
        else:
            gap += 1
        current = summed
    while len(current) > 1 and current[-1] == 0:
        current.pop()
    return current


def _evaluate(polynomial: list[int], exponent: int) -> int:
    total = 0
    for i, coefficient in enumerate(polynomial):
        total ^= _multiply(coefficient, _POWER[exponent * i % N])
    return total
