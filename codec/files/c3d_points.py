"""Reading the points of C3D files of any maker, frame by frame, in constant memory.

A C3D file is a header block, a section of parameters and the frames, in blocks of 512 bytes;
numbers are those of Intel, DEC or MIPS processors, points are floating or scaled integers, and
analogue samples stand between them, which are skipped. Source: C3D format user guide (Motion Lab
Systems 2021). Whatever a damaged file claims, no more is read than it holds.
"""

import os
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

_BLOCK = 512
"""Bytes of a block of the format."""

_MAGIC = 0x50
"""Second byte of every C3D file."""

_ORDERS = {84: "<", 85: "<", 86: ">"}
"""Byte order by processor: Intel, DEC (whose floats are special), MIPS."""

_DEC = 85
"""Processor number that means VAX floating point."""

_MOST_POINTS = 10_000
"""Points of a file at most: far more than laboratories record; more is damage."""

_FARTHEST = 1e6
"""Coordinates at most, in the file's unit: a kilometre in mm. What lies beyond is damage and counts
as hidden: its squares would drown all others."""

_SIXTEEN_BITS = 0xFFFF
"""Largest number of the header's 16-bit fields."""

Parameters = dict[str, Any]


@dataclass(frozen=True, slots=True)
class C3dPoints:
    """The points of one file.

    Attributes
    ----------
    labels : tuple of str
        As they stand in the file, without blanks around them; points without a label are ``*n``.
    unit : str
        As it stands in the file, in small letters; may be empty.
    rate_hz : float
    start_s : float
        Time of the first frame.
    n_frames : int
        Frames that the file holds.
    missing_frames : int
        Frames that it claims and does not hold.
    """

    labels: tuple[str, ...]
    unit: str
    rate_hz: float
    start_s: float
    n_frames: int
    missing_frames: int
    _path: str = field(repr=False)
    _offset: int = field(repr=False)
    _dtype: "np.dtype[Any]" = field(repr=False)
    _words: int = field(repr=False)
    _scale: float = field(repr=False)
    _dec: bool = field(repr=False)

    def frames(self, begin: int, end: int) -> NDArray[np.float32]:
        """Return the points of some frames in the file's unit, NaN where hidden.

        Parameters
        ----------
        begin, end : int
            As in a slice.

        Returns
        -------
        ndarray of float32, shape (n, number of labels, 3)
        """
        begin, end = max(begin, 0), min(end, self.n_frames)
        raw = np.fromfile(
            self._path,
            self._dtype,
            max(end - begin, 0) * self._words,
            offset=self._offset + begin * self._words * self._dtype.itemsize,
        )
        raw = raw.reshape(-1, self._words)[:, : 4 * len(self.labels)]
        if raw.dtype.kind == "i":
            values = raw.astype(np.float32).reshape(len(raw), -1, 4)
            with np.errstate(over="ignore"):  # too far, below
                points = values[..., :3] * np.float32(self._scale)
            hidden = values[..., 3] < 0
        else:
            read = _from_dec(raw) if self._dec else raw.astype(np.float32)
            floats = read.reshape(len(raw), -1, 4)
            points, hidden = floats[..., :3].copy(), floats[..., 3] < 0
        far = ~(np.abs(points) <= np.float32(_FARTHEST)).all(-1)
        # Some systems leave the origin where a marker is hidden, and say no more about it.
        points[hidden | far | (points == 0).all(-1)] = np.nan
        return np.asarray(points, dtype=np.float32)


def open_c3d(path: str | os.PathLike[str]) -> C3dPoints:
    """Return the points of a C3D file; the frames stay in the file until they are asked for.

    Raises
    ------
    CueError
        If the file is missing, no C3D, or holds no points.
    """
    try:
        size = Path(path).stat().st_size
        with open(path, "rb") as file:
            header = file.read(_BLOCK)
            if len(header) < _BLOCK or header[1] != _MAGIC:
                raise CueError(f"{path}: not a C3D file")
            file.seek(max(header[0] - 1, 0) * _BLOCK)
            section = file.read(256 * _BLOCK)
        return _open(path, size, header, section)
    except (struct.error, IndexError, ValueError, OverflowError) as error:
        raise CueError(f"{path}: damaged C3D file: {error}") from error
    except OSError as error:
        raise CueError(f"{path}: not a C3D file: {error.strerror}") from error


def _open(path: str | os.PathLike[str], size: int, header: bytes, section: bytes) -> C3dPoints:
    processor = section[3]
    if processor not in _ORDERS:
        raise CueError(f"{path}: damaged C3D file: processor {processor} is not within 84..86")
    order, dec = _ORDERS[processor], processor == _DEC
    parameters = read_parameters(section, order, dec)
    point = parameters.get("POINT", {})
    # Header words 2-5: points, analogue samples per frame, first and last frame; 9: the data's
    # block. Rate and scale of the parameters are preferred: the header's are often stale.
    points, analogue, first, last = struct.unpack(f"{order}4H", header[2:10])
    data_start, _ = struct.unpack(f"{order}2H", header[16:20])
    scale, rate_hz = _float(header[12:16], order, dec), _float(header[20:24], order, dec)
    rate_hz = float(_first(point.get("RATE"), rate_hz))
    scale = float(_first(point.get("SCALE"), scale))
    if not 0 < points <= _MOST_POINTS:
        raise CueError(f"{path}: {points} points in a C3D file, not within 1..{_MOST_POINTS}")
    if not 0 < rate_hz < np.inf:
        raise CueError(f"{path}: rate {rate_hz} Hz is not positive")
    if not np.isfinite(scale):
        raise CueError(f"{path}: damaged C3D file: scale {scale}")
    words = 4 * points + analogue
    # A positive scale means integers to be multiplied by it, a negative one floating point numbers.
    kind = "i2" if scale > 0 else "u4" if dec else "f4"
    offset = (max(data_start, 1) - 1) * _BLOCK
    held = max(size - offset, 0) // (words * np.dtype(kind).itemsize)
    claimed = _claimed_frames(parameters, first, last, held)
    if not (held and claimed):
        raise CueError(f"{path}: a C3D file without frames")
    n_frames = min(held, claimed)
    dtype = np.dtype(f"{order}{kind}")
    unit = str(_first(point.get("UNITS"), "")).strip().lower()
    return C3dPoints(
        _labels(point, points), unit, rate_hz, max(first - 1, 0) / rate_hz, n_frames,
        claimed - n_frames, str(path), offset, dtype, words, scale, dec,
    )  # fmt: skip


def _claimed_frames(parameters: Parameters, first: int, last: int, held: int) -> int:
    """Return the number of frames that a file claims; headers count to 65535 only."""
    trial = parameters.get("TRIAL", {})
    begin, end = (trial.get(f"ACTUAL_{name}_FIELD") for name in ("START", "END"))
    if _is_long(begin) and _is_long(end):
        low, high = (
            np.asarray(v).ravel()[:2].astype(np.int64) & _SIXTEEN_BITS for v in (begin, end)
        )
        span = int(high[0] + (high[1] << 16)) - int(low[0] + (low[1] << 16)) + 1
        if span > 0:
            return span
    if last >= _SIXTEEN_BITS:
        return held
    return max(last - first + 1, 0)


def _is_long(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind == "i" and value.size >= 2


def _labels(point: Parameters, count: int) -> tuple[str, ...]:
    names: list[str] = []
    for key in ("LABELS", "LABELS2", "LABELS3", "LABELS4"):
        value = point.get(key, [])
        names += value if isinstance(value, list) else []
    names = [name.strip() for name in names[:count]]
    names += [""] * (count - len(names))
    return tuple(name or f"*{number}" for number, name in enumerate(names, start=1))


def _first(value: Any, other: Any) -> Any:
    """Return the first element of a parameter, or `other` if there is none."""
    if isinstance(value, list):
        return value[0] if value else other
    if isinstance(value, np.ndarray) and value.size:
        return value.ravel()[0]
    return other


def read_parameters(section: bytes, order: str, dec: bool) -> dict[str, Parameters]:
    """Return the parameters of every group: lists of str, or arrays of numbers.

    Parameters
    ----------
    section : bytes
        From the section's first block on.
    order : str
        Byte order, as for `struct`.
    dec : bool
        Whether floating numbers are those of DEC.

    Raises
    ------
    ValueError, IndexError, struct.error
        If the section is damaged.
    """
    names: dict[int, str] = {}
    found: list[tuple[int, str, Any]] = []
    at = 4
    while at + 2 < len(section):
        # A group or a parameter: length of its name (negative: locked), number of the group
        # (negative: this names the group), the name, and the distance to the next entry.
        length, group = struct.unpack("2b", section[at : at + 2])
        if length == 0 or group == 0:
            break
        after = at + 2 + abs(length)
        name = section[at + 2 : after].decode("latin-1").upper()
        (step,) = struct.unpack(f"{order}h", section[after : after + 2])
        if group < 0:
            names[-group] = name
        else:
            found.append((group, name, _value(section, after + 2, order, dec)))
        if step <= 0:
            break
        at = after + step
    groups: dict[str, Parameters] = {}
    for group, name, value in found:
        groups.setdefault(names.get(group, ""), {})[name] = value
    return groups


def _value(section: bytes, at: int, order: str, dec: bool) -> Any:
    """Return a parameter: a list of str, or an array of numbers in order of the file."""
    kind, n_dims = struct.unpack("bB", section[at : at + 2])
    dims = tuple(section[at + 2 : at + 2 + n_dims])
    at += 2 + n_dims
    count = int(np.prod(dims, dtype=np.int64))
    size = abs(kind)
    if size not in (1, 2, 4):
        raise ValueError(f"parameter of unknown type {kind}")
    data = section[at : at + count * size]
    if len(data) < count * size:
        raise ValueError("a parameter ends after its section")
    if kind == -1:
        width = dims[0] if dims else 1
        return [data[i : i + width].decode("latin-1") for i in range(0, len(data), max(width, 1))]
    if kind == 4 and dec:
        return _from_dec(np.frombuffer(data, "<u4"))
    return np.frombuffer(data, {1: "u1", 2: f"{order}i2", 4: f"{order}f4"}[size]).copy()


def _float(data: bytes, order: str, dec: bool) -> float:
    if dec:
        return float(_from_dec(np.frombuffer(data, "<u4"))[0])
    return float(struct.unpack(f"{order}f", data)[0])


def _from_dec(words: NDArray[Any]) -> NDArray[np.float32]:
    """Return IEEE values of DEC's F floats: halves swapped, exponent greater by 2.

    Examples
    --------
    >>> _from_dec(np.array([0x00004080], dtype="<u4")).tolist()
    [1.0]
    """
    bits = words.astype(np.uint32)
    swapped = (bits >> np.uint32(16)) | (bits << np.uint32(16))
    with np.errstate(all="ignore"):  # damage can be any number, or none
        return np.asarray(swapped.view(np.float32) / np.float32(4.0))
