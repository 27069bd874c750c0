"""``python -m synth.corpus --out DIR``: make the three corpora."""

import argparse
import os
import sys
from pathlib import Path

from tqdm import tqdm

from codec.errors import CueError
from synth.body.anatomy import IDENTITIES
from synth.corpus.make import (
    RATE_OF_CORPORA_HZ,
    Session,
    make_corpora,
    plan_corpora,
    write_manifest,
)
from synth.corpus.studio import Studio
from synth.recordings.sentences import N_SENTENCES
from synth.rules.gesture import GestureSynthesiser
from synth.rules.movement import LAWS
from synth.text.sentences import read_sentences


def main(arguments: list[str] | None = None) -> int:
    """Run the command."""
    options = _parser().parse_args(arguments)
    try:
        GestureSynthesiser(options.identity, law=options.law, rate_hz=options.rate)
        sentences = read_sentences(options.sentences)
        utterances, report = plan_corpora(sentences, count=options.count, seed=options.seed)
        session = Session(
            options.out, options.identity, options.law, options.rate,
            Studio(
                noise_mm=options.noise, swaps_per_s=options.swaps, ghosts_per_s=options.ghosts,
            ),
        )  # fmt: skip
        options.out.mkdir(parents=True, exist_ok=True)
        with tqdm(total=len(utterances), unit="utterance", disable=options.quiet) as bar:
            make_corpora(session, utterances, jobs=options.jobs, advance=bar.update)
        write_manifest(session, utterances, report)
    except (CueError, OSError) as error:
        print(f"synth.corpus: {error}", file=sys.stderr)
        return 3
    for part in report:
        print(
            f"{part.kind}: {part.offered} offered, {part.covered} covered, {part.twice} twice, "
            f"{part.short} short, {part.running:.2%} of running units"
        )
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="synth.corpus", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder of the corpora")
    parser.add_argument("--identity", default="claire", help=f"one of {', '.join(IDENTITIES)}")
    parser.add_argument("--law", default="minimum-jerk", help=f"one of {', '.join(LAWS)}")
    parser.add_argument("--rate", type=float, default=RATE_OF_CORPORA_HZ, help="frames per second")
    parser.add_argument("--sentences", type=Path, help="list of sentences, one a line")
    parser.add_argument("--count", type=int, default=N_SENTENCES, help="sentences to choose")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--noise", type=float, default=0.2, help="of each coordinate, mm")
    parser.add_argument("--swaps", type=float, default=0.0, help="exchanged neighbours per second")
    parser.add_argument("--ghosts", type=float, default=0.0, help="ghost points per second")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes at work")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    return parser


if __name__ == "__main__":
    sys.exit(main())
