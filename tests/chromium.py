"""A headless Chromium driven over the DevTools protocol with aiohttp's WebSocket client."""

import asyncio
import base64
import contextlib
import json
import shutil
import signal
import tempfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--autoplay-policy=no-user-gesture-required", "--remote-debugging-port=0",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--mute-audio", "--hide-scrollbars", "--lang=fr",
)  # fmt: skip


class Page:
    """One tab."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._serial = 0
        self._answers: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self.errors: list[str] = []
        self._reader = asyncio.create_task(self._read())

    async def _read(self) -> None:
        async for message in self._socket:
            document = json.loads(message.data)
            waiting = self._answers.pop(document.get("id", -1), None)
            if waiting is not None and not waiting.done():
                waiting.set_result(document)
            elif document.get("method") == "Runtime.exceptionThrown":
                details = document["params"]["exceptionDetails"]
                self.errors.append(str(details.get("exception", details).get("description")))

    async def call(self, method: str, **params: Any) -> dict[str, Any]:
        self._serial += 1
        answer = asyncio.get_running_loop().create_future()
        self._answers[self._serial] = answer
        await self._socket.send_json({"id": self._serial, "method": method, "params": params})
        document = await asyncio.wait_for(answer, 60)
        assert "error" not in document, document
        return dict(document["result"])

    async def evaluate(self, expression: str) -> Any:
        result = await self.call(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

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

    async def press(self, key: str, code: int = 0) -> None:
        text = {"text": "\r" if key == "Enter" else key} if len(key) == 1 or key == "Enter" else {}
        for kind in ("keyDown", "keyUp"):
            extra = text if kind == "keyDown" else {}
            await self.call(
                "Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, **extra
            )

    async def resize(self, width: int, height: int) -> None:
        await self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height,
            deviceScaleFactor=1, mobile=False,
        )  # fmt: skip

    async def screenshot(self, path: Path) -> None:
        result = await self.call("Page.captureScreenshot", format="png")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(base64.b64decode(result["data"]))


@contextlib.asynccontextmanager
async def browse(address: str, width: int = 1280, height: int = 720) -> AsyncIterator[Page]:
    """Open `address` in a new browser with a profile of its own; skip if there is none."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("no chromium on this machine: the page cannot be tried")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        process = await asyncio.create_subprocess_exec(
            program, *FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}",
            "about:blank", stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE,
            start_new_session=True,
        )  # fmt: skip
        assert process.stderr is not None
        drain: asyncio.Task[bytes] | None = None
        try:
            port = await asyncio.wait_for(_port(process.stderr), 40)
            drain = asyncio.create_task(process.stderr.read())
            async with aiohttp.ClientSession() as session:
                async with session.get(f"http://127.0.0.1:{port}/json") as answer:
                    tabs = await answer.json()
                target = next(tab for tab in tabs if tab["type"] == "page")
                async with session.ws_connect(
                    target["webSocketDebuggerUrl"], max_msg_size=0, heartbeat=None
                ) as socket:
                    page = Page(socket)
                    await page.call("Runtime.enable")
                    await page.call("Page.enable")
                    await page.resize(width, height)
                    await page.call("Page.navigate", url=address)
                    yield page
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


async def _port(stream: asyncio.StreamReader) -> int:
    while line := await stream.readline():
        if b"DevTools listening on ws://" in line:
            return int(line.split(b"127.0.0.1:")[1].split(b"/")[0])
    raise AssertionError("chromium ended before it listened")
