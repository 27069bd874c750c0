"""Outputs appear whole or not at all, and what is no file stays what it is."""

import os
import stat
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from codec.errors import CueError
from codec.files.npz import read_arrays, write_arrays
from codec.files.whole import folder_beside, whole_file


@pytest.fixture(params=[0o022, 0o077, 0o027])
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield int(request.param)
    os.umask(before)


def test_modes_are_the_umask_s_or_those_of_before(tmp_path: Path, umask: int) -> None:
    new, old = tmp_path / "new.npz", tmp_path / "old.npz"
    old.touch()
    old.chmod(0o604)
    for path in (new, old):
        write_arrays(path, {"x": np.arange(3)})
    assert stat.S_IMODE(new.stat().st_mode) == 0o666 & ~umask
    assert stat.S_IMODE(old.stat().st_mode) == 0o604
    with whole_file(tmp_path / "x") as temporary:
        assert not temporary.stat().st_mode & 0o022


def test_a_device_stays_one() -> None:
    before = Path("/dev/null").stat()
    write_arrays("/dev/null", {"x": np.arange(3)})
    after = Path("/dev/null").stat()
    assert stat.S_ISCHR(after.st_mode)
    assert (before.st_rdev, before.st_ino) == (after.st_rdev, after.st_ino)
    assert folder_beside("/dev/null") != Path("/dev")


def test_a_named_pipe_gets_the_bytes(tmp_path: Path) -> None:
    pipe, read = tmp_path / "pipe", tmp_path / "read.npz"
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.write_bytes(pipe.read_bytes()))
    reader.start()
    write_arrays(pipe, {"x": np.arange(3)})
    reader.join(10)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert read_arrays(read, max_bytes=1000)["x"].tolist() == [0, 1, 2]


@pytest.mark.parametrize("there", [False, True])
def test_a_symbolic_link_stays_one(tmp_path: Path, there: bool) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    link = tmp_path / "link"
    link.symlink_to(folder / "target")
    if there:
        (folder / "target").write_text("old")
    with whole_file(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink()
    assert (folder / "target").read_text() == "new"
    assert [p.name for p in folder.iterdir()] == ["target"]


def test_a_link_that_turns_round_is_an_error(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(link)
    with pytest.raises(CueError, match="cannot write"), whole_file(link):
        pass


def interrupted(path: Path) -> None:
    path.write_text("half")
    raise KeyboardInterrupt


def test_nothing_stays_after_a_failure(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), whole_file(tmp_path / "a.txt") as temporary:
        interrupted(temporary)
    assert list(tmp_path.iterdir()) == []
