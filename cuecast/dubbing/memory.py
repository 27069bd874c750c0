"""Memory of a command that works through large arrays."""

from receiver.television.memory import set_allocator

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
"""Numbers of mallopt's parameters (glibc, malloc.h)."""

_LARGE, _KEPT = 32 << 20, 128 << 20
"""Least size of a block with its own pages, and free memory that is kept, bytes."""


def keep_freed_memory() -> bool:
    """Let the C library keep the memory of freed arrays for the next ones.

    By itself glibc gives arrays of some megabytes back as they are freed; the system then clears
    their pages again for the next ones: 3 % of the processor time of marking sound.

    Returns
    -------
    bool
        False if the C library has no such choice: nothing has changed.
    """
    return set_allocator({_M_MMAP_THRESHOLD: _LARGE, _M_TRIM_THRESHOLD: _KEPT})
