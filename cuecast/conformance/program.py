"""The decoder under test: a program that answers each line of JSON with one line of JSON."""

import json
import os
import selectors
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from codec.errors import CueError

TIMEOUT_S = 120.0
"""Seconds that an answer may take before the program counts as hung."""

_CHUNK = 1 << 16
"""Bytes read at once from a decoder."""
_MOST_BYTES = 1 << 26
"""Bytes of one answer at most."""


class Program:
    """A decoder as a process; closes it on leaving a `with` block.

    Parameters
    ----------
    command : sequence of str
        The program and its arguments.
    folder : path-like, optional
        Where it runs; here by default.
    timeout_s : float
        Limit for one answer.

    Raises
    ------
    CueError
        If the program cannot be started.
    """

    def __init__(
        self,
        command: Sequence[str],
        *,
        folder: str | os.PathLike[str] | None = None,
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        self.name = Path(command[0]).name
        self._timeout_s = timeout_s
        self._rest = b""
        try:
            self._process = subprocess.Popen(
                list(command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=folder
            )
        except OSError as error:
            raise CueError(f"{command[0]}: cannot start: {error.strerror}") from error
        assert self._process.stdout is not None
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._process.stdout, selectors.EVENT_READ)

    def ask(self, what: str, **fields: Any) -> dict[str, Any]:
        """Send a request and return the answer.

        Raises
        ------
        CueError
            If the program ended, hangs, or answers with something else than one JSON object.
        """
        line = json.dumps({"do": what, **fields}, separators=(",", ":"))
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(line.encode() + b"\n")
            self._process.stdin.flush()
        except OSError as error:
            raise CueError(self._ended(what)) from error
        text = self._line(what)
        try:
            answer = json.loads(text)
        except ValueError as error:
            shown = text[:60].decode(errors="replace")
            raise CueError(f"{self.name}: no JSON in answer to {what!r}: {shown}") from error
        if not isinstance(answer, dict):
            raise CueError(f"{self.name}: answer to {what!r} is no JSON object")
        return answer

    def _line(self, what: str) -> bytes:
        assert self._process.stdout is not None
        until = time.monotonic() + self._timeout_s
        pieces = [self._rest]
        size = len(self._rest)
        while b"\n" not in pieces[-1]:
            if not self._selector.select(max(until - time.monotonic(), 0.0)):
                raise CueError(f"{self.name}: no answer to {what!r} in {self._timeout_s:g} s")
            piece = os.read(self._process.stdout.fileno(), _CHUNK)
            size += len(piece)
            if not piece:
                raise CueError(self._ended(what))
            if size > _MOST_BYTES:
                raise CueError(
                    f"{self.name}: answer to {what!r} is longer than {_MOST_BYTES} bytes"
                )
            pieces.append(piece)
        line, _, self._rest = b"".join(pieces).partition(b"\n")
        return line

    def _ended(self, what: str) -> str:
        try:
            code = self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            return f"{self.name}: closed its output at {what!r}"
        return f"{self.name}: ended with status {code} at {what!r}"

    def close(self) -> None:
        """End the program."""
        self._selector.close()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:
                    continue
        try:
            self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
