"""Measure how well a part of Cuecast does: a table, CSV, JSON and a picture."""

import argparse
import importlib
import importlib.util
import os
import tempfile
from pathlib import Path

from cuecast.command.arguments import add_json, add_seed, not_negative, print_json
from cuecast.command.files import write_json
from cuecast.command.progress import note

SUMMARY = "figures as CSV, JSON and plots"

KINDS = (
    "codec", "legs", "onair", "audio", "video", "together", "chain", "synthesis", "models",
    "capture", "reader", "readability", "places", "alignment", "intelligibility",
)  # fmt: skip


def offered() -> tuple[str, ...]:
    """Return the kinds that this installation can measure."""
    return tuple(k for k in KINDS if importlib.util.find_spec(f"cuecast.evaluate.{k}"))


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("kind", choices=offered(), metavar="KIND", help=" | ".join(offered()))
    parser.add_argument("--clips", metavar="DIR", help="material; default: built-in")
    parser.add_argument("--channels", metavar="LIST", help="names, separated by commas")
    parser.add_argument(
        "--cuers",
        metavar="LIST",
        help="of models and capture: virtual cuers as identity/law, or all",
    )
    parser.add_argument(
        "--voice", default="claire", metavar="V", help="of codec: voice by name or file"
    )
    parser.add_argument(
        "--after",
        type=not_negative,
        default=0.0,
        metavar="S",
        help="of audio: seconds of unmarked sound before the mark",
    )
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes at work"
    )
    parser.add_argument("--out", metavar="DIR", help="folder for CSV, JSON and plot")
    parser.add_argument(
        "--record",
        metavar="R.json",
        help="figures with all that repeats them: commit, command, machine, clips",
    )
    add_json(parser)
    add_seed(parser)


def run(args: argparse.Namespace) -> int:
    """Measure, print, write."""
    from cuecast.evaluate.options import EvaluateOptions
    from cuecast.evaluate.records import make_record
    from cuecast.evaluate.tables import as_table, write_plots, write_results

    module = importlib.import_module(f"cuecast.evaluate.{args.kind}")
    with tempfile.TemporaryDirectory(prefix="cuecast-") as folder:
        results = module.evaluate(
            EvaluateOptions(
                clips=None if args.clips is None else Path(args.clips),
                channels=tuple(args.channels.split(",")) if args.channels else None,
                seed=args.seed,
                folder=Path(folder),
                say=note,
                out=None if args.out is None else Path(args.out),
                cuers=tuple(args.cuers.split(",")) if args.cuers else None,
                jobs=max(1, args.jobs),
                voice=args.voice,
                after_s=args.after,
            )
        )
    if args.json:
        print_json(results)
    else:
        print(as_table(results))
    if args.out is not None:
        for path in write_results(Path(args.out), args.kind, results):
            note(f"written: {path}")
        if hasattr(module, "plot"):
            for path in write_plots(Path(args.out) / args.kind, results, module.plot):
                note(f"written: {path}")
    if args.record is not None:
        clips = None if args.clips is None else Path(args.clips)
        record = make_record(args.kind, args.argv, results, seed=args.seed, clips=clips)
        write_json(args.record, record)
        note(f"written: {args.record}")
    return 0 if results else 1
