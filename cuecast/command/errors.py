"""Exceptions of the command line."""

from codec.errors import CueError


class UsageError(CueError):
    """The command line asks for something that does not exist or does not fit together."""
