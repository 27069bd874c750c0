"""Pass a running programme on with its cuer in the sound.

The source is a transport stream over UDP, from a pipe or a file; it leaves a constant time later,
with every other stream unchanged. Without --subtitles and --motion the stream's own TTML is cued,
or live text.
"""

import argparse

from cuecast.command.arguments import (
    add_alignment,
    add_pace,
    add_reading,
    add_seed,
    add_voice,
    grade,
    natural,
    not_negative,
)
from cuecast.command.files import PIPE

SUMMARY = "a running programme with its cuer, some seconds later"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("source", metavar="IN", help="udp://@:PORT, a file, or - for a pipe")
    parser.add_argument("target", metavar="OUT", help="udp://HOST:PORT, a file, or - for a pipe")
    form = parser.add_argument_group("the programme")
    form.add_argument(
        "--programme-number", type=natural, metavar="N", help="which of the stream's programmes"
    )
    form.add_argument("--track", type=natural, default=0, metavar="N", help="which sound, from 0")
    form.add_argument(
        "--samples",
        metavar="FORM",
        help="plain samples instead of a transport stream, such as s16le:48000:2",
    )
    form.add_argument("--low-delay", action="store_true", help="2.5 s of delay instead of 5 s")
    _add_content(parser)
    _add_mark(parser)
    _add_server(parser)
    add_voice(parser)
    add_seed(parser)
    add_alignment(parser)
    add_reading(parser)
    add_pace(parser)
    parser.set_defaults(align=False)  # a running programme cannot be aligned to its text


def _add_content(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("text or interpreter")
    source = group.add_mutually_exclusive_group()
    source.add_argument(
        "--subtitles", metavar="SUBS", help="subtitle file; time 0 is the stream's first sample"
    )
    source.add_argument(
        "--motion", metavar="M.npz", help="motion file; - reads the lines of `capture - --live`"
    )
    source.add_argument(
        "--text", choices=(PIPE,), help="live text as JSON lines from the standard input"
    )
    group.add_argument(
        "--seen-late",
        type=not_negative,
        default=0.0,
        metavar="S",
        help="how much later than the stream arrives the interpreter sees it, seconds",
    )


def _add_mark(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("the mark")
    group.add_argument("--profile", default="standard", metavar="NAME", help="such as robust")
    group.add_argument(
        "--grade",
        type=grade,
        metavar="ODG",
        help="audibility allowed to the mark, from 0 (none) to -4 (BS.1387)",
    )
    group.add_argument(
        "--through", metavar="CODER", help="the broadcaster's coder, such as aac:64k"
    )
    group.add_argument("--sign", metavar="SECRET", help="sign the cues with this key: `key new`")
    group.add_argument(
        "--on-air",
        metavar="TIME",
        help="when a signed programme from a file or pipe begins on air, such as "
        "2027-01-31T20:00:00Z (default: now)",
    )
    group.add_argument("--key", type=natural, default=0, metavar="N", help="key of the watermark")
    group.add_argument(
        "--no-read-back",
        action="store_true",
        help="do not receive the own output (it costs 2 %% of a core)",
    )
    group.add_argument(
        "--no-standby",
        action="store_true",
        help="no second marking process and no second playout that go on if the first one dies",
    )


def _add_server(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("figures, health and live text over HTTP")
    group.add_argument(
        "--port",
        type=natural,
        metavar="N",
        help="serve /metrics, /health and the WebSocket /captions",
    )
    group.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDR",
        help="address to serve on; any other than this machine's own needs --token-file",
    )
    group.add_argument(
        "--token-file",
        metavar="FILE",
        help="file with the token that live text has to bring as `Authorization: Bearer TOKEN`",
    )
    group.add_argument(
        "--allow-origin",
        action="append",
        default=[],
        metavar="URL",
        help="web pages of this origin may send live text, such as https://respeak.example",
    )


def run(args: argparse.Namespace) -> int:
    """Run the playout until its source ends or it is stopped."""
    from cuecast.live.command import run_playout

    return run_playout(args)
