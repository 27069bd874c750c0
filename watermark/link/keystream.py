"""Pseudorandom integers that both ends draw from a watermark key."""

import hashlib

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

MAX_KEY = 2**64
"""Keys are below this."""


def stream_words(purpose: str, key: int, count: int) -> NDArray[np.int64]:
    """Return `count` pseudorandom integers in 0..2**32-1 of the stream called `purpose`.

    Raises
    ------
    CueError
        If the key does not fit into 64 bits.

    Examples
    --------
    >>> bool((stream_words("signs", 0, 4) < 2**32).all())
    True
    """
    if not 0 <= key < MAX_KEY:
        raise CueError(f"key {key} is not within 0..2**64-1")
    raw = hashlib.shake_256(f"cuecast audio 1/{purpose}/{key}".encode()).digest(4 * count)
    return np.frombuffer(raw, dtype="<u4").astype(np.int64)
