"""The pseudocode of spec/syntax.md gives every vector of superframes."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from spec.reference.superframe import crc
from spec.reference.tables import TABLES, of_the_language

SPEC = Path(__file__).parents[2] / "spec"
DOCUMENT = json.loads((SPEC / "vectors/superframe.json").read_text(encoding="utf-8"))


class RefusedError(Exception):
    """A part breaks the paragraph that is the argument."""


def require(holds: bool, paragraph: str) -> None:
    if not holds:
        raise RefusedError(paragraph)


def blocks(document: dict[str, Any]) -> dict[str, Any]:
    """Return what the blocks of the page define, for a document's bases and identity."""
    found = re.findall(r"```python\n(.*?)```", (SPEC / "syntax.md").read_text("utf-8"), re.S)
    names: dict[str, Any] = {
        "tables": TABLES,
        "bases": document["bases"],
        "identity": document["identity"],
        "crc": crc,
        "require": require,
        "number": lambda data: int.from_bytes(data, "big"),
        **of_the_language(),
    }
    for block in found:
        exec(compile(block, "spec/syntax.md", "exec"), names)
    return names


@pytest.fixture(scope="module")
def page() -> dict[str, Any]:
    return blocks(DOCUMENT)


@pytest.mark.vectors("superframe")
def test_the_page_gives_the_vector(case: dict[str, Any], page: dict[str, Any]) -> None:
    l0, l1 = bytes.fromhex(case["l0"]), bytes.fromhex(case["l1"])
    if not case["valid"]:
        with pytest.raises(RefusedError, match=case["section"]):
            page["superframe"](l0, l1)
        return
    said = page["superframe"](l0, l1)
    for name, value in said.items():
        assert value == case[name], name
