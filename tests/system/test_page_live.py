"""The live page in a headless Chromium: a transport stream over UDP, its loss and its return."""

import asyncio
import json
import socket
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from receiver.live.server import LiveTelevision
from tests.chromium import Page, browse
from tests.receiver.air import marked_noise, transport_stream
from tests.receiver.standin import make_motion
from tests.receiver.transmitter import Transmitter

pytestmark = pytest.mark.long(24)

ARTEFACTS = Path(__file__).resolve().parents[2] / "artefacts" / "page"
VOICE = load_voice()
SECONDS = 75
"""Longer than the test needs, so that something is still on air on a machine that is busy."""

MOTION = make_motion(VOICE, duration_s=SECONDS + 4.0)


STATUS = "document.getElementById('status').dataset.state"
STYLE = "cuecast.settings.set('style', '{}')"
"""Points, except for the picture: a processor that draws the avatar has no time for the film."""

SAMPLES = """new Promise((resolve) => {
    const found = [];
    const look = (now, frame) => {
        const shown = cuecast.drawn;
        const laterMs = shown.nowMs + cuecast.clock.refreshMs - frame.expectedDisplayTime;
        const due = frame.mediaTime + laterMs / 1000;
        if (shown.visibility == 1) found.push([shown.timeS, due]);
        if (found.length < 25) cuecast.video.requestVideoFrameCallback(look);
        else resolve(JSON.stringify(found));
    };
    cuecast.video.requestVideoFrameCallback(look);
})"""


@pytest.mark.parametrize("fps", [25, pytest.param(50, marks=pytest.mark.slow)])
def test_a_broadcast_is_watched_lost_and_found(fps: int) -> None:
    data = transport_stream(marked_noise(VOICE, MOTION, SECONDS), fps=fps)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    transmitter = Transmitter(data, port, SECONDS)

    async def visit(page: Page) -> None:
        await page.until("Boolean(window.cuecast)")
        await page.evaluate(STYLE.format("points"))
        transmitter.start()
        await page.until("cuecast.video.readyState >= 3")
        assert await page.evaluate(STATUS) != "absent"
        await page.evaluate("cuecast.video.play()")
        await page.until(f"{STATUS} == 'locked' && cuecast.drawn.visibility == 1", timeout_s=60)
        samples = np.array(json.loads(await page.evaluate(SAMPLES)))
        offset = np.abs(samples[:, 0] - samples[:, 1])
        assert np.median(offset) <= 0.020
        if fps == 25:
            await page.evaluate(STYLE.format("avatar"))
            await page.until("!document.getElementById('avatar').hidden")
            await page.screenshot(ARTEFACTS / "live.png")
            await page.evaluate(STYLE.format("points"))
        transmitter.silent.set()
        await page.until(f"{STATUS} == 'lost'")
        before_s = await page.evaluate("cuecast.drawn.timeS")
        transmitter.silent.clear()
        await page.until(
            f"{STATUS} != 'lost' && cuecast.drawn.visibility == 1"
            f" && cuecast.drawn.timeS > {before_s} + 1",
            timeout_s=60,
        )
        figures = json.loads(
            await page.evaluate("fetch('/status.json').then((a) => a.json()).then(JSON.stringify)")
        )
        assert figures["live"] is True
        assert figures["viewers"] == 1
        assert figures["superframes_received_total"] > 5

    async def main() -> None:
        television = LiveTelevision(f"udp://127.0.0.1:{port}", VOICE)
        try:
            async with television.running() as address, browse(address) as page:
                await visit(page)
                assert page.errors == []
        finally:
            transmitter.over.set()

    asyncio.run(asyncio.wait_for(main(), 240))
