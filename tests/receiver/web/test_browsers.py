"""The demonstration's page in headless Chromium and Firefox, as a viewer uses it.

The *display error* of a refresh is the programme's time of the motion that is drawn, less that of
the picture on the screen when it appears, for pictures that are on time. Reception adds the
distance of its keys from those that were sent.
"""

import asyncio
import json
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from cuecast.command.cli import main
from receiver.web.folder import write_folder
from tests import chromium, firefox
from tests.browsing import Tab
from tests.receiver.web.server import http_server, serving

pytestmark = pytest.mark.slow

PLAYER = "document.querySelector('cuecast-player')"
MEDIA = f"{PLAYER}.media"
FPS = 25
WATCH = f"""(() => {{
  const c = {PLAYER};
  Object.assign(window, {{ told: [], frames: [], ticks: [] }});
  c.addEventListener("key", (e) => told.push(e.detail));
  const look = (_, frame) => {{
    frames.push([frame.mediaTime, frame.expectedDisplayTime]);
    c.media.requestVideoFrameCallback(look);
  }};
  c.media.requestVideoFrameCallback(look);
  const show = c.cuer.show.bind(c.cuer);
  c.cuer.show = (timeS, look) => {{
    const visibility = show(timeS, look);
    if (c.media.paused || c.media.seeking) return visibility;
    ticks.push([timeS, c.clock.beforeMs + c.clock.refreshMs, visibility, c.media.playbackRate]);
    return visibility;
  }};
}})()"""

PROOFS = f"""(() => {{
  window.proofs = [];
  {PLAYER}.addEventListener("verified", (e) => proofs.push(e.detail));
}})()"""

Browse = Callable[[str, int, int], AbstractAsyncContextManager[Tab]]
Sent = list[dict[str, Any]]


@pytest.fixture(scope="module")
def site(demonstration: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("player") / "site"
    write_folder(demonstration / "broadcast-aac.mp4", folder, load_voice("claire"))
    return folder


@pytest.fixture(scope="module")
def sent(demonstration: Path) -> Sent:
    return list(json.loads((demonstration / "report.json").read_text(encoding="utf-8"))["keys"])


@pytest.fixture(params=[chromium, firefox], ids=["chromium", "firefox"])
def browse(request: pytest.FixtureRequest) -> Browse:
    return request.param.browse  # type: ignore[no-any-return]


async def display_errors(page: Tab, rate: float = 1.0) -> NDArray[np.float64]:
    """Return the display error of each refresh at a playback rate, seconds, and forget them."""
    frames = np.array(await page.evaluate("frames.splice(0)"))
    errors = []
    for time_s, shown_ms, visibility, at_rate in await page.evaluate("ticks.splice(0)"):
        frame = np.searchsorted(frames[:, 1], shown_ms + 0.5, side="right") - 1
        age_ms = rate * (shown_ms - frames[frame, 1])
        if frame >= 0 and at_rate == rate and visibility > 0 and age_ms < 1000 / FPS + 17 * rate:
            errors.append(time_s - frames[frame, 0] - min(age_ms, 1000 / FPS) / 1000)
    return np.array(errors)


def shapes(keys: Sent, start_s: float, end_s: float) -> list[tuple[int, str]]:
    return [(k["shape"], k["placement"]) for k in keys if start_s <= k["start"] < end_s]


async def position(page: Tab) -> float:
    return float(await page.evaluate(f"{MEDIA}.currentTime"))


async def ready(page: Tab, script: str = WATCH) -> None:
    await page.until(f"Boolean(customElements.get('cuecast-player') && {PLAYER}.hearing)")
    await page.evaluate(script)


def test_every_key_in_time(browse: Browse, site: Path, sent: Sent, tmp_path: Path) -> None:
    async def run() -> None:
        async with http_server(site) as address, browse(f"{address}/index.html", 960, 540) as page:
            await ready(page)
            await page.evaluate(f"void {MEDIA}.play()")
            await page.until(f"{MEDIA}.currentTime > 5")
            await page.screenshot(tmp_path / "player.png")
            await page.until(f"{MEDIA}.ended", timeout_s=120)
            got = await page.evaluate("told")
            content = [(k["shape"], k["placement"], k["phones"]) for k in got]
            assert content == [(k["shape"], k["placement"], k["phones"]) for k in sent]
            placed = np.array([k["start"] - s["start"] for k, s in zip(got, sent, strict=True)])
            first = await page.evaluate("ticks.find((tick) => tick[2] > 0)[0]")
            assert first <= 3
            errors = await display_errors(page)
            assert len(errors) > 50
            assert np.percentile(np.abs(errors + np.median(placed)), 95) <= 0.04
            assert np.abs(placed).max() < 0.04
            elsewhere = [r for r in page.requests if not r.startswith((f"{address}/", "data:"))]
            assert elsewhere == []
            assert len(page.requests) > 5
            assert page.errors == []

    asyncio.run(run())


def test_pause_seek_rates_and_a_hidden_tab(browse: Browse, site: Path, sent: Sent) -> None:
    async def run() -> None:
        async with serving(site, []) as address, browse(f"{address}/index.html", 960, 540) as page:
            await ready(page)
            await page.evaluate(f"void {MEDIA}.play()")
            await page.until(f"{MEDIA}.currentTime > 6")
            await _pause(page, sent)
            await _rates(page)
            await _hide(page, sent)
            await _margins(page)
            assert page.errors == []

    asyncio.run(run())


@pytest.fixture(scope="module")
def signed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A programme signed by one; the pages in the folders `one` and `two` trust either."""
    folder = tmp_path_factory.mktemp("signed")
    noise = np.random.default_rng(1).normal(0, 0.03, 44 * 48000)
    soundfile.write(folder / "p.wav", noise, 48000)
    (folder / "p.srt").write_text("1\n00:00:06,000 --> 00:00:08,000\nBonjour madame.\n", "utf-8")
    for name in ("one", "two"):
        files = ["--secret", str(folder / f"{name}.key"), "--public", str(folder / f"{name}.pub")]
        assert main(["key", "new", name, *files, "--days", "1", "--from", "2027-03-01"]) == 0
    dub = ["dub", str(folder / "p.wav"), "--subtitles", str(folder / "p.srt")]
    dub += ["-o", str(folder / "s.wav"), "--sign", str(folder / "one.key")]
    dub += ["--on-air", "2027-03-01T20:00:00Z", "--no-grade", "--no-read-back"]
    assert main(dub) == 0
    for name in ("one", "two"):
        page = ["page", str(folder / "s.wav"), "-o", str(folder / name)]
        assert main([*page, "--verify", str(folder / f"{name}.pub")]) == 0
    return folder


@pytest.mark.parametrize("trusted", ["one", "two"])
def test_whose_cues_they_are(browse: Browse, signed: Path, trusted: str) -> None:
    """Verified soon by the public file of the one who signed; by another's never."""

    async def run() -> None:
        async with (
            serving(signed / trusted, []) as address,
            browse(f"{address}/index.html", 960, 540) as page,
        ):
            await ready(page, PROOFS)
            await page.evaluate(f"void {MEDIA}.play()")
            await page.until(f"{MEDIA}.ended", timeout_s=120)
            proofs = await page.evaluate("proofs")
            assert len(await page.evaluate(f"{PLAYER}.keyList")) == 6
            status = await page.evaluate(f"{PLAYER}.whose.status")
            assert status == ("verified" if trusted == "one" else "unknown")
            assert bool(proofs) == (trusted == "one")
            assert page.errors == []

    asyncio.run(run())


async def _pause(page: Tab, sent: Sent) -> None:
    """Reception goes on after a pause where it stopped: no key is missed."""
    await page.evaluate(f"{MEDIA}.pause()")
    await asyncio.sleep(1)
    assert await page.evaluate(f"{PLAYER}.drawn.visibility") == 1
    await page.evaluate(f"void {MEDIA}.play()")
    await page.until(f"{MEDIA}.currentTime > 10")
    assert shapes(await page.evaluate(f"{PLAYER}.keyList"), 3, 9.9) == shapes(sent, 3, 9.9)


async def _rates(page: Tab) -> None:
    """Keys known are shown at any speed; that nothing new is heard is said."""
    for rate in (0.5, 2):
        # Known before: shown at once after a seek.
        await page.evaluate(f"{MEDIA}.currentTime = 4; {MEDIA}.playbackRate = {rate}")
        await page.until(f"!{MEDIA}.seeking && {PLAYER}.reason === 'speed'")
        await page.evaluate("frames.length = ticks.length = 0")
        await page.until(f"{MEDIA}.currentTime > {4 + 3 * rate}")
        errors = await display_errors(page, rate)
        assert len(errors) > 4
        assert np.percentile(np.abs(errors), 95) <= 0.04
    await page.evaluate(f"{MEDIA}.playbackRate = 1")
    await page.until(f"{PLAYER}.reason === ''")


async def _hide(page: Tab, sent: Sent) -> None:
    """A hidden tab hears on; back in front the cuer is there at once."""
    await page.evaluate(f"{MEDIA}.currentTime = 13")
    await page.until(f"!{MEDIA}.seeking && {PLAYER}.drawn.visibility === 0")
    await page.until(f"{PLAYER}.drawn.visibility === 1")
    begin_s = await position(page) + 0.1
    await page.hide()
    assert await page.evaluate("document.visibilityState") == "hidden"
    await page.evaluate("ticks.length = 0")
    await asyncio.sleep(4)
    assert await page.evaluate("ticks.length < 20"), "a hidden page draws nothing"
    await page.show()
    await page.until("ticks.length > 2")
    assert await page.evaluate("ticks.at(-1)[2]") == 1
    end_s = await position(page)
    assert end_s > begin_s + 3
    assert shapes(await page.evaluate(f"{PLAYER}.keyList"), begin_s, end_s) == shapes(
        sent, begin_s, end_s
    )


async def _margins(page: Tab) -> None:
    """Where a page wraps the video, as many editors do, the cuer stands on the picture."""
    await page.evaluate(
        f"{PLAYER}.insertBefore(document.createElement('p'), {MEDIA}).append({MEDIA}), "
        f"{MEDIA}.style.marginTop = '60px', {MEDIA}.style.width = '60%'"
    )
    box = "shadowRoot.getElementById('inset').getBoundingClientRect()"
    await page.until(
        f"(({{ left, right, top, bottom }}, media) => left > media.left && right < media.right"
        f" && top > media.top && bottom < media.bottom)({PLAYER}.{box},"
        f" {MEDIA}.getBoundingClientRect())"
    )
