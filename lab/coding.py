"""Build coding tables: the virtual cuer performs sentences, and the codec is trained on them.

``python -m lab.coding [--identity claire] [--filmed DIR] [--format]`` writes the tables of the
built-in voice under its present identity; run it after `lab.voice`; ``cuecast voice build`` trains
those of other voices. ``--filmed`` names a folder of motions that ``python -m lab.filmed`` made.
With ``--format`` the tables of the bitstream are trained too, which changes the format; those of
the score only with ``--labels``: they have seen the 1001 sentences of enst-camille besides (needs
PyYAML).
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from codec.cuer.motion import Motion, load_motion
from codec.cuer.voice import Voice, load_voice
from codec.errors import CueError
from codec.superframe.coding import FOLDER, keep_coding
from codec.training.coding_tables import train_coding
from lab.format_tables import format_tables, write_tables
from synth.motion.body.anatomy import IDENTITIES
from synth.motion.measured.cuer import MeasuredCuer
from synth.motion.measured.plan import paced as at_real_pace
from synth.studio.recital import TAIL_S, examples, paced, recital, sentences

_OTHERS = 30
"""Sentences of each of the other cuers."""


def labelled(path: Path) -> list[str]:
    """Return the sentences of a labelled reading, as `lab.durations` takes it."""
    import yaml

    document: list[dict[str, Any]] = yaml.load(path.read_text("utf-8"), Loader=yaml.CSafeLoader)
    return [str(item["text"]) for item in document]


def other_cuers(voice: Voice) -> Iterator[Motion]:
    """Yield the motion of cuers who move as real ones were measured to, as a voice explains it.

    Each has another body, and none moves by the rule that the codec predicts with.
    """
    for number, identity in enumerate(sorted(IDENTITIES)):
        texts = sentences()[_OTHERS * number : _OTHERS * (number + 1)]
        score = at_real_pace(recital(texts, seed=number))
        cuer = MeasuredCuer(identity, seed=number)
        yield cuer.motion(score, 0.0, int(50 * (score.phones[-1].end + TAIL_S)), voice)


def films(folder: Path) -> Iterator[Motion]:
    """Yield the captured motions of a folder, as `python -m lab.filmed` makes them."""
    for path in sorted(folder.glob("*.npz")):
        yield load_motion(path)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program; return its exit status."""
    parser = argparse.ArgumentParser(prog="python -m lab.coding", description=__doc__)
    parser.add_argument("--identity", choices=sorted(IDENTITIES), default="claire")
    parser.add_argument("--format", action="store_true", help="train the format's tables too")
    parser.add_argument(
        "--labels",
        type=Path,
        help="with --format: further sentences, as YAML; without, the score's tables stay",
    )
    parser.add_argument("--filmed", type=Path, help="folder of motions from films of other cuers")
    args = parser.parse_args(argv)
    try:
        voice = load_voice(args.identity)
        exact, loose = examples(voice)
        others = [*other_cuers(voice), *(films(args.filmed) if args.filmed else ())]
        coding = train_coding(voice, [exact], [loose], others)
        keep_coding(coding, FOLDER)
        if args.format:
            said = recital([*sentences(), *labelled(args.labels)]) if args.labels else None
            scores = [said, *paced(said)] if said else ()
            write_tables(format_tables(coding, [exact], [loose], scores, others))
    except (CueError, OSError) as error:
        print(f"lab.coding: {error}", file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
