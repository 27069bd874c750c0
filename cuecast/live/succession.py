"""A second playout that stands by, and goes on where one dies.

The active playout writes down all that comes in, and when it let packets go, in memory that both
have (`cuecast.live.ring`). The one that stands by does the same work on it, so that it holds the
same packets in the same state; it marks and sends nothing. It holds the sockets as well, and the
lines to the processes that mark. Once the other one is gone it sends from the next datagram on.
"""

import contextlib
import mmap
import os
import pickle
import select
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from cuecast.live.channel import pair
from cuecast.live.lines import datagrams
from cuecast.live.marking_process import MarkingProcess
from cuecast.live.ring import Ring

_VARIABLE = "CUECAST_SUCCEEDS"
"""Variable of the environment with the descriptors of one that stands by."""

_AGAIN_S = 15.0
"""Seconds before another one is started in place of one that ended."""

_ROUND_S = 0.02
"""How often the one that stands by does the work on new records."""

_SUSPENDED_S = 0.5
"""A longer pause of its own: the whole machine may have stood still."""

_LONGEST_MESSAGE = 65_536
"""Bytes of a message at most: a report of the state is shorter."""

_READY, _STATE, _PROCESS, _OVER = b"R", b"S", b"P", b"O"
"""Messages: it has loaded; the state, then records; a process; no need any more."""


class Successor:
    """The process that stands by, as the active playout sees it.

    Parameters
    ----------
    argv : sequence of str
        Command line of the playout.
    sockets : sequence of socket.socket
        Those that the programme comes in by and goes out by.
    tell : callable
        Takes a line of the log.
    """

    def __init__(
        self, argv: Sequence[str], sockets: Sequence[socket.socket], tell: Callable[[str], None]
    ) -> None:
        self._tell = tell
        self.ring = Ring()
        self._line, theirs = pair()
        handed = [theirs.fileno(), self.ring.file, *(one.fileno() for one in sockets)]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "cuecast", *argv],
            pass_fds=handed,
            env=os.environ | {_VARIABLE: ",".join(map(str, handed))},
        )
        theirs.close()
        self._known: set[int] = set()
        self._behind = False
        self.follows = False

    def waits(self) -> bool:
        """Whether it has loaded and asks for the state.

        Raises
        ------
        EOFError
            If it has ended, or is too far behind.
        """
        if self._behind:
            raise EOFError
        try:
            message = self._line.recv(1, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except OSError as error:
            raise EOFError from error
        if message != _READY:
            raise EOFError
        return True

    def begin(self, state: bytes) -> None:
        """Give it the state; from here on it follows the records."""
        file = os.memfd_create("cuecast-state")
        try:
            os.ftruncate(file, len(state))
            with mmap.mmap(file, len(state)) as memory:
                memory[:] = state
            socket.send_fds(self._line, [_STATE], [file])
        finally:
            os.close(file)
        self.follows = True

    def processes(self, found: Mapping[int, MarkingProcess]) -> None:
        """Give it the lines of the processes that it does not have yet."""
        for serial, process in found.items():
            if serial not in self._known:
                self._known.add(serial)
                about = _PROCESS + pickle.dumps((serial, process.pid))
                with contextlib.suppress(OSError):  # it has ended: `waits` reports it
                    socket.send_fds(self._line, [about], [process.channel.line.fileno()])

    def write(self, kind: bytes, data: bytes = b"") -> None:
        """Write a record for it, from any thread."""
        if not self.ring.write(kind, data):
            self._behind = True

    @property
    def end(self) -> str:
        """Why it cannot take over, for the log."""
        if self._behind:
            return "was too far behind"
        status = self._process.poll()
        return "left its line" if status is None else f"ended ({status})"

    def close(self) -> None:
        """End it: it is not needed any more."""
        with contextlib.suppress(OSError):
            self._line.send(_OVER, socket.MSG_DONTWAIT)
        self._line.close()
        self._process.kill()
        self._process.wait()
        self.ring.close()


class Succession:
    """Keeps a playout's successor: starts one, and another one where that ended.

    Parameters
    ----------
    argv, sockets, tell
        As of `Successor`.
    """

    def __init__(
        self, argv: Sequence[str], sockets: Sequence[socket.socket], tell: Callable[[str], None]
    ) -> None:
        self._arguments = argv, sockets, tell
        self._tell = tell
        self.one: Successor | None = None
        self._again_s = 0.0

    @property
    def stands_by(self) -> bool:
        """Whether one could take over now."""
        return self.one is not None and self.one.follows

    def look(self) -> Successor | None:
        """Start one where there is none; return one that asks for the state.

        Raises
        ------
        EOFError
            If it has ended, or is too far behind.
        """
        if self.one is None:
            if time.monotonic() >= self._again_s:
                self.one = Successor(*self._arguments)
            return None
        return self.one if self.one.waits() else None

    def give_up(self) -> None:
        """Note that it has ended: another one is started later."""
        end = self.one.end if self.one else "did not start"
        self.close()
        self._again_s = time.monotonic() + _AGAIN_S
        self._tell(f"the playout that stood by {end}: another one in {_AGAIN_S:g} s")

    def close(self) -> None:
        """End it."""
        one, self.one = self.one, None
        if one is not None:
            one.close()


class Follower(Protocol):
    """A playout that follows another one."""

    def set_state(self, state: bytes) -> None:
        """Take the other one's state."""

    def replay(self, kind: bytes, data: bytes) -> None:
        """Do the work that a record stands for."""


class ShadowOutput:
    """Takes the datagrams of the active playout, up to where it has sent it.

    Parameters
    ----------
    ring : Ring
    first : int
        Datagrams that had been sent before.
    """

    ring: Ring | None = None
    handle: socket.socket | None = None

    def __init__(self, ring: Ring, first: int) -> None:
        self._ring, self._first = ring, first
        self._waiting: deque[bytes] = deque()

    def send(self, data: bytes) -> None:
        """Take data."""
        self._waiting += datagrams(data)
        self.rest()

    def rest(self) -> deque[bytes]:
        """Return the datagrams that the active playout did not send."""
        while self._waiting and self._first < self._ring.sent:
            self._waiting.popleft()
            self._first += 1
        return self._waiting

    def close(self) -> None:
        """Do nothing: there is nothing to end."""


class Inheritance:
    """Sockets, record and lines that a process which stands by has of the active one.

    Parameters
    ----------
    files : sequence of int
        Descriptors of the line, the ring, and the two sockets.
    """

    def __init__(self, files: Sequence[int]) -> None:
        self._line = socket.socket(fileno=files[0])
        self.ring = Ring(files[1])
        self.input, self.output = (socket.socket(fileno=one) for one in files[2:])
        self.processes: dict[int, tuple[int, socket.socket]] = {}
        self._active = os.getppid()

    @classmethod
    def find(cls) -> "Inheritance | None":
        """Return that of this process, None where it stands by for no other one."""
        files = os.environ.pop(_VARIABLE, "")
        return cls([int(one) for one in files.split(",")]) if files else None

    def follow(self, playout: Follower, patience_s: float) -> bool:
        """Follow until the other playout is gone; return whether to go on in its place.

        A playout that makes no round for longer than `patience_s` is ended.
        """
        usual = {signal.SIGTERM: signal.SIG_DFL}
        usual |= dict.fromkeys((signal.SIGINT, signal.SIGHUP), signal.SIG_IGN)
        before = {number: signal.signal(number, handler) for number, handler in usual.items()}
        self._line.send(_READY)
        begun, pulse, moved_s = False, -1, time.monotonic()
        looked_s = moved_s
        try:
            while True:
                now_s = time.monotonic()
                if self.ring.pulse != pulse or now_s - looked_s > _SUSPENDED_S:
                    pulse, moved_s = self.ring.pulse, now_s
                elif begun and now_s - moved_s > patience_s and os.getppid() == self._active:
                    os.kill(self._active, signal.SIGKILL)
                looked_s = now_s
                ready, _, _ = select.select([self._line], [], [], _ROUND_S)
                if ready:
                    message, files = self._message()
                    if message == _STATE:
                        playout.set_state(_content(files[0]))
                        begun = True
                    elif message[:1] == _PROCESS:
                        serial, pid = pickle.loads(message[1:])
                        self.processes[serial] = pid, socket.socket(fileno=files[0])
                    else:
                        break
                for kind, data in self.ring.read() if begun else ():
                    playout.replay(kind, data)
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
        if message == _OVER or not begun:
            return False
        for kind, data in self.ring.read():
            playout.replay(kind, data)
        return True

    def _message(self) -> tuple[bytes, list[int]]:
        """Return the next message and its descriptors, nothing at the end."""
        try:
            message, files, _, _ = socket.recv_fds(self._line, _LONGEST_MESSAGE, 1)
        except OSError:
            return b"", []
        return message, files

    def close(self) -> None:
        """Let all go that is not needed any more."""
        for _, line in self.processes.values():
            line.close()
        self._line.close()
        self.ring.close()

    def forget(self, last: int, kept: Sequence[int]) -> None:
        """Let go the lines to processes up to a number, but for some."""
        for serial in [one for one in self.processes if one <= last and one not in kept]:
            self.processes.pop(serial)[1].close()


def _content(file: int) -> bytes:
    with mmap.mmap(file, os.fstat(file).st_size) as memory:
        state = memory[:]
    os.close(file)
    return state
