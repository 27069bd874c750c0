"""Whoever misreads the pseudocode of spec/syntax.md notices: vectors of superframes fail."""

# ruff: noqa: E501 (names of misreadings quote whole statements)

import ast
import json
import re
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from spec.reference.superframe import crc
from spec.reference.tables import TABLES, of_the_language
from tests.spec.misreading import Misreading, ends
from tests.spec.test_syntax_page import RefusedError, require

SPEC = Path(__file__).parents[2] / "spec"
DOCUMENTS = [
    json.loads((SPEC / "vectors" / f"{name}.json").read_text(encoding="utf-8"))
    for name in ("misread", "superframe")
]
LEAST = 400
"""Misreadings that have to be tried at least."""


HARMLESS = frozenset(
    {
        # Bytes have 7, 6 or 4 payload bits, 8 or none: 255 >> 8 and 255 >> 0 say the same.
        "take: unknown = 255 if left <= 0 else 255 >> left if left < 8 else / 1 0: one more",
        "take: unknown = 255 if left <= 0 else 255 >> left if left < 8 else / 2 left <= 0: Lt",
        "take: unknown = 255 if left <= 0 else 255 >> left if left < 8 else / 4 8: one more",
        "take: unknown = 255 if left <= 0 else 255 >> left if left < 8 else / 5 left < 8: LtE",
        "take: byte = d.data[d.at] & ~unknown & 255 if left > 0 else 0 / 1 0: one more",
        # Borders that a code meets once in 2**24: the end of an interval, or of the coder's range.
        "s: d.sure = d.code + d.slack < unit * start + size / 4 d.code + d.slack < unit * start + size: LtE",
        "s: while d.range < 2 ** 24: / 3 d.range < 2 ** 24: LtE",
        # More bytes than nine bits lie in.
        "superframe: proof = number(body[-2:]) & 511 if signed else 0 / 1 2: one more",
        # At step 63 no class of these bases is above 0.
        "coefficients: if step == 63: / 1 63: one more",
        # The last entry of a row, or a limit that is the row's last symbol.
        "read_setting: use = d.s([12288, 18432, 2048] if filmed else [16384, 8192,  / 8 8192: one more",
        "score: first_end = tick = d.s(t['left'][first], 32) / 1 32: one more",
        "labels: rest = [2560, 2560, 2560, 2048, 2048, 2048, 1536, 1536, 1587 / 9 15872: one more",
        "labels: key = [3072, 6656, 7168, 5632, 3584, 2560, 1536, 1024, 1536] / 9 1536: one more",
        # Behind a key of these cells a gap of seven is the limit's symbol at least.
        "labels: key = [3072, 6656, 7168, 5632, 3584, 2560, 1536, 1024, 1536] / 8 1024: one more",
        # A limit of 0 leaves one symbol and takes nothing off the code.
        "previews: while cell < 15: / 1 15: one more",
        "previews: while cell < 15: / 2 cell < 15: LtE",
        "labels: while cell < 7: / 1 7: one more",
        "labels: while cell < 7: / 2 cell < 7: LtE",
        # What is told in ticks has no pace; a compact superframe has no coefficients.
        "compact: pace = (3, 4, 5, 6, 7, 8, 10, 13)[d.s([2048, 7168, 8192, 614 / 17 0: one more",
        # Coefficients are listed by channel before they are sorted, and sorting keeps that order.
        "coefficients: places.sort(key=lambda cf: (-own[cf[0]][cf[1]], cf[1], cf[0] / 4 0: one more",
        # Zero has gone by then.
        "value: return -size if q < 0 else size / 1 0: one more",
        "value: return -size if q < 0 else size / 2 q < 0: LtE",
    }
)
"""Changes that change nothing, or nothing that a vector could show: each with its reason."""


def source() -> str:
    """Return the blocks of the page as one program."""
    text = (SPEC / "syntax.md").read_text(encoding="utf-8")
    return "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))


def misread(wanted: int) -> tuple[ast.Module, str]:
    """Return the program with one misreading, and what it is; '' behind the last."""
    change = Misreading(wanted)
    tree = ast.parse(source())
    change.visit(tree)
    return ast.fix_missing_locations(tree), change.told


def passes(tree: ast.Module) -> bool:
    """Return whether a program gives all vectors."""
    names: dict[str, Any] = {
        "tables": TABLES,
        "bases": DOCUMENTS[0]["bases"],
        "identity": DOCUMENTS[0]["identity"],
        "crc": crc,
        "require": require,
        "number": lambda data: int.from_bytes(data, "big"),
        **of_the_language(),
    }
    try:
        exec(compile(tree, "spec/syntax.md", "exec"), names)
        return all(gives(names, case) for document in DOCUMENTS for case in document["cases"])
    except Exception:
        return False


def gives(names: dict[str, Any], case: dict[str, Any]) -> bool:
    """Return whether a program gives a vector."""
    try:
        said = names["superframe"](bytes.fromhex(case["l0"]), bytes.fromhex(case["l1"]))
    except RefusedError as error:
        return not case["valid"] and str(error) == case["section"]
    return bool(case["valid"]) and all(said[name] == case[name] for name in said)


@pytest.mark.slow
def test_no_misreading_of_the_pseudocode_passes() -> None:
    wanted, survived = 0, []
    while True:
        tree, told = misread(wanted)
        if not told:
            break
        if told not in HARMLESS and ends(partial(passes, tree)):
            survived.append(told)
        wanted += 1
    assert wanted >= LEAST
    assert not survived
