"""`<cuecast-player>` in headless Chromium, from folders that `cuecast page` writes."""

import asyncio
import wave
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.streamfile.stream import choose_stream, decode_stream
from cuecast.media.film import write_film
from receiver.drawing.avatar_document import avatar_document, read_avatar
from receiver.foreign.build import foreign_avatar
from receiver.web.folder import write_folder
from tests import chromium, firefox
from tests.chromium import browse
from tests.receiver.foreign.figure import figure
from tests.receiver.standin import make_motion
from tests.receiver.web.server import serving

pytestmark = pytest.mark.long(20)

FS = 48000
PLAYER = "document.querySelector('cuecast-player')"


def write_sound(path: Path, level: float, seconds: float = 20) -> Path:
    """Write unmarked noise or silence in stereo."""
    noise = level * np.random.default_rng(1).standard_normal((int(seconds * FS), 2))
    with wave.open(str(path), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(2)
        file.setframerate(FS)
        file.writeframes(np.rint(32767 * noise).astype("<i2").tobytes())
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("page")
    write_folder(write_sound(place / "noise.wav", 0.02), place / "site", load_voice("claire"))
    write_sound(place / "site" / "silent.wav", 0.0)
    (place / "figure.glb").write_bytes(figure())
    own, _ = foreign_avatar(place / "figure.glb", load_voice("claire"))
    (place / "site" / "own.avatar").write_bytes(avatar_document(own))
    return place / "site"


@pytest.mark.parametrize("browser", [chromium, firefox], ids=["chromium", "firefox"])
def test_says_why_it_does_not_hear(browser: ModuleType, folder: Path) -> None:
    async def run() -> None:
        others: list[str] = []
        async with (
            serving(folder, []) as address,
            serving(folder, others) as other,
            browser.browse(f"{address}/index.html", 640, 360) as page,
        ):
            await page.until(f"Boolean(customElements.get('cuecast-player') && {PLAYER}.hearing)")
            media = f"{PLAYER}.media"
            # The server's policy allows no <style>: the player's sheet is there all the same.
            inset = f"{PLAYER}.shadowRoot.getElementById('inset')"
            assert await page.evaluate(f"getComputedStyle({inset}).position") == "absolute"
            # Another site's sound is not touched: no context, no worker.
            await page.evaluate(f"{media}.src = '{other}/programme.wav'; {media}.play()")
            await page.until(f"{PLAYER}.reason === 'other-origin' && {media}.currentTime > 0.3")
            assert await page.evaluate(f"{PLAYER}.hearing.context === undefined")
            assert set(others) == {"programme.wav", "programme.cue"}
            await page.evaluate(f"{media}.src = 'silent.wav'; {media}.play()")
            await page.until(f"{PLAYER}.reason === 'silence'")
            assert await page.evaluate(f"{media}.currentTime > 3")
            await page.evaluate(f"{media}.muted = true")
            await page.until(f"{PLAYER}.reason === 'muted'")
            await page.evaluate(f"{media}.muted = false; {media}.playbackRate = 2")
            await page.until(f"{PLAYER}.reason === 'speed'")
            status = f"{PLAYER}.shadowRoot.getElementById('status').textContent"
            await page.until(f"{status}.includes('vitesse')")
            await page.evaluate(f"{PLAYER}.setAttribute('avatar', 'own.avatar')")
            await page.until(f"{PLAYER}.cuer.look.endsWith('/own.avatar')")
            await page.evaluate(f"{PLAYER}.cuer.dressed")
            assert page.errors == []
            avatar = read_avatar((folder / "own.avatar").read_bytes(), load_voice("claire"))
            count = await page.evaluate(f"{PLAYER}.cuer.avatar.head.surface.count")
            assert count == len(avatar.head.sources)

    asyncio.run(run())


def test_reads_the_stream_file_beside_the_programme(folder: Path, tmp_path: Path) -> None:
    """Sound of another site stays as it is; the file beside it shows the cuer at any speed."""
    (tmp_path / "film.wav").symlink_to(folder / "programme.wav")
    voice = load_voice("claire")
    stream = choose_stream(make_motion(voice, 20.0), voice, rate_bps=400, score="drop").data
    (tmp_path / "film.cue").write_bytes(stream)
    sent = decode_stream(stream, voice).params

    async def run() -> None:
        others: list[str] = []
        async with (
            serving(folder, []) as address,
            serving(tmp_path, others, ("film.cue",)) as other,
            browse(f"{address}/index.html", 640, 360) as page,
        ):
            await page.until(f"Boolean(customElements.get('cuecast-player') && {PLAYER}.hearing)")
            media, seen = f"{PLAYER}.media", f"{PLAYER}.drawn.visibility === 1"
            await page.evaluate(f"{media}.src = '{other}/film.wav?t=1'; void {media}.play()")
            await page.until(f"{PLAYER}.sidecar && {media}.currentTime > 0.3 && {seen}")
            assert await page.evaluate(f"{PLAYER}.hearing") is None
            assert await page.evaluate(f"{PLAYER}.reason") == ""
            await page.evaluate(f"{media}.muted = true; {media}.playbackRate = 2")
            await page.evaluate(f"{media}.currentTime = 14")
            await page.until(f"{media}.currentTime > 15 && {seen}")
            await page.evaluate(f"{media}.pause(); {media}.currentTime = 3.3")
            await page.until(f"!{media}.seeking && {PLAYER}.drawn.timeS === 3.3 && {seen}")
            drawn = await page.evaluate(f"[...{PLAYER}.cuer.params]")
            assert np.abs(np.array(drawn) - sent[165]).max() < 0.01
            assert await page.evaluate(f"{PLAYER}.reason") == ""
            # Another programme is heard anew; a file that is named must be there.
            await page.evaluate(f"{media}.src = 'programme.wav'")
            await page.until(f"Boolean({PLAYER}.hearing && !{PLAYER}.sidecar)")
            await page.evaluate(f"{PLAYER}.setAttribute('cue', 'missing.cue')")
            await page.evaluate(f"{media}.src = 'programme.wav?2'")
            await page.until(f"{PLAYER}.reason === 'no-file'")
            assert page.errors == []

    asyncio.run(run())


def test_searches_sound_without_a_cuer(folder: Path) -> None:
    async def run() -> None:
        async with (
            serving(folder, []) as address,
            browse(f"{address}/index.html", 640, 360) as page,
        ):
            await page.until(f"customElements.get('cuecast-player') && {PLAYER}.hearing")
            await page.evaluate(f"{PLAYER}.media.play()")
            await page.until(f"{PLAYER}.reason === 'no-mark'")
            assert await page.evaluate(f"{PLAYER}.diagnosis.superframes") == 0
            assert await page.evaluate(f"{PLAYER}.keyList.length") == 0
            assert page.errors == []

    asyncio.run(run())


def test_a_page_without_https(folder: Path) -> None:
    """At the address that Python's server prints no page may read sound."""

    async def run() -> None:
        async with serving(folder, []) as address:
            everywhere = address.replace("127.0.0.1", "0.0.0.0")
            async with browse(f"{everywhere}/index.html", 640, 360) as page:
                await page.until(f"customElements.get('cuecast-player') && {PLAYER}.hearing")
                await page.evaluate(f"{PLAYER}.media.play()")
                await page.until(f"{PLAYER}.reason === 'insecure'")
                assert page.errors == []

    asyncio.run(run())


def test_missing_files_are_a_reason(folder: Path, tmp_path: Path) -> None:
    for name in ("index.html", "cuecast-player.js", "programme.wav"):
        (tmp_path / name).symlink_to(folder / name)

    async def run() -> None:
        async with serving(tmp_path, []) as address, browse(f"{address}/index.html") as page:
            await page.until(f"customElements.get('cuecast-player') && {PLAYER}.reason")
            assert await page.evaluate(f"{PLAYER}.reason") == "no-files"

    asyncio.run(run())


def test_an_upright_film_fits_the_window(tmp_path: Path) -> None:
    """So do its keys, and the word on reception stands clear of them."""
    pictures = (np.full((640, 360, 3), 90, np.uint8) for _ in range(50))
    sound = np.zeros((96_000, 2), np.float32)
    write_film(tmp_path / "p.mp4", sound, 48_000, bit_rate=128_000, pictures=pictures)
    write_folder(tmp_path / "p.mp4", tmp_path / "site", load_voice("claire"))
    boxes = asyncio.run(_boxes(tmp_path / "site"))
    for left, top, right, bottom in boxes.values():
        assert 0 <= left < right <= 1280
        assert 0 <= top < bottom <= 720
    assert boxes["status"][1] >= boxes["keys"][3]


async def _boxes(site: Path) -> dict[str, list[float]]:
    """Left, top, right and bottom of what the page shows, and where the word would stand."""
    async with serving(site, []) as address, browse(f"{address}/index.html", 1280, 720) as page:
        await page.until(f"{PLAYER}?.stage?.layout?.programme.width < 640")
        found: dict[str, list[float]] = await page.evaluate(
            f"""(() => {{
              const {{ layout, status }} = {PLAYER}.stage;
              const of = (one) => [one.left, one.top, one.left + one.width, one.top + one.height];
              const word = [status.style.left, status.style.top].map(parseFloat);
              return {{ video: of(document.querySelector("video").getBoundingClientRect()),
                        keys: of(layout.keys), cuer: of(layout.cuer),
                        status: [...word, word[0] + 1, word[1] + 1] }};
            }})()"""
        )
    return found
