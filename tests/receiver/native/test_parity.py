"""The native receiver loses hardly more than Python's on real sound: nightly, with the clips."""

import io
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import soundfile

from tests.receiver.native.test_hearing import FS, SUPERFRAME_S, Sound, hear, payload, superframes
from watermark import AudioEmbedder, AudioReceiver
from watermark.audio.signal.profile import PROFILES

FOLDER = Path(__file__).resolve().parents[4] / "shared" / "data" / "audio"
SECONDS = 14
CHAINS: dict[str, list[tuple[str, int]]] = {
    "plain": [],
    "aac 128": [("aac", 128_000)],
    "mp2 192": [("mp2", 192_000)],
    "ac3 192": [("ac3", 192_000)],
    "mp2 192, aac 96": [("mp2", 192_000), ("aac", 96_000)],
}
CONTAINERS = {"aac": "adts", "mp2": "mp2", "ac3": "ac3"}
MOST_LOST = 0.005

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not FOLDER.exists(), reason="clips of ../shared/data/audio absent"),
]


def coded(x: Sound, codec: str, bit_rate: int) -> Sound:
    """Code and decode a sound of one or two channels."""
    memory, layout = io.BytesIO(), "mono" if x.shape[1] == 1 else "stereo"
    output: Any
    with av.open(memory, "w", format=CONTAINERS[codec]) as output:
        stream = output.add_stream(codec, rate=FS)
        stream.bit_rate, stream.layout = bit_rate, layout
        frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(x.T), "fltp", layout)
        frame.sample_rate = FS
        context = stream.codec_context
        cut = av.AudioResampler(context.format, layout, FS, frame_size=context.frame_size or 1152)
        for piece in [*cut.resample(frame), *cut.resample(None), None]:
            for packet in stream.encode(piece):
                output.mux(packet)
    memory.seek(0)
    planar, parts = av.AudioResampler("fltp", layout, FS), []
    source: Any
    with av.open(memory) as source:
        for frame in source.decode(audio=0):
            parts += [part.to_ndarray() for part in planar.resample(frame)]
    return np.concatenate(parts, axis=1).T.astype(np.float32)


def right(found: list[tuple[str | None, float]], profile: str) -> int:
    """Count the superframes on air that were read; a wrong one is a failure."""
    sent = {payload(profile)(k)[0].hex() for k in range(int(SECONDS / SUPERFRAME_S) + 2)}
    read = {l0 for l0, _ in found if l0 is not None}
    assert read <= sent
    return len(read)


@pytest.mark.parametrize("name", ["film_mix", "pop_vocal", "speech_fr_m_lv"])
def test_hardly_more_is_lost_than_by_python(name: str) -> None:
    x, _ = soundfile.read(FOLDER / f"{name}.flac", dtype="float32", always_2d=True)
    x = x[: SECONDS * FS]
    native = python = 0
    table: list[str] = []
    for profile in PROFILES:
        embedder = AudioEmbedder(FS, x.shape[1], payload(profile), profile=profile)
        marked = np.concatenate([embedder.process(x), embedder.flush()])
        for title, chain in CHAINS.items():
            y = marked
            for codec, bit_rate in chain:
                y = coded(y, codec, bit_rate)
            receiver = AudioReceiver(FS, y.shape[1])
            heard = [*receiver.process(y), *receiver.flush()]
            there = right([(s.l0.hex() if s.l0 else None, s.position_s) for s in heard], profile)
            here = right([(s["l0"], s["time_s"]) for s in superframes(hear(y))], profile)
            native, python = native + here, python + there
            table += [f"{profile}, {title}: {here}, Python {there}"] if here != there else []
    # Measured: 1056 of 1056 at most 192 kbit/s once; 21 of 22 and 16 of 18 of `high` in tandem.
    assert native >= (1 - MOST_LOST) * python, table
