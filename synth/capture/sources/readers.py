"""Files of labelled points: C3D, TRC, the TSV of Qualisys, and CSV with a column per coordinate."""

import csv
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from codec.files.c3d_points import open_c3d
from synth.capture.sources.recording import MAX_LABELS, PointRecording, Spool, numbers, text_lines
from synth.capture.sources.sniff import kind_of

_HEADER_LINES = 64
"""Lines within which a table's header ends."""


def read_points(path: str | os.PathLike[str], kind: str) -> PointRecording:
    """Return the recording in a file.

    Parameters
    ----------
    path : path-like
    kind : {"c3d", "trc", "tsv", "points"}
        From `synth.capture.sources.sniff.kind_of`.

    Raises
    ------
    CueError
        If the file is missing or malformed.
    """
    read = {"c3d": _read_c3d, "trc": _read_trc, "tsv": _read_tsv, "points": _read_csv}[kind]
    try:
        return read(str(path))
    except (ValueError, IndexError, OverflowError, csv.Error) as error:
        raise CueError(f"{path}: malformed: {error}") from error


def read_markers(path: str | os.PathLike[str], why: str) -> PointRecording:
    """Return the recording in a file of markers of whatever kind.

    Parameters
    ----------
    path : path-like
    why : str
        Begin of the message for files of other kinds.

    Raises
    ------
    CueError
        If the file is missing, malformed, or holds no markers.
    """
    kind = kind_of(path)
    if kind not in ("c3d", "trc", "tsv", "points"):
        raise CueError(f"{path}: {why}, this is {kind}")
    return read_points(path, kind)


def _read_c3d(path: str) -> PointRecording:
    file = open_c3d(path)
    notes = []
    if file.missing_frames:
        notes.append(f"{file.missing_frames} of the frames that the file claims are not in it")
    return PointRecording(
        Path(path).name, "C3D", file.labels, file.unit, file.rate_hz, file.start_s,
        file.n_frames, tuple(notes), file.frames,
    )  # fmt: skip


def _read_trc(path: str) -> PointRecording:
    """Read a TRC file (Motion Analysis, OpenSim).

    Line 3 holds rate, unit and numbers, line 4 the labels, each over three columns, line 5 the
    names of the columns; data follow, the first column a number, the second the time.
    """
    lines = text_lines(path)
    head = [next(lines, "") for _ in range(5)]
    if "DataRate" not in head[1] or not head[3].lower().startswith("frame"):
        raise CueError(f"{path}: not a TRC file: line 2 without DataRate, or line 4 without Frame#")
    names, values = head[1].split(), head[2].split()
    facts = dict(zip(names, values, strict=False))
    rate_hz = float(facts["DataRate"]) if "DataRate" in facts else float("nan")
    separator = "\t" if "\t" in head[3] else None
    fields = [field.strip() for field in head[3].split(separator)]
    labels = [field for field in fields[2:] if field]
    rows = _rows(path, lines, separator, lead=2, labels=labels)
    notes = rows.notes
    claimed = facts.get("NumFrames", "")
    if claimed.isdecimal() and int(claimed) > rows.count:
        notes.append(f"{int(claimed) - rows.count} of the frames that the file claims are missing")
    return PointRecording(
        Path(path).name, "TRC", tuple(labels), facts.get("Units", "").lower(), rate_hz,
        rows.first_s, rows.count, tuple(notes), rows.points,
    )  # fmt: skip


def _read_tsv(path: str) -> PointRecording:
    """Read what Qualisys Track Manager exports: lines of facts, then a column per coordinate."""
    facts: dict[str, list[str]] = {}
    lines = text_lines(path)
    first = ""
    for _, line in zip(range(_HEADER_LINES), lines, strict=False):
        fields = line.split("\t")
        if _is_row(fields):
            first = line
            break
        facts[fields[0].strip().upper()] = [field.strip() for field in fields[1:]]
    if "MARKER_NAMES" not in facts or "FREQUENCY" not in facts:
        raise CueError(f"{path}: not a TSV of markers: MARKER_NAMES or FREQUENCY is missing")
    labels = [name for name in facts["MARKER_NAMES"] if name]
    count = len(first.split("\t"))
    # A tab at the end of a line is no column.
    count -= first.endswith("\t") and count - 3 * len(labels) > _lead(facts)
    lead = count - 3 * len(labels)
    if lead not in (0, 1, 2):
        raise CueError(f"{path}: {len(labels)} markers but {count} columns of numbers")
    rows = _rows(path, _with_first(first, lines), "\t", lead=lead, labels=labels)
    return PointRecording(
        Path(path).name, "TSV", tuple(labels), "mm", float(facts["FREQUENCY"][0]),
        rows.first_s, rows.count, tuple(rows.notes), rows.points,
    )  # fmt: skip


def _lead(facts: dict[str, list[str]]) -> int:
    """Return how many columns stand before the coordinates, by the columns' titles."""
    if "FRAME" in facts:
        return 1 + (facts["FRAME"][:1] == ["Time"])
    return 0


def _with_first(first: str, rest: Iterator[str]) -> Iterator[str]:
    yield first
    yield from rest


def _is_row(fields: list[str]) -> bool:
    return (
        len(fields) > 2
        and bool(np.isfinite(numbers(fields[:3])).any())
        and (not fields[0].strip() or _is_number(fields[0]))
    )


@dataclass(frozen=True, slots=True)
class _Rows:
    """The coordinates of all rows, how many, the first one's time, and notes."""

    points: Callable[[int, int], NDArray[np.float32]]
    count: int
    first_s: float
    notes: list[str]


def _rows(
    path: str, lines: Iterator[str], separator: str | None, *, lead: int, labels: list[str]
) -> _Rows:
    if not 0 < len(labels) <= MAX_LABELS:
        raise CueError(f"{path}: {len(labels)} labels, not within 1..{MAX_LABELS}")
    width = 3 * len(labels)
    cut, first_s = 0, 0.0
    with Spool(width) as spool:
        for line in lines:
            if not line.strip():
                continue
            fields = line.split(separator)
            row = np.full(width, np.nan, dtype=np.float32)
            given = numbers(fields[lead : lead + width])
            # Empty fields at the end of a line are often left out.
            if not _is_number(fields[0]) or (separator is None and len(given) < width):
                cut += 1
            else:
                row[: len(given)] = given
                if not spool.count and lead == 2:
                    first_s = float(np.nan_to_num(numbers(fields[1:2])[0]))
            spool.append(row)
        notes = [f"{cut} lines are damaged: hidden there"] if cut else []
        return _Rows(spool.points(), spool.count, first_s, notes)


def _is_number(text: str) -> bool:
    return not np.isnan(numbers([text or "nan"])[0])


def _read_csv(path: str) -> PointRecording:
    """Read a table with the time in the first column, then NAME.x, NAME.y, NAME.z in any order."""
    lines = text_lines(path)
    titles = [title.strip() for title in next(csv.reader(lines))]
    columns: dict[str, list[int]] = {}
    for number, title in enumerate(titles[1:]):
        stem, axis = title[:-2], title[-2:].lower()
        if axis in (".x", ".y", ".z", "_x", "_y", "_z", " x", " y", " z"):
            columns.setdefault(stem, [-1, -1, -1])["xyz".index(axis[1])] = number
    labels = [name for name, at in columns.items() if min(at) >= 0]
    if not 0 < len(labels) <= MAX_LABELS:
        raise CueError(f"{path}: no columns NAME.x, NAME.y, NAME.z")
    order = np.array([columns[name] for name in labels]).ravel()
    times = []
    with Spool(len(order)) as spool:
        for fields in csv.reader(lines):
            if not fields:
                continue
            # Short rows are padded with NaN: hidden.
            row = np.full(len(titles) - 1, np.nan, dtype=np.float32)
            given = numbers(fields[1 : len(titles)])
            row[: len(given)] = given
            spool.append(row[order])
            times.append(float(fields[0]))
        points = spool.points()
    if len(times) < 2 or times[-1] <= times[0]:
        raise CueError(f"{path}: the first column is not a time that rises")
    rate_hz = (len(times) - 1) / (times[-1] - times[0])
    return PointRecording(
        Path(path).name, "CSV", tuple(labels), "", rate_hz, times[0], len(times), (), points
    )
