"""The television's page in a headless Chromium: in step, through pause, seek, rate and loss."""

import asyncio
import json
import re
from collections.abc import Awaitable, Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from receiver.reception.events import State, StateChanged
from receiver.reception.reception import Progress
from receiver.television.server import Television
from receiver.television.tuner import MotionTuner, Tuner
from tests.chromium import Page, browse
from tests.receiver.node import PAGE
from tests.receiver.standin import make_motion, make_voice

pytestmark = pytest.mark.long(60)

ARTEFACTS = Path(__file__).resolve().parents[2] / "artefacts" / "page"
VOICE = make_voice()
MOTION = make_motion(VOICE, duration_s=20.0)
READY = "window.cuecast && cuecast.video.readyState >= 3 && cuecast.timeline.pieces.length > 9"


@pytest.fixture(scope="module")
def programme(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twenty seconds of picture, a bar that walks, 25 frames per second."""
    return make_programme(tmp_path_factory.mktemp("programme") / "bars.mp4", 320, 180, 25)


def make_programme(path: Path, width: int, height: int, fps: int, seconds: int = 20) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=fps)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.options = {"preset": "ultrafast", "g": str(fps)}
        for number in range(fps * seconds):
            picture = np.full((height, width, 3), (24, 32, 60), np.uint8)
            at = number * 2 % (width - 12)
            picture[:, at : at + 12] = (200, 180, 90)
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.time_base, frame.pts = Fraction(1, fps), number
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def watch(
    media: Path,
    visit: Callable[[Page], Awaitable[None]],
    tuner: Tuner | None = None,
    width: int = 1280,
    height: int = 720,
    voice: Voice = VOICE,
    ready: str = READY,
    avatar: bytes | None = None,
) -> None:
    async def main() -> None:
        television = Television(tuner or MotionTuner(MOTION), voice, media, avatar=avatar)
        async with television.running() as address, browse(address, width, height) as page:
            await page.until(ready)
            await visit(page)
            assert page.errors == []

    asyncio.run(asyncio.wait_for(main(), 120))


def truth(time_s: float) -> NDArray[np.float32]:
    """Markers that the stand-in's formula gives, not only its frames."""
    rates = np.linspace(0.2, 1.0, len(VOICE.layout))
    params = 0.7 * np.sin(2 * np.pi * time_s * rates + rates * 9)
    markers: NDArray[np.float32] = VOICE.reconstruct(params[None])[0]
    return markers


DRAWN = """JSON.stringify({
    timeS: cuecast.drawn.timeS, visibility: cuecast.drawn.visibility,
    markers: Array.from(cuecast.cuer.markers), current: cuecast.video.currentTime })"""


async def drawn(page: Page) -> dict[str, Any]:
    return dict(json.loads(await page.evaluate(DRAWN)))


async def seek(page: Page, time_s: float) -> None:
    await page.evaluate(f"cuecast.seekTo({time_s})")
    await page.until(
        f"!cuecast.video.seeking && cuecast.drawn.visibility == 1"
        f" && Math.abs(cuecast.drawn.timeS - {time_s}) < 0.001"
    )


def test_markers_are_python_s_at_twenty_times(programme: Path) -> None:
    async def visit(page: Page) -> None:
        for time_s in np.linspace(0.3, 18.9, 20).round(3):
            await seek(page, float(time_s))
            state = await drawn(page)
            error = np.reshape(state["markers"], (113, 3)) - truth(state["timeS"])
            assert np.abs(error).max() < 0.05  # cubic interpolation of 50 Hz frames

    watch(programme, visit)


SAMPLE_WHILE_PLAYING = """new Promise((resolve) => {
    const found = [];
    const video = cuecast.video;
    const look = (now, frame) => {
        const shown = cuecast.drawn;
        const due = frame.mediaTime
            + (shown.nowMs + cuecast.clock.refreshMs - frame.expectedDisplayTime)
            / 1000 * video.playbackRate;
        found.push([shown.timeS, due, ...cuecast.cuer.markers]);
        if (found.length < 40) video.requestVideoFrameCallback(look);
        else resolve(JSON.stringify(found));
    };
    video.requestVideoFrameCallback(look);
})"""


@pytest.mark.parametrize("rate", [1.0, 0.5])
def test_cuer_is_in_step_while_playing(programme: Path, rate: float) -> None:
    async def visit(page: Page) -> None:
        await page.evaluate(f"cuecast.video.playbackRate = {rate}; cuecast.video.play()")
        await page.until("cuecast.video.currentTime > 0.5")
        samples = np.array(json.loads(await page.evaluate(SAMPLE_WHILE_PLAYING)))
        for row in samples:
            assert np.abs(np.reshape(row[2:], (113, 3)) - truth(row[0])).max() < 0.05
        offset = np.abs(samples[:, 0] - samples[:, 1])
        assert np.median(offset) <= 0.020
        assert offset.max() <= 0.100

    watch(programme, visit)


def test_pause_seek_and_rate_by_keyboard(programme: Path) -> None:
    async def visit(page: Page) -> None:
        await page.press(" ")
        await page.until("!cuecast.video.paused && cuecast.drawn.timeS > 0.3")
        await page.press(" ")
        await page.until("cuecast.video.paused")
        before = (await drawn(page))["current"]
        await page.press("ArrowRight")
        await page.until(f"cuecast.drawn.timeS > {before + 4.9}")
        await page.press(".")
        await page.until(f"cuecast.drawn.timeS > {before + 5.03}")
        await page.press("]")
        assert await page.evaluate("cuecast.video.playbackRate") == 1.25
        await page.press("[")
        await page.press("[")
        assert await page.evaluate("cuecast.video.playbackRate") == 0.75

    watch(programme, visit)


def test_choices_by_keyboard_and_remote_control_are_remembered(programme: Path) -> None:
    async def visit(page: Page) -> None:
        start = await page.evaluate("document.getElementById('inset').getBoundingClientRect().left")
        await page.press("p")
        await page.until(
            f"document.getElementById('inset').getBoundingClientRect().left < {start - 300}"
        )
        for key, name in {"m": "mirror", "h": "handOnly"}.items():
            await page.press(key)
            assert await page.evaluate(f"cuecast.settings.get('{name}')") is True
        await page.press("ColorF3Blue")
        assert await page.evaluate("cuecast.settings.get('size')") == "whole"
        await page.press("", code=403)
        assert await page.evaluate("cuecast.settings.get('handOnly')") is False
        language = await page.evaluate("document.documentElement.lang")
        await page.press("l")
        await page.until(f"document.documentElement.lang != '{language}'")
        await page.until(
            "document.getElementById('keys').textContent.includes(cuecast.words().side)"
        )
        await page.press("r")
        await page.until("!document.getElementById('panel').hidden")
        await page.screenshot(ARTEFACTS / "settings.png")
        await page.call("Page.reload")
        await page.until(READY)
        stored = await page.evaluate("JSON.stringify(cuecast.settings.values)")
        values = json.loads(stored)
        assert (values["mirror"], values["handOnly"], values["size"]) == (True, False, "whole")
        assert values["place"] == "bottom-left"

    watch(programme, visit)


FOCUS = "(document.activeElement.id || document.activeElement.tagName)"


def test_remote_control_of_four_arrows_reaches_everything(programme: Path) -> None:
    async def visit(page: Page) -> None:
        async def pressed(key: str) -> str:
            await page.press(key)
            return str(await page.evaluate(FOCUS))

        assert await pressed("ArrowUp") == "play"
        assert [await pressed("ArrowRight") for _ in range(3)] == ["back", "forward", "speed"]
        ring = "getComputedStyle(document.activeElement).outlineStyle"
        assert await page.evaluate(ring) == "solid"
        assert await pressed("ArrowUp") == "seek"
        assert await pressed("ArrowDown") == "play"
        while await pressed("ArrowRight") != "settings":
            pass
        await page.press("Enter", 13)
        await page.until("!document.getElementById('panel').hidden")
        assert await page.evaluate(FOCUS) == "set-layout"
        assert [await pressed("ArrowDown") for _ in range(2)] == ["set-size", "set-place"]
        await page.press("ArrowRight")
        assert await page.evaluate("cuecast.settings.get('place')") == "bottom-left"
        while await pressed("ArrowDown") != "set-mirror":
            pass
        await page.press("Enter", 13)
        assert await page.evaluate("cuecast.settings.get('mirror')") is True
        assert await pressed("GoBack") == "settings"
        assert await page.evaluate("document.getElementById('panel').hidden")
        assert await pressed("GoBack") == "BODY"
        before = await page.evaluate("cuecast.video.currentTime")
        await page.press("ArrowRight")
        await page.until(f"cuecast.video.currentTime > {before} + 4.9")

    watch(programme, visit)


def contrast(ink: tuple[float, ...], ground: tuple[float, ...]) -> float:
    """The ratio of WCAG 2.2, section 1.4.3, of two sRGB colours (0..255)."""
    light = []
    for colour in (ink, ground):
        c = np.array(colour) / 255
        linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        light.append(float(linear @ [0.2126, 0.7152, 0.0722]) + 0.05)
    return max(light) / min(light)


def test_words_stand_out_over_any_picture() -> None:
    """Text on glass, over black and over white: at least 4.5 to 1."""
    style = (PAGE / "style.css").read_text()
    inks = [
        tuple(int(found[i : i + 2], 16) for i in (0, 2, 4))
        for name in ("ink", "soft")
        for found in re.findall(rf"--{name}: #([0-9a-f]{{6}})", style)
    ]
    red, green, blue, share = map(
        float, re.findall(r"--glass: rgba\((\d+), (\d+), (\d+), ([.\d]+)\)", style)[0]
    )
    for behind in (0, 255):
        ground = tuple(share * c + (1 - share) * behind for c in (red, green, blue))
        assert all(contrast(ink, ground) >= 4.5 for ink in inks)
    assert len(inks) >= 2


def test_page_asks_nobody_else(programme: Path) -> None:
    async def visit(page: Page) -> None:
        await page.evaluate("cuecast.video.play()")
        await page.until("cuecast.video.currentTime > 0.5")
        names = "performance.getEntriesByType('resource').map((entry) => entry.name)"
        asked = json.loads(await page.evaluate(f"JSON.stringify({names})"))
        origin = await page.evaluate("location.origin")
        assert len(asked) > 10
        assert [name for name in asked if not name.startswith((origin, "data:"))] == []

    watch(programme, visit)


DRAWINGS = """new Promise((resolve) => {
    const view = cuecast.cuer.points;
    const draw = view.draw;
    let count = 0;
    let ticks = 0;
    view.draw = (...given) => { count += 1; draw.apply(view, given); };
    %s
    const wait = () => { if ((ticks += 1) < 12) requestAnimationFrame(wait); else finish(); };
    const finish = () => { view.draw = draw; resolve(count); };
    requestAnimationFrame(wait);
})"""


def test_a_cuer_who_stands_still_is_drawn_once(programme: Path) -> None:
    """A set that rests on a picture has nothing to draw; a choice, a step, a size are drawn."""

    async def visit(page: Page) -> None:
        await page.until("cuecast.timeline.knownFrom(0) > 19")
        await seek(page, 3.0)
        assert await page.evaluate(DRAWINGS % "") == 0
        assert await page.evaluate(DRAWINGS % "cuecast.settings.toggle('mirror');") == 1
        assert await page.evaluate(DRAWINGS % "cuecast.settings.set('size', 'large');") >= 1
        assert await page.evaluate(DRAWINGS % "cuecast.seekTo(3.04);") >= 1
        assert await page.evaluate(DRAWINGS % "cuecast.video.play();") > 3

    watch(programme, visit)


BOX = "getComputedStyle(document.getElementById('inset')).visibility"


class _Broken:
    """The cuer is missing between 4 and 8 seconds."""

    def tune(self, start_s: float) -> Iterator[Progress]:
        changes: list[tuple[float, State]]
        changes = [(0.0, "searching"), (0.6, "locked"), (5.0, "lost"), (8.0, "locked")]
        yield Progress(start_s, tuple(StateChanged(*change) for change in changes))
        for progress in MotionTuner(MOTION).tune(start_s):
            kept = tuple(e for e in progress.events if not isinstance(e, StateChanged))
            if not 4.0 < progress.until_s < 8.0:
                yield Progress(progress.until_s, kept)


def test_loss_is_shown_and_recovered(programme: Path) -> None:
    async def visit(page: Page) -> None:
        status = "document.getElementById('status').dataset.state"
        await page.until("cuecast.timeline.states.length >= 4")
        await seek(page, 3.0)
        await page.until(f"{status} == 'locked'")
        await page.evaluate("cuecast.seekTo(6.0)")
        await page.until(f"{status} == 'lost' && cuecast.drawn.visibility == 0")
        assert await page.evaluate(BOX) == "hidden"
        await page.screenshot(ARTEFACTS / "lost.png")
        await seek(page, 9.0)
        await page.until(f"{status} == 'locked'")
        assert await page.evaluate(BOX) == "visible"

    watch(programme, visit, _Broken())


class _Uncued:
    """A programme without a mark: the search goes on and on."""

    def tune(self, start_s: float) -> Iterator[Progress]:
        yield Progress(start_s, (StateChanged(0.0, "searching"),))
        for until_s in range(1, 25):
            yield Progress(float(until_s), ())


def test_without_a_cuer_there_is_no_box(programme: Path) -> None:
    async def visit(page: Page) -> None:
        await page.until("document.getElementById('status').dataset.state == 'absent'")
        said = "document.getElementById('{}').textContent"
        await page.evaluate("cuecast.settings.set('language', 'fr')")
        await page.until(f"{said.format('status-text')} == 'Pas de codeuse dans ce programme'")
        await page.until(f"{said.format('status-more')} == 'recherchée sur 24 s'")
        for style in ("points", "avatar"):
            await page.evaluate(f"cuecast.settings.set('style', '{style}')")
            assert await page.evaluate(BOX) == "hidden"
        await page.until("cuecast.video.getBoundingClientRect().width == innerWidth")
        await page.screenshot(ARTEFACTS / "uncued.png")

    watch(programme, visit, _Uncued(), ready="window.cuecast && cuecast.video.readyState >= 3")


class _Patient:
    """Says that the cuer is received, and sends her motion up to the eighth second only."""

    def tune(self, start_s: float) -> Iterator[Progress]:
        yield Progress(start_s, (StateChanged(0.0, "locked"),))
        for progress in MotionTuner(MOTION).tune(0.0):
            kept = tuple(e for e in progress.events if not isinstance(e, StateChanged))
            yield Progress(progress.until_s, kept if progress.until_s < 8.0 else ())


def test_a_seek_beyond_what_came_shows_one_state(programme: Path) -> None:
    async def visit(page: Page) -> None:
        await seek(page, 3.0)
        await page.until("document.getElementById('status').dataset.state == 'locked'")
        await page.evaluate("cuecast.seekTo(15.0)")
        await page.until("document.getElementById('status').dataset.state == 'awaiting'")
        assert await page.evaluate(BOX) == "hidden"
        shown = await page.evaluate("document.getElementById('status-text').textContent")
        assert shown == await page.evaluate("cuecast.words().awaiting")
        said = await page.evaluate("document.getElementById('stage').innerText")
        for other in ("locked", "searching", "lost"):
            assert await page.evaluate(f"cuecast.words().{other}") not in said

    watch(programme, visit, _Patient())
