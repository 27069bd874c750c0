"""The ledger of a batch: outputs with their inputs, locks, and remains of ended workers.

Beside every output lies its record, JSON with the hashes of all inputs and of the
output. An item is worked on under a lock of the file system, which ends with its process however
that ends, and in a folder of its own. The record is written before the output is moved to its
place: who finds a record without its output finishes the move, so that nothing is made twice.
"""

import errno
import fcntl
import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from codec.errors import CueError
from cuecast.command.files import write_json
from cuecast.command.version import installed_version
from cuecast.dubbing.catalogue import Task

WORK = ".cuecast-batch"
"""Folder of items in work, beside the outputs; gone when nobody works."""

_BLOCK = 1 << 20
"""Bytes that are hashed at once."""

_hashes: dict[tuple[str, int, int], str] = {}
"""What this process knows of files that have not changed since, by path, size and time."""


class BusyError(CueError):
    """Another process works on this item."""


def hash_of(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a file."""
    stamp = os.stat(path)
    known = os.fspath(path), stamp.st_size, stamp.st_mtime_ns
    if known not in _hashes:
        digest = hashlib.sha256()
        with open(path, "rb") as file:
            while block := file.read(_BLOCK):
                digest.update(block)
        _hashes[known] = digest.hexdigest()
    return _hashes[known]


class BatchItem:
    """An item of a batch and its place in the file system.

    Parameters
    ----------
    task : Task
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self.output = Path(task.output)
        self.record = Path(f"{task.output}.json")
        self._home = self.output.parent / WORK
        self._lock = self._home / f"{self.output.name}.lock"
        self.folder = self._home / self.output.name

    def done(self) -> dict[str, Any] | None:
        """Return the record if the output is there and was made from what lies there now.

        Sizes and times that are still the same stand for the content; otherwise it is hashed.
        """
        record = self._read()
        if record is None or not _is_still(record["output"], self.output):
            return None
        return record if self._is_of(record) else None

    def run(self, work: Callable[[Path], dict[str, Any]]) -> tuple[dict[str, Any], bool]:
        """Make the output under the item's lock, unless it is there by now.

        Parameters
        ----------
        work : callable
            Makes the output under the path that it is given, and returns its report.

        Returns
        -------
        dict
            The record.
        bool
            Whether the output was made here and now.

        Raises
        ------
        BusyError
            If another process works on it.
        """
        with self.locked():
            if (record := self.done() or self._finished()) is not None:
                return record, False
            shutil.rmtree(self.folder)
            self.folder.mkdir()
            made = self.folder / self.output.name
            inputs = {path: _stamp(path) for path in self.task.inputs}
            report = work(made)
            for path, stamp in inputs.items():
                if not _is_still(stamp, Path(path)):
                    raise CueError(f"{path}: it changed while it was worked on")
            record = report | {
                "task": self._told(),
                "version": installed_version(),
                "inputs": inputs,
                "output": _stamp(made),
            }
            write_json(str(self.folder / "record.json"), record)
            (self.folder / "record.json").replace(self.record)
            return self._move(record, made), True

    def _move(self, record: dict[str, Any], made: Path) -> dict[str, Any]:
        made.replace(self.output)
        return record

    def _finished(self) -> dict[str, Any] | None:
        """Move an output to its place that somebody finished who could not do that any more."""
        made, record = self.folder / self.output.name, self._read()
        if record is None or not made.exists() or not self._is_of(record):
            return None
        return self._move(record, made) if _is_still(record["output"], made) else None

    def _read(self) -> dict[str, Any] | None:
        try:
            record = json.loads(self.record.read_text(encoding="utf-8"))
            return dict(record) if {"task", "version", "inputs", "output"} <= set(record) else None
        except (OSError, ValueError, TypeError):
            return None

    def _told(self) -> dict[str, Any]:
        task = self.task
        told = [task.programme, task.subtitles, task.motion, task.options]
        return dict(json.loads(json.dumps({"of": told})))

    def _is_of(self, record: dict[str, Any]) -> bool:
        """Whether a record is of this task, of its inputs as they are, and of this version."""
        return (
            record["task"] == self._told()
            and record["version"] == installed_version()
            and set(record["inputs"]) == set(self.task.inputs)
            and all(_is_still(stamp, Path(path)) for path, stamp in record["inputs"].items())
        )

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the item's lock; its folder is there meanwhile, with the last holder's files.

        Raises
        ------
        BusyError
            If another process holds it.
        """
        while True:
            self._home.mkdir(parents=True, exist_ok=True)
            try:
                handle = os.open(self._lock, os.O_RDWR | os.O_CREAT, 0o666)
            except FileNotFoundError:  # another one cleaned up in between
                continue
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                os.close(handle)
                if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                    raise BusyError(f"{self.output}: another process works on it") from error
                raise CueError(f"{self._lock}: cannot be locked: {error.strerror}") from error
            if _is_same(handle, self._lock):
                break
            os.close(handle)
        try:
            self.folder.mkdir(exist_ok=True)
            yield
        finally:
            shutil.rmtree(self.folder, ignore_errors=True)
            self._lock.unlink(missing_ok=True)
            os.close(handle)


def clean(folder: Path) -> None:
    """Take away what killed processes left in a folder of outputs, where nobody works on it."""
    home = folder / WORK
    for lock in home.glob("*.lock") if home.is_dir() else ():
        try:
            with BatchItem(Task("", str(folder / lock.name.removesuffix(".lock")))).locked():
                pass
        except CueError:
            continue
    try:
        home.rmdir()
    except OSError:  # somebody works, or there is none
        return


def _stamp(path: str | os.PathLike[str]) -> dict[str, Any]:
    found = os.stat(path)
    return {"size": found.st_size, "mtime_ns": found.st_mtime_ns, "sha256": hash_of(path)}


def _is_still(stamp: dict[str, Any], path: Path) -> bool:
    """Whether a file is unchanged, by its size and time or else by its content."""
    try:
        found = path.stat()
    except OSError:
        return False
    if found.st_size != stamp["size"]:
        return False
    return bool(found.st_mtime_ns == stamp["mtime_ns"] or hash_of(path) == stamp["sha256"])


def _is_same(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except OSError:
        return False
