"""Show a programme and its cuer on a page, in step, until interrupted."""

import argparse
import sys
import tempfile
from typing import Any

from cuecast.command.arguments import add_avatar, add_key, add_voice, natural, not_negative
from cuecast.command.files import PIPE
from cuecast.command.progress import note
from cuecast.command.trust import HOLD_S, add_trust, trust_of

SUMMARY = "the TV page: programme and cuer together"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "programme", metavar="PROGRAMME", help="file, udp://..., playlist; - is a pipe"
    )
    parser.add_argument("--port", type=natural, default=8080, metavar="N", help="0: any free one")
    parser.add_argument("--host", default="127.0.0.1", help="address to answer at")
    parser.add_argument("--motion", metavar="M.npz", help="show this motion, not the received one")
    parser.add_argument(
        "--subtitles", metavar="SUBS", help="text to show (default: that of the programme's tracks)"
    )
    add_trust(parser)
    parser.add_argument(
        "--hold",
        type=not_negative,
        metavar="S",
        help=f"show a broadcast S seconds later ({HOLD_S:.0f} with --trust; 123 for robust sound)",
    )
    add_avatar(parser)
    add_voice(parser)
    add_key(parser)


def run(args: argparse.Namespace) -> int:
    """Serve the page."""
    from codec.cuer.motion import load_motion
    from cuecast.command.voices import coding_voice
    from cuecast.media.avatars import avatar_file
    from cuecast.media.captions import captions_of
    from cuecast.media.playable import playable
    from receiver.television.memory import give_back_large_blocks
    from receiver.television.server import AHEAD_S, serve
    from receiver.television.tuner import EagerTuner, MotionTuner, ProgrammeTuner, Tuner

    voice = coding_voice(args.voice)
    place: dict[str, Any] = {
        "host": args.host,
        "port": args.port,
        "on_ready": lambda url: note(f"watch at {url}"),
        "avatar": avatar_file(args.avatar, voice),
    }
    if args.programme == PIPE or "://" in args.programme:
        from receiver.live.server import serve_live

        hold_s = args.hold if args.hold is not None else HOLD_S * (args.trust is not None)
        source = sys.stdin.buffer if args.programme == PIPE else args.programme
        serve_live(
            source, voice, key=args.key, trust=trust_of(args, live=True), hold_s=hold_s, **place
        )
        return 0
    give_back_large_blocks()
    with tempfile.TemporaryDirectory(prefix="cuecast-") as folder:
        media = playable(args.programme, folder)
        captions = captions_of(args.programme, args.subtitles)
        tuner: Tuner = ProgrammeTuner(args.programme, voice, key=args.key, trust=trust_of(args))
        if args.motion is not None:
            tuner = MotionTuner(load_motion(args.motion))
        serve(EagerTuner(tuner, AHEAD_S), voice, media, captions=captions, **place)
    return 0
