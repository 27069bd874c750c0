"""Say how alike two motions are."""

import argparse
from dataclasses import asdict

from cuecast.command.arguments import add_json, add_voice, positive, print_json

SUMMARY = "how alike two motions are"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("first", metavar="A.npz")
    parser.add_argument("second", metavar="B.npz")
    parser.add_argument(
        "--limit", type=positive, metavar="MM", help="a mismatch if the markers differ by more"
    )
    add_json(parser)
    add_voice(parser)


def run(args: argparse.Namespace) -> int:
    """Print the comparison; 1 if keys are missing or the limit is exceeded."""
    from codec.analysis.compare import compare_motions
    from codec.cuer.motion import load_motion
    from codec.cuer.voice import load_voice

    motions = load_motion(args.first), load_motion(args.second)
    result = compare_motions(*motions, load_voice(args.voice))
    figures = {name: round(value, 4) for name, value in asdict(result).items()}
    if args.json:
        print_json(figures)
    else:
        for name, value in figures.items():
            print(f"{name:>14}  {value}")
    exceeded = args.limit is not None and result.marker_rms_mm > args.limit
    return 1 if exceeded or result.keys_correct < result.keys_total else 0
