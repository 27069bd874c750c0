"""Constants say what they are: a unit and a meaning, or where they come from."""

import ast
import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("codec", "synth", "watermark", "receiver", "cuecast", "lab")
CALLS = {"array", "Fraction", "cumulative", "radians"}
"""Functions whose result is a constant if their arguments are."""

UNIT = re.compile(
    r"%|°|(?i:\b(seconds?|m?s|minutes?|hours?|days?|k?hz|db|[cm]m2?|m/s|metres?|millimetres?|inches"
    r"|bits?|k?bit/s|bytes?|samples?|frames?|pixels?|ticks?|radians?|degrees?|rotations|octaves?"
    r"|semitones?|cents|superframes?|cells?|bins?|keys?|pictures?|rounds?|steps?|times|numbers?"
    r"|counts?|index|code|version|polynomial|parameters?|grades?|closures?|shares?|parts?|percentile|ratios?"
    r"|factors?|weights?|probability|likelihood|density|confidence|belief|strength|correlation"
    r"|significance|evidence|deviations?|variance|spread|error|bias|levels?|powers?|exponent"
    r"|logarithms?|nats?|points?|lines?|columns?|rows?|channels?|bands?|order|rates?|lengths?|width"
    r"|heights?|sizes?|scale|price|costs?|margin|millionths|tenths|half|halves|thirds|quarter|twice|units?"
    r"|per|of 1|of 255)\b)"
)
"""Words by which a docstring says in what a number is counted or measured."""

COUNT = re.compile(
    r"The same|Those|That of|Their|How (?:many|much|often|long)|Most|Least|Fewest"
    r"|(?!(?:Of|The|What|This|At|Who)\b)[A-Z][\w-]*(?: [\w-]+)?s\b|Quanta"
)
"""Beginnings of a docstring that name the things counted, or the number above: `Rounds of ...`."""

SUFFIX = re.compile(
    r"_(S|MS|S2|HZ|DB|MM2?|DEG|ST|BITS|BYTES|BPS|TICKS|SHARE|RATE|XRT|PPM|PER_MINUTE)$"
)
"""Units that names end in."""

WHY = re.compile(
    r"[:;]|\b(because|since|so that|against|measured|otherwise|for|to|where|which|that|like|as|than"
    r"|usual|typical|beyond|without|1[89]\d\d|20\d\d|[A-Z]\d+|ITU|ETSI|ISO|RFC|python -m)\b"
)
"""What a docstring gives a reason, a use or a source by."""

LEAST_WITH_WHY = 0.77
"""Share of the numbers whose docstring has one of these; it may only rise."""


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


def docstrings(source: str) -> Iterator[tuple[str, str]]:
    """Yield the names of the module's numbers that have a docstring, and that."""
    body = ast.parse(source).body
    for node, after in itertools.pairwise(body):
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        if not isinstance(after, ast.Expr) or not isinstance(target, ast.Name):
            continue
        if is_numeric(node.value) and is_text(after):
            yield target.id, str(ast.literal_eval(after.value))


def lacks_unit(name: str, text: str) -> bool:
    """Whether neither name nor docstring says in what a number is counted or measured."""
    return not (SUFFIX.search(name) or UNIT.search(text) or COUNT.match(text.strip("\"' ")))


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


def every_docstring() -> Iterator[tuple[Path, str, str]]:
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for name, text in docstrings(path.read_text(encoding="utf-8")):
                yield path.relative_to(ROOT), name, text


def test_numbers_have_a_unit() -> None:
    found = [
        f"{path}: {name}: {text}"
        for path, name, text in every_docstring()
        if lacks_unit(name, text)
    ]
    assert not found, "\n".join(found)


def test_numbers_have_a_reason() -> None:
    """A use, a source or a measurement; not yet all of them: the share does not fall."""
    texts = [text for _, _, text in every_docstring()]
    assert len(texts) > 1000
    assert sum(bool(WHY.search(text)) for text in texts) >= LEAST_WITH_WHY * len(texts)


def test_units_and_reasons_are_seen() -> None:
    assert lacks_unit("A", "Of what is kept.")
    assert not lacks_unit("A_S", "Of what is kept.")
    assert not lacks_unit("A", "Rounds at most.")
    assert not lacks_unit("A", "Greatest distance in mm.")
    assert not WHY.search("Rounds at most.")
    assert WHY.search("Rounds at most: later ones change nothing.")
    assert WHY.search("Decay (Attina 2005).")
    assert list(docstrings('A = 3\n"""Metres."""\nB = 4\n')) == [("A", "Metres.")]


def test_the_check_sees_what_is_missing() -> None:
    assert unexplained("A = 3\n") == ["A = 3"]
    assert unexplained('A = -3.0 * 2\n"""Metres."""\n') == []
    assert unexplained("A = 3  # metres\n") == []
    assert unexplained("# Metres.\nA = 3\nB = (4, 5)\n\nC = [6]\n") == ["C = [6]"]
    assert unexplained("A = 3  # fmt: skip\n") == ["A = 3  # fmt: skip"]
