"""Superframes that the native receiver and Python's read of real sound through coders.

``python -m tests.receiver.native.parity`` compares twelve excerpts and lists where both differ.
"""

import io
import json
import sys
from pathlib import Path
from typing import Any

import av
import numpy as np
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
EXCERPTS = [
    *((name, at) for name in ("film_mix", "pop_vocal", "speech_fr_m_lv") for at in (0, 13, 26)),
    ("classical_strings", 0),
    ("classical_strings", 20),
    ("speech_fr_f_lv", 5),
]
"""Clips of ../shared/data/audio and the second at which each excerpt begins."""


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


def compare(name: str, at_s: int) -> tuple[int, int, list[str]]:
    """Return superframes read by the native receiver and by Python's, and where both differ."""
    x, _ = soundfile.read(FOLDER / f"{name}.flac", dtype="float32", always_2d=True)
    x = x[at_s * FS : (at_s + SECONDS) * FS]
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
    return native, python, table


def main() -> None:
    """Print a line for each excerpt, and the sums."""
    sums = [0, 0]
    for name, at_s in EXCERPTS:
        native, python, differing = compare(name, at_s)
        sums = [sums[0] + native, sums[1] + python]
        line = {"clip": name, "at_s": at_s, "native": native, "python": python}
        print(json.dumps({**line, "differing": differing}), flush=True)
    json.dump({"native": sums[0], "python": sums[1]}, sys.stdout)


if __name__ == "__main__":
    main()
