"""Code a motion into a bit stream."""

import argparse

from cuecast.command.arguments import add_json, add_voice, bit_rate, positive, print_json
from cuecast.command.errors import UsageError
from cuecast.command.files import PIPE, write_bytes
from cuecast.command.progress import note, seconds_bar

SUMMARY = "a motion as few bits"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("motion", metavar="M.npz", help="motion to code")
    parser.add_argument("-o", "--output", required=True, metavar="S.cue", help="- writes a pipe")
    goal = parser.add_mutually_exclusive_group()
    goal.add_argument("--rate", type=bit_rate, metavar="BPS", help="bits per second to keep to")
    goal.add_argument("--error", type=positive, metavar="MM", help="marker error to keep to, mm")
    parser.add_argument(
        "--constant",
        action="store_true",
        help="give every superframe the same size, as on air; with --rate",
    )
    told = parser.add_mutually_exclusive_group()
    told.add_argument(
        "--keep-score",
        action="store_true",
        help="keep the score, and so the keys, at any cost (default: if the file is at most "
        "1 %% larger with it, or less exact at the rate)",
    )
    told.add_argument(
        "--drop-score", action="store_true", help="leave the score, and so the keys, out"
    )
    add_voice(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Write the stream."""
    from codec.cuer.motion import load_motion
    from codec.streamfile.stream import choose_stream
    from cuecast.command.voices import coding_voice

    if args.json and args.output == PIPE:
        raise UsageError("--json and -o - would share the standard output")
    motion, voice = load_motion(args.motion), coding_voice(args.voice)
    with seconds_bar(None, "encode, some rounds") as advance:
        found = choose_stream(
            motion,
            voice,
            rate_bps=args.rate,
            error_mm=args.error,
            constant=args.constant,
            score="keep" if args.keep_score else "drop" if args.drop_score else "auto",
            progress=advance,
        )
    write_bytes(args.output, found.data)
    percent = None if found.score_cost is None else round(100 * found.score_cost, 2)
    if args.json:
        print_json(
            {
                "bytes": len(found.data),
                "duration_s": round(motion.duration_s, 3),
                "bps": round(8 * len(found.data) / motion.duration_s, 1),
                "score": "none" if motion.score is None else "kept" if found.scored else "left out",
                "score_cost_percent": percent,
            }
        )
    elif percent is not None and not found.scored and not args.drop_score:
        what = "its error" if args.rate else "the file"
        note(
            f"score and keys left out: with them {what} would be {percent:g} % greater "
            "(--keep-score)"
        )
    return 0
