"""Prepare, run and evaluate perceptual tests; answers stay on this machine as CSV."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from cuecast.command.arguments import (
    add_json,
    add_seed,
    add_voice,
    count,
    natural,
    not_negative,
    print_json,
)
from cuecast.command.errors import UsageError
from cuecast.command.progress import count_bar, note

if TYPE_CHECKING:
    from cuecast.practice.trial import Trial

SUMMARY = "perceptual tests: prepare, run, results, power"

_KINDS = ("pairs", "naturalness", "comprehension", "voices")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    _configure_prepare(actions.add_parser("prepare", help="make the items of a test in a folder"))
    check = actions.add_parser(
        "check", help="let the recogniser read the items of minimal pairs before people do"
    )
    running = actions.add_parser("run", help="serve the participants' page")
    running.add_argument("--port", type=natural, default=8082, metavar="N", help="0: any free one")
    results = actions.add_parser("results", help="figures of the answers that are there")
    for action in (check, running, results):
        action.add_argument("folder", metavar="DIR", help="made by prepare")
    power = actions.add_parser(
        "power", help="probability that a test finds a difference of two conditions"
    )
    power.add_argument("--d-prime", type=float, default=1.5, metavar="D", help="in one condition")
    power.add_argument("--against", type=float, default=0.0, metavar="D", help="in the other")
    power.add_argument(
        "--trials", type=count, default=10, metavar="N", help="of each condition, even"
    )
    power.add_argument("--participants", type=count, default=12, metavar="N")
    power.add_argument(
        "--spread",
        type=not_negative,
        default=0.5,
        metavar="D",
        help="standard deviation over people of the true difference, .5 by default",
    )
    for action in (check, results, power):
        add_json(action)


def _configure_prepare(prepare: argparse.ArgumentParser) -> None:
    prepare.add_argument(
        "kind",
        choices=_KINDS,
        help="pairs: words that look alike on the lips; naturalness: natural and synthetic "
        "movement under natural speech, rated; comprehension: two minutes with questions; "
        "voices: sentences spoken by two synthetic voices, compared",
    )
    prepare.add_argument("-o", "--output", required=True, metavar="DIR", help="a new folder")
    prepare.add_argument(
        "--hands", default="lips,hand", metavar="LIST", help="of pairs: lips, hand or both"
    )
    prepare.add_argument(
        "--displays",
        metavar="LIST",
        help="points, avatar or both: both for pairs by default, avatar for comprehension",
    )
    prepare.add_argument(
        "--channels",
        default="clear,channel",
        metavar="LIST",
        help="of pairs: clear, channel (coded, with losses) or both",
    )
    prepare.add_argument(
        "--trials",
        type=count,
        default=10,
        metavar="N",
        help="of pairs: trials of each condition for each participant; of voices: sentences; "
        "even, 10 by default",
    )
    prepare.add_argument(
        "--lost",
        type=not_negative,
        default=0.05,
        metavar="SHARE",
        help="of pairs: superframes lost in the channel, .05 by default",
    )
    prepare.add_argument(
        "--recordings",
        metavar="DIR",
        help="of naturalness: motions with scores (NAME.npz) and their speech (NAME.wav)",
    )
    prepare.add_argument(
        "--passages", metavar="DIR", help="of comprehension: your own passages (*.json)"
    )
    prepare.add_argument(
        "--speakers",
        default="reader,espeak",
        metavar="LIST",
        help="of voices: two or more of reader, units, espeak, as in evaluate intelligibility",
    )
    prepare.add_argument(
        "--texts", metavar="FILE", help="of voices: one sentence a line; by default news"
    )
    add_voice(prepare)
    add_seed(prepare)


def run(args: argparse.Namespace) -> int:
    """Carry out the action."""
    actions = {
        "prepare": _prepare,
        "check": _check,
        "run": _run,
        "results": _results,
        "power": _power,
    }
    return actions[args.action](args)


def _prepare(args: argparse.Namespace) -> int:
    from cuecast.practice.papers import CONSENT, write_papers
    from cuecast.practice.trial import new_trial

    with new_trial(args.output) as folder:
        trial = _made(args, folder)
        write_papers(trial)
        steps = len(trial.steps(1))
    note(
        f"{steps} steps for each participant; complete {args.output}/{CONSENT}, then: "
        f"cuecast trial run {args.output}"
    )
    return 0


def _made(args: argparse.Namespace, folder: Path) -> "Trial":
    from cuecast.practice import comprehension, naturalness, pairs, voices

    displays = tuple((args.displays or "").split(",")) if args.displays else None
    with count_bar("items") as progress:
        if args.kind == "pairs":
            plan = pairs.PairsPlan(
                tuple(args.hands.split(",")),
                displays or pairs.DISPLAYS,
                tuple(args.channels.split(",")),
                args.trials,
                args.lost,
            )
            return pairs.prepare(folder, args.voice, plan, seed=args.seed, progress=progress)
        if args.kind == "naturalness":
            if args.recordings is None:
                raise UsageError("naturalness needs --recordings DIR")
            return naturalness.prepare(
                folder, Path(args.recordings), args.voice, seed=args.seed, progress=progress
            )
        if args.kind == "voices":
            return voices.prepare(
                folder,
                args.voice,
                speakers=args.speakers.split(","),
                sentences=args.trials,
                texts=Path(args.texts) if args.texts else None,
                seed=args.seed,
                progress=progress,
            )
        shown = displays or ("avatar",)
        if len(shown) != 1 or shown[0] not in pairs.DISPLAYS:
            raise UsageError("comprehension takes one display: avatar or points")
        return comprehension.prepare(
            folder,
            args.voice,
            passages=Path(args.passages) if args.passages else None,
            display=shown[0],
            seed=args.seed,
            progress=progress,
        )


def _check(args: argparse.Namespace) -> int:
    from cuecast.practice.pairs import read_by_machine
    from cuecast.practice.trial import read_trial

    trial = read_trial(args.folder)
    if trial.kind != "pairs":
        raise UsageError(f"{args.folder} is a test of {trial.kind}: check reads minimal pairs")
    with count_bar("reading") as progress:
        rows = read_by_machine(trial, progress)
    if args.json:
        print_json(rows)
    else:
        for row in rows:
            print("  ".join(f"{name} {value}" for name, value in row.items()))
    return 0


def _run(args: argparse.Namespace) -> int:
    from cuecast.practice.pages import TrialPages, serve_pages
    from cuecast.practice.papers import CONSENT, UNFINISHED, consent_of
    from cuecast.practice.trial import read_trial

    trial = read_trial(args.folder)
    if any(UNFINISHED in part for part in consent_of(trial)):
        note(f"{args.folder}/{CONSENT} does not say yet who is responsible: complete it")
    pages = TrialPages(trial, port=args.port)
    serve_pages(pages, lambda url: note(f"participants at {url}"))
    return 0


def _results(args: argparse.Namespace) -> int:
    from cuecast.practice.results import figures, in_words
    from cuecast.practice.trial import read_trial

    found = figures(read_trial(args.folder))
    if args.json:
        print_json(found)
    else:
        print(in_words(found))
    return 0


def _power(args: argparse.Namespace) -> int:
    from cuecast.practice.statistics import power

    found = power(
        args.d_prime,
        args.against,
        trials=args.trials,
        observers=args.participants,
        spread=args.spread,
    )
    if args.json:
        print_json({"power": round(found, 4)})
    else:
        print(f"power {found:.2f}")
    return 0
