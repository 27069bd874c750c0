"""Examine a decoder: run it over the vectors of the specification, name violated paragraphs.

DECODER is a program that answers JSON lines (docs/reference/conformance.md); put its own arguments
behind it. `python`, the toolkit's decoder, and `reference`, the plain one, are built in.
"""

import argparse

from cuecast.command.arguments import add_json, print_json
from cuecast.command.progress import note

SUMMARY = "examine a decoder against the vectors of the specification"

_SHOWN = 20
"""Failures that are printed; all of them are in the JSON."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--vectors", metavar="DIR", help="folder of the vectors (default: of the checkout)"
    )
    add_json(parser)
    parser.add_argument("decoder", metavar="DECODER", help="program; python or reference")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, metavar="...", help="its arguments")


def run(args: argparse.Namespace) -> int:
    """Print the verdicts; 1 if a case failed or none was run."""
    from cuecast.conformance.examine import examine
    from cuecast.conformance.own import BUILT_IN

    command = BUILT_IN.get(args.decoder, [args.decoder]) + args.arguments
    report = examine(command, args.vectors)
    if args.json:
        print_json(report.as_dict())
    else:
        for group, count in report.counts().items():
            print(f"{group:>28}  {count['passed']} of {count['cases']}")
        for verdict in report.failed[:_SHOWN]:
            print(f"{verdict.case} violates {verdict.section}: {verdict.detail}")
            print(f"    look at: {verdict.suggests}")
        if len(report.failed) > _SHOWN:
            note(f"{len(report.failed) - _SHOWN} more failures: --json has all of them")
        print(f"classes reached: {', '.join(report.reached()) or 'none'}")
    return 1 if report.failed or not report.verdicts else 0
