"""The page's layout, captions, controls and accessibility, in Chromium and Firefox."""

import asyncio
import io
import json
from collections.abc import Awaitable, Callable
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from codec.cuer.voice import load_voice
from receiver.live.captions import CaptionDecoder, CaptionsShown
from receiver.live.server import LiveTelevision
from receiver.television.packed import Captions
from receiver.television.server import Television
from receiver.television.tuner import MotionTuner
from tests import chromium, firefox
from tests.browsing import Tab
from tests.receiver.live.dvb_text import page as page_of
from tests.receiver.node import run_node
from tests.receiver.standin import make_motion
from tests.system.test_page import make_programme

pytestmark = pytest.mark.long(60)

ROOT = Path(__file__).resolve().parents[2]
ARTEFACTS = ROOT / "artefacts" / "page"
AXE = ROOT / "node_modules" / "axe-core" / "axe.min.js"
READY = "window.cuecast && cuecast.video.readyState >= 3 && cuecast.timeline.pieces.length > 9"
SIZES = [(1280, 720), (1920, 1080), (390, 844), (844, 390)]

TEXT = """WEBVTT

00:04.000 --> 00:07.000
Bonjour, <c.yellow>voici la codeuse</c>
et son texte.
"""

Browse = Callable[[str], AbstractAsyncContextManager[Tab]]

BROWSERS = [
    pytest.param(chromium.browse, id="chromium"),
    pytest.param(firefox.browse, id="firefox", marks=pytest.mark.slow),
]

CHOICE = {"keys": True, "captions": 4, "left": 40, "top": 30, "width": 25}


def layouts(tmp_path: Path, cases: list[dict[str, Any]]) -> list[dict[str, Any]]:
    script = """
        import { layoutOf } from "./layout.js";
        console.log(JSON.stringify(data.map(({ screen, ratio, choice }) =>
            layoutOf({ width: screen[0], height: screen[1] }, null, ratio, 0.86, choice))));
    """
    return list(run_node(tmp_path, script, cases))


def overlap(a: dict[str, float], b: dict[str, float]) -> float:
    wide = min(a["left"] + a["width"], b["left"] + b["width"]) - max(a["left"], b["left"])
    high = min(a["top"] + a["height"], b["top"] + b["height"]) - max(a["top"], b["top"])
    return max(0.0, wide) * max(0.0, high)


def is_inside(one: dict[str, float], width: float, height: float) -> bool:
    right, bottom = one["left"] + one["width"], one["top"] + one["height"]
    return min(one["left"], one["top"]) > -1 and right < width + 1 and bottom < height + 1


def test_nothing_lies_on_the_cuer(tmp_path: Path) -> None:
    """Keys, captions and settings stand beside her, in every layout and on every screen."""
    screens = [*SIZES, (1024, 768), (1680, 720), (360, 740), (740, 360), (320, 568), (2560, 1080)]
    cases: list[dict[str, Any]] = [
        {"screen": screen, "ratio": ratio, "choice": {**CHOICE, **named}}
        for screen in screens
        for ratio in (16 / 9, 4 / 3, 0.0)
        for named in (
            {"layout": layout, "size": size, "place": place}
            for layout in ("beside", "over")
            for size in ("small", "medium", "large", "whole")
            for place in ("bottom-right", "bottom-left", "top-right", "top-left", "free")
        )
    ]
    for case, found in zip(cases, layouts(tmp_path, cases), strict=True):
        width, height = case["screen"]
        cuer = found["cuer"]
        names = ["keys", "captions"] if case["choice"]["place"] != "free" else ["keys"]
        for name in names:
            assert overlap(cuer, found[name]) < 1, (name, case, found)
        for name in ("cuer", "keys", "programme", "captions"):
            assert is_inside(found[name], width, height), (name, case, found)
        if found["kind"] in ("beside", "below"):
            assert overlap(cuer, found["programme"]) < 1
            assert overlap(cuer, found["panel"]) < 1


def test_the_cuer_has_a_third_beside_and_the_width_below(tmp_path: Path) -> None:
    choice = {**CHOICE, "layout": "beside", "place": "bottom-right"}
    cases: list[dict[str, Any]] = [
        {"screen": screen, "ratio": 16 / 9, "choice": {**choice, "size": size}}
        for screen, size in [((1280, 720), "large"), ((1280, 720), "small"), ((390, 844), "large")]
    ]
    third, sixth, upright = layouts(tmp_path, cases)
    assert third["cuer"]["width"] == pytest.approx(1280 / 3)
    assert sixth["cuer"]["width"] == pytest.approx(1280 / 6)
    assert third["programme"]["width"] == pytest.approx(1280 * 2 / 3)
    assert upright["cuer"]["width"] == pytest.approx(390)
    assert upright["cuer"]["top"] >= upright["programme"]["height"]


@pytest.fixture(scope="module")
def programme(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_programme(tmp_path_factory.mktemp("programme") / "bars.mp4", 320, 180, 25)


RULES = '{runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]}'

VIOLATIONS = f"""axe.run(document, {RULES}).then((found) => JSON.stringify(found.violations.map(
    (v) => [v.id, v.nodes.map((n) => [n.html, n.failureSummary])])))"""
"""Rules of WCAG 2.2 AA and axe's own, such as names that contain what is seen."""

CUT_OFF = """JSON.stringify([...document.querySelectorAll('.keys li, .keys small, .bar button')]
    .filter((one) => one.scrollWidth > one.clientWidth + 1 && one.clientWidth
        || one.getBoundingClientRect().right > innerWidth + 1).map((one) => one.outerHTML))"""
"""Keys and buttons whose words do not fit."""

AT_REST = "document.getAnimations().every((one) => !(one instanceof CSSTransition))"

RECTANGLES = """JSON.stringify(Object.fromEntries(
    ['bar', 'inset', 'keys', 'captions', 'panel', 'status', 'programme'].map((id) => {
        const element = document.getElementById(id);
        const { left, top, width, height } = element.getBoundingClientRect();
        return [id, { left, top, width, height, shown: element.getClientRects().length }];
    })))"""


@pytest.mark.parametrize("browse", BROWSERS)
def test_every_screen_is_in_order(browse: Browse, programme: Path) -> None:
    """Captions, keys and controls clear of the cuer on four screens; axe has nothing to say."""
    if not AXE.is_file():
        pytest.skip("no axe-core: npm ci")
    captions = Captions(TEXT.encode(), "fr")

    async def visit(page: Tab) -> None:
        await page.evaluate("cuecast.settings.setAll({language: 'fr'})")
        await page.evaluate("cuecast.seekTo(5)")
        await page.until("cuecast.drawn.visibility == 1 && cuecast.captions.present")
        await page.until("document.getElementById('captions').textContent.includes('codeuse')")
        coloured = "getComputedStyle(document.querySelector('.captions .yellow')).color"
        assert await page.evaluate(coloured) == "rgb(255, 255, 0)"
        await page.evaluate(AXE.read_text(encoding="utf-8") + ";0")
        for width, height in SIZES:
            await page.resize(width, height)
            for is_open in (False, True):
                opened = str(is_open).lower()
                await page.evaluate(f"cuecast.controls.openPanel({opened}); cuecast.apply()")
                await page.until(AT_REST)
                where = json.loads(await page.evaluate(RECTANGLES))
                for name in ["keys", "bar", "captions", *(["panel"] if is_open else [])]:
                    assert overlap(where[name], where["inset"]) < 30, (name, width, where)
                for name, one in where.items():
                    assert is_inside(one, width, height) or not one["shown"], (name, width, one)
                assert json.loads(await page.evaluate(CUT_OFF)) == [], width
                await page.screenshot(ARTEFACTS / f"screen-{width}x{height}-{is_open}.png")
                if width in (1280, 390):
                    assert json.loads(await page.evaluate(VIOLATIONS)) == []
        await keyboard(page)
        if isinstance(page, chromium.Page):
            await preferences(page)

    asyncio.run(asyncio.wait_for(open_page(browse, programme, visit, captions), 200))


async def keyboard(page: Tab) -> None:
    """Keys of a keyboard or remote control reach layout, captions and controls."""
    await page.resize(1280, 720)
    await page.evaluate("cuecast.controls.openPanel(false); document.activeElement.blur()")
    await page.press("b")
    assert await page.evaluate("cuecast.stage.layout.kind") == "over"
    await page.press("t")
    assert await page.evaluate("cuecast.settings.get('captions')") == 6
    await page.press("ArrowUp")
    assert await page.evaluate("document.activeElement.id") == "play"
    await page.press("Escape")
    await page.evaluate("cuecast.settings.setAll({layout: 'beside', delay: 200})")
    await page.until("Math.abs(cuecast.shownS - 4.8) < 0.001")


SYSTEM_COLOURS = [
    {"name": "forced-colors", "value": "active"},
    {"name": "prefers-reduced-motion", "value": "reduce"},
]

STANDS_OUT = """((style) => JSON.stringify([style('#keys .now').backgroundColor,
    style('#keys li:not(.now)').backgroundColor, style('#inset').transitionDuration]))(
    (which) => getComputedStyle(document.querySelector(which)))"""


async def preferences(page: chromium.Page) -> None:
    """The system's colours keep the present key apart; without WebGL nothing says "Avatar"."""
    await page.evaluate("cuecast.settings.setAll({delay: 0})")
    await page.evaluate("cuecast.seekTo(cuecast.timeline.keys[4].start + 0.02)")
    await page.until("Boolean(document.querySelector('#keys .now'))")
    await page.call("Emulation.setEmulatedMedia", features=SYSTEM_COLOURS)
    present, other, moving = json.loads(await page.evaluate(STANDS_OUT))
    assert present != other
    assert moving in ("0s", "1e-05s")
    await page.screenshot(ARTEFACTS / "forced-colours.png")
    source = "HTMLCanvasElement.prototype.getContext = ((old) => function (kind, ...rest) {"
    source += " return kind.startsWith('webgl') ? null : old.call(this, kind, ...rest);"
    source += " })(HTMLCanvasElement.prototype.getContext)"
    await page.call("Page.addScriptToEvaluateOnNewDocument", source=source)
    await page.call("Page.reload")
    await page.until(f"{READY} && !cuecast.cuer.avatar")
    for id in ("style", "set-style"):
        assert await page.evaluate(f"document.getElementById('{id}').hidden") is True


def test_pictures_of_text_come_and_go_beside_the_cuer(programme: Path) -> None:
    """A broadcast's text, which has no track."""
    shown = CaptionDecoder().take(av.Packet(page_of(np.ones((40, 200), np.uint8), 0)), 3.0)
    assert shown is not None
    television = LiveTelevision(io.BytesIO(), load_voice())
    sent: list[tuple[str, Any]] = []
    television._send = lambda kind, message: sent.append((kind, message))  # type: ignore[method-assign]
    asyncio.run(publish(television, [shown, CaptionsShown(5.0, 9.0, b"")]))
    assert [kind for kind, _ in sent] == ["feed", "feed"]
    image = "document.querySelector('#captions:not([hidden]) img')"

    async def visit(page: Tab) -> None:
        assert not await page.evaluate("cuecast.captions.present")
        for _, message in sent:
            await page.evaluate(f"cuecast.receive({message})")
        for time_s, there in ((2.9, False), (3.1, True), (4.9, True), (5.1, False), (4.0, True)):
            await page.evaluate(f"cuecast.seekTo({time_s})")
            await page.until(f"Math.abs(cuecast.drawn.timeS - {time_s}) < 0.05")
            assert await page.evaluate(f"{image} !== null") is there
        await page.until(f"{image}.naturalWidth === 200")
        lies = f"JSON.stringify({image}.getBoundingClientRect())"
        box, cuer = [
            json.loads(await page.evaluate(where))
            for where in (lies, lies.replace(image, "document.getElementById('avatar')"))
        ]
        assert box["height"] > 20
        assert box["right"] <= cuer["left"]

    asyncio.run(open_page(chromium.browse, programme, visit, None))


async def publish(television: LiveTelevision, happenings: list[CaptionsShown]) -> None:
    television._loop = asyncio.get_running_loop()
    for happening in happenings:
        television.publish(happening)


async def open_page(
    browse: Browse,
    programme: Path,
    visit: Callable[[Tab], Awaitable[None]],
    captions: Captions | None,
) -> None:
    voice = load_voice()
    motion = make_motion(voice, 20.0)
    television = Television(MotionTuner(motion), voice, programme, captions=captions)
    async with television.running() as address, browse(address) as page:
        await page.until(READY)
        await visit(page)
        assert page.errors == []
