"""SVT-AV1, an encoder that gives itself the machine.

Opened by root it puts the thread that opens it, and all of its own, into the real-time class
SCHED_FIFO at the highest priority, where they stay: a twentieth of the time is left to all other
programs then. In: the opening of an encoder; out: threads of
the class that they had. It is also told not to print its life on the standard error.
"""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

SVT_AV1 = "libsvtav1"
"""FFmpeg's name of it."""

_THREADS = Path("/proc/self/task")


@contextmanager
def priorities_kept() -> Iterator[None]:
    """Give threads that were there their classes back at the end, new ones that of the caller.

    Elsewhere than on Linux it does nothing; nor does SVT-AV1 there.
    """
    os.environ.setdefault("SVT_LOG", "1")
    before = _classes()
    try:
        yield
    finally:
        own = before.get(threading.get_native_id())
        for thread, now in _classes().items():
            kept = before.get(thread, own)
            if kept and kept[0] != now[0]:
                os.sched_setscheduler(thread, *kept)


def _classes() -> dict[int, tuple[int, Any]]:
    """Return the class and parameters of each thread of this process."""
    if not _THREADS.is_dir():
        return {}
    found = {}
    for thread in map(int, os.listdir(_THREADS)):
        try:
            found[thread] = os.sched_getscheduler(thread), os.sched_getparam(thread)
        except ProcessLookupError:
            continue  # it has ended
    return found
