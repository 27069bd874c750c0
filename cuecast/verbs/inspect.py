"""Print the content of a bit stream, field by field."""

import argparse
import os
import sys
from dataclasses import asdict

from codec.errors import CueError
from cuecast.command.arguments import add_json, print_json
from cuecast.command.files import read_bytes, stream_named

SUMMARY = "the fields of a bit stream, up to its damage if it has any"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("stream", metavar="S.cue", help="bit stream; - reads a pipe")
    parser.add_argument(
        "--bits",
        action="store_true",
        help="the bit map: name, bits, value and paragraph of every field, in colour on a terminal",
    )
    parser.add_argument(
        "--superframe", type=int, metavar="K", help="of this one only (default: of all)"
    )
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Print the fields; 1 if the superframe that is asked for is not there.

    Raises
    ------
    CueError
        If the file is damaged; the fields up to the damage are printed before.
    """
    from codec.streamfile.inspect import describe, inspect_stream

    if args.bits or args.superframe is not None:
        with stream_named(args.stream):
            return _print_bits(args)
    with stream_named(args.stream):
        document = inspect_stream(read_bytes(args.stream), partial=True)
    if args.json:
        print_json(document)
    else:
        print(describe(document))
    if "damage" in document:
        raise CueError(f"{args.stream}: damaged")
    return 0


def _print_bits(args: argparse.Namespace) -> int:
    from codec.streamfile.content import common_data, read_head, read_superframes
    from codec.streamfile.inspect import describe_bits
    from codec.superframe.bitmap import map_record, map_superframe

    wanted, data = args.superframe, read_bytes(args.stream)
    frames = [frame for frame in read_superframes(data) if wanted in (None, frame.index)]
    scored = common_data(data).line is not None
    alone = read_head(data).l0 > 0
    maps = [map_superframe(f) if alone else map_record(f, scored=scored) for f in frames]
    if args.json:
        print_json(
            [
                {"index": frame.index, "fields": [asdict(field) for field in fields]}
                for frame, fields in zip(frames, maps, strict=True)
            ]
        )
    else:
        colour = sys.stdout.isatty() and "NO_COLOR" not in os.environ
        texts = (
            describe_bits(frame, fields=fields, colour=colour)
            for frame, fields in zip(frames, maps, strict=True)
        )
        print("\n\n".join(texts))
    return 0 if frames else 1
