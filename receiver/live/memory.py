"""Memory of a receiver that runs for weeks."""

import ctypes

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8
"""Numbers of mallopt's parameters (glibc, malloc.h)."""

_ARENAS = 1
"""Heaps for the small blocks of all threads: those of pool threads would each keep their peak."""


def give_back_large_blocks(threshold: int = 256 * 1024) -> bool:
    """Let the C library return large blocks when they are freed, and keep one heap for all threads.

    By itself glibc raises the least size of blocks with pages of their own up to that of the
    largest that was freed; arrays of some megabytes then come from the heap, which small objects
    among them keep from shrinking. Each thread of a pool has a heap of its own besides.

    Parameters
    ----------
    threshold : int
        Least size of a block with its own pages, bytes.

    Returns
    -------
    bool
        False if the C library has no such choice: nothing has changed.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return False
    return bool(mallopt(_M_MMAP_THRESHOLD, threshold)) and bool(mallopt(_M_ARENA_MAX, _ARENAS))
