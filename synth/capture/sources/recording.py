"""A recording of labelled points, whatever file it stands in; text is spooled to a file of numbers.

Readers (`synth.capture.sources.readers`) make one; its frames are read piece by piece, so that
memory does not grow with the length of a take.
"""

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

UNITS_MM = {
    "mm": 1.0, "cm": 10.0, "dm": 100.0, "m": 1000.0, "meters": 1000.0, "metres": 1000.0,
    "millimeters": 1.0, "millimetres": 1.0, "centimeters": 10.0, "in": 25.4, "inches": 25.4,
}  # fmt: skip
"""Names of units of length in files."""

MAX_LABELS = 10_000
"""Labels of a file at most: a bound against damage."""

_MAX_LINE = 4_000_000
"""Characters of a line at most: a bound against files without lines."""

_SPOOL_ROWS = 512
"""Rows that are spooled to disk at once."""


@dataclass(frozen=True, slots=True)
class PointRecording:
    """Labelled points over time.

    Attributes
    ----------
    name : str
        Of the file.
    kind : str
        Such as ``C3D``.
    labels : tuple of str
    unit : str
        As the file names it; may be empty.
    rate_hz : float
    start_s : float
        Time of the first frame.
    n_frames : int
    notes : tuple of str
        Oddities of the file.
    """

    name: str
    kind: str
    labels: tuple[str, ...]
    unit: str
    rate_hz: float
    start_s: float
    n_frames: int
    notes: tuple[str, ...]
    _frames: Callable[[int, int], NDArray[np.float32]] = field(repr=False)

    def __post_init__(self) -> None:
        if not self.n_frames:
            raise CueError(f"{self.name}: no frames")
        if not 1 <= self.rate_hz <= 10_000:
            raise CueError(f"{self.name}: {self.rate_hz:g} frames/s are not within 1..10000")

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return self.n_frames / self.rate_hz

    def frames(self, begin: int, end: int) -> NDArray[np.float32]:
        """Return points (n, number of labels, 3) in the file's unit; NaN where hidden."""
        return self._frames(max(begin, 0), min(end, self.n_frames))

    def spread(self, count: int) -> NDArray[np.float32]:
        """Return at most `count` frames from all over the recording."""
        at = np.unique(np.linspace(0, self.n_frames - 1, min(count, self.n_frames)).astype(int))
        return np.concatenate([self.frames(k, k + 1) for k in at.tolist()])


class Spool:
    """Rows of numbers kept in an unnamed file, which goes when what `points` gave goes."""

    def __init__(self, width: int) -> None:
        self._width = width
        self._rows: list[NDArray[np.float32]] = []
        self.count = 0

    def __enter__(self) -> "Spool":
        self._file = tempfile.TemporaryFile()
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def append(self, row: NDArray[np.float32]) -> None:
        """Add a row of `width` numbers."""
        self._rows.append(row)
        self.count += 1
        if len(self._rows) == _SPOOL_ROWS:
            self._flush()

    def _flush(self) -> None:
        self._file.write(b"".join(row.astype("<f4").tobytes() for row in self._rows))
        self._rows.clear()

    def points(self) -> Callable[[int, int], NDArray[np.float32]]:
        """Return what gives points (n, width / 3, 3) of a range of rows, NaN where hidden.

        Zeros in all three coordinates mean a hidden point, as most writers do.
        """
        self._flush()
        self._file.flush()
        if not self.count:
            return lambda begin, end: np.zeros((0, self._width // 3, 3), dtype=np.float32)
        shape = (self.count, self._width // 3, 3)
        # The map outlives the file object: it holds the file by itself.
        rows = np.memmap(self._file, dtype="<f4", mode="r", shape=shape)

        def read(begin: int, end: int) -> NDArray[np.float32]:
            points = np.array(rows[begin:end], dtype=np.float32)
            points[(points == 0).all(-1) | ~np.isfinite(points).all(-1)] = np.nan
            return points

        return read


def text_lines(path: str | os.PathLike[str]) -> Iterator[str]:
    """Yield the lines of a text file without their ends.

    Raises
    ------
    CueError
        If the file cannot be read, or is no text.
    """
    try:
        with Path(path).open(encoding="utf-8-sig", errors="replace", newline=None) as file:
            while line := file.readline(_MAX_LINE):
                if len(line) >= _MAX_LINE or "\0" in line:
                    raise CueError(f"{path}: not a text file of numbers")
                yield line.rstrip("\n")
    except OSError as error:
        raise CueError(f"{path}: {error.strerror}") from error


def numbers(fields: list[str]) -> NDArray[np.float32]:
    """Return the numbers of some fields, NaN for empty ones and words.

    Examples
    --------
    >>> numbers(["1.5", "", "NaN", "2,5"]).tolist()
    [1.5, nan, nan, 2.5]
    """
    try:
        return _narrow(np.array(fields, dtype=np.float64))
    except (ValueError, OverflowError):
        return _narrow(np.array([_number(text) for text in fields], dtype=np.float64))


def _number(text: str) -> float:
    with suppress(ValueError):
        return float(text)
    with suppress(ValueError):
        return float(text.replace(",", "."))
    return float("nan")


def _narrow(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the values in single precision, infinite where they are too large for it."""
    with np.errstate(over="ignore"):
        return values.astype(np.float32)
