"""Print what stands in a bit stream, field by field."""

import argparse
import os
import sys
from dataclasses import asdict

from cuecast.command.arguments import add_json, print_json
from cuecast.command.files import read_bytes

SUMMARY = "what stands in a bit stream"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("stream", metavar="S.cue", help="bit stream; - reads a pipe")
    parser.add_argument(
        "--bits", action="store_true",
        help="the bit map: name, bits, value and paragraph of every field, in colour on a terminal",
    )  # fmt: skip
    parser.add_argument(
        "--superframe", type=int, metavar="K", help="of this one only (default: of all)"
    )
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Print the fields; 1 if the superframe that is asked for is not there."""
    from codec.bitstream.inspect import describe, inspect_stream

    if args.bits or args.superframe is not None:
        return _print_bits(args)
    document = inspect_stream(read_bytes(args.stream))
    if args.json:
        print_json(document)
    else:
        print(describe(document))
    return 0


def _print_bits(args: argparse.Namespace) -> int:
    from codec.bitstream.bitmap import map_superframe
    from codec.bitstream.inspect import describe_bits
    from codec.bitstream.stream import read_superframes

    wanted = args.superframe
    frames = [
        frame for frame in read_superframes(read_bytes(args.stream))
        if wanted in (None, frame.index)
    ]  # fmt: skip
    if args.json:
        print_json(
            [
                {"index": frame.index, "fields": [asdict(f) for f in map_superframe(frame)]}
                for frame in frames
            ]
        )
    else:
        colour = sys.stdout.isatty() and "NO_COLOR" not in os.environ
        print("\n\n".join(describe_bits(frame, colour=colour) for frame in frames))
    return 0 if frames else 1
