"""The reference of the command line, from its own help; every option has an anchor."""

import argparse
import re
from collections.abc import Iterator

from cuecast.command.cli import VERBS, build_parser


def verb_page() -> str:
    """Return the page of all verbs in Markdown."""
    parser = build_parser()
    parts = [
        "# Verbs",
        "Results go to the standard output, notes and progress to the standard error; `--json` "
        "prints one JSON document; `-` is a pipe. Where a verb has many options, `--help` names "
        "groups of them and `--help-all` explains each as this page does. " + (parser.epilog or ""),
    ]
    for name, verb in parsers_of(parser).items():
        parts += [f"## {name}", *_described(name, verb)]
        for action, sub in parsers_of(verb).items():
            parts += [f"### {name} {action}", *_described(f"{name}-{action}", sub)]
    return "\n\n".join(part for part in parts if part) + "\n"


def parsers_of(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Return the parsers below a parser, by name; none where there are none."""
    found: dict[str, argparse.ArgumentParser] = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found |= action.choices
    return {name: found[name] for name in VERBS if name in found} or found


def options_of(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Yield the long names of all options of a parser and of those below it, but of help."""
    for action in parser._actions:
        if isinstance(action, argparse._HelpAction):
            continue
        yield from (name for name in action.option_strings if name.startswith("--"))
    for below in parsers_of(parser).values():
        yield from options_of(below)


def _described(anchor: str, parser: argparse.ArgumentParser) -> list[str]:
    """Return the description, the arguments by group, and the epilogue of a parser."""
    parts = [_plain(parser.description or "")]
    for group in parser._action_groups:
        actions = [
            action
            for action in group._group_actions
            if action.help != argparse.SUPPRESS
            and not isinstance(action, argparse._SubParsersAction | argparse._HelpAction)
        ]
        if actions:
            parts.append(f"*{(group.title or 'options').capitalize()}*")
            parts.append("\n".join(_line(anchor, parser, action) for action in actions))
    return [*parts, _plain(parser.epilog or "")]


def _line(anchor: str, parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    """Return an argument with its anchor, e.g. ``dub-through``, and its help."""
    formatter = parser._get_formatter()
    if action.option_strings:
        value = formatter._format_args(action, formatter._get_default_metavar_for_optional(action))
        shown = (
            f"{', '.join(action.option_strings)} {value}".strip()
            if action.nargs != 0
            else (", ".join(action.option_strings))
        )
        name = action.option_strings[-1].lstrip("-")
    else:
        default = formatter._get_default_metavar_for_positional(action)
        shown = formatter._format_args(action, default)
        name = action.dest
    text = f": {_plain(formatter._expand_help(action))}" if action.help else ""
    return f'- <a id="{anchor}-{name}"></a>`{shown}`{text}'


def _plain(text: str) -> str:
    """Return help as Markdown that shows the same characters."""
    escaped = re.sub(r"([<>*_])", r"\\\1", " ".join(text.split()))
    return re.sub(r"(?<![\w`-])(--[a-z][a-z-]*)", r"`\1`", escaped)
