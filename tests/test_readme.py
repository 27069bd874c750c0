"""The examples of README.md are true: every console block runs, and prints what it shows."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from cuecast.command import cli

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def sessions() -> list[tuple[str, str]]:
    """Commands of the console blocks in order, each with the output that stands below it."""
    found = []
    for block in re.findall(r"```console\n(.*?)```", README, re.DOTALL):
        for command, output in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", block, re.MULTILINE):
            found.append((command, output))
    return found


def test_there_are_examples() -> None:
    assert len(sessions()) > 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("readme")


@pytest.mark.parametrize(("command", "expected"), sessions(), ids=[c for c, _ in sessions()])
def test_example(folder: Path, command: str, expected: str) -> None:
    """Run in order in one folder: later examples use the files of earlier ones."""
    home = Path(sys.executable).parent
    environment = os.environ | {
        "PATH": f"{home}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
    }
    run = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command}"], cwd=folder, env=environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert run.stdout == expected


def test_every_verb_is_in_the_table() -> None:
    for verb in cli.VERBS:
        assert f"`{verb}`" in README


def test_changelog_has_this_version() -> None:
    from importlib.metadata import version

    assert f"## {version('cuecast')} " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
