"""A headless Firefox driven over WebDriver BiDi, which it speaks itself."""

import asyncio
import base64
import contextlib
import os
import shutil
import tempfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from tests.browsing import Tab, running

PREFERENCES = {
    "media.autoplay.default": 0,
    "media.autoplay.blocking_policy": 0,
    "intl.accept_languages": "fr",
    "webgl.force-enabled": True,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "app.update.auto": False,
}


_KEYS = {
    "Enter": "\ue007",
    "Escape": "\ue00c",
    "ArrowLeft": "\ue012",
    "ArrowUp": "\ue013",
    "ArrowRight": "\ue014",
    "ArrowDown": "\ue015",
}
"""Characters of WebDriver that stand for keys without one."""


class FirefoxPage(Tab):
    """One tab of Firefox."""

    context: str

    def _note(self, event: str, params: dict[str, Any]) -> None:
        if event == "log.entryAdded":
            # Besides exceptions it logs refused requests, which scripts get as an answer.
            refused = params["text"].startswith("Cross-Origin Request Blocked")
            if params["type"] == "javascript" and params["level"] == "error" and not refused:
                self.errors.append(params["text"])
        elif event == "network.beforeRequestSent":
            self.requests.append(params["request"]["url"])

    async def evaluate(self, expression: str) -> Any:
        """Return the value of an expression in the page, awaited if it is a promise."""
        result = await self.call(
            "script.evaluate",
            expression=expression,
            target={"context": self.context},
            awaitPromise=True,
        )
        assert result["type"] == "success", result["exceptionDetails"]
        return _value(result["result"])

    async def press(self, key: str, code: int = 0) -> None:
        """Press and release a key, by its name or its character."""
        value = _KEYS.get(key, key)
        actions = [{"type": kind, "value": value} for kind in ("keyDown", "keyUp")]
        source = {"type": "key", "id": "keyboard", "actions": actions}
        await self.call("input.performActions", context=self.context, actions=[source])

    async def resize(self, width: int, height: int) -> None:
        """Set the size of the visible part."""
        size = {"width": width, "height": height}
        await self.call("browsingContext.setViewport", context=self.context, viewport=size)

    async def screenshot(self, path: Path) -> None:
        """Write the visible part of the page as PNG."""
        result = await self.call("browsingContext.captureScreenshot", context=self.context)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(base64.b64decode(result["data"]))

    async def hide(self) -> None:
        """Put another tab before this one."""
        self._other = (await self.call("browsingContext.create", type="tab"))["context"]
        await self.call("browsingContext.activate", context=self._other)

    async def show(self) -> None:
        """Put this tab in front again."""
        await self.call("browsingContext.close", context=self._other)
        await self.call("browsingContext.activate", context=self.context)


def _value(node: dict[str, Any]) -> Any:
    """Return a value of the protocol as Python has it; None for what JSON has no form for."""
    match node["type"]:
        case "array":
            return [_value(item) for item in node["value"]]
        case "object":
            return {key: _value(item) for key, item in node["value"]}
        case "number":
            return float(node["value"]) if isinstance(node["value"], str) else node["value"]
        case "string" | "boolean":
            return node["value"]
    return None


@contextlib.asynccontextmanager
async def browse(address: str, width: int = 1280, height: int = 720) -> AsyncIterator[FirefoxPage]:
    """Open `address` in a new browser with a profile of its own; skip if there is none."""
    program = shutil.which("firefox-esr") or shutil.which("firefox")
    if program is None:
        pytest.skip("no firefox on this machine: the page cannot be tried")
    async with (
        _sound() as sound,
        running(
            program, "--headless", "--no-remote", "--remote-debugging-port", "0", "--profile",
            mark=b"WebDriver BiDi listening on ws://", profile="{}", preferences=PREFERENCES,
            variables={"MOZ_WEBGL_FORCE_EGL": "1", "PULSE_SERVER": sound},
        ) as listening,
        aiohttp.ClientSession() as session,
        session.ws_connect(f"ws://{listening}/session", max_msg_size=0, heartbeat=None) as socket,
    ):  # fmt: skip
        page = FirefoxPage(socket)
        await page.call("session.new", capabilities={})
        contexts = (await page.call("browsingContext.getTree"))["contexts"]
        page.context = contexts[0]["context"]
        events = ["log.entryAdded", "network.beforeRequestSent"]
        await page.call("session.subscribe", events=events)
        await page.resize(width, height)
        await page.call("browsingContext.navigate", context=page.context, url=address, wait="none")
        yield page


@contextlib.asynccontextmanager
async def _sound() -> AsyncIterator[str]:
    """Start a sound server without a device, without which Firefox runs no audio context."""
    program = shutil.which("pulseaudio")
    if program is None:
        pytest.skip("no pulseaudio on this machine: Firefox hears nothing without a sound device")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        address = f"unix:{folder}/socket"
        process = await asyncio.create_subprocess_exec(
            program,
            "-n",
            "--daemonize=no",
            "--exit-idle-time=-1",
            "--use-pid-file=no",
            "--load=module-null-sink rate=48000",
            f"--load=module-native-protocol-unix auth-anonymous=1 socket={folder}/socket",
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.DEVNULL,
            env={**os.environ, "HOME": folder, "XDG_RUNTIME_DIR": folder},
        )
        try:
            while not Path(folder, "socket").exists():
                assert process.returncode is None, "pulseaudio ended before it listened"
                await asyncio.sleep(0.05)
            yield address
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
            await process.wait()
