"""Where a running programme comes from and goes to: datagrams, pipes and files.

``udp://host:port`` (in: ``udp://@:port`` or a multicast group), ``-`` for a pipe, or a path. A
thread of its own receives data, with their times of arrival.
"""

import contextlib
import queue
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import BinaryIO
from urllib.parse import urlsplit

from codec.errors import CueError
from cuecast.live.ring import Ring
from receiver.live.line import listen

_DATAGRAM = 65536
"""Bytes of the largest datagram."""

_BLOCK = 188 * 7 * 16
"""Bytes that are read at once from a pipe."""

_WAITING = 40_000
"""Datagrams that wait for the playout: half a minute of 14 Mbit/s."""

_WAITING_BLOCKS = 8
"""Blocks that wait where the programme is not paced by its own arrival."""

_PAYLOAD = 188 * 7
"""Bytes of a datagram that is sent: seven packets, as is usual."""

_BUFFER = 16 << 20
"""Buffer of the system for a process that does not come to read, bytes."""

_FORCED = 33
"""Code of SO_RCVBUFFORCE on Linux: beyond the limit of the system, for who may."""

_STAMPED = 35
"""Code of SO_TIMESTAMPNS on Linux: the system says when each datagram came."""

_TIMESPEC = struct.Struct("@qq")
"""Seconds and nanoseconds of such a stamp."""

_NOTES = socket.CMSG_SPACE(_TIMESPEC.size)
"""Bytes that the system may add to a datagram."""

_OLDEST_S = 60.0
"""A stamp of longer ago is one of a clock that was set."""

_LONGEST_LINE = 1 << 16
"""Bytes of a line on the standard input; a longer one is passed over."""

_STAMP = struct.Struct("=dB")
"""Of a record of a datagram: when it came, and how many bytes of the system's stamp follow."""

Arrival = tuple[float, bytes]


def _forget(record: bytes) -> None:
    """Take the record of a datagram that nobody needs."""


class Input:
    """Input, with its times.

    Parameters
    ----------
    address : str
    inherited : socket.socket, optional
        Of a process that died, in place of a new one for the address.
    last : bytes
        Record of the last datagram that process took, see `mirrored`.

    Attributes
    ----------
    paced : bool
        Whether it comes at its own pace, as datagrams do; a pipe can be made to wait.
    over : bool
        Whether it has ended.

    Raises
    ------
    CueError
        If it cannot be opened.
    """

    def __init__(
        self, address: str, inherited: socket.socket | None = None, last: bytes = b""
    ) -> None:
        self.paced = address.startswith("udp:")
        self.over = False
        self._last = last
        self._mirror: Callable[[bytes], object] = _forget
        self._lock = threading.Lock()
        self._arrivals: queue.Queue[Arrival | None] = queue.Queue(
            _WAITING if self.paced else _WAITING_BLOCKS
        )
        self.dropped = 0
        if self.paced:
            self._socket = listen(address) if inherited is None else inherited
            self._socket.settimeout(0.5)
            with contextlib.suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, _FORCED, _BUFFER)
            with contextlib.suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, _STAMPED, 1)
            work = self._take_datagrams
        else:
            self._file = _opened(address, "rb")
            work = self._take_file
        threading.Thread(target=work, daemon=True, name="input").start()

    def take(self, wait_s: float) -> list[Arrival]:
        """Return the data since the last call, waiting at most that long for a first piece."""
        found: list[Arrival] = []
        try:
            one = self._arrivals.get(timeout=wait_s) if wait_s > 0 else self._arrivals.get_nowait()
            while True:
                if one is None:
                    self.over = True
                    break
                found.append(one)
                if len(found) >= 200:
                    break
                one = self._arrivals.get_nowait()
        except queue.Empty:
            pass
        return found

    def mirrored(self, mirror: Callable[[bytes], object] = _forget) -> tuple[list[Arrival], bytes]:
        """Give the record of each further datagram to a function, before it is off the system.

        Return the datagrams that wait, and the record of the last one.
        """
        with self._lock:
            self._mirror = mirror
            with self._arrivals.mutex:
                return [one for one in self._arrivals.queue if one is not None], self._last

    def put(self, arrivals: Iterable[Arrival]) -> None:
        """Let arrivals wait that another process took."""
        for one in arrivals:
            self._arrivals.put_nowait(one)

    @property
    def handle(self) -> socket.socket:
        """Socket of datagrams."""
        return self._socket

    def _take_datagrams(self) -> None:
        while True:
            try:
                data, notes, _, _ = self._socket.recvmsg(_DATAGRAM, _NOTES, socket.MSG_PEEK)
            except TimeoutError:
                continue
            except OSError:  # closed
                return
            stamp = notes[0][2] if notes else b""
            came_s = time.monotonic() - _age_s(notes)
            record = _STAMP.pack(came_s, len(stamp)) + stamp + data
            with self._lock:
                repeated = bool(stamp) and record[_STAMP.size :] == self._last[_STAMP.size :]
                if not repeated and self._arrivals.full():
                    self.dropped += 1
                elif not repeated:
                    self._last = record
                    self._mirror(record)
                    self._arrivals.put_nowait((came_s, data))
            with contextlib.suppress(OSError):
                self._socket.recv(1)

    def _take_file(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            while data := self._file.read(_BLOCK):
                self._arrivals.put((time.monotonic(), data))
        self._arrivals.put(None)
        self._file.close()

    def close(self) -> None:
        """Stop listening."""
        if self.paced:
            self._socket.close()


def arrival_of(record: bytes) -> Arrival:
    """Return the arrival in the record of a datagram."""
    came_s, length = _STAMP.unpack_from(record)
    return came_s, record[_STAMP.size + length :]


def _age_s(notes: list[tuple[int, int, bytes]]) -> float:
    """Return how long ago the system took a datagram in, 0 where it does not report it."""
    for level, kind, data in notes:
        if (level, kind, len(data)) == (socket.SOL_SOCKET, _STAMPED, _TIMESPEC.size):
            seconds, nanoseconds = _TIMESPEC.unpack(data)
            age_s = time.time() - (seconds + 1e-9 * nanoseconds)
            return age_s if 0.0 < age_s < _OLDEST_S else 0.0
    return 0.0


class Output:
    """Output.

    Parameters
    ----------
    address : str
    inherited : socket.socket, optional
        Of a process that died.

    Attributes
    ----------
    sent : int
        Datagrams so far.
    ring : Ring or None
        Where that number is noted for another process.

    Raises
    ------
    CueError
        If it cannot be opened.
    """

    def __init__(self, address: str, inherited: socket.socket | None = None) -> None:
        self._socket: socket.socket | None = None
        self._new: Path | None = None
        self.sent = 0
        self.ring: Ring | None = None
        if not address.startswith("udp:"):
            known = address == "-" or Path(address).exists()
            self._new = None if known else Path(address)
            self._file = _opened(address, "wb")
            return
        parts = urlsplit(address)
        try:
            if not parts.hostname or not parts.port:
                raise ValueError("a host or a port is missing")
            family, kind, _, _, target = socket.getaddrinfo(
                parts.hostname, parts.port, type=socket.SOCK_DGRAM
            )[0]
            self._socket = inherited or socket.socket(family, kind)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 << 20)
            self._target = target
        except (OSError, ValueError) as error:
            raise CueError(f"{address}: cannot be sent to: {error}") from error

    def send(self, data: bytes) -> None:
        """Send whole packets.

        Raises
        ------
        CueError
            If nobody reads the pipe any more, or the disk is full.
        """
        if self._socket is None:
            self._new = None
            try:
                left = memoryview(data)
                while left:
                    left = left[self._file.write(left) :]
            except (OSError, ValueError) as error:
                raise CueError(f"the output ended: {error}") from error
            return
        for one in datagrams(data):
            with contextlib.suppress(OSError):  # nobody there yet, or a full line: as a network
                self._socket.sendto(one, self._target)
            self.sent += 1
            if self.ring is not None:
                self.ring.sent = self.sent

    @property
    def handle(self) -> socket.socket | None:
        """Socket of datagrams, None where it is a file or a pipe."""
        return self._socket

    def close(self) -> None:
        """End it; a new file that nothing was written to is removed."""
        if self._socket is not None:
            self._socket.close()
        else:
            with contextlib.suppress(OSError):
                self._file.close()
            if self._new is not None and self._new.is_file():
                self._new.unlink(missing_ok=True)


def datagrams(data: bytes) -> list[bytes]:
    """Return the datagrams that carry the data."""
    return [data[at : at + _PAYLOAD] for at in range(0, len(data), _PAYLOAD)]


def piped_lines() -> Iterator[bytes]:
    r"""Yield the lines of the standard input without their ends, as they come.

    Lines of more than 64 KiB are passed over. The file descriptor is read without Python's buffer:
    a daemon thread that waits inside that one makes the interpreter abort at its end.
    """
    held, skipping = bytearray(), False
    with open(sys.stdin.fileno(), "rb", buffering=0, closefd=False) as pipe:
        while data := pipe.read(_LONGEST_LINE):
            held += data
            *lines, rest = held.split(b"\n")
            for line in lines:
                if not skipping and len(line) <= _LONGEST_LINE:
                    yield bytes(line)
                skipping = False
            skipping |= len(rest) > _LONGEST_LINE
            held = bytearray() if skipping else rest
    if held and not skipping:
        yield bytes(held)


def _opened(address: str, mode: str) -> "BinaryIO":
    """Open a file or, for ``-``, a standard stream without Python's buffer (see `piped_lines`)."""
    pipe = sys.stdin if mode == "rb" else sys.stdout
    try:
        if address == "-":
            return open(pipe.fileno(), mode, buffering=0, closefd=False)  # type: ignore[return-value]
        return open(address, mode, buffering=0)  # type: ignore[return-value]
    except OSError as error:
        raise CueError(f"{address}: {error.strerror}") from error
