"""Damaged and hostile programmes: one clear error or an honest result, nothing left behind."""

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from types import FrameType
from typing import Any

import av
import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.cues.score import Score
from codec.errors import CueError
from cuecast.dubbing.dub import DubOptions, dub
from cuecast.dubbing.motions import SynthesisedMotion
from cuecast.dubbing.receive import receive
from receiver.media.programme import open_programme

pytestmark = pytest.mark.long(7)

VOICE = load_voice()
FPS, FS, SECONDS = 25, 48_000, 2
FORMS = {
    "a.mp4": ("libx264", "aac"),
    "a.mkv": ("libx264", "flac"),
    "a.ts": ("mpeg2video", "mp2"),
    "a.wav": (None, "pcm_s16le"),
    "b.mp4": ("mpeg4", None),
    "a.ogg": (None, "libopus"),
}
LONGEST_S = 300
MOST_MEMORY_KB, MORE_MEMORY_KB = 1_500_000, 100_000


def write(path: Path, picture: str | None, sound: str | None) -> None:
    rng = np.random.default_rng(3)
    with av.open(str(path), "w") as out:
        shown: Any = None
        heard: Any = None
        if picture:
            shown = out.add_stream(picture, rate=FPS)
            shown.width, shown.height, shown.pix_fmt = 320, 180, "yuv420p"
        if sound:
            heard = out.add_stream(sound, rate=FS)
            heard.layout = "mono"
        for n in range(SECONDS * FPS):
            if shown is not None:
                luma = np.clip(rng.normal(110, 5, (180, 320)) + n, 0, 255).astype(np.uint8)
                frame = av.VideoFrame.from_ndarray(luma, format="gray").reformat(format="yuv420p")
                frame.pts, frame.time_base = n, Fraction(1, FPS)
                out.mux(shown.encode(frame))
            if heard is not None:
                noise = rng.normal(0, 3000, (1, FS // FPS)).astype(np.int16)
                block = av.AudioFrame.from_ndarray(noise, format="s16", layout="mono")
                block.sample_rate, block.pts = FS, n * FS // FPS
                block.time_base = Fraction(1, FS)
                out.mux(heard.encode(block))
        for stream in (shown, heard):
            if stream is not None:
                out.mux(stream.encode(None))


@pytest.fixture(scope="module")
def programmes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("fuzz")
    for name, codecs in FORMS.items():
        write(folder / name, *codecs)
    return {name: (folder / name).read_bytes() for name in FORMS}


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Injure a file in one of eight ways; headers, where it hurts most, more often."""
    raw = bytearray(data)
    begin = int(rng.integers(len(raw) if rng.random() < 0.5 else min(len(raw), 1500)))
    end = min(len(raw), begin + int(rng.integers(1, 3000)))
    match int(rng.integers(8)):
        case 0:
            del raw[begin:]
        case 1:
            for place in rng.integers(begin, len(raw), 20):
                raw[place] ^= int(rng.integers(1, 256))
        case 2:
            raw[begin:end] = bytes(end - begin)
        case 3:
            del raw[begin:end]
        case 4:
            raw[begin:begin] = raw[begin:end] * 3
        case 5:
            raw[begin:end] = rng.bytes(end - begin)
        case 6:
            raw[begin : begin + 4] = b"\xff\xff\xff\xff"
        case _:
            raw += raw[begin:]
    return bytes(raw)


@contextmanager
def deadline() -> Iterator[None]:
    """Fail instead of hanging."""

    def late(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"not done after {LONGEST_S} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(LONGEST_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def attempt(path: Path, name: str, data: bytes, carriers: tuple[str, ...]) -> str:
    """Receive and dub a file; return what came of it."""
    folder = path / "out"
    folder.mkdir(exist_ok=True)
    source, target = path / name, folder / name
    source.write_bytes(data)
    told, before = [], resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with deadline():
        try:
            receive(source, VOICE)
            told.append("received")
        except CueError as error:
            told.append(str(error))
        try:
            motion = SynthesisedMotion(Score((), ()), VOICE)
            dub(source, motion, VOICE, target, DubOptions(carriers=carriers, graded=False))
            told.append("dubbed")
        except CueError as error:
            told.append(str(error))
            assert not list(folder.iterdir()), "an error left something behind"
    assert all("\n" not in line for line in told)
    assert set(folder.iterdir()) <= {target}
    target.unlink(missing_ok=True)
    # The peak is the process's, of the tests before as well.
    most = max(MOST_MEMORY_KB, before + MORE_MEMORY_KB)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < most
    return "; ".join(told)


def carriers_of(name: str) -> tuple[str, ...]:
    picture, sound = FORMS[name]
    return (("audio",) if sound else ()) + (("video",) if picture else ())


@pytest.mark.parametrize("name", FORMS)
def test_whole_programmes_pass(programmes: dict[str, bytes], tmp_path: Path, name: str) -> None:
    told = attempt(tmp_path, name, programmes[name], carriers_of(name))
    assert told == "received; dubbed"


@pytest.mark.parametrize("name", ["a.mp4", "a.ts", "a.wav"])
def test_damage(programmes: dict[str, bytes], tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(list(FORMS).index(name))
    attempt(tmp_path, name, damaged(programmes[name], rng), carriers_of(name))


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMS)
def test_damage_for_long(programmes: dict[str, bytes], tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(100 + list(FORMS).index(name))
    told: dict[str, int] = {}
    for _ in range(150):
        what = attempt(tmp_path, name, damaged(programmes[name], rng), carriers_of(name))
        told[what] = told.get(what, 0) + 1
    assert len(told) > 1, "the damage changed nothing"


@pytest.mark.parametrize("name", ["a.mp4", "a.mkv", "a.ts"])
@pytest.mark.parametrize("content", [b"", b"\0" * 5000, b"RIFF\xff\xff\xff\xffWAVEfmt "])
def test_no_programme_at_all(tmp_path: Path, name: str, content: bytes) -> None:
    told = attempt(tmp_path, name, content, ("audio", "video"))
    assert "received" not in told
    assert "dubbed" not in told


def test_jumping_times(programmes: dict[str, bytes], tmp_path: Path) -> None:
    """Two transport streams in a row: the times start again in the middle."""
    told = attempt(tmp_path, "a.ts", 2 * programmes["a.ts"], ("audio", "video"))
    assert told.startswith("received")
    with open_programme(tmp_path / "a.ts") as programme:
        assert programme.fault == ""
