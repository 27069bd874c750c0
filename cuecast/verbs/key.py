"""Make and show the keys that prove a broadcaster's cues."""

import argparse
import time
from datetime import UTC, datetime

from cuecast.command.arguments import add_json, natural, print_json
from cuecast.command.errors import UsageError
from cuecast.command.progress import count_bar, note, printable

SUMMARY = "keys of authentic cues: new, renew, show"

_DAYS = 366
"""Days that a key holds: a year."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    new = actions.add_parser("new", help="a new key: SECRET for `dub --sign`, PUBLIC for sets")
    new.add_argument("name", metavar="NAME", help="of the broadcaster or channel")
    _add_files(new, "written, for its owner only")
    renew = actions.add_parser("renew", help="PUBLIC again, for a later time")
    _add_files(renew, "of `key new`")
    show = actions.add_parser("show", help="whose key a public file is, and how long it holds")
    show.add_argument("public", metavar="PUBLIC")
    show.add_argument(
        "--pinned", metavar="OLD", help="exit 1 unless the key is that of this older file"
    )
    add_json(show)


def _add_files(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument("--secret", metavar="SECRET", required=True, help=what)
    parser.add_argument("--public", metavar="PUBLIC", required=True, help="written, for everybody")
    parser.add_argument(
        "--days", type=natural, default=_DAYS, metavar="N", help=f"it holds, {_DAYS} by default"
    )
    parser.add_argument(
        "--from", dest="begin", metavar="DATE", help="first day, 2027-01-31; today by default"
    )


def run(args: argparse.Namespace) -> int:
    """Make or show keys."""
    from codec.authentication.announcement import load_signing_key, new_key

    if args.action == "show":
        return _show(args)
    begin_s = time.time() if args.begin is None else _seconds(args.begin)
    key = new_key(args.name) if args.action == "new" else load_signing_key(args.secret)
    with count_bar("months") as advance:
        announcement = key.announce(begin_s, args.days, advance)
    if args.action == "new":
        key.save(args.secret)
    announcement.save(args.public)
    note(f"fingerprint of {key.name}: {announcement.fingerprint}")
    return 0


def _seconds(date: str) -> float:
    try:
        return datetime.fromisoformat(date).replace(tzinfo=UTC).timestamp()
    except ValueError as error:
        raise UsageError(f"--from {date}: not a date such as 2027-01-31") from error


def _show(args: argparse.Namespace) -> int:
    from codec.authentication.announcement import load_announcement

    found = load_announcement(args.public)
    begin, end = found.dates
    pinned = args.pinned is None or found.continues(load_announcement(args.pinned))
    told = {
        "name": found.name,
        "fingerprint": found.fingerprint,
        "from": begin,
        "to": end,
        "as_pinned": pinned,
    }
    if args.json:
        print_json(told)
    else:
        for name, value in told.items():
            if name != "as_pinned" or args.pinned is not None:
                print(f"{name:>12}  {printable(str(value))}")
    return 0 if pinned else 1
