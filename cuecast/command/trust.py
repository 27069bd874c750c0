"""Options that say whose cues are wanted, and when a programme is on air."""

import argparse
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from cuecast.command.arguments import positive
from cuecast.command.errors import UsageError

if TYPE_CHECKING:
    from receiver.reception.authenticity import Trust

_RECORDING_S = 5.0
"""How far the time of a recording's keys may move within it: no sender's clock drifts so much."""

LIVE_S = 10.0
"""How old a broadcast may be that is received live, unless --late says otherwise."""

STREAM_S = 60.0
"""How old one may be that comes by HTTP: players and servers hold it back for segments."""

HOLD_S = 30.0
"""After so long a superframe is verified though a key was lost: three blocks, less its lead."""


def add_trust(parser: argparse.ArgumentParser) -> None:
    """Add the options of who receives."""
    whose = parser.add_mutually_exclusive_group()
    whose.add_argument("--verify", metavar="PUBLIC", help="report whether the cues are of this key")
    whose.add_argument("--trust", metavar="PUBLIC", help="show only cues verified by this key")
    parser.add_argument(
        "--late",
        type=positive,
        metavar="S",
        help=f"how old verified cues may be where the time is known: {LIVE_S:.0f} s by default, "
        f"{STREAM_S:.0f} s by HTTP; who can hold a programme back for less can forge it",
    )


def trust_of(args: argparse.Namespace, *, live: bool = False) -> "Trust | None":
    """Return whose cues are wanted; a recording was on air when ``--on-air`` says, if it does."""
    path = args.trust or args.verify
    if path is None:
        return None
    from codec.authentication.announcement import load_announcement
    from receiver.reception.authenticity import Trust

    announcement, strict = load_announcement(path), args.trust is not None
    late_s = args.late
    if late_s is None:
        late_s = STREAM_S if str(args.programme).startswith("http") else LIVE_S
    if live:
        return Trust(announcement, strict, lambda position_s: time.time(), late_s)
    told = getattr(args, "on_air", None)
    if told is None:
        likely = (*_written_s(args.programme), time.time())
        return Trust(announcement, strict, tolerance_s=_RECORDING_S, likely_s=likely)
    begin_s = seconds_of(told)
    return Trust(announcement, strict, lambda position_s: begin_s + position_s, late_s)


def _written_s(path: str) -> tuple[float, ...]:
    """Return when a recording was written: it is likely to have been on air then."""
    try:
        return (Path(path).stat().st_mtime,)
    except (OSError, ValueError):
        return ()


def add_on_air(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the option that says when a programme begins on air."""
    parser.add_argument("--on-air", metavar="TIME", help=f"{what}, such as 2027-01-31T20:00:00Z")


def seconds_of(text: str) -> float:
    """Return a time in seconds since 1970 (UTC).

    Raises
    ------
    UsageError
        If it is none.

    Examples
    --------
    >>> seconds_of("2027-01-31T20:00:00+01:00")
    1801422000.0
    """
    try:
        time_of_day = datetime.fromisoformat(text)
    except ValueError as error:
        raise UsageError(f"{text!r} is no time such as 2027-01-31T20:00:00Z") from error
    if time_of_day.tzinfo is None:
        time_of_day = time_of_day.replace(tzinfo=UTC)
    return time_of_day.timestamp()
