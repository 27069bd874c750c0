"""Robustness of the audio carrier on real sound: nightly, skipped without the shared clips."""

import io
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from tests.bench.false_locks import listen
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.sample_buffer import SampleBuffer
from watermark.link.superframe import ReceivedSuperframe
from watermark.quality import grade

FOLDER = Path(__file__).resolve().parents[4] / "shared" / "data" / "audio"
FS = 48000
Sound = NDArray[np.float32]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not FOLDER.exists(), reason="clips of ../shared/data/audio absent"),
]


def clip(name: str) -> Sound:
    x, _ = soundfile.read(FOLDER / f"{name}.flac", dtype="float32", always_2d=True)
    return np.asarray(x)


def payload(k: int) -> tuple[bytes, bytes]:
    return k.to_bytes(20, "big"), bytes(7)


def number(superframe: ReceivedSuperframe) -> int:
    assert superframe.l0 is not None
    return int.from_bytes(superframe.l0, "big")


def marked(x: Sound, level: int = 7) -> Sound:
    embedder = AudioEmbedder(FS, x.shape[1], payload, level=level)
    return np.concatenate([embedder.process(x), embedder.flush()])


def at_speed(x: Sound, ratio: float) -> Sound:
    count = int(len(x) / ratio)
    out = np.empty((count, x.shape[1]), dtype=np.float32)
    for channel in range(x.shape[1]):
        tape = SampleBuffer()
        tape.append(x[:, channel].astype(np.float64))
        out[:, channel] = tape.read(0.0, ratio, count)
    return out


def receive(y: Sound) -> list[ReceivedSuperframe]:
    receiver = AudioReceiver(FS, y.shape[1])
    found = [s for i in range(0, len(y), FS) for s in receiver.process(y[i : i + FS])]
    return found + receiver.flush()


def through_ac3(x: Sound, layout: str) -> Sound:
    """Code 5.1 at 384 kbit/s, and decode it to a layout."""
    memory, parts = io.BytesIO(), []
    output: Any
    with av.open(memory, "w", format="ac3") as output:
        stream = output.add_stream("ac3", rate=FS)
        stream.bit_rate, stream.layout, stream.format = 384_000, "5.1(side)", "fltp"
        planes = np.ascontiguousarray(x.T)
        frame = av.AudioFrame.from_ndarray(planes, format="fltp", layout="5.1(side)")
        frame.sample_rate = FS
        for packet in (*stream.encode(frame), *stream.encode(None)):
            output.mux(packet)
    memory.seek(0)
    resampler = av.AudioResampler("fltp", layout, FS)
    source: Any
    with av.open(memory) as source:
        for frame in source.decode(audio=0):
            parts += [part.to_ndarray() for part in resampler.resample(frame)]
    return np.concatenate(parts, axis=1).T.astype(np.float32)


@pytest.mark.parametrize("ppm", [100, -100, 200, -200])
def test_two_minutes_on_another_clock(ppm: int) -> None:
    y = at_speed(marked(np.tile(clip("film_mix"), (3, 1))), 1 + ppm * 1e-6)
    found = receive(y)
    assert [number(s) for s in found] == list(range(len(found)))
    assert len(found) >= 186  # 12 minutes gave 1125 of 1125 through AAC 128k as well


@pytest.mark.parametrize("name", ["pop_vocal", "speech_fr_m_lv"])
def test_splices_are_found_again(name: str) -> None:
    y = marked(clip(name), 7 if name == "pop_vocal" else 5)
    rng = np.random.default_rng(0)
    places = rng.integers([4 * FS, 14 * FS], [9 * FS, 30 * FS], (4, 2))
    for cut, resume in places.tolist():
        joined = np.concatenate([y[:cut], y[resume : resume + 5 * FS]])
        later = [s for s in receive(joined) if s.l0 and number(s) * 0.64 * FS >= resume - 0.7 * FS]
        # The superframe is complete 0.64 s after its position. Seven of eight waits are at most
        # 1.1 s; one is 2.05 s, where the allowance is used up (0.77 s with savings of 150 units).
        assert later[0].position_s + 0.64 - cut / FS <= 2.1


def test_no_lock_in_unmarked_sound() -> None:
    for heard in listen(sorted(FOLDER.glob("*.flac")), seed=1):
        assert (heard.locks, heard.superframes) == (0, 0)
        if heard.hours > 0.1:  # python tests/bench/false_locks.py takes as many as wanted
            return


def test_each_part_of_surround_sound_has_the_grade() -> None:
    film = clip("film_mix")
    left, right = film.T
    x = np.stack([left, right, (left + right) / 2, 0 * left, 0.2 * left, 0.2 * right], axis=1)
    embedder = AudioEmbedder(FS, 6, payload, grade=-0.42)
    y = np.concatenate([embedder.process(x), embedder.flush()])
    down = np.zeros((6, 2))
    down[[0, 1], [0, 1]] = 1.0
    down[[2, 2, 4, 5], [0, 1, 0, 1]] = np.sqrt(0.5)
    assert grade(x @ down, y @ down, FS).odg > -0.5  # measured -0.39
    assert grade(x[:, :2], y[:, :2], FS).odg > -0.5  # -0.41; -0.99 with the whole mark there
    assert grade(x[:, 2:3], y[:, 2:3], FS).odg > -0.5  # -0.45
    for layout, channels in (("5.1(side)", 6), ("stereo", 2)):
        heard = through_ac3(np.float32(0.6) * y, layout)  # room for the downmix
        assert heard.shape[1] == channels
        assert [number(s) for s in receive(heard) if s.l0] == list(range(62))


def test_tune_in_from_random_samples() -> None:
    y, rng, waits = marked(clip("classical_strings")), np.random.default_rng(2), []
    for start in rng.integers(0, 35 * FS, 20):
        receiver = AudioReceiver(FS, 2)
        for i in range(start, start + 4 * FS, FS // 20):
            receiver.process(y[i : i + FS // 20])
        assert receiver.first_lock_s is not None
        waits.append(receiver.first_lock_s)
    assert np.median(waits) <= 1.0  # measured 0.7
    assert max(waits) <= 2.5
