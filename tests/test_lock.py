"""The lock pins what the project needs, within its bounds, with hashes."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parents[1]
PIN = re.compile(r"^([a-z0-9][a-z0-9._-]*)==([^ ;\\]+)[^\n]*\\\n((?:    --hash=sha256:[0-9a-f]{64}[^\n]*\n)+)", re.M)  # fmt: skip  # noqa: E501


def pins() -> dict[str, list[Version]]:
    found: dict[str, list[Version]] = {}
    for name, version, _ in PIN.findall((ROOT / "requirements.lock").read_text(encoding="utf-8")):
        found.setdefault(canonicalize_name(name), []).append(Version(version))
    return found


def needed() -> list[Requirement]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [
        Requirement(line)
        for line in [*project["dependencies"], *project["optional-dependencies"]["c3d"]]
    ]


def test_every_line_is_a_pin_with_hashes() -> None:
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    left = re.sub(r"^ +# .*\n", "", PIN.sub("", text), flags=re.M)
    assert left == ""
    assert len(pins()) > 30


@pytest.mark.parametrize("requirement", needed(), ids=lambda r: r.name)
def test_what_is_needed_is_pinned_within_its_bounds(requirement: Requirement) -> None:
    """Else `make lock`."""
    found = pins()[canonicalize_name(requirement.name)]
    assert all(version in requirement.specifier for version in found)
