"""Constants say what they are: a unit and a meaning, or where they come from."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("codec", "synth", "watermark", "receiver", "cuecast", "lab")
CALLS = {"array", "Fraction", "cumulative", "radians"}
"""Functions whose result is a constant if their arguments are."""


def is_numeric(value: ast.expr) -> bool:
    """Whether an expression holds a number that somebody chose."""
    match value:
        case ast.Constant():
            return isinstance(value.value, int | float) and not isinstance(value.value, bool)
        case ast.UnaryOp():
            return is_numeric(value.operand)
        case ast.BinOp():
            return is_numeric(value.left) or is_numeric(value.right)
        case ast.Tuple() | ast.List():
            return bool(value.elts) and all(map(is_numeric, value.elts))
        case ast.Call(func=ast.Attribute(attr=name) | ast.Name(id=name)):
            return name in CALLS and any(map(is_numeric, value.args))
    return False


def is_text(node: ast.stmt | None) -> bool:
    """Whether a statement is a docstring."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def unexplained(source: str) -> list[str]:
    """Return the module's numbers without a docstring or comment, one line of code each.

    A comment speaks for all lines directly below it.
    """
    lines = source.split("\n")
    body = ast.parse(source).body
    found = []
    spoken_for = 0
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        above = lines[node.lineno - 2] if node.lineno > 1 else ""
        beside = lines[node.end_lineno - 1].partition("#")[2] if node.end_lineno else ""
        if above.startswith("#") or (spoken_for == node.lineno - 1 and above.strip()):
            spoken_for = node.end_lineno or node.lineno
        elif is_numeric(node.value) and not is_text(after) and not beside.strip(" fmt:skip"):
            found.append(lines[node.lineno - 1])
    return found


ROOMS = sorted(
    path.relative_to(ROOT).as_posix()
    for package in PACKAGES
    for path in (ROOT / package).iterdir()
    if any(path.glob("*.py"))
)


@pytest.mark.parametrize("room", ROOMS)
def test_numbers_are_explained(room: str) -> None:
    found = {
        f"{path.relative_to(ROOT)}: {line}"
        for path in (ROOT / room).rglob("*.py")
        for line in unexplained(path.read_text(encoding="utf-8"))
    }
    assert not found, "\n".join(sorted(found))


def test_the_check_sees_what_is_missing() -> None:
    assert unexplained("A = 3\n") == ["A = 3"]
    assert unexplained('A = -3.0 * 2\n"""Metres."""\n') == []
    assert unexplained("A = 3  # metres\n") == []
    assert unexplained("# Metres.\nA = 3\nB = (4, 5)\n\nC = [6]\n") == ["C = [6]"]
    assert unexplained("A = 3  # fmt: skip\n") == ["A = 3  # fmt: skip"]
