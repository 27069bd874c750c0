"""A playout as the options ask for, with its log, its server and its live text."""

import argparse
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from codec.errors import CueError
from cuecast.command.errors import UsageError
from cuecast.command.files import PIPE
from cuecast.command.progress import note
from cuecast.command.trust import seconds_of
from cuecast.dubbing.inputs import reading_of
from cuecast.live.guard import Guard, read_token
from cuecast.live.lines import piped_lines
from cuecast.live.options import LiveOptions
from cuecast.live.pcm import PcmForm
from cuecast.live.playout import Playout, Route
from cuecast.live.server import PlayoutServer
from cuecast.live.succession import Inheritance
from cuecast.live.worker import Cuer

_ATTEMPTS, _ATTEMPT_S = 100, 0.1
"""How often, and how many seconds apart, a port is tried that another process had."""


def run_playout(args: argparse.Namespace) -> int:
    """Pass a running programme on with its cuer, until it ends or is stopped.

    Raises
    ------
    UsageError
        If options do not go together.
    CueError
        If the source or the target cannot be opened, or the target ends.
    """
    if [args.source, args.text, args.motion].count(PIPE) > 1:
        raise UsageError(
            "playout: only one of programme, live text and interpreter can be the pipe"
        )
    if args.port is None and (args.token_file or args.allow_origin):
        raise UsageError("playout: --token-file and --allow-origin need --port")
    guard = Guard(
        args.host, read_token(args.token_file) if args.token_file else "", tuple(args.allow_origin)
    )
    options = LiveOptions(
        args.profile, args.key, args.grade, args.through, args.low_delay,
        args.seen_late, _absolute(args.sign), args.on_air and seconds_of(args.on_air),
    )  # fmt: skip
    options.signing()  # a key that cannot be read is an error now, and not of the marking process
    inheritance = Inheritance.find()
    playout = Playout(
        Route(
            args.source, args.target, args.track, args.programme_number,
            PcmForm.read(args.samples) if args.samples else None,
        ),
        Cuer(
            args.voice, reading_of(args), args.seed, args.alignment,
            _absolute(args.subtitles), _absolute(args.motion),
        ),
        options,
        log,
        standby=not args.no_standby, read_back=not args.no_read_back, argv=args.argv,
        inheritance=inheritance,
    )  # fmt: skip
    if inheritance is not None and not playout.follow():
        return 0
    with _stopping(playout):
        if args.text == PIPE:
            threading.Thread(target=_read_captions, args=(playout,), daemon=True).start()
        if args.motion == PIPE:
            threading.Thread(target=_read_interpreter, args=(playout,), daemon=True).start()
        if args.port is None:
            playout.run()
        elif inheritance is not None:
            threading.Thread(
                target=_serve_again, args=(playout, args.port, guard), daemon=True
            ).start()
            playout.run()
        else:
            with closing(PlayoutServer(playout, args.port, log, guard)):
                playout.run()
    return 0


def _serve_again(playout: Playout, port: int, guard: Guard) -> None:
    """Serve in place of a playout that ended, as soon as the system has freed its port."""
    for _ in range(_ATTEMPTS):
        try:
            PlayoutServer(playout, port, log, guard)
            return
        except CueError as error:
            refusal = str(error)
            time.sleep(_ATTEMPT_S)
    log(refusal)


def log(line: str) -> None:
    """Write a line with the time of day to the standard error."""
    note(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {line}")


def _read_captions(playout: Playout) -> None:
    for line in piped_lines():
        try:
            playout.caption(line, "standard input")
        except CueError:  # counted and logged by the playout
            continue


def _read_interpreter(playout: Playout) -> None:
    for line in piped_lines():
        playout.interpret(line)
    playout.interpret(None)


def _absolute(path: str | None) -> str:
    return "" if path is None else path if path == PIPE else str(Path(path).absolute())


@contextmanager
def _stopping(playout: Playout) -> Iterator[None]:
    """Let the programme run out on the first signal to stop; end at once on the second."""
    numbers = [signal.SIGTERM, signal.SIGINT]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # of a terminal that closes
        numbers.append(signal.SIGHUP)

    def stop(number: int, frame: Any) -> None:
        log("stopping: what was taken in goes out")
        playout.stop()
        for one, handler in zip(numbers, before, strict=True):
            signal.signal(one, handler)

    before = [signal.signal(number, stop) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
