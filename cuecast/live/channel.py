"""Numbered messages between two processes, each of which arrives whole or not at all.

An end can be held by several processes. Where the one that used it is killed, another one goes on:
it repeats its last messages, those that were taken already are passed over, and it asks the other
side to repeat messages that the killed one may have taken with it. Needs Linux: packets in order,
and an end that is noticed (SOCK_SEQPACKET).
"""

import pickle
import select
import socket
import struct
import threading
from collections import deque
from collections.abc import Iterator
from typing import Any

from codec.errors import CueError

_HEAD = struct.Struct("<QHH")
"""Number of the message, number of the part, parts."""

_PART = 32_768
"""Bytes of a part at most: the system takes one whole or not at all."""

_LONGEST_PACKET = _PART + _HEAD.size

_WAITING = 8000
"""Parts that may wait for the other side: minutes of sound."""

_REPEATED = 4 << 20
"""Bytes of sent messages that can be repeated: seconds of marked sound."""

_CONTROL = 0
"""Number of the lines' own messages: all after a number are asked for, or follow."""


def pair() -> tuple[socket.socket, socket.socket]:
    """Return the two ends of a line.

    Raises
    ------
    CueError
        If the system has no such lines.
    """
    try:
        return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    except (AttributeError, OSError) as error:
        raise CueError("playout: needs sockets of packets in order, as Linux has them") from error


class Channel:
    """One end of a line of messages.

    Parameters
    ----------
    line : socket.socket

    Attributes
    ----------
    taken : int
        Number of the last message that was taken.
    """

    def __init__(self, line: socket.socket) -> None:
        self.line = line
        self.taken = 0
        self._number = 0
        self._waiting: deque[bytes] = deque()
        self._sent: deque[tuple[int, bytes]] = deque()
        self._sent_bytes = 0
        self._parts: list[bytes] = []
        self._asked = False
        self._lock = threading.Lock()
        self._poll = select.poll()
        self._poll.register(line, select.POLLIN)

    def post(self, number: int, message: object) -> None:
        """Send a message when there is room, without waiting; one too many is left out."""
        if len(self._waiting) < _WAITING:
            self._waiting += _packets(number, pickle.dumps(message))
        self.flush()

    def flush(self) -> None:
        """Send waiting packets, as far as there is room."""
        while self._waiting:
            try:
                self.line.send(self._waiting[0], socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            except OSError:  # nobody there: `receive` reports it
                self._waiting.clear()
                return
            self._waiting.popleft()

    def send(self, message: object) -> None:
        """Send a message with the next number, from any thread; wait until there is room.

        Raises
        ------
        OSError
            If the other side is gone.
        """
        data = pickle.dumps(message)
        with self._lock:
            self._number += 1
            self._sent.append((self._number, data))
            self._sent_bytes += len(data)
            while self._sent_bytes > _REPEATED:
                self._sent_bytes -= len(self._sent.popleft()[1])
            for packet in _packets(self._number, data):
                self.line.send(packet)

    def receive(self, wait_s: float) -> Iterator[Any]:
        """Yield new messages that have come, waiting at most that long for a first one.

        Raises
        ------
        EOFError
            If nobody holds the other end any more.
        """
        while self._poll.poll(1000 * wait_s):
            wait_s = 0.0
            try:
                packet = self.line.recv(_LONGEST_PACKET, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            except OSError as error:
                raise EOFError from error
            if not packet:
                raise EOFError
            number, part, parts = _HEAD.unpack_from(packet)
            if part == 0:
                self._parts = []
            if part != len(self._parts):  # the beginning went to a process that was killed
                continue
            self._parts.append(packet[_HEAD.size :])
            if part + 1 < parts:
                continue
            data, self._parts = b"".join(self._parts), []
            if number == _CONTROL:
                asks, after = pickle.loads(data)
                if asks:
                    self._repeat(after)
                else:
                    self._asked, self.taken = False, max(self.taken, after)
            elif number > self.taken and not self._asked:
                self.taken = number
                yield pickle.loads(data)

    def ask_again(self) -> None:
        """Ask for all messages after the last one that was taken; until they come none counts."""
        self._asked = True
        self._waiting += _packets(_CONTROL, pickle.dumps((True, self.taken)))
        self.flush()

    def _repeat(self, after: int) -> None:
        with self._lock:
            for packet in _packets(_CONTROL, pickle.dumps((False, after))):
                self.line.send(packet)
            for number, data in self._sent:
                if number > after:
                    for packet in _packets(number, data):
                        self.line.send(packet)

    def close(self) -> None:
        """Let the line go."""
        self._waiting.clear()
        self.line.close()


def _packets(number: int, data: bytes) -> Iterator[bytes]:
    parts = max(1, -(-len(data) // _PART))
    for part in range(parts):
        yield _HEAD.pack(number, part, parts) + data[part * _PART : (part + 1) * _PART]
