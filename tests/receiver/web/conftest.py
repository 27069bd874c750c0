"""The demonstration's files, made once for the slow tests."""

import contextlib
import io
from pathlib import Path

import pytest

from cuecast.command.cli import main


@pytest.fixture(scope="session")
def demonstration(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demo")
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(["demo", "--out", str(folder)]) == 0
    return folder
