"""Cyclic redundancy checks of the link layer. Specification: section 6.2."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

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
    polynomial, mask = POLYNOMIALS[width], (1 << width) - 1
    register = mask
    for bit in bits:
        feedback = (register >> (width - 1)) ^ int(bit)
        register = ((register << 1) & mask) ^ (polynomial if feedback else 0)
    return (register >> np.arange(width - 1, -1, -1)) & 1
