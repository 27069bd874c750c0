"""Tables of landmarks: a column per coordinate, or a row per point.

Wide tables have columns ``hand_x0``, ``lip_y17``, ``face_z454`` (any part, coordinate and number,
also as ``x_right_hand_3``) beside ``frame`` or ``frame_number``, or ``time``. Long tables have the
columns ``frame`` (or ``time``), ``part`` (or ``type``), ``index`` (or ``landmark_index``), ``x``,
``y`` and, if there is a depth, ``z``. Coordinates are in parts of the picture's width and height,
or in pixels; y points down. Lips, mouth and face are numbered alike, as in MediaPipe's face mesh.
"""

import csv
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from synth.capture.sources.landmark_maps import (
    FACE_LANDMARKS,
    MOST_FACE_LANDMARKS,
    N_HAND_LANDMARKS,
)
from synth.capture.sources.recording import numbers, text_lines
from synth.capture.sources.resample import MOST_FRAMES

FloatArray = NDArray[np.float64]

_WIDE = (
    re.compile(r"^(?P<part>[a-z_]+?)_(?P<axis>[xyz])_?(?P<index>\d+)$"),
    re.compile(r"^(?P<axis>[xyz])_(?P<part>[a-z_]+?)_(?P<index>\d+)$"),
)
_PARTS = {
    "face": "face", "lip": "face", "lips": "face", "mouth": "face", "face_landmarks": "face",
    "hand": "hand", "right_hand": "right_hand", "left_hand": "left_hand",
    "hand_right": "right_hand", "hand_left": "left_hand", "righthand": "right_hand",
    "lefthand": "left_hand",
}  # fmt: skip
_FRAME = ("frame", "frame_number", "frame_id", "frame_index", "frame_idx")
_TIME = ("time", "time_s", "t", "seconds", "timestamp_s")
_MILLIS = ("timestamp_ms", "time_ms", "timestamp")
_PART, _INDEX = ("part", "type", "landmark_type"), ("index", "landmark_index", "landmark", "id")
HANDS = ("hand", "right_hand", "left_hand")

USUAL_RATE_HZ = 30.0
"""Frames per second of a table that numbers its frames and states no rate: that of most cameras."""

_FARTHEST = 1e5
"""Coordinate beyond which a landmark is damage, in pixels or picture widths."""

_PIXELS = 4.0
"""Coordinates beyond this are pixels: parts of the picture are about 0 to 1."""

_SLOT = {number: slot for slot, number in enumerate(FACE_LANDMARKS)}


@dataclass(frozen=True, slots=True)
class LandmarkTable:
    """Landmarks of a film, frame by frame.

    Attributes
    ----------
    times : ndarray of float64, shape (T,)
        Seconds from the first row on, rising.
    face : ndarray of float64, shape (T, L, 3)
        Landmarks `synth.capture.sources.landmark_maps.FACE_LANDMARKS`; NaN where not given.
    hands : dict of str to ndarray of float64, shape (T, 21, 3)
        By name, of `HANDS`; NaN where not given.
    timed : bool
        Whether times stood in the table.
    """

    times: FloatArray
    face: FloatArray
    hands: dict[str, FloatArray]
    timed: bool

    @property
    def in_pixels(self) -> bool:
        """Whether coordinates are pixels, not parts of the picture's width and height."""
        known = np.abs(self.face[..., :2])
        return bool((known[np.isfinite(known)] > _PIXELS).any())


def is_landmark_table(titles: set[str]) -> bool:
    """Return whether the titles of a table, in small letters, are those of landmarks."""
    if any(match and match["part"] in _PARTS for match in map(_wide, titles)):
        return True
    return all(set(names) & titles for names in (_PART, _INDEX)) and {"x", "y"} <= titles


def read_landmarks(path: Path, *, rate_hz: float | None = None) -> LandmarkTable:
    """Read a table of landmarks.

    Parameters
    ----------
    path : Path
    rate_hz : float, optional
        Of the frames that the table numbers; default: `USUAL_RATE_HZ`.

    Raises
    ------
    CueError
        If the table is malformed, or holds nothing that is known.
    """
    try:
        clock, read = _opened(path, text_lines(path), rate_hz)
        return _gathered(path, clock, read)
    except (csv.Error, IndexError, ValueError) as error:
        raise CueError(f"{path}: malformed table: {error}") from error


def landmark_frames(
    lines: Iterable[str], *, name: str, rate_hz: float | None = None
) -> Iterator[LandmarkTable]:
    """Yield the frames of a table as its lines come, each as a table of one frame.

    Parameters
    ----------
    lines : iterable of str
        Titles first. A frame is known when the next one begins.
    name : str
        Of the source, for messages.
    rate_hz : float, optional
        As for `read_landmarks`.

    Raises
    ------
    CueError
        If the table is malformed.
    """
    path = Path(name)
    try:
        clock, read = _opened(path, lines, rate_hz)
        for time_s, frame in _frames(clock, read):
            yield LandmarkTable(
                np.array([time_s]),
                _stacked([frame], "face", len(FACE_LANDMARKS)),
                {n: _stacked([frame], n, N_HAND_LANDMARKS) for n in HANDS if n in frame},
                clock.timed,
            )
    except (csv.Error, IndexError, ValueError) as error:
        raise CueError(f"{path}: malformed table: {error}") from error


def _opened(
    path: Path, lines: Iterable[str], rate_hz: float | None
) -> "tuple[_RowClock, Iterator[tuple[list[str], list[Point]]]]":
    """Return the clock of a table, and its rows as they come."""
    rows = csv.reader(lines)
    titles = [title.strip().strip('"').casefold() for title in next(rows, [])]
    clock = _RowClock(path, titles, rate_hz or USUAL_RATE_HZ)
    wide = {n: match for n, title in enumerate(titles) if (match := _wide(title))}
    return clock, _read_wide(wide, rows) if wide else _read_long(path, titles, rows)


def _wide(title: str) -> "re.Match[str] | None":
    return next((m for pattern in _WIDE if (m := pattern.match(title))), None)


class _RowClock:
    """The column of a row's time."""

    def __init__(self, path: Path, titles: list[str], rate_hz: float) -> None:
        self.timed = True
        for names, unit in ((_TIME, 1.0), (_MILLIS, 1e-3), (_FRAME, 1.0 / rate_hz)):
            found = [n for n, title in enumerate(titles) if title in names]
            if found:
                self._column, self._unit = found[0], unit
                self.timed = names is not _FRAME
                return
        raise CueError(f"{path}: a table of landmarks without a column frame or time")

    def seconds(self, fields: list[str]) -> float:
        """Return the time of a row, NaN if it has none."""
        return self._unit * float(numbers([fields[self._column]])[0])


Point = tuple[str, int, int, float]


def _read_wide(
    columns: "dict[int, re.Match[str]]", rows: Iterator[list[str]]
) -> Iterator[tuple[list[str], list[Point]]]:
    """Yield the fields of each row and its coordinates: part, number, axis and value."""
    places = [
        (n, _PARTS[m["part"]], int(m["index"]), "xyz".index(m["axis"]))
        for n, m in columns.items()
        if m["part"] in _PARTS
    ]
    for fields in rows:
        if fields:
            values = numbers([fields[n] if n < len(fields) else "" for n, *_ in places])
            yield (
                fields,
                [
                    (part, index, axis, float(value))
                    for (_, part, index, axis), value in zip(places, values, strict=True)
                    if np.isfinite(value)
                ],
            )


def _read_long(
    path: Path, titles: list[str], rows: Iterator[list[str]]
) -> Iterator[tuple[list[str], list[Point]]]:
    at = [
        next((n for n, title in enumerate(titles) if title in names), -1)
        for names in (_PART, _INDEX, ("x",), ("y",), ("z",))
    ]
    if min(at[:4]) < 0:
        raise CueError(f"{path}: a table of landmarks without the columns part, index, x, y")
    for fields in rows:
        if len(fields) <= max(at):
            continue
        part = _PARTS.get(fields[at[0]].strip().strip('"').casefold())
        index = numbers([fields[at[1]]])[0]
        if part is None or not 0 <= index < MOST_FACE_LANDMARKS:
            # A frame that shows nothing known is a frame all the same.
            yield fields, []
            continue
        values = numbers([fields[n] if n >= 0 else "nan" for n in at[2:]])
        yield (
            fields,
            [
                (part, int(index), axis, float(value))
                for axis, value in enumerate(values)
                if np.isfinite(value)
            ],
        )


def _gathered(
    path: Path, clock: _RowClock, read: Iterator[tuple[list[str], list[Point]]]
) -> LandmarkTable:
    """Return the table of coordinates that come row by row, one or more rows a frame."""
    times: list[float] = []
    frames: list[dict[str, FloatArray]] = []
    for time_s, frame in _frames(clock, read):
        if len(times) >= MOST_FRAMES:
            raise CueError(f"{path}: more than {MOST_FRAMES} frames")
        times.append(time_s)
        frames.append(frame)
    if len(times) < 2:
        raise CueError(f"{path}: {len(times)} frames of landmarks, 2 needed")
    names = {name for frame in frames for name in frame}
    if not names:
        raise CueError(f"{path}: no landmarks of face or hand")
    return LandmarkTable(
        np.array(times) - times[0],
        _stacked(frames, "face", len(FACE_LANDMARKS)),
        {n: _stacked(frames, n, N_HAND_LANDMARKS) for n in HANDS if n in names},
        clock.timed,
    )


def _frames(
    clock: _RowClock, read: Iterator[tuple[list[str], list[Point]]]
) -> Iterator[tuple[float, dict[str, FloatArray]]]:
    """Yield times, rising, and the parts that each frame shows."""
    now, frame = -np.inf, dict[str, FloatArray]()
    for fields, points in read:
        time_s = clock.seconds(fields)
        if not np.isfinite(time_s) or time_s < now:
            continue
        if time_s > now:
            if np.isfinite(now):
                yield now, frame
            now, frame = time_s, {}
        for part, index, axis, value in points:
            _put(frame, part, index, axis, value)
    if np.isfinite(now):
        yield now, frame


def _put(frame: dict[str, FloatArray], part: str, index: int, axis: int, value: float) -> None:
    slot = _SLOT.get(index) if part == "face" else index
    size = len(FACE_LANDMARKS) if part == "face" else N_HAND_LANDMARKS
    if slot is None or slot >= size:
        return
    if part not in frame:
        frame[part] = np.full((size, 3), np.nan)
    frame[part][slot, axis] = value


def _stacked(frames: list[dict[str, FloatArray]], part: str, size: int) -> FloatArray:
    """Return a part over all frames; points without x or y are not given, a missing z is 0."""
    out = np.full((len(frames), size, 3), np.nan)
    for number, frame in enumerate(frames):
        if part in frame:
            out[number] = frame[part]
    out[~(np.abs(out[..., :2]) < _FARTHEST).all(-1)] = np.nan
    given = np.isfinite(out[..., 0])
    deep = np.where(np.abs(out[..., 2]) < _FARTHEST, out[..., 2], 0.0)
    out[..., 2] = np.where(given, deep, np.nan)
    return out
