"""Turn a bit stream back into a motion."""

import argparse

from cuecast.command.arguments import add_voice
from cuecast.command.files import read_bytes, stream_named

SUMMARY = "a bit stream as motion"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("stream", metavar="S.cue", help="bit stream; - reads a pipe")
    parser.add_argument("-o", "--output", required=True, metavar="M.npz")
    add_voice(parser)


def run(args: argparse.Namespace) -> int:
    """Write the motion."""
    from codec.cuer.motion import save_motion
    from codec.streamfile.stream import decode_stream
    from cuecast.command.voices import coding_voice

    with stream_named(args.stream):
        motion = decode_stream(read_bytes(args.stream), coding_voice(args.voice))
    save_motion(motion, args.output)
    return 0
