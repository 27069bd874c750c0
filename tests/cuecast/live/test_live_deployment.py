"""The unit and the container file of the playout: what they say is what there is."""

import configparser
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from cuecast.command.cli import VERBS, build_parser

DEPLOY = Path(__file__).resolve().parents[3] / "deploy"
UNIT = DEPLOY / "cuecast-playout@.service"
CONTAINER = DEPLOY / "Containerfile"


def unit() -> configparser.ConfigParser:
    parser = configparser.ConfigParser(interpolation=None, strict=True)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(UNIT, encoding="utf-8")
    return parser


def test_unit_starts_a_playout() -> None:
    service = unit()["Service"]
    argv = shlex.split(service["ExecStart"])
    assert argv[:2] == ["/usr/bin/env", "cuecast"]
    given = [
        arg.replace("${CUECAST_IN}", "udp://@:5000").replace("${CUECAST_OUT}", "-")
        for arg in argv[2:]
        if arg != "$CUECAST_OPTIONS"
    ]
    args = build_parser().parse_args(given)
    assert (args.verb, args.source, args.target) == ("playout", "udp://@:5000", "-")
    assert service["Restart"] == "always"
    assert float(service["TimeoutStopSec"]) > 10  # what was taken in goes out first


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
def test_systemd_understands_the_unit(tmp_path: Path) -> None:
    copy = tmp_path / "cuecast-playout@x.service"
    copy.write_text(UNIT.read_text(encoding="utf-8"), encoding="utf-8")
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(copy)],
        capture_output=True,
        text=True,
        check=False,
    )
    about_us = [line for line in done.stderr.splitlines() if "cuecast-playout" in line]
    assert about_us == []


def test_container_file() -> None:
    text = re.sub(r"\\\n", " ", CONTAINER.read_text(encoding="utf-8"))
    lines = [line.split(maxsplit=1) for line in text.splitlines() if line and line[0] != "#"]
    known = {"FROM", "ENV", "COPY", "RUN", "USER", "STOPSIGNAL", "ENTRYPOINT", "CMD"}
    assert {name for name, _ in lines} <= known
    assert lines[0][0] == "FROM"
    assert [rest for name, rest in lines if name == "ENTRYPOINT"] == ['["cuecast"]']
    assert "warm" in VERBS
    assert any(rest == '["cuecast", "warm"]' for name, rest in lines if name == "RUN")


def engine() -> str | None:
    """A container engine that works here."""
    for name in ("podman", "docker"):
        path = shutil.which(name)
        if (
            path
            and subprocess.run([path, "info"], capture_output=True, check=False).returncode == 0
        ):
            return path
    return None


@pytest.mark.slow
def test_container_is_built_and_starts() -> None:
    found = engine()
    if found is None:
        pytest.skip("needs a container engine that runs")
    build = [found, "build", "-q", "-f", str(CONTAINER), str(DEPLOY.parent)]
    image = subprocess.run(build, capture_output=True, text=True, check=True).stdout.strip()
    shown = subprocess.run(
        [found, "run", "--rm", image, "--version"], capture_output=True, text=True
    )
    assert shown.stdout.startswith("cuecast ")
