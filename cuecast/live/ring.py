"""A record of one process that another one reads, in memory that outlives the writer.

A record is there even if the writer is killed in the next moment; one that was under way then is
not seen. Counters lie before it, each read and written as one word of the processor: `struct`
clears its bytes first, and the other process now and then saw a 0. Linux only.
"""

import mmap
import os
import struct
import threading
from collections.abc import Iterator

_SIZE = 16 << 20
"""Bytes of records that the reader may be behind: 9 s of a programme of 14 Mbit/s."""

_WRITTEN, _READ, _SENT, _PULSE = range(4)
"""Places of the counters, in words of 8 bytes."""

_BEGIN = 64
"""Bytes before the records: those of the counters, and room for others."""

_HEAD = struct.Struct("<cI")
"""Kind and length of a record."""


class Ring:
    """The memory, and this process's way to it.

    Parameters
    ----------
    file : int, optional
        Descriptor of the memory; without one it is made.
    """

    def __init__(self, file: int | None = None) -> None:
        self.file = os.memfd_create("cuecast") if file is None else file
        if file is None:
            os.ftruncate(self.file, _BEGIN + _SIZE)
        self._memory = mmap.mmap(self.file, _BEGIN + _SIZE)
        self._counters = memoryview(self._memory)[:_BEGIN].cast("Q")
        self._lock = threading.Lock()

    @property
    def sent(self) -> int:
        """Datagrams that the writer has sent."""
        return self._counters[_SENT]

    @sent.setter
    def sent(self, count: int) -> None:
        self._counters[_SENT] = count

    @property
    def pulse(self) -> int:
        """Rounds of the writer's loop."""
        return self._counters[_PULSE]

    def beat(self) -> None:
        """Count a round."""
        self._counters[_PULSE] += 1

    def write(self, kind: bytes, data: bytes = b"") -> bool:
        """Write a record, from any thread; return whether there was room for it."""
        record = _HEAD.pack(kind, len(data)) + data
        with self._lock:
            written = self._counters[_WRITTEN]
            if written + len(record) - self._counters[_READ] > _SIZE:
                return False
            at = written % _SIZE
            first = record[: _SIZE - at]
            self._memory[_BEGIN + at : _BEGIN + at + len(first)] = first
            rest = len(record) - len(first)
            self._memory[_BEGIN : _BEGIN + rest] = record[len(first) :]
            self._counters[_WRITTEN] = written + len(record)
        return True

    def read(self) -> Iterator[tuple[bytes, bytes]]:
        """Yield the records that are there: their kinds and contents."""
        while (at := self._counters[_READ]) < self._counters[_WRITTEN]:
            kind, size = _HEAD.unpack(self._bytes(at, _HEAD.size))
            yield kind, self._bytes(at + _HEAD.size, size)
            self._counters[_READ] = at + _HEAD.size + size

    def _bytes(self, at: int, size: int) -> bytes:
        at %= _SIZE
        first = self._memory[_BEGIN + at : _BEGIN + min(_SIZE, at + size)]
        return first + self._memory[_BEGIN : _BEGIN + size - len(first)]

    def close(self) -> None:
        """Let the memory go."""
        self._counters.release()
        self._memory.close()
        os.close(self.file)
