"""Memory of a receiver that runs for weeks."""

import asyncio
import ctypes
import re
from pathlib import Path

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8
"""Numbers of mallopt's parameters (glibc, malloc.h)."""

_MADV_DONTNEED = 4
"""Number of madvise's advice that pages may leave memory (Linux, mman.h)."""

_ARENAS = 1
"""Heaps for the small blocks of all threads: those of pool threads would each keep their peak."""

_COMPILER = "libllvmlite"
"""Library that loads and compiles kernels; running kernels do not use it."""

_EVERY_S = 1.0
"""Seconds between two releases of the compiler's pages."""


def set_allocator(choices: dict[int, int]) -> bool:
    """Set parameters of the C library's memory.

    Parameters
    ----------
    choices : dict of int to int
        Values by numbers of mallopt's parameters (glibc, malloc.h).

    Returns
    -------
    bool
        False if the C library has no such choice: nothing has changed.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return False
    return all(mallopt(number, value) for number, value in choices.items())


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
    return set_allocator({_M_MMAP_THRESHOLD: threshold, _M_ARENA_MAX: _ARENAS})


async def give_back_compiler() -> None:
    """Release the pages of the compiler's library every `_EVERY_S`, until cancelled.

    Kernels are loaded in the first seconds and when reception changes; 70 MB of the library's code
    then stay resident though nothing reads them. A released page that is needed again is read from
    the system's copy of the file.
    """
    ranges: list[tuple[int, int]] = []
    while True:
        await asyncio.sleep(_EVERY_S)
        ranges = ranges or unchanged_ranges(_COMPILER)
        release(ranges)


def unchanged_ranges(library: str) -> list[tuple[int, int]]:
    """Return the address ranges of a library that are as in its file and stay so.

    Parameters
    ----------
    library : str
        Part of the file's name.

    Returns
    -------
    list of (int, int)
        First address and size in bytes of each; empty where the system does not list them.
    """
    try:
        listing = Path("/proc/self/smaps").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    found = re.findall(
        r"^([0-9a-f]+)-([0-9a-f]+) r-.p [^\n]*/([^/\n]*)\n((?:[A-Z][^\n]*\n)*)", listing, re.M
    )
    return [
        (int(begin, 16), int(end, 16) - int(begin, 16))
        for begin, end, name, figures in found
        if library in name and re.search(r"^Anonymous: +0 kB$", figures, re.M)
    ]


def release(ranges: list[tuple[int, int]]) -> None:
    """Release the pages in ranges of `unchanged_ranges`."""
    if ranges:
        libc = ctypes.CDLL(None)
        for begin, size in ranges:
            libc.madvise(ctypes.c_void_p(begin), ctypes.c_size_t(size), _MADV_DONTNEED)
