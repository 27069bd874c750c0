"""An experiment: 1200 bit/s in the sound, more than three times what `standard` carries.

The profile is not on air: it has the cells of `high` and fills them with 20 and 76 bytes. Measured
is what `cuecast evaluate audio` measures of a profile. The record is one of kind ``audio``.
``python -m tests.bench.dense_sound [--clips FOLDER] [--record FILE]``
"""

import argparse
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from cuecast.evaluate.audio import evaluate
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.records import make_record
from watermark.audio.signal.profile import HIGH, PROFILES

L1_BYTES, L0_CODED = 76, 1750
"""With the 20 bytes of `high`'s first class, 768 bits in 0.64 s; and the coded bits of that class,
at which both classes end at about the same noise."""

CHANNELS = ("none", "aac_128", "mp2_192", "ac3_192")
"""Of `cuecast.evaluate.sound_channels`."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clips", type=Path, help="folder of sound files; the built-in sound")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--record", type=Path)
    chosen = parser.parse_args()
    PROFILES["dense"] = replace(
        HIGH, name="dense", number=len(PROFILES), l1_bytes=L1_BYTES, l0_coded=L0_CODED
    )
    channels = tuple(f"dense:{name}" for name in CHANNELS)
    with tempfile.TemporaryDirectory() as folder:
        options = EvaluateOptions(
            clips=chosen.clips, channels=channels, seed=chosen.seed, folder=Path(folder), say=_say
        )
        rows = evaluate(options)
    if chosen.record:
        document = make_record("audio", (), rows, seed=chosen.seed, clips=chosen.clips)
        document["command"] = "python -m tests.bench.dense_sound --clips CLIPS --record FILE"
        chosen.record.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _say(line: str) -> None:
    print(line, file=sys.stderr)


if __name__ == "__main__":
    main()
