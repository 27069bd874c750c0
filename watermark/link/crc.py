"""Cyclic redundancy checks of the link layer. Specification: spec/audio-carrier.md, W30."""

from collections.abc import Iterable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from watermark.link import _kernels

POLYNOMIALS = {16: 0x1021, 24: 0x864CFB}
"""CRC-16/CCITT and the CRC-24 of RFC 4880, highest power left out."""


def crc_bits(bits: Iterable[int], width: int) -> NDArray[np.int64]:
    """Check bits of a bit sequence, first bit first, register starting with ones.

    Parameters
    ----------
    bits : iterable of int
        0 or 1.
    width : int
        16 or 24.

    Returns
    -------
    ndarray of int64, shape (width,)
        Most significant bit first.

    Examples
    --------
    >>> message = np.unpackbits(np.frombuffer(b"123456789", dtype=np.uint8))
    >>> hex(int("".join(map(str, crc_bits(message, 16))), 2))
    '0x29b1'
    """
    message = bits if isinstance(bits, np.ndarray) else np.fromiter(bits, dtype=np.int64)
    register = _start(message.size, width)
    register ^= int(np.bitwise_xor.reduce(_weights(message.size, width)[message != 0]))
    return (register >> np.arange(width - 1, -1, -1)) & 1


def passes(messages: NDArray[np.int64], width: int) -> NDArray[np.bool_]:
    """Whether messages, shape (n, bits), end with the check bits of the bits before.

    Examples
    --------
    >>> bits = np.array([1, 0, 1, 1])
    >>> message = np.concatenate([bits, crc_bits(bits, 16)])
    >>> passes(np.stack([message, 1 - message]), 16).tolist()
    [True, False]
    """
    count = messages.shape[1] - width
    found = np.empty(len(messages), dtype=np.int64)
    _kernels.remainders(messages, _all_weights(count, width), found)
    return np.asarray(found == _start(count, width))


def _shift(register: int, width: int) -> int:
    """Return the register times x, modulo the polynomial."""
    shifted = (register << 1) & ((1 << width) - 1)
    return shifted ^ POLYNOMIALS[width] if register >> (width - 1) else shifted


@lru_cache(maxsize=16)
def _start(count: int, width: int) -> int:
    """Return the check of `count` zeros."""
    register = (1 << width) - 1
    for _ in range(count):
        register = _shift(register, width)
    return register


@lru_cache(maxsize=16)
def _all_weights(count: int, width: int) -> NDArray[np.int64]:
    """Return the same of bits and of the check's own."""
    return np.concatenate([_weights(count, width), 1 << np.arange(width - 1, -1, -1)])


@lru_cache(maxsize=16)
def _weights(count: int, width: int) -> NDArray[np.int64]:
    """Return what each one of `count` bits changes in the check, which is linear."""
    weights, register = np.empty(count, dtype=np.int64), POLYNOMIALS[width]
    for i in range(count - 1, -1, -1):
        weights[i] = register
        register = _shift(register, width)
    return weights
