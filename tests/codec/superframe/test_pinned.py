"""The same motion gives the same bits, and the same bits the same motion, from version to version.

Where a change is meant, `tests.codec.pinned` writes the figures anew, and the change is told.
"""

import json
from typing import Any

import pytest

from tests.codec.pinned import PINNED, cases

EXPECTED: dict[str, dict[str, Any]] = json.loads(PINNED.read_text(encoding="utf-8"))
ROUNDING = 5e-4
"""Of a sum of a thousand float32 parameters."""


def same(found: Any, expected: Any) -> bool:
    """Whether figures agree, those that are no whole numbers but for their rounding."""
    if isinstance(expected, dict):
        return found.keys() == expected.keys() and all(same(found[k], expected[k]) for k in found)
    if isinstance(expected, list):
        return len(found) == len(expected) and all(map(same, found, expected))
    if isinstance(expected, float):
        return bool(abs(found - expected) < ROUNDING)
    return bool(found == expected)


@pytest.mark.parametrize("name", cases())
def test_pinned(name: str) -> None:
    found = cases()[name]()
    assert found.keys() == EXPECTED[name].keys()
    assert [part for part in found if not same(found[part], EXPECTED[name][part])] == []


def test_all_are_tried() -> None:
    assert set(EXPECTED) == set(cases())
