"""Put a cuer into the sound of a programme.

The output keeps the container, the picture and the parameters of the sound; every other stream
is copied as it stands.
"""

import argparse
from typing import Any

from cuecast.command.arguments import (
    CARRIERS,
    add_json,
    add_key,
    add_motion,
    add_pace,
    add_reading,
    add_seed,
    add_subtitle_terms,
    add_voice,
    bit_rate,
    carrier_list,
    grade,
    natural,
    print_json,
)
from cuecast.command.errors import UsageError
from cuecast.command.files import write_json
from cuecast.command.progress import note
from cuecast.command.trust import add_on_air

SUMMARY = "the programme with its cuer inside"


NOT_SHOWN = {"silent_s", "margin"}
"""Figures of carriers that are too long for a line."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("programme", metavar="PROGRAMME", help="sound or video file")
    source = parser.add_mutually_exclusive_group()
    source.add_argument(
        "--subtitles",
        metavar="SUBS",
        help="subtitles; - reads a pipe (default: the programme's own French subtitles)",
    )
    source.add_argument("--motion", metavar="M.npz", help="motion of the cuer")
    parser.add_argument("-o", "--output", metavar="OUT", help="the programme with its cuer")
    add_on_air(parser, "when a signed programme begins on air (default: now)")
    parser.add_argument("--report", metavar="R.json", help="report of the work; - prints it")
    add_json(parser)
    add_dubbing(parser)


def add_dubbing(parser: argparse.ArgumentParser) -> None:
    """Add how programmes are dubbed, for one of them and for many."""
    parser.add_argument(
        "--subtitle-track", metavar="N|LANG", help="which of the programme's own, from 0"
    )
    parser.add_argument(
        "--carriers",
        type=carrier_list,
        default=("audio",),
        metavar="LIST",
        help=f"of {', '.join(CARRIERS)}",
    )
    parser.add_argument(
        "--align", action="store_true", help="time the cues by the voices of the programme"
    )
    parser.add_argument("--track", type=natural, default=0, metavar="N", help="which sound, from 0")
    parser.add_argument(
        "--replace", action="store_true", help="write over the cuer that the programme has already"
    )
    parser.add_argument(
        "--mend",
        action="store_true",
        help="let damaged frames of the sound be silence, and tell how many there are (default: "
        "such a programme is refused)",
    )
    parser.add_argument("--sign", metavar="SECRET", help="sign the cues with this key: `key new`")
    add_voice(parser)
    _add_mark(parser)
    coders = parser.add_argument_group("how the output is coded")
    for kind, example in (("audio", "192k"), ("video", "4000k")):
        coders.add_argument(f"--{kind}-codec", metavar="NAME", help="of the output, if another")
        coders.add_argument(
            f"--{kind}-bitrate", type=bit_rate, metavar="BPS", help=f"such as {example}"
        )
    gestures = parser.add_argument_group("how the cuer moves")
    add_motion(gestures)
    add_seed(gestures)
    add_reading(parser)
    add_pace(parser)
    add_subtitle_terms(parser)


def _add_mark(parser: argparse.ArgumentParser) -> None:
    """Add how strong the mark is, on which coders it is tried, and how it is checked."""
    group = parser.add_argument_group("how the mark is made and checked")
    group.add_argument(
        "--profile",
        action="append",
        default=[],
        metavar="CARRIER=NAME",
        help="such as audio=robust, video=high, a335=2x",
    )
    group.add_argument(
        "--grade",
        type=grade,
        metavar="ODG",
        help="how much of the mark a listener may notice, from 0 (nothing) to -4 (BS.1387; "
        "default: the profile's own)",
    )
    group.add_argument(
        "--through",
        metavar="CODERS",
        help="the broadcaster's coder, such as aac:64k: the mark is rehearsed through it; "
        "alternatives with commas; a chain as mp2:192k+aac:128k, or as a list that repeats a "
        "coder (aac:128k,mp3:128k,aac:128k); aac:64k:mono codes both channels as one; or none "
        "(default: aac:64k for robust, aac:128k,mp2:192k for standard and high; with them the "
        "output's own coder below 96 kbit/s for a channel)",
    )
    group.add_argument(
        "--video-through",
        metavar="CODERS",
        help="the broadcaster's coder of pictures, such as h264:2000k, hevc:1500k, av1:1000k or "
        "mpeg2:4000k: the invisible mark is as weak as it allows, rehearsed through it; "
        "alternatives with commas; behind hqdn3d+h264:2000k, a cleaner of noise, or "
        "l0+av1:1000k, the cues arrive but not their details; or none "
        "(default: h264:2000k, less for pictures below 720 lines, about h264:1000k at 360; above, "
        "h264 with 0.087 bits per pixel, and details are given up where h264:2000k makes them "
        "cost much; and for the cues hqdn3d+h264:2000k, av1:1600k and mpeg2 at 360 lines)",
    )
    group.add_argument("--no-grade", action="store_true", help="do not run the quality meter")
    group.add_argument(
        "--no-read-back", action="store_true", help="do not receive the written file"
    )
    add_key(group)


def run(args: argparse.Namespace) -> int:
    """Write the programme and the report."""
    if args.output is None:
        raise UsageError("dub: say the output with -o OUT")
    from cuecast.dubbing.job import job_of, run_job
    from cuecast.dubbing.memory import keep_freed_memory

    keep_freed_memory()
    report = run_job(job_of(args))
    if args.report is not None:
        write_json(args.report, report)
    if args.json:
        print_json(report)
    else:
        note(f"{args.output}: {len(report['keys'])} keys, {report['superframes']} superframes")
        for name, figures in report["carriers"].items():
            shown = {key: value for key, value in figures.items() if key not in NOT_SHOWN}
            if margin := figures.get("margin"):
                shown |= {"margin": f"{margin['least']} to {margin['median']} in the median"}
            note(f"{name}: " + ", ".join(f"{key} {value}" for key, value in shown.items()))
    return 1 if _in_vain(report) else 0


def _in_vain(report: dict[str, Any]) -> bool:
    """Whether nothing of a carrier can be read back."""
    found = report.get("read_back", {"carriers": {}})["carriers"].values()
    return any(one["sent"] and not one["received"] for one in found)
