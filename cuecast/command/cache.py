"""Where compiled code is kept between runs, and what happens where nothing can be written.

Numba keeps machine code beside the sources or in the user's own cache. A read-only installation
without a writable home (a container, a hardened unit, a set-top box) has neither: code is then
compiled in each run, unless a folder is given.
"""

import os
import stat
import tempfile
import time
from pathlib import Path
from typing import Any

from codec.compiled import Settings
from codec.errors import CueError
from cuecast.command.progress import note

VARIABLE = "NUMBA_CACHE_DIR"

_NOTED_S = 10.0
"""Seconds between two remarks while kernels are compiled."""


def prepare_cache(folder: str | None) -> None:
    """Choose where compiled code is kept; say it once if it is kept nowhere.

    Parameters
    ----------
    folder : str or None
        Given by the user; made if it does not exist.

    Raises
    ------
    CueError
        If the folder cannot be written, or others could put their code into it.
    """
    Settings.listener = CompilationNotes()
    if folder is not None:
        _check(folder)
        os.environ[VARIABLE] = folder
        _tell_numba(folder)
    elif VARIABLE not in os.environ and not any(map(_can_be_written, _usual_folders())):
        Settings.kept = False
        note("note: compiled code can be kept nowhere: it is made in each run; see --cache")


class CompilationNotes:
    """Remarks on the standard error while kernels are compiled, here or by another process."""

    def __init__(self) -> None:
        self._noted_s: float | None = None

    def __call__(self, count: int) -> None:
        """Take the number of kernels compiled so far, -1 for waiting."""
        now_s = time.monotonic()
        if count < 0:
            note("waiting for another process that compiles kernels")
        elif self._noted_s is None:
            note("compiling kernels, once (about 40 s)")
        elif now_s - self._noted_s >= _NOTED_S:
            note(f"compiling kernels: {count} done")
        else:
            return
        self._noted_s = now_s


def _usual_folders() -> list[Path]:
    """Folders that numba tries: beside the sources, then the user's."""
    import codec

    home = os.environ.get("XDG_CACHE_HOME") or str(Path("~/.cache").expanduser())
    return [Path(str(codec.__file__)).parent / "superframe" / "__pycache__", Path(home) / "numba"]


def _can_be_written(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _check(folder: str) -> None:
    """Refuse a folder into which another user could put code that we would run."""
    path = Path(folder)
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = path.stat()
    except OSError as error:
        raise CueError(f"{folder}: cannot keep compiled code: {error.strerror}") from error
    if status.st_uid not in (0, os.getuid()) or status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise CueError(f"{folder}: cannot keep compiled code: others can write there")
    if not _can_be_written(path):
        raise CueError(f"{folder}: cannot keep compiled code: it cannot be written")


def _tell_numba(folder: str) -> None:
    """Tell numba if it was imported before its variable was set."""
    import sys

    if "numba" in sys.modules:
        import numba

        config: Any = numba.config
        config.CACHE_DIR = folder
