"""Files of the command line: outputs that appear whole or not at all, and ``-`` as a pipe."""

import io
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from codec.errors import CueError

PIPE = "-"
"""Name that stands for the standard input or output."""


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary name beside `path` that is moved there when the block succeeds.

    The temporary name keeps the suffix, by which media libraries choose a container. Whatever
    ends the block early, an interrupt too, leaves neither file behind.

    Raises
    ------
    CueError
        If the folder does not exist or cannot be written.
    """
    target = Path(path)
    if target.is_dir():
        raise CueError(f"{path}: cannot write, it is a folder")
    try:
        handle, name = tempfile.mkstemp(
            dir=target.parent, prefix=f".{target.stem[:40]}.", suffix=target.suffix
        )
    except OSError as error:
        raise CueError(f"{path}: cannot write: {error.strerror}") from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def read_bytes(path: str) -> bytes:
    """Return the content of the file `path`, or of the standard input for ``-``."""
    if path == PIPE:
        return _standard_input().read()
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise CueError(f"{path}: {error.strerror}") from error


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
