"""A headless Chromium driven over the DevTools protocol."""

import base64
import contextlib
import shutil
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from tests.browsing import Tab, running

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--autoplay-policy=no-user-gesture-required", "--remote-debugging-port=0",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--mute-audio", "--hide-scrollbars", "--lang=fr",
)  # fmt: skip


class Page(Tab):
    """One tab of Chromium."""

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
        self._other = (await self.call("Target.createTarget", url="about:blank"))["targetId"]
        await self.call("Target.activateTarget", targetId=self._other)

    async def show(self) -> None:
        """Put this tab in front again."""
        await self.call("Target.closeTarget", targetId=self._other)
        await self.call("Page.bringToFront")


@contextlib.asynccontextmanager
async def browse(address: str, width: int = 1280, height: int = 720) -> AsyncIterator[Page]:
    """Open `address` in a new browser with a profile of its own; skip if there is none."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("no chromium on this machine: the page cannot be tried")
    flags = (*FLAGS, f"--window-size={width},{height}", "about:blank")
    mark = b"DevTools listening on ws://"
    async with (
        running(program, *flags, mark=mark, profile="--user-data-dir={}") as listening,
        aiohttp.ClientSession() as session,
    ):
        async with session.get(f"http://{listening}/json") as answer:
            tabs = await answer.json()
        target = next(tab for tab in tabs if tab["type"] == "page")
        async with session.ws_connect(
            target["webSocketDebuggerUrl"], max_msg_size=0, heartbeat=None
        ) as socket:
            page = Page(socket)
            for domain in ("Runtime", "Page", "Network"):
                await page.call(f"{domain}.enable")
            await page.resize(width, height)
            await page.call("Page.navigate", url=address)
            yield page
