"""An erasure code over bytes: any k of n parts give the data back.

Systematic Cauchy Reed-Solomon code over GF(256) with x^8 + x^4 + x^3 + x^2 + 1: parts 0..k-1 are
the data, part k + i weighs data j with 1 / ((255 - i) + j), "+" being the field's addition.
Source: Bloemer et al., "An XOR-based erasure-resilient coding scheme", 1995. Specification:
spec/a335-carrier.md, section 4.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

MAX_PARTS = 256
"""Parts that a field of 256 elements can distinguish."""

ByteMatrix = NDArray[np.uint8]


def _tables() -> tuple[ByteMatrix, NDArray[np.int64]]:
    power, log = np.zeros(510, dtype=np.uint8), np.zeros(256, dtype=np.int64)
    x = 1
    for i in range(255):
        power[i] = power[i + 255] = x
        log[x] = i
        x = x << 1 ^ (0x11D if x & 0x80 else 0)
    return power, log


_POWER, _LOG = _tables()


def _multiply(a: ByteMatrix, b: ByteMatrix) -> ByteMatrix:
    product: ByteMatrix = _POWER.take(_LOG.take(a) + _LOG.take(b))
    return np.asarray(product * ((a != 0) & (b != 0)), dtype=np.uint8)


def _row(part: int, k: int) -> ByteMatrix:
    """Weights of the k data parts in part number `part`."""
    if part < k:
        return np.asarray(np.arange(k) == part, dtype=np.uint8)
    difference = (255 - (part - k)) ^ np.arange(k)
    return np.asarray(_POWER[(255 - _LOG[difference]) % 255], dtype=np.uint8)


def encode_part(data: ByteMatrix, part: int) -> ByteMatrix:
    """One part of the code.

    Parameters
    ----------
    data : ndarray of uint8, shape (k, size)
        The data parts.
    part : int
        0..255; parts below k are the data themselves.

    Returns
    -------
    ndarray of uint8, shape (size,)

    Raises
    ------
    CueError
        If the part's number is out of range.

    Examples
    --------
    >>> encode_part(np.array([[1, 2], [3, 4]], dtype=np.uint8), 1).tolist()
    [3, 4]
    """
    if not 0 <= part < MAX_PARTS:
        raise CueError(f"part {part}: must be 0..{MAX_PARTS - 1}")
    weights = _row(part, len(data))
    return np.asarray(
        np.bitwise_xor.reduce(_multiply(weights[:, None], data), axis=0), dtype=np.uint8
    )


def decode_parts(parts: Mapping[int, ByteMatrix], k: int) -> ByteMatrix | None:
    """Recover the data behind at least k different parts.

    Parameters
    ----------
    parts : mapping of int to ndarray of uint8, shape (size,)
        What arrived, by part number.
    k : int
        Number of data parts.

    Returns
    -------
    ndarray of uint8, shape (k, size), or None
        None while fewer than k parts are there.

    Examples
    --------
    >>> data = np.arange(6, dtype=np.uint8).reshape(3, 2)
    >>> parts = {i: encode_part(data, i) for i in (1, 5, 9)}
    >>> bool((decode_parts(parts, 3) == data).all())
    True
    """
    if len(parts) < k:
        return None
    chosen = sorted(parts)[:k]
    matrix = np.stack([_row(part, k) for part in chosen])
    values = np.stack([parts[part] for part in chosen]).astype(np.uint8)
    for i in range(k):
        pivot = i + int(np.argmax(matrix[i:, i] != 0))
        for table in (matrix, values):
            table[[i, pivot]] = table[[pivot, i]]
        inverse = np.full(1, _POWER[(255 - _LOG[matrix[i, i]]) % 255])
        matrix[i], values[i] = _multiply(matrix[i], inverse), _multiply(values[i], inverse)
        others = np.arange(k) != i
        weight = matrix[others, i][:, None]
        values[others] ^= _multiply(weight, values[i][None, :])
        matrix[others] ^= _multiply(weight, matrix[i][None, :])
    return values
