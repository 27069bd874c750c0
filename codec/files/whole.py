"""Outputs that appear whole or not at all.

A file is written under a temporary name beside its own and moved there when it is complete; its
mode is that of the file it replaces, or as the umask says. A device, or a pipe with
a name, is kept and gets the bytes; a symbolic link stays and its target is replaced.
"""

import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from codec.errors import CueError


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary name that is moved to `path` when the block succeeds.

    The temporary name keeps the suffix: media libraries choose a container by it. Whatever
    ends the block early, an interrupt too, leaves neither file behind.

    Raises
    ------
    CueError
        If the folder does not exist or cannot be written.

    Examples
    --------
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with whole_file(f"{folder}/a.txt") as temporary:
    ...         size = temporary.write_text("all of it")
    ...     os.listdir(folder)
    ['a.txt']
    """
    try:
        target = Path(os.path.realpath(path))
        if target.is_dir():
            raise CueError(f"{path}: cannot write, it is a folder")
        mode = _mode_of(path)
        temporary = _create(folder_beside(path), target)
    except (OSError, ValueError) as error:
        raise CueError(f"{path}: cannot write: {getattr(error, 'strerror', error)}") from error
    try:
        yield temporary
        # New file, existing file (keep its permissions), or a device or pipe, which cannot be
        # replaced.
        if mode is None:
            temporary.replace(target)
        elif stat.S_ISREG(mode):
            temporary.chmod(stat.S_IMODE(mode))
            temporary.replace(target)
        else:
            _pour(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def folder_beside(path: str | os.PathLike[str]) -> Path:
    """Return the folder for temporary files of `path`: its own, if it is a file's."""
    mode = _mode_of(path)
    if mode is None or stat.S_ISREG(mode):
        return Path(os.path.realpath(path)).parent
    return Path(tempfile.gettempdir())


def _mode_of(path: str | os.PathLike[str]) -> int | None:
    """Return type and permissions of the file at `path`, None if there is none."""
    try:
        return Path(path).stat().st_mode
    except FileNotFoundError:
        return None


def _create(folder: Path, target: Path) -> Path:
    """Create an empty file exclusively, with the permissions that the umask leaves."""
    name = f".{target.stem[:40]}.{secrets.token_hex(8)}{target.suffix[:40]}"
    handle = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    os.close(handle)
    return folder / name


def _pour(temporary: Path, path: str | os.PathLike[str]) -> None:
    """Write a finished file into a device or a pipe, and remove it."""
    with temporary.open("rb") as source, open(path, "wb") as sink:
        shutil.copyfileobj(source, sink)
    temporary.unlink()
