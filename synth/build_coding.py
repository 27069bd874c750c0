"""Build coding tables: the virtual cuer performs sentences, and the codec is trained on them.

``python -m synth.build_coding [--identity claire] [--format]`` writes the tables of the built-in
voice under its present identity; run it after `synth.build_voice`. With ``--format`` the tables
of the bitstream are trained too, which changes the format.
"""

import argparse
import itertools
import sys
from collections.abc import Iterator, Sequence
from importlib import resources

import numpy as np

from codec.coding import FOLDER, save_coding
from codec.errors import CueError
from codec.motion import Motion
from codec.score import Phone, Score
from codec.train import format_tables, write_tables
from codec.train_voice import train_coding
from codec.voice import Voice, load_voice
from synth.body.anatomy import IDENTITIES
from synth.gesture import GestureSynthesiser
from synth.score import score_from_text

PAUSES_S = (0.3, 0.6, 1.2, 2.0)
"""Silences between sentences."""

PACES = (0.85, 1.25, 1.6)
"""Factors on the lengths of phones in further scores for the format's tables."""

HELD_OUT_EVERY = 8
"""One sentence of so many is kept from training, for `cuecast evaluate codec`."""

_UNEVENNESS = 0.4
"""Standard deviation of the logarithm of a phone's length about its prediction, read speech."""

_TAIL_S = 1.5


def sentences(*, held_out: bool = False) -> list[str]:
    """Return the sentences that come with the package for training, or those kept from it."""
    text = resources.files("synth").joinpath("assets/sentences.txt").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [line for i, line in enumerate(lines) if (i % HELD_OUT_EVERY == 0) == held_out]


def recital(texts: Sequence[str], *, seed: int = 0, start_s: float = 1.0) -> Score:
    """Return the score of texts one after another, with silences of all lengths between them."""
    rng = np.random.default_rng([seed, 71])
    score = Score((), ())
    for text in texts:
        more = score_from_text(text, start_s=start_s)
        score = Score(score.phones + more.phones, score.keys + more.keys)
        if more.phones:
            start_s = round(more.phones[-1].end + float(rng.choice(PAUSES_S)), 2)
    return score


def perform(voice: Voice, score: Score, *, seed: int = 0, law: str = "minimum-jerk") -> Motion:
    """Return the motion of the voice's cuer performing a score, at 50 Hz from time 0."""
    cuer = GestureSynthesiser(voice.name, law=law, seed=seed)
    return cuer.motion(score, 0.0, int(50 * (score.phones[-1].end + _TAIL_S)), voice)


def paced(score: Score, *, seed: int = 0) -> Iterator[Score]:
    """Yield the phones of a score at other paces, with lengths as uneven as real speakers'."""
    rng = np.random.default_rng([seed, 72])
    for pace in PACES:
        time_s, phones = 1.0, list[Phone]()
        for before, phone in itertools.pairwise([score.phones[0], *score.phones]):
            time_s += max(0.0, phone.start - before.end) if phones else 0.0
            length = pace * (phone.end - phone.start) * float(np.exp(_UNEVENNESS * rng.normal()))
            phones.append(Phone(phone.symbol, time_s, time_s + length))
            time_s += length
        yield Score(tuple(phones), ())


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program; return its exit status."""
    parser = argparse.ArgumentParser(prog="python -m synth.build_coding", description=__doc__)
    parser.add_argument("--identity", choices=sorted(IDENTITIES), default="claire")
    parser.add_argument("--format", action="store_true", help="train the format's tables too")
    args = parser.parse_args(argv)
    try:
        voice = load_voice(args.identity)
        score = recital(sentences())
        motions = [perform(voice, score, seed=3)]
        coding = train_coding(voice, motions)
        FOLDER.mkdir(exist_ok=True)
        save_coding(coding, FOLDER / f"{voice.identity}.npz")
        if args.format:
            write_tables(format_tables(coding, motions, [score, *paced(score)]))
    except (CueError, OSError) as error:
        print(f"synth.build_coding: {error}", file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
