"""What the procedure of spec/hearing.md hears, beside the receiver.

The demonstration's programme is marked with pseudorandom payloads and sent through coders, gains
and clocks. ``python -m tests.spec.hearing_record docs/records/hearing.json`` writes the record.
"""

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample_poly

from cuecast.demo.content import FS, make_sound
from cuecast.dubbing.coder_stream import make_rehearsal
from cuecast.evaluate.records import make_record
from cuecast.evaluate.sound_channels import through_codec
from cuecast.evaluate.sound_clocks import at_other_speed
from spec.reference.hearing import hear
from tests.watermark.payloads import payloads
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import STANDARD

Sound = NDArray[np.float32]
Row = dict[str, int]


def marked() -> Sound:
    """Return the demonstration's programme with a mark, shape (n, 2)."""
    sound, _ = make_sound()
    source = payloads(STANDARD.l0_bytes, STANDARD.l1_bytes)
    embedder = AudioEmbedder(FS, 2, source, rehearsal=make_rehearsal(STANDARD, 0, None))
    return np.concatenate([embedder.process(sound), embedder.flush()])


def aac(sound: Sound) -> Sound:
    """Send a programme through AAC at 128 kbit/s."""
    return through_codec(sound, FS, codec="aac", bit_rate=128_000)


CONDITIONS: Mapping[str, tuple[int, Callable[[Sound], Sound]]] = {
    "aac 128k": (FS, aac),
    "mp2 192k": (FS, lambda x: through_codec(x, FS, codec="mp2", bit_rate=192_000)),
    "ac3 192k": (FS, lambda x: through_codec(x, FS, codec="ac3", bit_rate=192_000)),
    "aac 128k, -20 dB": (FS, lambda x: aac(x) * np.float32(0.1)),
    "aac 128k, -10 dB": (FS, lambda x: aac(x) * np.float32(10**-0.5)),
    "aac 128k, +20 dB": (FS, lambda x: aac(x) * np.float32(10)),
    "aac 128k, 44.1 kHz": (
        44100,
        lambda x: resample_poly(aac(x), 147, 160, axis=0).astype(np.float32),
    ),
    "aac 128k, one channel": (FS, lambda x: aac(x).mean(axis=1, keepdims=True)),
    "aac 128k, 50 ppm": (FS, lambda x: at_other_speed(aac(x), FS, ppm=50.0)),
}
"""Rate in Hz, and what happens to the marked programme (W5 to W7, A17)."""


def heard(sound: Sound, rate: int) -> Row:
    """Return how many superframes each receiver hears of a programme, and wrong ones."""
    source = payloads(STANDARD.l0_bytes, STANDARD.l1_bytes)
    sent = {source(k)[0]: source(k)[1] for k in range(200)}
    receiver = AudioReceiver(rate, sound.shape[1])
    usual = [s for s in receiver.process(sound) + receiver.flush() if s.l0 is not None]
    plain = list(hear(sound.T.astype(np.float64), rate))
    return {
        "sent": len(sound) * FS // rate // 30720,
        "receive": len({s.l0 for s in usual} & set(sent)),
        "hearing": len({s.l0 for s in plain} & set(sent)),
        "hearing, with L1": sum(sent.get(s.l0) == s.l1 for s in plain),
        "wrong": sum(s.l0 not in sent for s in plain),
    }


def record(path: Path | None) -> dict[str, Row]:
    """Measure all conditions; write a record where a path is given."""
    sound = marked()
    rows = {}
    for name, (rate, change) in CONDITIONS.items():
        rows[name] = heard(change(sound), rate)
        print(name, rows[name], flush=True)
    if path is not None:
        results = [{"channel": name, **row} for name, row in rows.items()]
        document = make_record("hearing", (), results, seed=0, clips=None)
        document["command"] = "python -m tests.spec.hearing_record docs/records/hearing.json"
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return rows


if __name__ == "__main__":
    record(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
