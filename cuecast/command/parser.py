"""The parser of the command line: help that fits a screen and a half, and help with everything."""

import argparse
import difflib
import textwrap
from collections.abc import Sequence
from typing import Any, NoReturn

from cuecast.command.progress import printable

LONGEST_PAGE = 60
"""Lines of help, a screen and a half, above which groups of options are named only."""

_PLAIN_GROUPS = 2
"""Groups of options that argparse makes itself: arguments and options. The others have titles."""


class Parser(argparse.ArgumentParser):
    """A parser whose help stays short and whose complaints cannot steer a terminal.

    Where the whole page would be longer than `LONGEST_PAGE` lines, ``--help`` explains the common
    options and names those of the titled groups; ``--help-all`` explains them all.

    Examples
    --------
    >>> parser = Parser(prog="tool")
    >>> group = parser.add_argument_group("the mark")
    >>> for n in range(LONGEST_PAGE):
    ...     _ = group.add_argument(f"--level-{n}", help="a level")
    >>> print(parser.format_help().splitlines()[-1])
      --level-55, --level-56, --level-57, --level-58, --level-59
    """

    def add_argument_group(self, *args: Any, **kwargs: Any) -> argparse._ArgumentGroup:
        """Add a titled group, and ``--help-all`` with the first one."""
        group = super().add_argument_group(*args, **kwargs)
        if len(self._action_groups) == _PLAIN_GROUPS + 1:
            self.add_argument("--help-all", action=_HelpAll, help="explain every option, then exit")
        return group

    def format_all(self) -> str:
        """Return the whole page."""
        return super().format_help()

    def format_help(self) -> str:
        """Return the page of ``--help``."""
        whole = self.format_all()
        if whole.count("\n") <= LONGEST_PAGE:
            return whole
        formatter = self._usage()
        formatter.add_text(self.description)
        for group in self._action_groups[:_PLAIN_GROUPS]:
            formatter.start_section(group.title)
            formatter.add_arguments(group._group_actions)
            formatter.end_section()
        parts = [formatter.format_help(), *map(_named, self._action_groups[_PLAIN_GROUPS:])]
        return "\n".join([*parts, *([self.epilog + "\n"] if self.epilog else [])])

    def format_usage(self) -> str:
        """Return the line of usage, without the options that ``--help`` only names."""
        if self.format_all().count("\n") <= LONGEST_PAGE:
            return super().format_usage()
        return self._usage().format_help()

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Read a command line; a verb itself refuses unknown words, with its own usage."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            name = unknown[0].partition("=")[0]
            known = [one for action in self._actions for one in action.option_strings]
            near = difflib.get_close_matches(name, known, 1) if name.startswith("-") else []
            hint = "".join(f"; {one} is known" for one in near)
            self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        """Refuse a command line."""
        super().error(printable(message))

    def _usage(self) -> argparse.HelpFormatter:
        """Return a formatter with the usage of arguments and common options."""
        shown = [a for group in self._action_groups[:_PLAIN_GROUPS] for a in group._group_actions]
        exclusive = [
            group for group in self._mutually_exclusive_groups if group._group_actions[0] in shown
        ]
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, shown, exclusive)
        return formatter


class _HelpAll(argparse._HelpAction):
    """Print the whole page."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> NoReturn:
        """Print it and end."""
        assert isinstance(parser, Parser)
        print(parser.format_all(), end="")
        parser.exit()


def _named(group: argparse._ArgumentGroup) -> str:
    """Return a group's title and the names of its options."""
    names = ", ".join(action.option_strings[-1] for action in group._group_actions)
    lines = textwrap.wrap(names, 76, break_on_hyphens=False)
    return f"{group.title}, see --help-all:\n{textwrap.indent(chr(10).join(lines), '  ')}\n"
