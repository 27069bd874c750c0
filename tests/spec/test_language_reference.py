"""A second language by the reference, by the pseudocode and by its vectors."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from spec.reference import files
from spec.reference.language_vectors import TABLES, told
from spec.reference.superframe import decode
from spec.reference.tables import using
from tests.spec.test_syntax_page import blocks

VECTORS = Path(__file__).parents[2] / "spec" / "vectors"
DOCUMENT = json.loads((VECTORS / "language.json").read_text(encoding="utf-8"))


@pytest.fixture(autouse=True)
def _american() -> Iterator[None]:
    with using(TABLES):
        yield


@pytest.mark.vectors("language")
def test_the_reference_gives_the_vector(case: dict[str, Any]) -> None:
    if "file" in case:
        found = files.read(bytes.fromhex(case["file"]))
        assert found.line == case["line"]
        assert [[cue.number, cue.start, cue.end] for cue in files.keys(found)] == case["keys"]
        return
    l0 = bytes.fromhex(case["l0"])
    said = told(decode(l0, None, DOCUMENT["bases"], DOCUMENT["identity"]))
    assert said == {name: case[name] for name in said}


@pytest.mark.vectors("language")
def test_the_page_gives_the_vector(case: dict[str, Any]) -> None:
    if "l0" not in case:
        pytest.skip("a file")
    said = blocks(DOCUMENT)["superframe"](bytes.fromhex(case["l0"]), b"")
    assert said == {name: case[name] for name in said}
