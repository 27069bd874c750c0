"""The reference of the command line, from its own help."""

import argparse
import os
from collections.abc import Iterator
from contextlib import contextmanager

from cuecast.command.cli import VERBS, build_parser

_WIDTH = 92
"""Letters in a line of the help: what a page shows without scrolling."""


def verb_page() -> str:
    """Return the page of all verbs in Markdown."""
    with _width(_WIDTH):
        parser = build_parser()
        parts = [
            "# Verbs",
            "Results go to the standard output, notes and progress to the standard error; `--json` "
            "prints one JSON document; `-` is a pipe. " + (parser.epilog or ""),
        ]
        for name, verb in parsers_of(parser).items():
            parts += [f"## {name}", _help_of(verb)]
            for action, sub in parsers_of(verb).items():
                parts += [f"### {name} {action}", _help_of(sub)]
    return "\n\n".join(parts) + "\n"


def parsers_of(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Return the parsers below a parser, by name; none where there are none."""
    found: dict[str, argparse.ArgumentParser] = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found |= action.choices
    return {name: found[name] for name in VERBS if name in found} or found


def options_of(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Yield the long names of all options of a parser and of those below it."""
    for action in parser._actions:
        yield from (name for name in action.option_strings if name.startswith("--"))
    for below in parsers_of(parser).values():
        yield from options_of(below)


def _help_of(parser: argparse.ArgumentParser) -> str:
    return f"```text\n{parser.format_help().strip()}\n```"


@contextmanager
def _width(letters: int) -> Iterator[None]:
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = str(letters)
    try:
        yield
    finally:
        if before is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = before
