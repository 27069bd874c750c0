"""Docstrings and pages keep to everyday technical English: patterns of a dialect stay rare."""

import ast
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("codec", "synth", "watermark", "receiver", "cuecast", "lab")
RATE = 0.3
"""Occurrences in 1000 words that each pattern may have."""

PATTERNS = {
    "tell: encode, report, state, show, distinguish": r"(?i)\b(tells?|told|telling)\b",
    "clause with what: name the thing": (
        r"\b[Ww]hat (is|was|are|comes?|came|goes|stands|it|a|the|else|has|nobody)\b"
    ),
    "preposition and which: a shorter sentence": r"\b(of|by|from|with|in|on) which\b",
    "quaint: everyday words": (
        r"\b(for want of|by rule|as ever|so many|may be had|untold|thereof|whence|hither|seldom"
        r"|nobody else|at leisure)\b"
    ),
}


@cache
def trees() -> list[ast.Module]:
    paths = [p for package in PACKAGES for p in sorted((ROOT / package).rglob("*.py"))]
    return [ast.parse(path.read_text(encoding="utf-8")) for path in paths]


def docstrings() -> Iterator[str]:
    kinds = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    for node in (node for tree in trees() for node in ast.walk(tree)):
        if isinstance(node, kinds):
            # Parameters may be called `tell`: only their descriptions are prose.
            yield re.sub(r"(?m)^(\w+(, \w+)* : |>>> .*)", "", ast.get_docstring(node) or "")


def constants() -> Iterator[str]:
    """Yield the descriptions below module constants."""
    for node in (node for tree in trees() for node in tree.body[1:]):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield str(node.value.value)


def pages() -> Iterator[str]:
    for path in [*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md"))]:
        if "api" not in path.parts:  # generated from docstrings
            yield re.sub(r"```.*?```|`[^`\n]*`", "", path.read_text(encoding="utf-8"), flags=re.S)


CASES = [(texts, pattern) for texts in (docstrings, constants, pages) for pattern in PATTERNS]


@pytest.mark.parametrize(("texts", "pattern"), CASES)
def test_prose_is_everyday_english(texts: Callable[[], Iterator[str]], pattern: str) -> None:
    words, found = 0, []
    for text in texts():
        words += len(text.split())
        found += [
            text[max(0, m.start() - 40) : m.end() + 20]
            for m in re.finditer(PATTERNS[pattern], text)
        ]
    assert words > 10000
    rate = 1000 * len(found) / words
    assert rate <= RATE, f"{pattern}: {rate:.2f} in 1000 words, such as {found[:20]}"
