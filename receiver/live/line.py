"""Inputs of a broadcast: datagrams of a network, or a pipe.

A line outlives its container. When a programme changes its form, the demultiplexer goes on looking
for packets that no longer come; the line then pretends to end, and whoever reads it opens a new
container on what follows.
"""

import queue
import socket
import struct
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import IO
from urllib.parse import parse_qs, urlsplit

from codec.errors import CueError

READ_TIMEOUT_S = 15.0
"""Silence on a line after which its container is opened again."""

PATIENCE_S, PATIENCE_BYTES = 1.0, 20_000
"""What may come without a packet of use before the programme is taken to have changed."""

_DATAGRAM = 65536
"""Bytes of the largest datagram."""

_WAITING = 20_000
"""Datagrams that wait for a slow reader: 26 MB of a transport stream."""

_RETRY_S = 0.5
"""Between two attempts to listen on a network that has gone."""


class InputLine(ABC):
    """A readable source that goes on after it has pretended to end.

    Attributes
    ----------
    over : bool
        Whether it has ended for good.
    """

    def __init__(self) -> None:
        self.over = False
        self._in_use = False
        self._bytes, self._first_s = 0, 0.0

    def connect(self) -> None:
        """Begin with a new container: nothing of use has come yet."""
        self._in_use = False

    def useful(self) -> None:
        """Note that the received data were of use."""
        self._in_use, self._bytes = True, 0

    def read(self, size: int) -> bytes:
        """Return up to `size` bytes as soon as there are some; none at an end."""
        if self.over or self._has_changed():
            return b""
        data = self._receive(size)
        if not self._bytes:
            self._first_s = time.monotonic()
        self._bytes += len(data)
        return data

    def _has_changed(self) -> bool:
        return (
            self._in_use
            and self._bytes > PATIENCE_BYTES
            and time.monotonic() - self._first_s > PATIENCE_S
        )

    @abstractmethod
    def _receive(self, size: int) -> bytes:
        """Return the next data; nothing after a silence or at the end."""

    @abstractmethod
    def stop(self) -> None:
        """End it for good, for whoever waits in `read` too."""


class Pipe(InputLine):
    """A binary file that is read once, from front to end."""

    def __init__(self, file: IO[bytes]) -> None:
        super().__init__()
        self._read = getattr(file, "read1", file.read)

    def _receive(self, size: int) -> bytes:
        data: bytes = self._read(size)
        self.over = self.over or not data
        return data

    def stop(self) -> None:
        """End it at its next byte."""
        self.over = True


class DatagramLine(InputLine):
    """Datagrams that come to a port; a thread of its own takes them off the system.

    Parameters
    ----------
    url : str
        ``udp://127.0.0.1:5004``, ``udp://@:5004`` (any of this machine's addresses), or that of a
        multicast group, with ``?localaddr=`` if it is to be joined by a certain interface.

    on_failure : callable
        Called in the thread with the reason why listening failed; it begins again after a while.

    Raises
    ------
    CueError
        If this is not the address of a port that can be listened to.
    """

    def __init__(
        self, url: str, *, on_failure: Callable[[Exception], None] = lambda error: None
    ) -> None:
        super().__init__()
        self._url, self._on_failure = url, on_failure
        self._socket = listen(url)
        self._datagrams: queue.Queue[bytes] = queue.Queue(_WAITING)
        self._held = memoryview(b"")
        threading.Thread(target=self._take, daemon=True, name="datagrams").start()

    def _take(self) -> None:
        while not self.over:
            try:
                data = self._socket.recv(_DATAGRAM)
            except TimeoutError:
                continue
            except OSError as error:
                self._listen_again(error)
                continue
            try:
                self._datagrams.put_nowait(data)
            except queue.Full:  # lost, as on the network
                continue
        self._socket.close()

    def _listen_again(self, error: Exception) -> None:
        """Listen anew after the network went away, as often as it takes."""
        self._on_failure(error)
        self._socket.close()
        while not self.over:
            time.sleep(_RETRY_S)
            try:
                self._socket = listen(self._url)
            except CueError:
                continue
            return

    def _receive(self, size: int) -> bytes:
        if not self._held:
            try:
                self._held = memoryview(self._datagrams.get(timeout=READ_TIMEOUT_S))
            except queue.Empty:
                return b""
        out, self._held = bytes(self._held[:size]), self._held[size:]
        return out

    def stop(self) -> None:
        """Stop listening."""
        self.over = True
        with self._datagrams.mutex:
            self._datagrams.queue.clear()
        self._datagrams.put(b"")


def listen(url: str) -> socket.socket:
    """Return a socket that takes the datagrams to an address."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname or "0.0.0.0", parts.port
        interface = parse_qs(parts.query).get("localaddr", ["0.0.0.0"])[0]
        if not port:
            raise ValueError("a port is missing")
        found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
        family, kind, protocol, _, address = found[0]
        group = socket.inet_pton(family, str(address[0]))
        joins = group[0] == 0xFF if family == socket.AF_INET6 else group[0] >> 4 == 0xE
        receiver = socket.socket(family, kind, protocol)
        try:
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, int(joins))
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
            receiver.settimeout(0.5)
            receiver.bind(address)
            if joins and family == socket.AF_INET6:
                receiver.setsockopt(
                    socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP, group + struct.pack("@I", 0)
                )
            elif joins:
                receiver.setsockopt(
                    socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + socket.inet_aton(interface)
                )
        except OSError:
            receiver.close()
            raise
    except (OSError, ValueError) as error:
        raise CueError(f"{url}: cannot be listened to: {error}") from error
    return receiver
