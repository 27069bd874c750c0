"""A headless Chromium driven over the DevTools protocol."""

import atexit
import base64
import contextlib
import shutil
import subprocess
import tempfile
import threading
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from tests.browsing import Connection, Tab

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--autoplay-policy=no-user-gesture-required", "--remote-debugging-port=0",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--mute-audio", "--hide-scrollbars", "--lang=fr",
)  # fmt: skip


MARK = b"DevTools listening on ws://"
"""What Chromium writes before the address at which it listens."""


class Page(Tab):
    """One tab of Chromium."""

    context = ""

    def _note(self, event: str, params: dict[str, Any]) -> None:
        if event == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.errors.append(str(details.get("exception", details).get("description")))
        elif event == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])

    async def evaluate(self, expression: str) -> Any:
        """Return the value of an expression in the page, awaited if it is a promise."""
        result = await self.call(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    async def press(self, key: str, code: int = 0) -> None:
        """Press and release a key."""
        text = {"text": "\r" if key == "Enter" else key} if len(key) == 1 or key == "Enter" else {}
        for kind in ("keyDown", "keyUp"):
            extra = text if kind == "keyDown" else {}
            await self.call(
                "Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, **extra
            )

    async def resize(self, width: int, height: int) -> None:
        """Set the size of the visible part."""
        await self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )

    async def screenshot(self, path: Path) -> None:
        """Write the visible part of the page as PNG."""
        result = await self.call("Page.captureScreenshot", format="png")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(base64.b64decode(result["data"]))

    async def hide(self) -> None:
        """Put another tab before this one."""
        found = await self.call(
            "Target.createTarget", url="about:blank", browserContextId=self.context
        )
        self._other = found["targetId"]
        await self.call("Target.activateTarget", targetId=self._other)

    async def show(self) -> None:
        """Put this tab in front again."""
        await self.call("Target.closeTarget", targetId=self._other)
        await self.call("Page.bringToFront")


class _Browser:
    """The one browser of this process: starting one takes longer than most tests of a page."""

    def __init__(self, program: str) -> None:
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        flags = (*FLAGS, f"--user-data-dir={self._profile.name}", "about:blank")
        self.process = subprocess.Popen(
            [program, *flags],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        atexit.register(self.end)
        self.address = ""
        assert self.process.stderr is not None
        for line in self.process.stderr:
            if MARK in line:
                self.address = line.split(MARK)[1].split(b"/")[0].strip().decode()
                break
        assert self.address, "the browser ended before it listened"
        threading.Thread(target=self.process.stderr.read, daemon=True).start()

    def end(self) -> None:
        """Stop it and forget its profile."""
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._profile.cleanup()


_started: list[_Browser] = []


def _browser() -> _Browser:
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("no chromium on this machine: the page cannot be tried")
    if not _started or _started[-1].process.poll() is not None:
        _started.append(_Browser(program))
    return _started[-1]


@contextlib.asynccontextmanager
async def browse(address: str, width: int = 1280, height: int = 720) -> AsyncIterator[Page]:
    """Open `address` in a tab with cookies and settings of its own; skip if there is no browser."""
    listening = _browser().address
    async with aiohttp.ClientSession() as session:
        async with session.get(f"http://{listening}/json/version") as answer:
            whole = (await answer.json())["webSocketDebuggerUrl"]
        async with session.ws_connect(whole, max_msg_size=0, heartbeat=None) as control:
            browser = Connection(control)
            context = (await browser.call("Target.createBrowserContext"))["browserContextId"]
            target = await browser.call(
                "Target.createTarget",
                url="about:blank",
                browserContextId=context,
                width=width,
                height=height,
            )
            tab = f"ws://{listening}/devtools/page/{target['targetId']}"
            try:
                async with session.ws_connect(tab, max_msg_size=0, heartbeat=None) as socket:
                    page = Page(socket)
                    page.context = context
                    for domain in ("Runtime", "Page", "Network"):
                        await page.call(f"{domain}.enable")
                    await page.resize(width, height)
                    await page.call("Page.navigate", url=address)
                    yield page
            finally:
                await browser.call("Target.disposeBrowserContext", browserContextId=context)
