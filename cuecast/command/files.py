"""Files of the command line, and ``-`` as a pipe."""

import argparse
import io
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from codec.errors import BitstreamError, CueError
from codec.files.whole import whole_file
from cuecast.command.errors import UsageError

PIPE = "-"
"""Name that stands for the standard input or output."""

WRITTEN = (
    "output", "target", "report", "plot", "markers", "markers_chart", "propose_map", "record",
    "c3d", "speech", "textgrid",
)  # fmt: skip
"""Arguments of all verbs that name a file to write."""


def check_outputs(args: argparse.Namespace) -> None:
    """Refuse to write over a file that is read, or twice into the same.

    Raises
    ------
    UsageError
        With the file's name.
    """
    named = {name: value for name, value in vars(args).items() if name not in ("argv", "verb")}
    written = [Path(path) for name in WRITTEN if isinstance(path := named.pop(name, None), str)]
    for n, one in enumerate(written):
        if any(one == other and str(one) != PIPE for other in written[:n]):
            raise UsageError(f"{one}: two outputs would be written there")
    for value in named.values():
        for path in value if isinstance(value, list | tuple) else [value]:
            if isinstance(path, str) and any(_same_file(path, one) for one in written):
                raise UsageError(f"{path}: the output would overwrite what is read")


def _same_file(path: str, other: Path) -> bool:
    try:
        return Path(path).is_file() and other.is_file() and other.samefile(path)
    except (OSError, ValueError):
        return False


def read_bytes(path: str, most: int = -1) -> bytes:
    """Return the content of the file `path`, or of the standard input for ``-``, up to `most`."""
    if path == PIPE:
        return _standard_input().read(most)
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise CueError(f"{path}: {error.strerror}") from error


@contextmanager
def stream_named(path: str) -> Iterator[None]:
    """Name the file in errors of a damaged stream, and the verb that shows what is left of it."""
    try:
        yield
    except BitstreamError as error:
        name = "standard input" if path == PIPE else path
        raise CueError(f"{name}: {error}; cuecast inspect shows what can be read") from error


def write_bytes(path: str, data: bytes) -> None:
    """Write `data` to the file `path`, or to the standard output for ``-``."""
    if path == PIPE:
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


def write_json(path: str, document: Any) -> None:
    """Write `document` as JSON to the file `path`, or to the standard output for ``-``."""
    write_bytes(path, (json.dumps(document, ensure_ascii=False, indent=1) + "\n").encode())


def spooled(path: str) -> "str | io.BytesIO":
    """Return `path`, or the standard input read whole for ``-``, for readers that seek."""
    return io.BytesIO(_standard_input().read()) if path == PIPE else path


def _standard_input() -> BinaryIO:
    return sys.stdin.buffer
