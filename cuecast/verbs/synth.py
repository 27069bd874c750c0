"""Make the motion of a cuer, and the sound of a speaker, from text or subtitles."""

import argparse
from typing import TYPE_CHECKING

from cuecast.arguments import (
    add_reading,
    add_seed,
    add_text,
    add_voice,
    aligned_score_of,
    not_negative,
    positive,
    score_of,
)
from cuecast.progress import note, seconds_bar

if TYPE_CHECKING:
    from codec.motion import Motion
    from codec.score import Score
    from codec.voice import Voice

SUMMARY = "motion (and speech) from text"

_AFTER_S = 1.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_text(parser)
    parser.add_argument("-o", "--output", required=True, metavar="M.npz", help="motion")
    parser.add_argument("--speech", metavar="S.wav", help="what is said, spoken in step")
    parser.add_argument(
        "--align", metavar="AUDIO", help="recording of the text: the cuer moves with its voice"
    )
    parser.add_argument("--c3d", metavar="M.c3d", help="markers of the motion")
    parser.add_argument(
        "--method", choices=("rules", "units"),
        help="gestures by rule, or joined from recorded units (the default with --speech)",
    )  # fmt: skip
    parser.add_argument(
        "--units", metavar="FOLDER", help="recordings that `voice build` made of a speaker"
    )
    parser.add_argument("--rate", type=positive, default=50.0, metavar="HZ", help="of the motion")
    parser.add_argument(
        "--rest-gap", type=not_negative, default=0.5, metavar="S",
        help="silence after which the hand rests",
    )  # fmt: skip
    add_voice(parser)
    add_seed(parser)
    add_reading(parser)


def run(args: argparse.Namespace) -> int:
    """Write the motion; 1 if nothing in the text is spoken."""
    if args.method == "rules" and (args.speech or args.units):
        note("cuecast synth: --speech and --units need --method units")
        return 2
    score = aligned_score_of(args, args.align) if args.align else score_of(args)
    if not score.keys:
        note("nothing in the text is spoken")
        return 1
    from codec.motion import save_motion
    from codec.voice import load_voice

    voice = load_voice(args.voice)
    end_s = score.phones[-1].end + _AFTER_S
    units = args.speech or args.units or args.method == "units"
    motion = (_by_units if units else _by_rules)(args, score, voice, end_s)
    save_motion(motion, args.output)
    if args.c3d:
        from synth.corpus.c3d import write_c3d

        write_c3d(args.c3d, voice.reconstruct(motion.params), rate_hz=args.rate)
    return 0


def _by_rules(args: argparse.Namespace, score: "Score", voice: "Voice", end_s: float) -> "Motion":
    from cuecast.motions import SynthesisedMotion, whole_motion

    source = SynthesisedMotion(
        score, voice, seed=args.seed, rate_hz=args.rate, rest_gap_s=args.rest_gap
    )
    with seconds_bar(end_s, "synth") as advance:
        return whole_motion(source, end_s, progress=advance)


def _by_units(args: argparse.Namespace, score: "Score", voice: "Voice", end_s: float) -> "Motion":
    from cuecast.performance import perform

    with seconds_bar(end_s, "synth") as advance:
        return perform(
            score, voice, rate_hz=args.rate, units=args.units, speech=args.speech,
            rest_gap_s=args.rest_gap, progress=advance,
        )  # fmt: skip
