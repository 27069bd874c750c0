"""The native receiver's hearing: from sound to the bytes of superframes, against Python's."""

import json
import subprocess
import wave
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.signal
from numpy.typing import NDArray

from tests.receiver.native.building import built
from watermark import AudioEmbedder, AudioReceiver
from watermark.audio.signal.profile import PROFILES

pytestmark = pytest.mark.long(12)

Sound = NDArray[np.float32]
Event = dict[str, Any]
ROOT = Path(__file__).resolve().parents[3]
FS, SUPERFRAME_S, SECONDS = 48000, 0.64, 4.0


def payload(profile: str) -> Callable[[int], tuple[bytes, bytes]]:
    sizes = PROFILES[profile].l0_bytes, PROFILES[profile].l1_bytes

    def of(k: int) -> tuple[bytes, bytes]:
        rng = np.random.default_rng(k)
        return rng.bytes(sizes[0]), rng.bytes(sizes[1])

    return of


def programme(fs: int = FS, channels: int = 2, seconds: float = SECONDS) -> Sound:
    """Murmuring noise whose loudness changes slowly, other noise in each channel."""
    n, rng = int(seconds * fs), np.random.default_rng(3)
    noise = scipy.signal.lfilter([1.0], [1.0, -0.93], rng.standard_normal((n, channels)), axis=0)
    loudness = 0.02 * (1 + 0.5 * np.sin(2 * np.pi * 2.3 * np.arange(n) / fs))
    return np.asarray(noise * loudness[:, np.newaxis], dtype=np.float32)


@pytest.fixture(scope="module")
def marked() -> Callable[[str, int, int], Sound]:
    made: dict[tuple[str, int, int], Sound] = {}

    def mark(profile: str, channels: int = 2, fs: int = FS) -> Sound:
        if (profile, channels, fs) not in made:
            embedder = AudioEmbedder(fs, channels, payload(profile), profile=profile)
            parts = [embedder.process(programme(fs, channels)), embedder.flush()]
            made[profile, channels, fs] = np.concatenate(parts)
        return made[profile, channels, fs]

    return mark


def hear(x: Sound, fs: int = FS, *options: str) -> list[Event]:
    command = [built("cue_dec"), "--rate", str(fs), "--channels", str(x.shape[1]), *options]
    sound = np.ascontiguousarray(x, dtype="<f4").tobytes()
    done = subprocess.run(command, input=sound, capture_output=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    events = [json.loads(line) for line in done.stdout.decode().splitlines()]
    assert done.returncode == (0 if any(e["kind"] == "superframe" for e in events) else 1)
    return events


def superframes(events: list[Event]) -> list[Event]:
    return sorted((e for e in events if e["kind"] == "superframe"), key=lambda e: e["time_s"])


def check(events: list[Event], profile: str, count: int, *, start_s: float = 0.0) -> None:
    """All superframes are there, are right and stand within a millisecond of their place."""
    found = superframes(events)
    for s in found:
        k = round((s["time_s"] + start_s) / SUPERFRAME_S)
        l0, l1 = payload(profile)(k)
        assert (s["l0"], s["l1"] or "") == (l0.hex(), l1.hex())
        assert s["profile"] == PROFILES[profile].number
        assert abs(s["time_s"] + start_s - k * SUPERFRAME_S) < 1e-3
    assert len(found) == count


def test_the_vector_s_sound() -> None:
    case = json.loads((ROOT / "spec" / "vectors" / "audio-sound.json").read_text())["cases"][0]
    with wave.open(str(ROOT / "spec" / "vectors" / case["file"])) as file:
        words = np.frombuffer(file.readframes(file.getnframes()), dtype="<i2")
    x = np.concatenate([np.zeros(20000), words / 32768, np.zeros(9000)]).astype(np.float32)
    (found,) = superframes(hear(x[:, np.newaxis]))
    assert (found["l0"], found["l1"]) == (case["l0"], case["l1"])
    assert abs(found["start_samples"] - 20000 - case["start"]) < 0.2


@pytest.mark.parametrize("profile", PROFILES)
def test_profiles_in_stereo(marked: Callable[..., Sound], profile: str) -> None:
    check(hear(marked(profile)), profile, 6)


@pytest.mark.parametrize(("fs", "channels"), [(44100, 1), (32000, 2), (48000, 6)])
def test_formats(marked: Callable[..., Sound], fs: int, channels: int) -> None:
    check(hear(marked("standard", channels, fs), fs), "standard", 6)


@pytest.mark.parametrize(("fs", "up", "down"), [(96000, 2, 1), (22050, 147, 320)])
def test_rates_that_are_not_marked(
    marked: Callable[..., Sound], fs: int, up: int, down: int
) -> None:
    x = scipy.signal.resample_poly(marked("standard"), up, down, axis=0)
    check(hear(x.astype(np.float32), fs), "standard", 6)


@pytest.mark.parametrize("gain_db", [-30.0, -17.0, 7.5, 30.0])
def test_gains(marked: Callable[..., Sound], gain_db: float) -> None:
    check(hear(marked("standard") * np.float32(10 ** (gain_db / 20))), "standard", 6)


def test_gain_of_a_short_sound(marked: Callable[..., Sound]) -> None:
    short = marked("standard")[: 2 * FS] * np.float32(10 ** (-10 / 20))
    check(hear(short), "standard", 3)


@pytest.mark.parametrize("weights", [(-1, -1), (1, -1), (-1, 1), (1, 0), (0, 1)])
def test_polarities_and_single_channels(
    marked: Callable[..., Sound], weights: tuple[int, int]
) -> None:
    x = np.concatenate([marked("robust", 1)] * 2, axis=1) * np.array(weights, dtype=np.float32)
    check(hear(x), "robust", 6)


@pytest.mark.parametrize("parts", [(500, 499), (499, 500)])
def test_speeds(marked: Callable[..., Sound], parts: tuple[int, int]) -> None:
    x = scipy.signal.resample_poly(marked("standard"), *parts, axis=0).astype(np.float32)
    found = superframes(hear(x))
    assert [s["l0"] for s in found] == [payload("standard")(k)[0].hex() for k in range(6)]


def test_tune_in_anywhere(marked: Callable[..., Sound]) -> None:
    events = hear(marked("standard")[29999:])
    check(events, "standard", 5, start_s=29999 / FS)
    assert events[-1]["first_lock_s"] < 1.5


def test_blocks_do_not_matter(marked: Callable[..., Sound]) -> None:
    whole = hear(marked("standard"), FS, "--block", "192000")
    for block in ("1", "480", "4801"):
        assert hear(marked("standard"), FS, "--block", block) == whole


def test_states_can_be_moved(marked: Callable[..., Sound]) -> None:
    sound = np.ascontiguousarray(marked("high"), dtype="<f4").tobytes()
    for block in ("4800", "777"):
        command = [built("states"), "48000", "2", block]
        done = subprocess.run(command, input=sound, capture_output=True, check=False)
        assert done.returncode == 0
        assert int(done.stdout) >= 6


@pytest.mark.parametrize("seconds", [2.0, 6.0])
def test_nothing_is_found_in_unmarked_sound(seconds: float) -> None:
    events = hear(programme(seconds=seconds))
    assert superframes(events) == []
    assert events[-1]["state"] == "ended"
    assert events[-1]["profile"] == 255


def test_gaps_are_bridged_and_reported(marked: Callable[..., Sound]) -> None:
    x = marked("standard").copy()
    x[int(1.9 * FS) : int(2.57 * FS)] = 0.0
    events = hear(x)
    assert [e["count"] for e in events if e["kind"] == "lost"] == [1]
    assert len(superframes(events)) == 5


def test_wrong_numbers_count_as_silence(marked: Callable[..., Sound]) -> None:
    x = marked("standard").copy()
    x[2 * FS : 2 * FS + 200] = np.nan
    x[3 * FS] = np.inf
    assert len(superframes(hear(x))) >= 5


def test_as_many_as_python(marked: Callable[..., Sound]) -> None:
    rng = np.random.default_rng(7)
    x = marked("standard")
    y = (x + 3e-5 * rng.standard_normal(x.shape)).astype(np.float32)
    receiver = AudioReceiver(FS, 2, guess=False)
    python = [s for s in [*receiver.process(y), *receiver.flush()] if s.l0 is not None]
    native = superframes(hear(y))
    assert len(native) >= len(python) > 0
    for s in native:
        assert s["l0"] == payload("standard")(round(s["time_s"] / SUPERFRAME_S))[0].hex()


@pytest.mark.parametrize("gains", [(1.0, 1.0), (1.5, 1.5), (1.0, 0.5)])
def test_cells_are_read_where_python_reads_them(gains: tuple[float, float]) -> None:
    """Left and right of narrow stereo tell of what stands in the mid, but less."""
    x = programme(channels=1) + 0.4 * programme()[::-1]
    middle = x.mean(axis=1, keepdims=True)
    embedder = AudioEmbedder(FS, 1, payload("standard"), profile="standard")
    marked = np.concatenate([embedder.process(middle), embedder.flush()])
    y = ((x + marked - middle) * np.array(gains)).astype(np.float32)
    receiver = AudioReceiver(FS, 2)
    python = [s for s in [*receiver.process(y), *receiver.flush()] if s.l0 is not None]
    native = {s["l0"]: s["confidence"] for s in superframes(hear(y))}
    assert len(native) >= len(python) >= 5
    for s in python:
        # Measured: within 0.01; left and right fit worse by 0.1 to 0.2.
        assert s.l0 is not None
        assert abs(native[s.l0.hex()] - s.confidence) < 0.03
