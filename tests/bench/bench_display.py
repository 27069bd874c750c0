"""How far the cuer on the screen is from the picture on the screen: file and live, 25 and 50 fps.

The *display error* at an instant is the time, on the programme's clock at the sender, of the motion
that is drawn, minus that of the picture that is shown. A picture stands for one frame's length
from the instant at which the browser presents it; what the page draws appears one refresh after the
page's time and stands for one refresh. A walking bar in the picture tells its number, the place of
superframes on the page's clock tells the motion's: the error holds everything between both ends.

Three distributions are kept. *As drawn*: at each refresh that the page got while the picture was
on time, the error of the design. *As served*: at every instant at which picture and page were on
time. *As seen*: at every instant, with the pictures and refreshes that came late: what software
graphics on busy cores add. Reports go to ``artefacts/page/display-MODE-FPS.json``.
"""

import asyncio
import json
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from codec.cuer.voice import load_voice
from receiver.live.server import LiveTelevision
from receiver.reception.events import SUPERFRAME_S
from receiver.television.server import Television
from receiver.television.tuner import ProgrammeTuner
from tests.chromium import Page, browse
from tests.receiver.air import marked_noise, transport_stream
from tests.receiver.standin import make_motion
from tests.receiver.transmitter import Transmitter

ARTEFACTS = Path(__file__).resolve().parents[2] / "artefacts" / "page"
VOICE = load_voice()
SECONDS, WATCHED_S = 26, 18
BAR_PERIOD = 150

WATCH = """(() => {
    const video = cuecast.video;
    const context = Object.assign(document.createElement("canvas"), { width: 320, height: 1 })
        .getContext("2d", { willReadFrequently: true });
    const barAt = () => {
        context.drawImage(video, 0, 90, 320, 1, 0, 0, 320, 1);
        const { data } = context.getImageData(0, 0, 320, 1);
        for (let x = 0; x < 320; x++) if (data[4 * x] > 110) return x;
        return -1;
    };
    window.seen = { frames: [], ticks: [], bars: [] };
    const look = (now, frame) => {
        seen.frames.push([frame.mediaTime, frame.expectedDisplayTime]);
        if (seen.bars.length < 40) seen.bars.push([frame.mediaTime, barAt()]);
        video.requestVideoFrameCallback(look);
    };
    video.requestVideoFrameCallback(look);
    const tick = cuecast.tick.bind(cuecast);
    cuecast.tick = (now) => {
        const before = performance.now();
        tick(now);
        const { timeS, visibility } = cuecast.drawn;
        const script = performance.now() - before;
        if (visibility == 1 && !video.paused) {
            seen.ticks.push([timeS, now + cuecast.clock.refreshMs, script]);
        }
    };
})()"""
TELL = "JSON.stringify({...seen, starts: cuecast.timeline.pieces.map((piece) => piece.startS)})"


def air(fps: int) -> bytes:
    motion = make_motion(VOICE, duration_s=SECONDS + 2.0)
    return transport_stream(marked_noise(VOICE, motion, SECONDS), fps=fps)


@asynccontextmanager
async def file_page(fps: int, folder: Path) -> AsyncIterator[Page]:
    path = folder / f"bars{fps}.mp4"
    with av.open(BytesIO(air(fps)), "r") as read, av.open(str(path), "w") as write:
        streams = {s.index: write.add_stream_from_template(s) for s in read.streams}
        for packet in read.demux():
            if packet.dts is not None:
                packet.stream = streams[packet.stream.index]
                write.mux(packet)
    television = Television(ProgrammeTuner(path, VOICE), VOICE, path)
    async with television.running() as address, browse(address) as page:
        yield page


@asynccontextmanager
async def live_page(fps: int, folder: Path) -> AsyncIterator[Page]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    transmitter = Transmitter(air(fps), port, SECONDS)
    television = LiveTelevision(f"udp://127.0.0.1:{port}", VOICE)
    try:
        async with television.running() as address, browse(address) as page:
            await page.until("Boolean(window.cuecast)")
            transmitter.start()
            yield page
    finally:
        transmitter.over.set()


async def watch(mode: str, fps: int, folder: Path) -> dict[str, Any]:
    pages = {"file": file_page, "live": live_page}
    async with pages[mode](fps, folder) as page:
        await page.call("Performance.setTimeDomain", timeDomain="threadTicks")
        await page.call("Performance.enable")
        await page.until("window.cuecast && cuecast.video.readyState >= 3")
        await page.evaluate(WATCH)
        await page.evaluate("cuecast.video.play()")
        await asyncio.sleep(WATCHED_S / 2)
        before = await script_s(page)
        await asyncio.sleep(WATCHED_S / 2)
        used = await script_s(page) - before
        seen: dict[str, Any] = json.loads(await page.evaluate(TELL))
        assert page.errors == []
    seen["script_cpu_s"] = used
    return seen


async def script_s(page: Page) -> float:
    """Return the processor time that the page's scripts have taken."""
    found = await page.call("Performance.getMetrics")
    return float(next(m["value"] for m in found["metrics"] if m["name"] == "ScriptDuration"))


def wrapped(values: NDArray[np.float64], period: float) -> NDArray[np.float64]:
    return np.asarray((values + period / 2) % period - period / 2)


def display_error_ms(seen: dict[str, Any], fps: int) -> dict[str, NDArray[np.float64]]:
    """Return the distributions, and what the machine did."""
    frames, ticks = np.array(seen["frames"]), np.array(seen["ticks"])
    bars = np.array([bar for bar in seen["bars"] if bar[1] >= 0])
    picture_zero_s = float(np.median(bars[:, 0] - (bars[:, 1] // 2) / fps))
    # The bar's number comes again after a while: so does the picture's zero.
    motion_zero_s = picture_zero_s + float(
        np.median(wrapped(np.array(seen["starts"]) - picture_zero_s, SUPERFRAME_S))
    )
    refresh_ms = 1000 / 60

    def error(instants_ms: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return errors, and whether picture and page were on time."""
        frame = np.searchsorted(frames[:, 1], instants_ms + 0.5, side="right") - 1
        tick = np.searchsorted(ticks[:, 1], instants_ms + 0.5, side="right") - 1
        since_frame, since_tick = instants_ms - frames[frame, 1], instants_ms - ticks[tick, 1]
        on_time = (since_frame < 1000 / fps + refresh_ms) & (since_tick < 2 * refresh_ms)
        frame_age = np.clip(since_frame, 0, 1000 / fps)
        tick_age = np.clip(since_tick, 0, refresh_ms)
        picture = 1000 * (frames[frame, 0] - picture_zero_s) + frame_age
        cuer = 1000 * (ticks[tick, 0] - motion_zero_s) + tick_age
        return np.asarray(cuer - picture), on_time

    first = max(frames[0, 1], ticks[0, 1])
    last = min(frames[-1, 1], ticks[-1, 1])
    drawn, drawn_on_time = error(ticks[(ticks[:, 1] >= first) & (ticks[:, 1] <= last), 1])
    shown, shown_on_time = error(np.arange(first, last, 2.0))
    return {
        "as_drawn": drawn[drawn_on_time],
        "as_served": shown[shown_on_time],
        "as_seen": shown,
        "refresh": np.diff(ticks[:, 1]),
        "picture": np.diff(frames[:, 1]),
        "script": ticks[:, 2],
        "chain": np.array([1000 * (motion_zero_s - picture_zero_s)]),
    }


def spread(values: NDArray[np.float64]) -> dict[str, float]:
    size = np.abs(values)
    found = {f"p{p}": float(np.percentile(size, p)) for p in (50, 95, 99)}
    return {"n": len(values), "mean": float(values.mean()), **found, "max": float(size.max())}


@pytest.mark.parametrize("fps", [25, 50])
@pytest.mark.parametrize("mode", ["file", "live"])
def test_display_error(benchmark: BenchmarkFixture, tmp_path: Path, mode: str, fps: int) -> None:
    seen: dict[str, Any] = {}
    benchmark.pedantic(  # type: ignore[no-untyped-call]
        lambda: seen.update(asyncio.run(asyncio.wait_for(watch(mode, fps, tmp_path), 120))),
        rounds=1,
    )
    found = display_error_ms(seen, fps)
    report: dict[str, Any] = {
        f"{name}_ms": {key: round(value, 2) for key, value in spread(values).items()}
        for name, values in found.items()
    }
    late = [tick for tick in seen["ticks"] if tick[1] > seen["ticks"][-1][1] - 500 * WATCHED_S]
    report["script_cpu_ms_per_refresh"] = round(1000 * seen["script_cpu_s"] / len(late), 2)
    report["share_of_time_served"] = round(len(found["as_served"]) / len(found["as_seen"]), 3)
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    (ARTEFACTS / f"display-{mode}-{fps}.json").write_text(json.dumps(report, indent=1))
    print(mode, fps, json.dumps(report, indent=1))
    assert report["as_drawn_ms"]["n"] > 50
