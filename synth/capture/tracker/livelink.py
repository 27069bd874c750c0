"""Live Link Face tables: 52 face weights and rotations of the head become face and head motion.

The weights move the face of the virtual cuer's body, whose units bear ARKit's names; the voice's
face model then explains her markers. Eyes and tongue have no markers and are left out. The table
has nothing of a hand: it rests.
"""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import FACE_MARKERS, N_FACE
from codec.cuer.models.inversion import invert_face
from codec.cuer.voice import Voice
from codec.errors import CueError
from synth.capture.cues.finish import finish
from synth.capture.options import Captured, CaptureOptions
from synth.capture.points.solve import resting
from synth.capture.points.speaker import Speaker
from synth.capture.sources.recording import numbers, text_lines
from synth.capture.sources.resample import evenly
from synth.motion.body.anatomy import IDENTITIES
from synth.motion.body.body import Body, load_body

FloatArray = NDArray[np.float64]

_TIME_CODE = re.compile(r"^\s*(\d+):(\d+):(\d+)[:;](\d+(?:\.\d+)?)")

_BASES = (24, 25, 30, 48, 50, 60, 120, 1000)
"""Frames per second of the time codes that occur."""

_DAY_S = 86_400.0
"""Seconds of a day, after which time codes begin anew."""

_TURNS = ("headyaw", "headpitch", "headroll")

_MOST_WEIGHT = 1.5
"""Largest weight of a face unit: trackers overshoot 1 by little."""

_MOST_TURN_RAD = 1.75
"""Heads do not turn farther: greater numbers are degrees."""

_PIECE = 4096
"""Frames that are solved at once, for constant memory."""

_LEAST_UNITS = 3
"""Face units that a table must have to be one."""

_HANDLESS = "the table shows no hand: it rests"


@dataclass(frozen=True, slots=True)
class FaceTable:
    """A table of face weights at a steady rate.

    Attributes
    ----------
    units : tuple of str
        Names as ARKit writes them, first letter small.
    weights : ndarray of float64, shape (T, U)
    turns : ndarray of float64, shape (T, 3)
        Yaw, pitch and roll of the head, radians.
    rate_hz : float
    notes : tuple of str
    """

    units: tuple[str, ...]
    weights: FloatArray
    turns: FloatArray
    rate_hz: float
    notes: tuple[str, ...]


def capture_live_link(path: Path, voice: Voice, options: CaptureOptions) -> Captured:
    """Return the motion of a Live Link Face table; time 0 is its first row.

    Raises
    ------
    CueError
        If the table is malformed.
    """
    table = read_live_link(path)
    body = load_body(voice.name if voice.name in IDENTITIES else "claire")
    params = np.tile(resting(Speaker(voice, voice.face, voice.hand)), (len(table.weights), 1))
    errors = np.zeros(N_FACE)
    # The blend shapes move a body's face; the voice's model is then inverted on its markers.
    for begin in range(0, len(params), _PIECE):
        part = slice(begin, begin + _PIECE)
        markers = _face_of(body, table, part)
        seen = np.ones(markers.shape[:2], dtype=bool)
        found = invert_face(voice.face, markers, seen)
        errors += np.linalg.norm(voice.face.reconstruct(found) - markers, axis=-1).sum(0)
        params[part, voice.face_columns] = found
        options.progress(len(markers) / table.rate_hz)
    report = {
        "input": {
            "file": path.name,
            "kind": "Live Link Face",
            "frames": len(params),
            "rate_hz": round(table.rate_hz, 4),
            "duration_s": round(len(params) / table.rate_hz, 3),
            "labels": len(table.units),
        },
        "residual_mm": {"face": round(float(errors.sum()) / (len(FACE_MARKERS) * len(params)), 3)},
        "notes": [*table.notes, _HANDLESS],
    }
    return finish(voice, params, table.rate_hz, 0.0, options, report, has_hand=False)


def _face_of(body: Body, table: FaceTable, part: slice) -> FloatArray:
    """Return the markers of the body's face for some rows, shape (n, 63, 3), mm."""
    weights = np.zeros((len(table.weights[part]), len(body.unit_names)))
    for number, name in enumerate(table.units):
        if name in body.unit_names:
            weights[:, body.unit_names.index(name)] = table.weights[part, number]
    yaw, pitch, roll = table.turns[part].T
    head = np.zeros((len(weights), 6))
    head[:, 0], head[:, 1], head[:, 2] = -pitch, yaw, -roll
    return body.face(weights, head)


def read_live_link(path: Path) -> FaceTable:
    """Read a table as Live Link Face writes it.

    Rows without a time code, or with one that does not rise, are left out; weights that are no
    numbers keep the row before.

    Raises
    ------
    CueError
        If the file is no such table, or holds fewer than two rows with rising time.
    """
    lines = text_lines(path)
    try:
        rows = csv.reader(lines)
        titles = [title.strip().casefold() for title in next(rows, [])]
        if "timecode" not in titles:
            raise CueError(f"{path}: not a Live Link Face table: no column Timecode")
        codes, values = [], []
        for row in rows:
            match = _TIME_CODE.match(row[titles.index("timecode")]) if len(row) > 1 else None
            if match:
                codes.append([float(part) for part in match.groups()])
                given = numbers(row[: len(titles)])
                padded = np.full(len(titles), np.nan, dtype=np.float32)
                padded[: len(given)] = given
                values.append(padded)
    except (csv.Error, IndexError) as error:
        raise CueError(f"{path}: malformed table: {error}") from error
    if len(codes) < 2:
        raise CueError(f"{path}: {len(codes)} rows with a time code, 2 needed")
    table, notes = _held(np.array(values, dtype=np.float64))
    known = {name.casefold(): name for name in _unit_names()}
    columns = [n for n, title in enumerate(titles) if title in known]
    if len(columns) < _LEAST_UNITS:
        raise CueError(f"{path}: not a Live Link Face table: {len(columns)} face weights")
    turns = np.zeros((len(table), 3))
    for number, name in enumerate(_TURNS):
        if name in titles:
            turns[:, number] = table[:, titles.index(name)]
    # Live Link writes radians; numbers beyond them are degrees of another program.
    if np.abs(turns).max() > _MOST_TURN_RAD:
        turns = np.radians(turns)
        notes.append("the head's rotations are taken for degrees")
    weights = np.clip(table[:, columns], 0.0, _MOST_WEIGHT)
    times = _seconds(np.array(codes))
    both, rate_hz = evenly(times, np.concatenate([weights, turns], axis=1), name=str(path))
    units = tuple(known[titles[n]] for n in columns)
    return FaceTable(
        units,
        both[:, : len(units)],
        np.clip(both[:, len(units) :], -np.pi, np.pi),
        rate_hz,
        tuple(notes),
    )


def _unit_names() -> tuple[str, ...]:
    return load_body("claire").unit_names


def _held(table: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return the table with holes filled from the row before, the first from zeros."""
    bad = ~np.isfinite(table)
    empty = bad.all(0)
    holes = int((bad & ~empty).any(1).sum())
    last = np.where(bad, 0, np.arange(len(table))[:, None])
    np.maximum.accumulate(last, axis=0, out=last)
    filled = np.nan_to_num(np.take_along_axis(table, last, axis=0), posinf=0.0, neginf=0.0)
    return filled, [f"{holes} rows with missing numbers keep those before"] if holes else []


def _seconds(codes: FloatArray) -> FloatArray:
    """Return seconds of time codes (hours, minutes, seconds, frames), shape (T,).

    The frames' base is the least usual one above all of them that holds the rows of a second;
    some programs write milliseconds there. Midnight is passed.

    Examples
    --------
    >>> _seconds(np.array([[23, 59, 59, 30.0], [23, 59, 59, 57], [0, 0, 0, 0]])).tolist()
    [86399.5, 86399.95, 86400.0]
    """
    base = next((b for b in _BASES if codes[:, 3].max() < b), int(codes[:, 3].max()) + 1)
    whole = codes[:, :3] @ [3600.0, 60.0, 1.0]
    _, rows = np.unique(whole, return_counts=True)
    base = max(base, next((b for b in _BASES if rows.max() <= b), base))
    times = whole + codes[:, 3] / base
    back = np.concatenate([[0.0], np.diff(times) < -0.5 * _DAY_S]).cumsum()
    return np.asarray(times + _DAY_S * back)
