"""Programmes in frugal sound, dubbed and read back: in their own codec and at their own rate.

    python -m tests.bench.frugal_sound CLIP ... --record FILE

Each clip's first seconds are written in each coding, dubbed as `cuecast dub` does it without a
choice, and again with a rehearsal on the profile's usual coders alone; the report says what arrives
of the file that was written.
"""

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

from cuecast.command.cli import main as cuecast
from cuecast.dubbing.coder_stream import USUAL
from cuecast.evaluate.records import make_record
from cuecast.media.film import write_film
from receiver.media.sound import read_sound

CODINGS = (
    ("aac", ".m4a", 64_000, 1), ("aac", ".m4a", 96_000, 2), ("aac", ".m4a", 128_000, 2),
    ("libmp3lame", ".mp3", 96_000, 2), ("libmp3lame", ".mp3", 128_000, 2),
    ("aac", ".ts", 64_000, 1), ("aac", ".ts", 96_000, 2),
)  # fmt: skip
SECONDS = 15
TEXT = (
    "1\n00:00:00,500 --> 00:00:03,500\nBonjour, voici les nouvelles de ce soir.\n\n"
    "2\n00:00:04,000 --> 00:00:07,000\nLe train part demain matin à huit heures.\n\n"
    "3\n00:00:07,500 --> 00:00:11,000\nIl fera beau sur toute la côte, avec un peu de vent.\n"
)


def main() -> None:
    """Print a row for each clip and coding."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clips", type=Path, nargs="+")
    parser.add_argument("--record", type=Path)
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for clip in options.clips:
        for encoder, suffix, bit_rate, channels in CODINGS:
            with tempfile.TemporaryDirectory() as name:
                folder = Path(name)
                sound, fs = read_sound(clip)
                sound = sound[: SECONDS * fs]
                sound = sound.mean(axis=1, keepdims=True) if channels == 1 else sound
                write_film(folder / f"a{suffix}", sound, fs, encoder=encoder, bit_rate=bit_rate)
                (folder / "a.srt").write_text(TEXT, encoding="utf-8")
                own, usual = (dubbed(folder, suffix, *more) for more in ((), ("--through", _USUAL)))
            coding = {"coder": suffix[1:], "kbit_s": bit_rate // 1000, "channels": sound.shape[1]}
            rows.append({"clip": clip.stem, **coding, **own, "usual": usual["received"]})
            print(", ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    if options.record:
        document = make_record("frugal_sound", (), rows, seed=0, clips=options.clips[0].parent)
        document["command"] = "python -m tests.bench.frugal_sound CLIPS --record FILE"
        options.record.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


_USUAL = USUAL["standard"]


def dubbed(folder: Path, suffix: str, *more: str) -> dict[str, Any]:
    """Dub the programme in a folder; return what its report says."""
    files = [str(folder / name) for name in (f"a{suffix}", "a.srt", f"b{suffix}", "r.json")]
    given = ["dub", files[0], "--subtitles", files[1], "-o", files[2], "--report", files[3]]
    assert cuecast([*given, *more]) in (0, 1)
    report = json.loads(Path(files[3]).read_text(encoding="utf-8"))
    audio, keys = report["carriers"]["audio"], report["read_back"]["keys"]
    return {
        "odg": round(audio["odg"], 2), "margin": audio["margin"]["least"],
        "sent": audio["received"] + audio["lost"], "received": audio["received"],
        "keys": keys["sent"], "keys_received": keys["received"],
    }  # fmt: skip


if __name__ == "__main__":
    main()
