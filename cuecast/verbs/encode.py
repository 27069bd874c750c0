"""Code a motion into a bit stream."""

import argparse

from cuecast.command.arguments import add_voice, bit_rate, positive
from cuecast.command.files import write_bytes
from cuecast.command.progress import note

SUMMARY = "a motion as few bits"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("motion", metavar="M.npz", help="motion to code")
    parser.add_argument("-o", "--output", required=True, metavar="S.cue", help="- writes a pipe")
    goal = parser.add_mutually_exclusive_group()
    goal.add_argument("--rate", type=bit_rate, metavar="BPS", help="bits per second to keep to")
    goal.add_argument("--error", type=positive, metavar="MM", help="marker error to keep to, mm")
    parser.add_argument(
        "--constant", action="store_true",
        help="give every superframe the same size, as on air; with --rate",
    )  # fmt: skip
    parser.add_argument(
        "--drop-score", action="store_true",
        help="leave the score, and its keys, out if it costs more than it saves",
    )  # fmt: skip
    add_voice(parser)


def run(args: argparse.Namespace) -> int:
    """Write the stream."""
    from codec.bitstream.stream import encode_stream, read_head, told_by
    from codec.cuer.motion import load_motion
    from cuecast.command.voices import coding_voice

    motion, voice = load_motion(args.motion), coding_voice(args.voice)
    data = encode_stream(
        motion, voice, rate_bps=args.rate, error_mm=args.error, constant=args.constant,
        drop_score=args.drop_score,
    )  # fmt: skip
    write_bytes(args.output, data)
    scored = motion.score is None or read_head(data).l0 or told_by(data).line is not None
    if not scored:
        note("the score did not pay: the stream does without it and its keys")
    return 0
