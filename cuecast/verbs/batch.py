"""Dub all programmes of a catalogue; finished ones are not done again.

The catalogue is CSV with the columns programme, and optionally subtitles or motion, and output;
signed programmes have on_air. Without subtitles or motion the programme's own subtitles are taken.
Several batches may work on one folder.
"""

import argparse
from pathlib import Path

from cuecast.command.arguments import add_json, count, print_json
from cuecast.command.progress import note
from cuecast.verbs.dub import add_dubbing

SUMMARY = "dub many programmes"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("catalogue", metavar="CATALOGUE.csv")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the results")
    parser.add_argument("--jobs", type=count, default=1, metavar="N", help="programmes at once")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler that spreads them")
    add_json(parser)
    add_dubbing(parser)


def run(args: argparse.Namespace) -> int:
    """Dub everything; 1 if a programme failed or was not done."""
    from cuecast.demo.warming import warm_kernels
    from cuecast.dubbing.batch import run_batch
    from cuecast.dubbing.catalogue import read_catalogue
    from cuecast.evaluate.tables import as_table

    folder = Path(args.out)
    tasks = read_catalogue(args.catalogue, folder, _dubbing_options(args))
    rows = run_batch(
        tasks, folder, jobs=args.jobs, scheduler=args.scheduler, tell=note, warm=warm_kernels
    )
    if args.json:
        print_json(rows)
    else:
        print(as_table(rows))
    return 0 if all(row["status"] in ("done", "done before") for row in rows) else 1


def _dubbing_options(args: argparse.Namespace) -> dict[str, object]:
    """Return the options that are those of ``dub``, files by absolute names."""
    parser = argparse.ArgumentParser()
    add_dubbing(parser)
    options = {name: getattr(args, name) for name in vars(parser.parse_args([]))}
    for name in ("lexicon", "units", "sign"):
        if options.get(name):
            options[name] = str(Path(options[name]).absolute())
    voice = str(options["voice"])
    if voice.endswith(".npz") or "/" in voice:
        options["voice"] = str(Path(voice).absolute())
    return options
