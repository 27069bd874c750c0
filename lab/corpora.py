"""Make the three corpora: labelled C3D at 120 Hz, sound and TextGrid of every utterance.

``python -m lab.corpora --out DIR`` fills a folder with ``corpus1/``, ``corpus2/`` and ``corpus3/``,
one file of each kind per utterance, and ``corpus.json``: who performed, the texts, and how they
cover French. Any C3D with the same marker names, with a TextGrid beside it, can take their place.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import soundfile
from tqdm import tqdm

from codec.cuer.c3d import write_c3d
from codec.errors import CueError
from synth.language.text.espeak import RATE_HZ
from synth.language.text.sentences import read_sentences
from synth.motion.body.anatomy import IDENTITIES
from synth.motion.rules.gesture import GestureSynthesiser
from synth.motion.rules.movement import LAWS
from synth.planning.scoring.drills import shape_transitions
from synth.planning.scoring.textgrid import write_textgrid
from synth.studio.corpora import (
    RATE_OF_CORPORA_HZ,
    ROUNDS_OF_SHAPES,
    Utterance,
    plan_corpora,
    spoken,
)
from synth.studio.studio import Studio, surround
from synth.studio.take import record
from synth.units.recordings.choice import SentenceCoverage
from synth.units.recordings.sentences import N_SENTENCES


@dataclass(frozen=True, slots=True)
class Session:
    """Who performs and who records.

    Attributes
    ----------
    out : Path
        Folder of the corpora.
    identity, law : str
        As for `GestureSynthesiser`.
    rate_hz : float
    studio : Studio
        For corpora 2 and 3; corpus 1 has the same faults and cameras all around.
    """

    out: Path
    identity: str = "claire"
    law: str = "minimum-jerk"
    rate_hz: float = RATE_OF_CORPORA_HZ
    studio: Studio = field(default_factory=Studio)


def make_corpora(
    session: Session,
    utterances: Sequence[Utterance],
    *,
    jobs: int = 1,
    advance: Callable[[], object] = lambda: None,
) -> None:
    """Perform, record and write all `utterances`.

    Parameters
    ----------
    session : Session
    utterances : sequence of Utterance
    jobs : int
        Processes at work.
    advance : callable
        Called once per finished utterance, for a progress bar.
    """
    for folder in {Path(u.name).parent for u in utterances}:
        (session.out / folder).mkdir(parents=True, exist_ok=True)
    if jobs == 1:
        for utterance in utterances:
            make_utterance(session, utterance)
            advance()
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for _ in pool.map(make_utterance, [session] * len(utterances), utterances):
            advance()


def make_utterance(session: Session, utterance: Utterance) -> None:
    """Perform, record and write one utterance."""
    free = not utterance.line
    cuer = _cuer(session.identity, session.law, session.rate_hz, utterance.seed, free)
    stem = session.out / utterance.name
    studio = session.studio
    if free:
        score = shape_transitions(rounds=ROUNDS_OF_SHAPES)
        studio = Studio(
            surround(),
            noise_mm=studio.noise_mm,
            bias_mm=studio.bias_mm,
            dropouts_per_s=studio.dropouts_per_s,
            swaps_per_s=studio.swaps_per_s,
            ghosts_per_s=studio.ghosts_per_s,
        )
    else:
        samples, score = spoken(utterance)
        soundfile.write(stem.with_suffix(".wav"), samples, RATE_HZ, subtype="PCM_16")
    recording = record(cuer, score, studio=studio, seed=utterance.seed)
    write_c3d(
        stem.with_suffix(".c3d"),
        recording.observed,
        rate_hz=session.rate_hz,
        ghosts=recording.ghosts,
    )
    duration_s = len(recording.observed) / session.rate_hz
    write_textgrid(stem.with_suffix(".TextGrid"), score, duration_s)


@cache
def _cuer(identity: str, law: str, rate_hz: float, seed: int, free: bool) -> GestureSynthesiser:
    return GestureSynthesiser(identity, law=law, rate_hz=rate_hz, seed=seed, free_space=free)


def write_manifest(
    session: Session, utterances: Sequence[Utterance], report: Sequence[SentenceCoverage]
) -> None:
    """Write ``corpus.json``."""
    manifest = {
        "identity": session.identity,
        "law": session.law,
        "rate_hz": session.rate_hz,
        "noise_mm": session.studio.noise_mm,
        "bias_mm": session.studio.bias_mm,
        "coverage": [asdict(part) for part in report],
        "utterances": [
            {"name": u.name, "text": u.text, "phones": " ".join(u.line)} for u in utterances
        ],
    }
    text = json.dumps(manifest, ensure_ascii=False, indent=1)
    (session.out / "corpus.json").write_text(text + "\n", encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    """Run the command."""
    options = _parser().parse_args(arguments)
    try:
        GestureSynthesiser(options.identity, law=options.law, rate_hz=options.rate)
        sentences = read_sentences(options.sentences)
        utterances, report = plan_corpora(sentences, count=options.count, seed=options.seed)
        session = Session(
            options.out,
            options.identity,
            options.law,
            options.rate,
            Studio(noise_mm=options.noise, swaps_per_s=options.swaps, ghosts_per_s=options.ghosts),
        )
        options.out.mkdir(parents=True, exist_ok=True)
        with tqdm(total=len(utterances), unit="utterance", disable=options.quiet) as bar:
            make_corpora(session, utterances, jobs=options.jobs, advance=bar.update)
        write_manifest(session, utterances, report)
    except (CueError, OSError) as error:
        print(f"lab.corpora: {error}", file=sys.stderr)
        return 3
    for part in report:
        print(
            f"{part.kind}: {part.offered} offered, {part.covered} covered, {part.twice} twice, "
            f"{part.short} short, {part.running:.2%} of running units"
        )
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="lab.corpora", description=__doc__)
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
