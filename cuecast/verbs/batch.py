"""Dub all programmes of a catalogue; what is done already is not done again.

The catalogue is CSV with the columns programme, subtitles or motion, and optionally output.
"""

import argparse
from pathlib import Path

from cuecast.command.arguments import (
    USUAL_GRADE,
    add_json,
    add_key,
    add_seed,
    add_voice,
    carrier_list,
    count,
    grade,
    print_json,
)
from cuecast.command.progress import note

SUMMARY = "dub many programmes"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("catalogue", metavar="CATALOGUE.csv")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the results")
    parser.add_argument("--jobs", type=count, default=1, metavar="N", help="programmes at once")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler that spreads them")
    parser.add_argument("--carriers", type=carrier_list, default=("audio",), metavar="LIST")
    parser.add_argument("--grade", type=grade, default=USUAL_GRADE, metavar="ODG", help="see dub")
    add_json(parser)
    add_voice(parser)
    add_seed(parser)
    add_key(parser)


def run(args: argparse.Namespace) -> int:
    """Dub everything; 1 if a programme failed."""
    from cuecast.dubbing.batch import read_catalogue, run_batch
    from cuecast.evaluate.tables import as_table

    folder = Path(args.out)
    tasks = read_catalogue(
        args.catalogue, folder, voice=args.voice, carriers=args.carriers, grade=args.grade,
        seed=args.seed, key=args.key,
    )  # fmt: skip
    rows = run_batch(
        tasks, folder, jobs=args.jobs, scheduler=args.scheduler,
        progress=lambda row: note(f"{row['status']}: {row['output']} {row['error']}".rstrip()),
    )  # fmt: skip
    if args.json:
        print_json(rows)
    else:
        print(as_table(rows))
    return 1 if any(row["status"] == "failed" for row in rows) else 0
