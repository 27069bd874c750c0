"""Compiled code where nothing can be written, and where others could write."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from codec.errors import CueError
from cuecast.command import cache
from cuecast.command.cache import prepare_cache

ROOT = Path(__file__).parents[3]
PACKAGES = ("codec", "synth", "watermark", "receiver", "cuecast")


def test_others_must_not_write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(cache.VARIABLE, "")
    monkeypatch.setattr(cache, "_tell_numba", lambda folder: None)
    shared = tmp_path / "shared"
    shared.mkdir()
    for mode in (0o777, 0o770, 0o1777):
        shared.chmod(mode)
        with pytest.raises(CueError, match="others can write there"):
            prepare_cache(str(shared))
    (tmp_path / "file").touch()
    with pytest.raises(CueError, match="cannot keep compiled code"):
        prepare_cache(str(tmp_path / "file" / "inside"))
    prepare_cache(str(tmp_path / "own"))
    assert os.environ[cache.VARIABLE] == str(tmp_path / "own")
    assert (tmp_path / "own").stat().st_mode & 0o777 == 0o700


@pytest.mark.slow
@pytest.mark.parametrize("told", [False, True])
def test_a_read_only_installation_without_a_home(tmp_path: Path, told: bool) -> None:
    """A verb that compiles, from sources beside which nothing can be made."""
    tree = tmp_path / "tree"
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tree / package, ignore=shutil.ignore_patterns("*.pyc"))
    shutil.copytree(ROOT / "spec" / "data", tree / "spec" / "data")
    for folder in [p for p in tree.rglob("__pycache__") if p.is_dir()]:
        shutil.rmtree(folder)
    for folder in [p.parent for p in tree.rglob("*.py")]:
        (folder / "__pycache__").touch(exist_ok=True)  # in the way, also of root
    (tmp_path / "home").touch()
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA", "XDG"))}
    environment = clean | {"HOME": str(tmp_path / "home" / "none"), "PYTHONDONTWRITEBYTECODE": "1"}
    option = ["--cache", str(tmp_path / "kept")] if told else []
    made = subprocess.run(
        [sys.executable, "-m", "cuecast", "synth", "Bonjour.", "-o", str(tmp_path / "m.npz"),
         *option],
        cwd=tree, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    assert ("compiled code can be kept nowhere" in made.stderr) is not told
    assert made.stderr.count("compiled code") == (0 if told else 1)
    encoded = subprocess.run(
        [sys.executable, "-m", "cuecast", "encode", str(tmp_path / "m.npz"), "-o", "-", *option],
        cwd=tree,
        env=environment,
        capture_output=True,
        check=False,
    )
    assert encoded.returncode == 0, encoded.stderr
    assert any((tmp_path / "kept").rglob("*.nbi")) if told else True
