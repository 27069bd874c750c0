"""The vectors of hearing: marked sounds and the soft values that a receiver has to find in them.

``python -m tests.spec.hearing_vectors spec/vectors`` writes `hearing.json` and its FLAC files.
Sound is noise shaped by a filter, marked by `marking`, coded by FFmpeg, read by `hearing_view`.
"""

import io
import json
import random
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
import soundfile
from scipy.signal import lfilter, resample_poly

from spec.reference import audio_carrier as carrier
from spec.reference.hearing import Reader, hear
from spec.reference.hearing_view import HOP, LENGTH, Array, converted, views
from spec.reference.marking import mark

ORIGIN = (
    "noise by tests/spec/hearing_vectors.py, marked by spec/reference/marking.py, coded by "
    "FFmpeg where said; payloads drawn at random; soft values by spec/reference/hearing_view.py, "
    "which were all written from the text"
)
FS = 48000
LOUDNESS = 0.02
"""RMS of the noise: quiet, so that 20 dB more fit, and small as FLAC."""
PARTS = 100
"""Parts of a soft value of 1 in `soft`."""
Case = dict[str, Any]


@dataclass(frozen=True)
class Sound:
    """A recording, shape (channels, n), and where and how its superframe is written."""

    samples: Array
    rate: int
    profile: str
    start: float
    level: float
    payload: tuple[bytes, bytes]


def host(seed: int, channels: int, superframes: int) -> Array:
    """Return noise that falls towards high frequencies, shape (channels, n)."""
    rng = np.random.default_rng(seed)
    count = HOP * (64 * superframes + 2)
    noise = lfilter([1.0], [1.0, -0.9], rng.normal(0, 1, (channels + 1, count)))
    mixed = noise[0] + 0.6 * noise[1:] * (channels - 1)
    swell = 0.6 + 0.4 * np.sin(2 * np.pi * np.arange(count) / 24000)
    return np.asarray(LOUDNESS * swell * mixed / np.std(mixed))


def written(profile: str, channels: int, superframes: int, level: int, seed: int) -> Sound:
    """Return a marked sound; the payload is that of its middle superframe."""
    rng = random.Random(seed)
    sizes = carrier.PROFILES[profile][5:7]
    payloads = [(rng.randbytes(sizes[0]), rng.randbytes(sizes[1])) for _ in range(superframes)]
    noise = host(seed, channels, superframes)
    sound = mark(noise, payloads, profile=profile, key=0, level=level)
    middle = superframes // 2
    start = float(HOP + LENGTH * middle)
    return Sound(sound, FS, profile, start, float(level), payloads[middle])


def coded(sound: Array) -> Array:
    """Send a sound of 48 kHz through AAC at 128 kbit/s (64 for one channel)."""
    memory = io.BytesIO()
    layout = "stereo" if len(sound) == 2 else "mono"
    output: Any
    with av.open(memory, "w", format="adts") as output:
        stream = output.add_stream("aac", rate=FS)
        stream.bit_rate, stream.layout = 64000 * len(sound), layout
        frame = av.AudioFrame.from_ndarray(
            np.ascontiguousarray(sound, dtype=np.float32), format="fltp", layout=layout
        )
        frame.sample_rate = FS
        for packet in (*stream.encode(frame), *stream.encode(None)):
            output.mux(packet)
    memory.seek(0)
    source: Any
    with av.open(memory) as source:
        parts = [frame.to_ndarray() for frame in source.decode(audio=0)]
    return np.concatenate(parts, axis=1).astype(np.float64)


def through_aac(sound: Sound) -> Sound:
    """Return the middle superframe of a sound as it comes out of AAC."""
    heard = coded(sound.samples)
    (found,) = (one for one in hear(heard) if one.l0 == sound.payload[0])
    start = round(found.start)
    cut = heard[:, start - HOP : start + LENGTH + HOP]
    return Sound(cut, FS, sound.profile, HOP, sound.level, sound.payload)


def amplified(sound: Sound, gain_db: float) -> Sound:
    """(W35) Return a sound at another gain, whose levels seem others."""
    level = sound.level + gain_db / 5
    samples = sound.samples * 10 ** (gain_db / 20)
    return Sound(samples, sound.rate, sound.profile, sound.start, level, sound.payload)


def at_44100(sound: Sound) -> Sound:
    """(W7) Return a sound at 44.1 kHz; its start counts samples at 48 kHz."""
    samples = resample_poly(sound.samples, 147, 160, axis=1)
    return Sound(samples, 44100, sound.profile, sound.start, sound.level, sound.payload)


def sounds() -> Iterator[tuple[str, str, str, Sound]]:
    """Yield identifier, purpose, what a failure suggests, and sound."""
    for seed, profile in enumerate(carrier.PROFILES):
        for channels, name in ((1, "mono"), (2, "stereo")):
            sound = written(profile, channels, 1, 3, 10 * seed + channels)
            yield (
                f"{profile}-{name}",
                f"soft values and payload of profile {profile}, {name}, plain",
                "units (W23 to W28), signs and dither of the profile (W16)"
                + ("; where cells stand, units of left and right (W43, W44)" * (channels - 1)),
                sound,
            )
    for channels, name in ((1, "mono"), (2, "stereo")):
        sound = written("standard", channels, 5, 7, 50 + channels)
        yield (
            f"standard-{name}-aac",
            f"a superframe behind AAC at {64 * channels} kbit/s",
            "both readings of side cells, weights by position (A8, A10), lists (A9)",
            through_aac(sound),
        )
    plain = written("standard", 2, 1, 4, 61)
    yield (
        "standard-stereo-plus-20-dB",
        "a gain of 20 dB",
        ("one tier higher: levels move by 4 (W35, A7)"),
        amplified(plain, 20.0),
    )
    yield (
        "standard-stereo-minus-10-dB",
        "a gain of -10 dB, half-way between two pilot steps",
        ("no offsets of a part of a tier (A4)"),
        amplified(plain, -10.0),
    )
    yield "standard-stereo-44100", "a recording at 44.1 kHz", "conversion (W7, A1)", at_44100(plain)
    yield (
        "acquisition",
        "three superframes: the first candidate, then one after another",
        ("search (A4, A5), refinement (A6), following (A12, A13)"),
        written("standard", 1, 3, 3, 71),
    )


def case_of(name: str, purpose: str, suggests: str, sound: Sound, folder: Path) -> Case:
    """Write a sound and return its case."""
    file = f"hearing-{name}.flac"
    soundfile.write(folder / file, sound.samples.T, sound.rate, subtype="PCM_16")
    samples, rate = soundfile.read(folder / file, always_2d=True)
    channels = np.stack([converted(channel, rate) for channel in samples.T])
    reader = Reader(channels, sound.profile, 0, 0.0)
    readings = reader.readings(views(channels, sound.start, 1.0), sound.level)
    found = [one for one in hear(samples.T, rate) if one.l0 == sound.payload[0]]
    assert [one.l1 for one in found] == [sound.payload[1]], name
    case: Case = {
        "id": name, "section": "3 to 8, 10", "valid": True, "purpose": purpose,
        "failure_suggests": suggests, "file": file, "rate": rate, "profile": sound.profile,
        "key": 0, "level": sound.level, "start": sound.start,
        "l0": sound.payload[0].hex(), "l1": sound.payload[1].hex(),
        "tolerance": 0.02 if rate == FS else 0.1, "share": 0.99,
    }  # fmt: skip
    for field, values in zip(("soft", "soft_mid"), readings[: len(channels)], strict=False):
        ordered = values.reshape(-1)[reader.layout.order]
        case[field] = np.round(PARTS * ordered).astype(np.int8).tobytes().hex()
    return case


def main(folder: Path) -> None:
    """Write the vectors."""
    cases = [case_of(*one, folder) for one in sounds()]
    lines = ",\n".join("  " + json.dumps(case, ensure_ascii=False) for case in cases)
    head = json.dumps({"origin": ORIGIN, "parts": PARTS})[:-1]
    text = f'{head}, "cases": [\n{lines}\n]}}\n'
    (folder / "hearing.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
