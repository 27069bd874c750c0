"""Show the whole way on a built-in programme.

Make a short programme, put a cuer into its sound, code it as broadcasters do, receive it,
compare the received with the sent motion, and draw both.
"""

import argparse
from dataclasses import asdict
from pathlib import Path

from cuecast.command.arguments import add_json, add_seed, print_json
from cuecast.command.progress import note

SUMMARY = "the whole way on a built-in programme, with pictures"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--out", default="demo-out", metavar="DIR", help="folder of the results")
    add_json(parser)
    add_seed(parser)


def run(args: argparse.Namespace) -> int:
    """Run the demonstration; 0 only if all keys arrived on every broadcast."""
    from cuecast.demo.run import describe, run_demo

    folder = Path(args.out)
    outcomes = run_demo(folder, seed=args.seed, say=note)
    if args.json:
        print_json(
            [
                {
                    "broadcast": o.broadcast,
                    "correct": o.correct,
                    "receive": o.summary,
                    "compare": None if o.comparison is None else asdict(o.comparison),
                }
                for o in outcomes
            ]
        )
    else:
        for outcome in outcomes:
            verdict = "all keys equal" if outcome.correct else "NOT all keys equal"
            print(f"{outcome.broadcast}: {verdict}; {describe(outcome)}")
        print(f"pictures: {folder / 'strip.png'}, {folder / 'keys.png'}")
    return 0 if all(outcome.correct for outcome in outcomes) else 1
