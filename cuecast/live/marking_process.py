"""One process that marks, with the ways to it and back."""

import contextlib
import os
import pickle
import queue
import signal
import socket
import tempfile
import time
from multiprocessing import get_context
from multiprocessing.reduction import DupFd
from typing import Any

from cuecast.live.channel import Channel, pair

_LINES = 400
"""Lines of an interpreter that may wait for the process."""


class MarkingProcess:
    """A process that marks: one of this process's own, or of one that died.

    Parameters
    ----------
    arguments : tuple, optional
        Its cuer and options; see `cuecast.live.marking.serve`.
    adopted : tuple of (int, socket.socket), optional
        A running one in place of that: its number in the system, and the line to it.

    Attributes
    ----------
    channel : Channel
    pid : int
    ready : bool
        Whether it can take sound.
    started_s : float
    """

    def __init__(
        self, arguments: tuple[Any, ...] = (), adopted: tuple[int, socket.socket] | None = None
    ) -> None:
        self.started_s = time.monotonic()
        self.ready = False
        self._process: Any = None
        self._lines: Any = None
        if adopted is not None:
            self.pid, line = adopted
            self.channel = Channel(line)
            # Unlike its number, this cannot come to stand for another process.
            self._handle = os.pidfd_open(self.pid) if hasattr(os, "pidfd_open") else -1
            return
        context = get_context("spawn")
        ours, theirs = pair()
        self.channel = Channel(ours)
        self._lines = context.Queue(_LINES)
        with tempfile.TemporaryFile() as file:
            pickle.dump(arguments, file)
            file.flush()
            self._process = context.Process(
                target=_serve, args=(_Handed(file.fileno()), theirs, self._lines), daemon=True
            )
            self._process.start()
        theirs.close()
        self.pid = self._process.pid

    def post(self, number: int, sent_s: float, *message: Any) -> None:
        """Give it a message; one that is full of them gets none."""
        self.channel.post(number, (sent_s, *message))

    def interpret(self, came_s: float, line: bytes | None) -> bool:
        """Give it a line of an interpreter; return whether there was room within a second."""
        try:
            if self._lines is not None:
                self._lines.put((came_s, line), timeout=1.0)
        except queue.Full:
            return False
        except (ValueError, OSError):  # it is closed
            return True
        return True

    @property
    def ending(self) -> str:
        """How it ended, in words."""
        if self._process is None:
            return "ended"
        self._process.join(0.1)
        status = self._process.exitcode
        return "ended" if status is None else f"ended ({status})"

    def close(self, wait_s: float = 0.0) -> None:
        """End it, and wait until it is gone.

        On a busy machine that takes a second: nobody waits for it who has a programme to send.
        """
        self.channel.close()
        if self._process is None:
            if self._handle >= 0:
                with contextlib.suppress(ProcessLookupError):
                    signal.pidfd_send_signal(self._handle, signal.SIGKILL)
                os.close(self._handle)
            return
        self._process.kill()
        self._process.join(wait_s)
        self._lines.cancel_join_thread()
        self._lines.close()


class _Handed:
    """An open file with the arguments of a process that is being started.

    Through the pipe on which a process gets its own ones no more than 64 KB pass before it reads:
    who starts it would wait until it has come up, 2.5 s at a load of 19.
    """

    def __init__(self, file: int) -> None:
        self._file = file

    def __reduce__(self) -> tuple[Any, ...]:
        return _of_file, (DupFd(self._file),)


def _of_file(handed: Any) -> tuple[Any, ...]:
    with open(handed.detach(), "rb") as file:
        file.seek(0)
        return tuple(pickle.load(file))


def _serve(arguments: tuple[Any, ...], *lines: Any) -> None:
    """Mark, in the process that does so."""
    # That process imports what it works with; the playout needs none of it.
    from cuecast.live.marking import serve

    serve(*arguments, *lines)
