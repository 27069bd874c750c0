"""The whole way on real sound and a real picture, where the shared clips are at hand."""

import asyncio
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import pytest

from codec.cuer.motion import load_motion, sample_params
from codec.cuer.voice import load_voice
from cuecast.command.cli import main
from cuecast.media.film import write_film
from receiver.media.sound import read_sound
from tests.chromium import Page, browse

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
ARTEFACTS = ROOT / "artefacts" / "watch"
POEM = ROOT / "tests" / "data" / "une_charogne.srt"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not DATA.is_dir(), reason="no ../shared/data beside the project"),
]


@pytest.fixture(scope="module")
def film_mix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the poem over music, dubbed and coded as broadcasters do, and the motion."""
    folder = tmp_path_factory.mktemp("film_mix")
    source = str(DATA / "audio" / "film_mix.flac")
    dub = ["dub", source, "--subtitles", str(POEM), "-o", str(folder / "d.flac")]
    assert main([*dub, "--report", str(folder / "r.json")]) == 0
    assert main(["synth", "--file", str(POEM), "-o", str(folder / "sent.npz")]) == 0
    sound, _ = read_sound(folder / "d.flac")
    write_film(folder / "aac.m4a", sound, 48000, encoder="aac", bit_rate=128_000)
    write_film(folder / "mp2.ts", sound, 48000, encoder="mp2", bit_rate=192_000)
    return folder


@pytest.mark.parametrize("file", ["aac.m4a", "mp2.ts"])
@pytest.mark.parametrize("start", [0.31, 13.5])
def test_film_mix(
    film_mix: Path, capsys: pytest.CaptureFixture[str], file: str, start: float
) -> None:
    """Every superframe after tune-in arrives, and every key in it; tune-in under 3 s."""
    motion = film_mix / "received.npz"
    argv = ["receive", str(film_mix / file), "--start", str(start), "-o", str(motion), "--json"]
    assert main(argv) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["superframes"]["lost"] == 0
    assert found["superframes"]["received"] >= (39.9 - start) / 0.64 - 4
    assert found["tune_in_s"] < 3
    assert main(["compare", str(film_mix / "sent.npz"), str(motion), "--json"]) == 0
    alike = json.loads(capsys.readouterr().out)
    assert alike["keys_correct"] == alike["keys_total"] > 100
    assert abs(alike["offset_s"]) < 0.033  # a raw MP2 stream is 10 ms late by its decoder


def test_report_of_film_mix(film_mix: Path) -> None:
    report = json.loads((film_mix / "r.json").read_text(encoding="utf-8"))
    audio = report["carriers"]["audio"]
    assert audio["net_bps"] >= 300
    assert audio["snr_db"] > 15
    assert audio["odg"] > -1


@pytest.fixture(scope="module")
def talker(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the talker's picture over ten seconds of film_mix: plain, and dubbed."""
    folder = tmp_path_factory.mktemp("talker")
    sound = read_sound(DATA / "audio" / "film_mix.flac")[0][: 10 * 48000]
    write_film(folder / "sound.m4a", sound, 48000, encoder="aac", bit_rate=192_000)
    mux(DATA / "video" / "lpc_talker_fr_720p25.mp4", folder / "sound.m4a", folder / "talker.mp4")
    dub = ["dub", str(folder / "talker.mp4"), "--subtitles", str(POEM), "--no-grade"]
    assert main([*dub, "-o", str(folder / "dubbed.mp4")]) == 0
    return folder


def mux(picture: Path, sound: Path, target: Path) -> None:
    with av.open(str(picture)) as a, av.open(str(sound)) as b, av.open(str(target), "w") as out:
        streams = [
            out.add_stream_from_template(a.streams.video[0]),
            out.add_stream_from_template(b.streams.audio[0]),
        ]
        for container, stream in zip((a, b), streams, strict=True):
            for packet in container.demux():
                if packet.size:
                    packet.stream = stream
                    out.mux(packet)


def test_talker_stays_as_it_was(talker: Path) -> None:
    def picture(path: Path) -> list[tuple[bytes, int | None]]:
        with av.open(str(path)) as container:
            return [(bytes(p), p.pts) for p in container.demux(video=0) if p.size]

    original = picture(DATA / "video" / "lpc_talker_fr_720p25.mp4")
    assert len(original) == 250
    assert picture(talker / "dubbed.mp4") == original
    with av.open(str(talker / "dubbed.mp4")) as container:
        assert sum(1 for _ in container.decode(video=0)) == 250


@pytest.fixture
def television(talker: Path) -> Iterator[str]:
    """The address of ``cuecast watch`` on the dubbed talker."""
    argv = [sys.executable, "-m", "cuecast", "watch", str(talker / "dubbed.mp4"), "--port", "0"]
    process = subprocess.Popen(argv, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    assert process.stderr is not None
    try:
        line = process.stderr.readline()
        address = re.search(r"http://\S+", line)
        assert address, line
        yield address[0]
    finally:
        process.terminate()
        process.communicate(timeout=20)


def test_watch_shows_talker_and_cuer_in_step(talker: Path, television: str) -> None:
    assert main(["receive", str(talker / "dubbed.mp4"), "-o", str(talker / "received.npz")]) == 0
    motion, voice = load_motion(talker / "received.npz"), load_voice()

    async def visit(page: Page) -> None:
        await page.until("window.cuecast && cuecast.video.readyState >= 3")
        assert await page.evaluate("cuecast.video.videoWidth") == 1280
        for number, time_s in enumerate((3.3, 5.1, 7.0)):
            await page.evaluate(f"cuecast.seekTo({time_s})")
            # The next superframe as well: it has a say in how this one ends.
            await page.until(f"cuecast.timeline.knownFrom({time_s}) > 0.7")
            arrived = await page.evaluate("performance.now()")
            await page.until(
                f"cuecast.drawn.nowMs > {arrived} && "
                "!cuecast.video.seeking && cuecast.drawn.visibility == 1"
                f" && Math.abs(cuecast.drawn.timeS - {time_s}) < 0.03"
            )
            drawn = json.loads(
                await page.evaluate(
                    "JSON.stringify([cuecast.drawn.timeS, Array.from(cuecast.cuer.markers)])"
                )
            )
            times = np.array([drawn[0]])
            expected = voice.reconstruct(sample_params(motion, times))[0]
            error = np.abs(np.reshape(drawn[1], (113, 3)) - expected)
            assert error.max() < 8, f"{error.max():.1f} mm at {drawn[0]} s"
            await page.screenshot(ARTEFACTS / f"talker-{number}.png")
        assert page.errors == []

    async def watch() -> None:
        async with browse(television) as page:
            await visit(page)

    asyncio.run(asyncio.wait_for(watch(), 120))
