"""A tab of a headless browser, driven over its WebSocket with aiohttp's client."""

import asyncio
import contextlib
import json
import os
import signal
import tempfile
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp

ANSWER_S = 60
"""Longest wait for a browser's answer."""


class Connection:
    """A WebSocket to a browser or to one of its tabs."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._serial = 0
        self._answers: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._reader = asyncio.create_task(self._read())

    async def _read(self) -> None:
        async for message in self._socket:
            document = json.loads(message.data)
            waiting = self._answers.pop(document.get("id") or -1, None)
            if waiting is None:
                self._note(document.get("method", ""), document.get("params", {}))
            elif not waiting.done():
                waiting.set_result(document)

    async def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a command of the browser's protocol and return its result."""
        self._serial += 1
        answer = asyncio.get_running_loop().create_future()
        self._answers[self._serial] = answer
        await self._socket.send_json({"id": self._serial, "method": method, "params": params})
        document = await asyncio.wait_for(answer, ANSWER_S)
        assert "error" not in document, document
        return dict(document["result"])

    def _note(self, event: str, params: dict[str, Any]) -> None:
        """Take an event of the browser."""


class Tab(Connection, ABC):
    """One tab.

    Attributes
    ----------
    errors : list of str
        Exceptions that no script of the page caught.
    requests : list of str
        Addresses that the page asked for.
    """

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        super().__init__(socket)
        self.errors: list[str] = []
        self.requests: list[str] = []

    async def until(self, expression: str, timeout_s: float = 30) -> Any:
        """Wait until an expression is truthy; fail with the page's errors."""
        deadline = asyncio.get_running_loop().time() + timeout_s
        while True:
            value = await self.evaluate(expression)
            if value:
                return value
            waited = asyncio.get_running_loop().time() > deadline
            assert not waited, f"{expression} stayed {value!r}; {self.errors}"
            await asyncio.sleep(0.05)

    @abstractmethod
    async def evaluate(self, expression: str) -> Any:
        """Return the value of an expression in the page, awaited if it is a promise."""

    @abstractmethod
    async def press(self, key: str, code: int = 0) -> None:
        """Press and release a key."""

    @abstractmethod
    async def resize(self, width: int, height: int) -> None:
        """Set the size of the visible part."""

    @abstractmethod
    async def screenshot(self, path: Path) -> None:
        """Write the visible part of the page as PNG."""

    @abstractmethod
    async def hide(self) -> None:
        """Put another tab before this one."""

    @abstractmethod
    async def show(self) -> None:
        """Put this tab in front again."""


@contextlib.asynccontextmanager
async def running(
    program: str,
    *flags: str,
    mark: bytes,
    profile: str,
    preferences: dict[str, Any] | None = None,
    variables: dict[str, str] | None = None,
) -> AsyncIterator[str]:
    """Start a browser.

    Parameters
    ----------
    program : str
    flags : str
    mark : bytes
        What the browser writes before the address at which it listens.
    profile : str
        Flag that names the folder of its own; text ``{}`` stands for the folder.
    preferences : dict, optional
        Settings of a Firefox by name.
    variables : dict, optional
        Environment variables that it gets besides the present ones.

    Yields
    ------
    str
        Host and port at which it listens.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        if preferences is not None:
            lines = [
                f"user_pref({json.dumps(n)}, {json.dumps(v)});" for n, v in preferences.items()
            ]
            Path(folder, "user.js").write_text("\n".join(lines), encoding="utf-8")
        process = await asyncio.create_subprocess_exec(
            program,
            *flags,
            profile.format(folder),
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, **(variables or {})},
        )
        assert process.stderr is not None
        drain: asyncio.Task[bytes] | None = None
        try:
            listening = await asyncio.wait_for(_address(process.stderr, mark), 40)
            drain = asyncio.create_task(process.stderr.read())
            yield listening
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.send_signal(signal.SIGTERM)
            try:
                await asyncio.wait_for(process.wait(), 10)
            except TimeoutError:
                process.kill()
                await process.wait()
            if drain is not None:
                await drain


async def _address(stream: asyncio.StreamReader, mark: bytes) -> str:
    while line := await stream.readline():
        if mark in line:
            return line.split(mark)[1].split(b"/")[0].strip().decode()
    raise AssertionError("the browser ended before it listened")
