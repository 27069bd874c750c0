"""Whoever misreads the pseudocode of spec/syntax.md notices: vectors of superframes fail."""

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
        "17 0: one more", "18 left <= 0: Lt", "20 8: one more", "21 left < 8: LtE",
        "25 0: one more",
        # Borders that a code meets once in 2**24: the end of an interval, or of the coder's range.
        "58 d.code + d.slack < unit * start + size: LtE", "63 d.range < 2 ** 24: LtE",
        # More bytes than nine bits lie in.
        "112 2: one more",
        # The last entry of a row, or a limit that is the row's last symbol.
        "163 8192: one more", "249 32: one more", "284 8: one more", "289 5: one more",
        "333 15872: one more", "342 1536: one more",
        # Behind a key of these cells a gap of seven is the limit's symbol at least.
        "341 1024: one more",
        # A limit of 0 leaves one symbol and takes nothing off the code.
        "307 15: one more", "308 cell < 15: LtE", "358 7: one more", "359 cell < 7: LtE",
        # What is told in ticks has no pace; the second of two phones is never missing.
        "469 0: one more", "485 38: one more",
        # At step 63 no class of these bases is above 0.
        "546 63: one more",
        # Coefficients are listed by channel before they are sorted, and sorting keeps that order.
        "560 0: one more",
        # Zero has gone by then.
        "658 0: one more", "659 q < 0: LtE",
    }
)  # fmt: skip
"""Changes that change nothing, or nothing that a vector could show: each with its reason."""


def source() -> str:
    """Return the blocks of the page as one program."""
    text = (SPEC / "syntax.md").read_text(encoding="utf-8")
    return "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))


def misread(wanted: int) -> tuple[ast.Module, str]:
    """Return the program with one misreading, and what it is; '' behind the last."""
    change = Misreading(wanted)
    tree = change.visit(ast.parse(source()))
    return ast.fix_missing_locations(tree), change.told


def passes(tree: ast.Module) -> bool:
    """Return whether a program gives all vectors."""
    names: dict[str, Any] = {
        "tables": TABLES, "bases": DOCUMENTS[0]["bases"], "identity": DOCUMENTS[0]["identity"],
        "crc": crc, "require": require, "number": lambda data: int.from_bytes(data, "big"),
        **of_the_language(),
    }  # fmt: skip
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
        name = f"{wanted} {told}"
        if name not in HARMLESS and ends(partial(passes, tree)):
            survived.append(name)
        wanted += 1
    assert wanted >= LEAST
    assert not survived
