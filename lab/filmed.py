"""Films of virtual cuers, captured: training data of the basis of filmed motion.

``python -m lab.filmed DIR`` writes one motion of the built-in voice per cuer and film,
from landmarks of a simulated camera; ``python -m lab.coding --filmed DIR`` reads
them. All cuers move as real ones were measured to.
"""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from codec.cuer.motion import save_motion
from codec.cuer.voice import load_voice
from codec.errors import CueError
from cuecast.evaluate.films import ASPECT
from cuecast.evaluate.legs import filmed_as_csv
from synth.capture.capture import capture_motion
from synth.capture.options import CaptureOptions
from synth.motion.body.anatomy import IDENTITIES
from synth.motion.measured.cuer import MEASURED
from synth.motion.measured.plan import paced
from synth.studio.recital import recital, sentences

_FILMS = 1
"""Films of each cuer, each with its own errors of the tracker."""

_SENTENCES = 10
"""Sentences of a film."""

_FIRST = 240
"""Number of the first one in the built-in list."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program; return its exit status."""
    parser = argparse.ArgumentParser(prog="python -m lab.filmed", description=__doc__)
    parser.add_argument("folder", type=Path)
    args = parser.parse_args(argv)
    voice = load_voice()
    try:
        args.folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix="cuecast-") as scratch:
            for seed, identity in enumerate(sorted(IDENTITIES) * _FILMS):
                begin = _FIRST + _SENTENCES * seed
                score = paced(recital(sentences()[begin : begin + _SENTENCES], seed=seed))
                table = Path(scratch) / "film.csv"
                filmed_as_csv(f"{identity}/{MEASURED}", score, table, seed=seed)
                options = CaptureOptions(aspect=ASPECT, keys=False)
                found = capture_motion(table, voice, options).motion
                save_motion(replace(found, start_s=0.0), args.folder / f"{identity}-{seed}.npz")
    except (CueError, OSError) as error:
        print(f"lab.filmed: {error}", file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
