"""Every case of every vector file says what it is for, and where to look when it fails."""

import json
from pathlib import Path
from typing import Any

import pytest

VECTORS = Path(__file__).parents[2] / "spec" / "vectors"
NAMES = sorted(path.stem for path in VECTORS.glob("*.json"))
MOST_BYTES = 3_000_000
"""Of all vectors together."""


@pytest.mark.parametrize("name", NAMES)
def test_cases_state_purpose_origin_and_what_a_failure_suggests(name: str) -> None:
    document = json.loads((VECTORS / f"{name}.json").read_text(encoding="utf-8"))
    cases: list[dict[str, Any]] = document["cases"]
    assert cases
    assert len({case["id"] for case in cases}) == len(cases)
    for case in cases:
        for field in ("id", "section", "origin", "purpose", "failure_suggests"):
            assert case.get(field) or document.get(field), f"{name} {case['id']}: no {field}"
        assert case["valid"] in (True, False)


def test_vectors_stay_small() -> None:
    assert sum(path.stat().st_size for path in VECTORS.iterdir()) < MOST_BYTES
