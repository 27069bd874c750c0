"""C3D files of all processors and number formats, written here byte by byte."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.errors import CueError
from codec.files.c3d_points import open_c3d

INTEL, DEC, MIPS = 84, 85, 86


def floats(values: np.ndarray, processor: int) -> bytes:
    if processor == MIPS:
        return values.astype(">f4").tobytes()
    if processor == DEC:
        bits = (values.astype("<f4") * np.float32(4)).view("<u4")
        return ((bits >> 16) | (bits << 16)).astype("<u4").tobytes()
    return values.astype("<f4").tobytes()


def parameter(
    group: int, name: str, kind: int, dims: tuple[int, ...], data: bytes, order: str
) -> bytes:
    body = struct.pack("bB", kind, len(dims)) + bytes(dims) + data + b"\0"
    head = struct.pack("2b", len(name), group) + name.encode()
    return head + struct.pack(f"{order}h", len(body) + 2) + body


def c3d(
    points: np.ndarray,
    *,
    processor: int = INTEL,
    scale: float = -1.0,
    analogue: int = 0,
    claimed: int | None = None,
    long: bool = False,
) -> bytes:
    """Return a C3D file of points (T, K, 3); NaN is hidden."""
    order = ">" if processor == MIPS else "<"
    frames, count, _ = points.shape
    labels = b"".join(f"P{k}".ljust(6).encode() for k in range(count))
    one = np.ones(1)
    groups = [
        parameter(1, "LABELS", -1, (6, count), labels, order),
        parameter(1, "UNITS", -1, (2,), b"mm", order),
        parameter(1, "RATE", 4, (), floats(100 * one, processor), order),
        parameter(1, "SCALE", 4, (), floats(scale * one, processor), order),
    ]
    head = struct.pack("2b", 5, -1) + b"POINT" + struct.pack(f"{order}h", 3) + b"\0"
    if long:
        groups.append(struct.pack("2b", 5, -2) + b"TRIAL" + struct.pack(f"{order}h", 3) + b"\0")
        for name, frame in (("START", 1), ("END", claimed or frames)):
            data = struct.pack(f"{order}2H", frame & 0xFFFF, frame >> 16)
            groups.append(parameter(2, f"ACTUAL_{name}_FIELD", 2, (2,), data, order))
    section = bytes([0, 0, 1, processor]) + head + b"".join(groups) + b"\0\0"
    blocks = -(-len(section) // 512)
    section = section.ljust(512 * blocks, b"\0")
    last = min(claimed or frames, 0xFFFF)
    header = bytes([2, 0x50]) + struct.pack(f"{order}5H", count, analogue, 1, last, 0)
    header += floats(scale * one, processor) + struct.pack(f"{order}2H", 2 + blocks, 1)
    header = (header + floats(100 * one, processor)).ljust(512, b"\0")
    hidden = np.isnan(points).any(-1)
    rows = np.concatenate([np.nan_to_num(points), np.where(hidden, -1.0, 0.0)[..., None]], axis=-1)
    rows = rows.reshape(frames, -1)
    if scale > 0:
        scaled = rows / np.where(np.arange(rows.shape[1]) % 4 == 3, 1.0, scale)
        rows = np.concatenate([np.round(scaled), np.full((frames, analogue), 7)], axis=1)
        return header + section + rows.astype(f"{order}i2").tobytes()
    return (
        header
        + section
        + floats(np.concatenate([rows, np.full((frames, analogue), 7.0)], axis=1), processor)
    )


def some_points() -> np.ndarray:
    points = np.random.default_rng(1).uniform(-900, 900, size=(9, 4, 3)).round(1)
    points[3:5, 2] = np.nan
    return points


@pytest.mark.parametrize("processor", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("scale", [-1.0, 0.1])
@pytest.mark.parametrize("analogue", [0, 6])
def test_every_kind_of_number(tmp_path: Path, processor: int, scale: float, analogue: int) -> None:
    points = some_points()
    path = tmp_path / "a.c3d"
    path.write_bytes(c3d(points, processor=processor, scale=scale, analogue=analogue))
    file = open_c3d(path)
    assert (file.labels, file.unit, file.rate_hz) == (("P0", "P1", "P2", "P3"), "mm", 100.0)
    assert (file.n_frames, file.missing_frames, file.start_s) == (9, 0, 0.0)
    np.testing.assert_allclose(file.frames(0, 9), points, atol=1e-3)
    np.testing.assert_array_equal(file.frames(4, 6), file.frames(0, 9)[4:6])


def test_a_file_that_ends_early_gives_what_it_has(tmp_path: Path) -> None:
    path = tmp_path / "a.c3d"
    path.write_bytes(c3d(some_points())[:-100])
    file = open_c3d(path)
    assert (file.n_frames, file.missing_frames) == (7, 2)


def test_frames_beyond_sixteen_bits_are_counted_in_a_parameter(tmp_path: Path) -> None:
    path = tmp_path / "a.c3d"
    path.write_bytes(c3d(some_points(), claimed=70_000, long=True))
    assert open_c3d(path).missing_frames == 70_000 - 9


@pytest.mark.parametrize("content", [b"", b"P" * 600, b"\2P" + b"\0" * 700])
def test_what_is_no_c3d_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.c3d").write_bytes(content)
    with pytest.raises(CueError, match=r"x\.c3d: .*C3D"):
        open_c3d(tmp_path / "x.c3d")


@settings(max_examples=300)
@given(st.lists(st.tuples(st.integers(0, 1300), st.integers(0, 255)), max_size=12), st.data())
def test_damage_is_one_error_or_frames(
    tmp_path_factory: pytest.TempPathFactory, damage: list[tuple[int, int]], data: st.DataObject
) -> None:
    content = bytearray(c3d(some_points()))
    for at, value in damage:
        content[at % len(content)] = value
    cut = data.draw(st.integers(0, len(content)))
    path = tmp_path_factory.mktemp("c3d") / "a.c3d"
    path.write_bytes(bytes(content[: max(cut, 400)]))
    try:
        file = open_c3d(path)
    except CueError:
        return
    assert file.frames(0, file.n_frames).shape == (file.n_frames, len(file.labels), 3)


@pytest.mark.parametrize("value", [1e7, -3e38])
def test_coordinates_beyond_a_kilometre_count_as_hidden(tmp_path: Path, value: float) -> None:
    points = np.arange(30.0).reshape(5, 2, 3)
    points[2, 1, 1] = value
    path = tmp_path / "take.c3d"
    path.write_bytes(c3d(points))
    with np.errstate(over="ignore"):
        read = open_c3d(path).frames(0, 5)
    assert np.isnan(read[2, 1]).all()
    assert np.isfinite(read).sum() == 27
