"""Print what stands in a bit stream, field by field."""

import argparse

from cuecast.command.arguments import add_json, print_json
from cuecast.command.files import read_bytes

SUMMARY = "what stands in a bit stream"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("stream", metavar="S.cue", help="bit stream; - reads a pipe")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Print the fields."""
    from codec.bitstream.inspect import describe, inspect_stream

    document = inspect_stream(read_bytes(args.stream))
    if args.json:
        print_json(document)
    else:
        print(describe(document))
    return 0
