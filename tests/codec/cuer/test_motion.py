import io
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.lib import format as npy

from codec.cuer.motion import Motion, MotionWriter, load_motion, save_motion
from codec.cues.score import Key, Phone, Score
from codec.errors import CueError
from codec.files.npz import read_arrays, write_arrays

SCORE = Score((Phone("p", 0.0, 0.1),), (Key(0.0, 0.1, ("p",), 1, "side"),))


def motion(frames: int = 5) -> Motion:
    params = np.arange(frames * 2, dtype=np.float32).reshape(frames, 2)
    return Motion(params, 50.0, 1.28, ("face.1", "hand.1"), "0123456789abcdef", SCORE)


def test_round_trip_is_exact_and_deterministic(tmp_path: Path) -> None:
    for name in "ab":
        save_motion(motion(), tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    again = load_motion(tmp_path / "a")
    np.testing.assert_array_equal(again.params, motion().params)
    assert (again.rate_hz, again.start_s, again.layout) == (50.0, 1.28, ("face.1", "hand.1"))
    assert (again.voice, again.score) == ("0123456789abcdef", SCORE)
    assert again.times_s[1] == pytest.approx(1.30)
    assert again.duration_s == pytest.approx(0.1)


def test_numpy_reads_what_we_write(tmp_path: Path) -> None:
    save_motion(motion(), tmp_path / "m.npz")
    with np.load(tmp_path / "m.npz", allow_pickle=False) as file:
        assert file["params"].shape == (5, 2)


@pytest.mark.parametrize(
    ("params", "rate"),
    [
        (np.zeros((3, 1)), 50),
        (np.zeros(3), 50),
        (np.full((3, 2), np.nan), 50),
        (np.zeros((3, 2)), 0),
        (np.zeros((3, 2)), float("nan")),
    ],
)
def test_refuses_nonsense(params: np.ndarray, rate: float) -> None:
    with pytest.raises(CueError):
        Motion(params, rate, 0.0, ("a", "b"), "v")


def test_every_truncation_is_refused(tmp_path: Path) -> None:
    save_motion(motion(), tmp_path / "m.npz")
    data = (tmp_path / "m.npz").read_bytes()
    for length in range(0, len(data), 7):
        (tmp_path / "cut").write_bytes(data[:length])
        with pytest.raises(CueError, match="cut: "):
            load_motion(tmp_path / "cut")


def test_every_flipped_byte_is_refused_or_harmless(tmp_path: Path) -> None:
    save_motion(motion(), tmp_path / "m.npz")
    data = bytearray((tmp_path / "m.npz").read_bytes())
    for position in range(0, len(data), 3):
        damaged = (
            bytes(data[:position]) + bytes([data[position] ^ 0x55]) + bytes(data[position + 1 :])
        )
        (tmp_path / "bad").write_bytes(damaged)
        try:
            load_motion(tmp_path / "bad")
        except CueError:
            continue


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_other_packings_than_numpy_s_are_refused(tmp_path: Path, method: int) -> None:
    """Python 3.14 unpacks more of them, each with errors of its own."""
    with zipfile.ZipFile(tmp_path / "m.npz", "w", method) as archive:
        archive.writestr("params.npy", b"\x93NUMPY")
    with pytest.raises(CueError, match=r"array params\.npy is packed in an unknown way"):
        load_motion(tmp_path / "m.npz")


def test_a_declared_terabyte_is_not_allocated(tmp_path: Path) -> None:
    header = io.BytesIO()
    npy.write_array_header_1_0(
        header, {"descr": "<f4", "fortran_order": False, "shape": (10**12, 31)}
    )
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w") as archive:
        archive.writestr("params.npy", header.getvalue())
    with pytest.raises(CueError, match="more than"):
        load_motion(tmp_path / "bomb.npz")


def test_pickles_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "objects.npz", params=np.array([{}], dtype=object))
    with pytest.raises(CueError, match="damaged or foreign"):
        read_arrays(tmp_path / "objects.npz", max_bytes=1000)


def test_a_file_of_another_kind_is_described_by_its_beginning(tmp_path: Path) -> None:
    (tmp_path / "sent.cue").write_bytes(b"CUES and so on")
    with pytest.raises(CueError, match=r"an npz archive begins with b'PK', this with b'CU'"):
        load_motion(tmp_path / "sent.cue")


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    save_motion(motion(), tmp_path / "m.npz")
    before = (tmp_path / "m.npz").read_bytes()
    with pytest.raises(ValueError, match="allow_pickle"):
        write_arrays(tmp_path / "m.npz", {"x": np.array([{}], dtype=object)})
    assert (tmp_path / "m.npz").read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m.npz"]


def test_missing_file_and_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "none.npz", tmp_path):
        with pytest.raises(CueError, match=str(path)):
            load_motion(path)


def test_a_motion_written_in_parts_is_the_motion_written_at_once(tmp_path: Path) -> None:
    whole = motion()
    save_motion(whole, tmp_path / "whole.npz")
    with MotionWriter(tmp_path / "parts.npz") as writer:
        for first in range(0, len(whole.params), 3):
            start_s = whole.start_s + first / whole.rate_hz
            score = whole.score if first == 0 else Score((), ())
            params = whole.params[first : first + 3]
            writer.append(replace(whole, params=params, start_s=start_s, score=score))
    assert (tmp_path / "parts.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()


def test_parts_of_a_motion_must_follow_each_other(tmp_path: Path) -> None:
    part = motion()
    with MotionWriter(tmp_path / "m.npz") as writer:
        writer.append(part)
        with pytest.raises(CueError, match="starts at"):
            writer.append(replace(part, start_s=part.start_s + 100))
        with pytest.raises(CueError, match="differ in rate, layout or voice"):
            writer.append(replace(part, voice="another"))
    (tmp_path / "m.npz").unlink()
    with pytest.raises(CueError, match="without frames"), MotionWriter(tmp_path / "m.npz"):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", [1001.0, -1e6, 3e38])
def test_parameters_beyond_any_pose_are_damage(value: float) -> None:
    with pytest.raises(CueError, match=r"motion holds parameters up to .* the limit is 1000"):
        replace(motion(), params=np.full((5, 2), value, np.float32))


def test_a_damaged_motion_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "m.npz"
    save_motion(motion(), path)
    good = dict(np.load(path))
    for name, value in (("params", good["params"] + np.float32(3e38)), ("start_s", 1e300)):
        np.savez(path, **(good | {name: value}))
        with pytest.raises(CueError, match=r"^\S*m\.npz: motion (holds|has rate)"):
            load_motion(path)


def hostile(path: Path, member: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("params.npy", member)
    return path


@pytest.mark.parametrize(
    ("shape", "dtype"), [((10**20,), "<U0"), ((0, 10**20), "<f4"), ((10**20, 0), "<f4"),
                         ((10**9,), "<U0"), ((10**18, 10**18), "|V0")],
)  # fmt: skip
def test_shapes_beyond_any_memory(tmp_path: Path, shape: tuple[int, ...], dtype: str) -> None:
    header = io.BytesIO()
    npy.write_array_header_1_0(header, {"descr": dtype, "fortran_order": False, "shape": shape})
    path = hostile(tmp_path / "m.npz", header.getvalue())
    with pytest.raises(CueError, match=r"damaged or foreign file|arrays take"):
        read_arrays(path, max_bytes=4_000_000)


def test_a_header_of_a_gigabyte_is_not_read(tmp_path: Path) -> None:
    """Version 2 of the header counts to 4 GB, and blanks pack well."""
    length = 300_000_000
    member = npy.magic(2, 0) + length.to_bytes(4, "little") + b" " * length
    path = hostile(tmp_path / "m.npz", member)
    del member
    tracemalloc.start()
    try:
        with pytest.raises(CueError, match="has a header of 300000000 bytes"):
            read_arrays(path, max_bytes=4_000_000)
        assert tracemalloc.get_traced_memory()[1] < 8_000_000
    finally:
        tracemalloc.stop()
