"""Make the motion of a cuer, and the sound of a speaker, from text or subtitles."""

import argparse
import itertools
from typing import TYPE_CHECKING

from cuecast.command.arguments import (
    add_motion,
    add_pace,
    add_reading,
    add_seed,
    add_subtitle_terms,
    add_text,
    add_voice,
    positive,
)
from cuecast.command.files import write_json
from cuecast.command.progress import note, seconds_bar
from cuecast.dubbing.inputs import pieces_of, reading_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from codec.cuer.motion import Motion
    from codec.cuer.voice import Voice
    from codec.cues.score import Score

SUMMARY = "motion (and speech) from text"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_text(parser)
    parser.add_argument("-o", "--output", required=True, metavar="M.npz", help="motion")
    parser.add_argument(
        "--speech", metavar="S.wav", help="the speech, in step; asks for --method units"
    )
    parser.add_argument(
        "--align", metavar="AUDIO", help="recording of the text: the cuer moves with its voice"
    )
    parser.add_argument(
        "--report",
        metavar="R.json",
        help="pace, lag and words left out by subtitle; with --align how sure their times are",
    )
    parser.add_argument("--c3d", metavar="M.c3d", help="markers of the motion")
    add_motion(parser)
    parser.add_argument("--rate", type=positive, default=50.0, metavar="HZ", help="of the motion")
    add_voice(parser)
    add_seed(parser)
    add_reading(parser)
    add_pace(parser)
    add_subtitle_terms(parser)


def run(args: argparse.Namespace) -> int:
    """Write the motion; 1 if nothing in the text is spoken."""
    if args.method == "rules" and (args.speech or args.units):
        note("cuecast synth: --speech and --units need --method units")
        return 2
    from codec.analysis.readability import classes_of
    from codec.cuer.motion import MotionWriter
    from codec.cuer.voice import load_voice
    from cuecast.dubbing.aligning import Confidence
    from cuecast.dubbing.readability import VisibilityMeter, in_words
    from synth.planning.prosody.pace_report import PaceReport

    confidence = Confidence()
    pace = PaceReport(reading_of(args).options, note)
    pieces, length_s = pieces_of(args, args.align, confidence, pace)
    first = next((piece for piece in pieces if piece.phones), None)
    if first is None:
        note("nothing in the text is spoken")
        return 1
    voice = load_voice(args.voice)
    parts = _motion(args, itertools.chain([first], pieces), voice)
    seen = VisibilityMeter(classes_of(voice), args.rate, reading_of(args).options)
    with MotionWriter(args.output) as writer, seconds_bar(length_s, "synth") as advance:
        for part in parts:
            writer.append(part)
            keys = part.score.keys if part.score else ()
            seen.add(voice.reconstruct(part.params), part.start_s, keys)
            advance(part.duration_s)
    if args.align:
        note(str(confidence))
    figures = seen.figures()
    pace.seen(seen.shown)
    note(str(pace))
    note(in_words(figures))
    if args.report:
        report = {"pace": pace.report() | figures}
        write_json(args.report, report | ({"alignment": confidence.report()} if args.align else {}))
    if args.c3d:
        _write_c3d(args, voice)
    return 0


def _motion(
    args: argparse.Namespace, pieces: "Iterable[Score]", voice: "Voice"
) -> "Iterator[Motion]":
    options = reading_of(args).options
    if args.speech or args.units or args.method == "units":
        from cuecast.dubbing.performance import perform, unit_synthesiser

        units = unit_synthesiser(
            voice, args.units, alignment=args.alignment, options=options, seed=args.seed
        )
        return perform(pieces, units, rate_hz=args.rate, speech=args.speech)
    from cuecast.dubbing.motions import ruled_motion
    from synth.motion.rules.bodiless import ruled_cuer

    cuer = ruled_cuer(
        voice, rate_hz=args.rate, seed=args.seed, alignment=args.alignment, options=options
    )
    return ruled_motion(pieces, cuer, voice)


def _write_c3d(args: argparse.Namespace, voice: "Voice") -> None:
    from codec.cuer.c3d import write_c3d
    from codec.cuer.motion import load_motion

    motion = load_motion(args.output)
    write_c3d(args.c3d, voice.reconstruct(motion.params), rate_hz=args.rate)
