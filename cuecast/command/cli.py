"""Command `cuecast`: one verb per module of `cuecast.verbs`.

A verb module offers ``SUMMARY`` (one line), ``configure(parser)`` and ``run(args) -> int``; it
imports its packages inside ``run``, so that ``cuecast --help`` answers at once. Results go
to the standard output, notes and progress to the standard error.

Exit status: 0 done, 1 nothing found or mismatch, 2 wrong usage, 3 malformed or unusable input,
130 interrupted.
"""

import argparse
import importlib
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from codec.errors import CueError
from cuecast.command.cache import prepare_cache
from cuecast.command.errors import UsageError
from cuecast.command.files import check_outputs
from cuecast.command.kinds import check_kinds
from cuecast.command.parser import Parser
from cuecast.command.progress import printable
from cuecast.command.version import installed_version

VERBS = (
    "demo", "keys", "key", "synth", "capture", "encode", "decode", "inspect", "dub", "playout",
    "receive", "watch", "page", "render", "avatar", "learn", "trial", "compare", "evaluate",
    "batch", "voice", "conform", "warm",
)  # fmt: skip
"""Verbs in the order of the help page; each is a module of `cuecast.verbs`."""

# Codes of exit, as the help page says; the last one is that of shells for an interrupt.
EXIT_OK = 0
EXIT_MISMATCH = 1
EXIT_USAGE = 2
EXIT_UNUSABLE = 3
EXIT_INTERRUPTED = 130


def build_parser(verbs_wanted: Sequence[str] = VERBS) -> Parser:
    """Return the parser of the whole command line, or of some verbs."""
    common = Parser(add_help=False)
    common.add_argument(
        "--debug",
        action="store_true",
        default=argparse.SUPPRESS,
        help="show a trace with an error message",
    )
    common.add_argument(
        "--cache",
        metavar="DIR",
        default=argparse.SUPPRESS,
        help="keep compiled code in DIR, a folder that only you can write",
    )
    parser = Parser(
        prog="cuecast",
        description="A virtual Cued Speech interpreter inside ordinary television.",
        epilog="Exit status: 0 done, 1 nothing found or mismatch, 2 usage, 3 unusable input.",
        parents=[common],
    )
    parser.add_argument("--version", action=_TellVersion, nargs=0, help="tell the version")
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", required=True)
    for name in verbs_wanted:
        module = importlib.import_module(f"cuecast.verbs.{name}")
        verb = verbs.add_parser(
            name, help=module.SUMMARY, description=module.__doc__, parents=[common]
        )
        module.configure(verb)
        verb.set_defaults(run=module.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Verb and options; those of the process by default.

    Returns
    -------
    int
        The exit status.

    Examples
    --------
    >>> main(["keys", "Oui"])  # doctest: +NORMALIZE_WHITESPACE
    start  end  key  taught  shape  placement  phones
    0.500  0.860  26  6-m  6  mouth  w i
    0
    """
    try:
        words = _present(sys.argv[1:] if argv is None else argv)
        # The modules of all verbs take as long to import as numpy.
        verbs = (words[0],) if words[:1] and words[0] in VERBS else VERBS
        args = build_parser(verbs).parse_args(words)
    except SystemExit as stop:  # argparse has printed its page or its complaint
        return stop.code if isinstance(stop.code, int) else EXIT_USAGE
    try:
        args.argv = tuple(sys.argv[1:] if argv is None else argv)
        with _termination_as_interrupt():
            prepare_cache(getattr(args, "cache", None))
            check_outputs(args)
            check_kinds(args)
            return int(args.run(args))
    except BrokenPipeError:  # the reader of our output has gone: not our failure
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
    except KeyboardInterrupt:
        print("cuecast: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except (CueError, OSError, MemoryError) as error:
        if "debug" in args:
            traceback.print_exc()
        print(f"cuecast: {one_line(error)}", file=sys.stderr)
        return EXIT_USAGE if isinstance(error, UsageError) else EXIT_UNUSABLE


def _present(argv: Sequence[str]) -> list[str]:
    """Return a command line in present words: ``dub --live`` is the verb ``playout``."""
    words = list(argv)
    if words[:1] == ["dub"] and "--live" in words:
        words.remove("--live")
        words[0] = "playout"
    return words


def one_line(error: BaseException) -> str:
    r"""Return the message of `error` on one line.

    Examples
    --------
    >>> one_line(FileNotFoundError(2, "No such file or directory", "film.mp4"))
    'film.mp4: No such file or directory'
    >>> one_line(MemoryError())
    'MemoryError'
    >>> one_line(ValueError("a name \x1b[31mof a file"))
    'a name \\x1b[31mof a file'
    """
    if isinstance(error, OSError) and error.strerror and error.filename:
        return printable(f"{error.filename}: {error.strerror}")
    return printable(" ".join(str(error).split())) or type(error).__name__


@contextmanager
def _termination_as_interrupt() -> Iterator[None]:
    """Turn SIGTERM, and SIGHUP of a terminal that closes, into KeyboardInterrupt.

    So unfinished files are removed. Ignored signals stay ignored, as under nohup.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    named = [getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP")]
    before = {
        number: signal.signal(number, interrupt)
        for number in named
        if number is not None and signal.getsignal(number) != signal.SIG_IGN
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _TellVersion(argparse.Action):
    """Print the version."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object, **__: object) -> NoReturn:
        print(f"cuecast {installed_version()}")
        parser.exit()
