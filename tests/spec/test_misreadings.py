"""Whoever misreads the specification notices: wrong decoders fail the vectors.

The reference decoder is changed in one place at a time, as a reader could err: a number by one, a
comparison at its border, a sign, a range. Each change has to be seen by a vector.
"""

# ruff: noqa: E501 (names of misreadings quote whole statements)

import ast
import dataclasses
import json
import sys
import types
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.spec.misreading import Misreading, ends

ROOT = Path(__file__).parents[2]
SOURCES = ("range_decoder", "superframe")
DOCUMENT = json.loads((ROOT / "spec/vectors/superframe.json").read_text(encoding="utf-8"))
LEAST = 100
"""Misreadings that have to be tried at least."""

HARMLESS = frozenset(
    {
        # Bytes have 7, 6 or 4 payload bits, 8 or none: 255 >> 8 and 255 >> 0 say the same.
        "range_decoder __init__: self.data = data[:len(data) - tail // 8] / 1 8: one more",
        # Borders that a code meets once in 2**24: the end of an interval, or of the coder's range.
        "range_decoder symbol: determined = self.code + self.slack < unit * start + new_ran / 4 self.code + self.slack < unit * start + new_range: LtE",
        "range_decoder symbol: while self.range < 2 ** 24: / 3 self.range < 2 ** 24: LtE",
        # More bytes than nine bits lie in.
        "superframe decode: out.proof = int.from_bytes(body[-2:], 'big') & 511 if signed / 1 2: one more",
        # Defaults of what the decoder always sets.
        "superframe Decoded: mode: int = 0 / 1 0: one more",
        # What is left out by the mask is zero after the shift.
        "superframe crc: register = register << 1 & (1 << width) - 1 / 3 1: one more",
        # At step 63 no class of these bases is above 0.
        "superframe decode: if out.step == 63: / 1 63: one more",
        "superframe record: if out.step != 63: / 1 63: one more",
        # The last entry of a row, or a limit that is the row's last symbol.
        "superframe compact: out.indices = [0] * 32 * len(bases[0]) / 2 32: one more",
        "superframe compact: out.values = [0] * 32 * len(bases[0]) / 2 32: one more",
        "superframe window: length = min(max(length, 1), 32) / 3 32: one more",
        "superframe score: first_end = start = decoder.symbol(tables['left'][first], 32 / 1 32: one more",
        # A limit of 0 leaves one symbol and takes nothing off the code.
        "superframe previews: while cell < 15: / 1 15: one more",
        "superframe previews: while cell < 15: / 2 cell < 15: LtE",
        "superframe labels: while cell < 7: / 1 7: one more",
        "superframe labels: while cell < 7: / 2 cell < 7: LtE",
        # What is told in ticks has no pace; a compact superframe has no coefficients.
        "superframe compact: pace = decoder.symbol(PACE)[0] if timing == 1 else 0 / 4 0: one more",
        "superframe compact: out.indices = [0] * 32 * len(bases[0]) / 4 0: one more",
        "superframe compact: out.values = [0] * 32 * len(bases[0]) / 4 0: one more",
        # Coefficients are listed by channel before they are sorted, and sorting keeps that order.
        "superframe order: return sorted(every, key=lambda cf: (-scales[cf[0]][cf[1]],  / 4 0: one more",
        # Equal only for the coefficient itself, whose index is still 0.
        "superframe coefficients: if j < i: / 1 j < i: LtE",
        # Zero has gone by then.
        "superframe value: return -magnitude if q < 0 else magnitude / 1 0: one more",
        "superframe value: return -magnitude if q < 0 else magnitude / 2 q < 0: LtE",
    }
)
"""Changes that change nothing, or nothing that a vector could show: each with its reason."""


def decoder(source: str, wanted: int) -> tuple[Any, str]:
    """Return the reference with one misreading in a source, and what it is; '' behind the last."""
    modules: dict[str, types.ModuleType] = {}
    told = ""
    for name in SOURCES:
        path = ROOT / "spec/reference" / f"{name}.py"
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if name == source:
            change = Misreading(wanted)
            change.visit(tree)
            tree = ast.fix_missing_locations(tree)
            told = change.told
        module = types.ModuleType(f"misread_{name}")
        module.__dict__["__file__"] = str(path)
        if name == "superframe":
            tree.body = [node for node in tree.body if not _imports_decoder(node)]
            module.__dict__["RangeDecoder"] = modules["range_decoder"].RangeDecoder
        sys.modules[module.__name__] = module
        exec(compile(tree, str(path), "exec"), module.__dict__)
        modules[name] = module
    return modules["superframe"], told


def _imports_decoder(node: ast.stmt) -> bool:
    return isinstance(node, ast.ImportFrom) and node.module == "spec.reference.range_decoder"


def passes(reference: Any) -> bool:
    """Return whether a decoder gives all vectors."""
    bases, identity = DOCUMENT["bases"], DOCUMENT["identity"]
    for case in DOCUMENT["cases"]:
        l0, l1 = bytes.fromhex(case["l0"]), bytes.fromhex(case["l1"])
        try:
            found = reference.decode(l0, l1, bases, identity)
        except reference.MalformedError as error:
            if case["valid"] or str(error) != case["section"]:
                return False
            continue
        except Exception:
            return False
        if not case["valid"]:
            return False
        header = [found.mode, found.sequence, found.lead, found.signed, found.proof]
        setting = [found.step, found.basis, found.level, found.course, found.shift, *found.shares]
        told = {
            "header": header,
            "slow": found.slow,
            "setting": setting,
            "previews": found.previews,
            "score": found.score,
            "indices": {str(i): q for i, q in enumerate(found.indices) if q},
            "values": {str(i): v for i, v in enumerate(found.values) if v},
        }
        if any(told[name] != case[name] for name in told):
            return False
        if found.mode == 1 and not (found.signed or found.slow or found.filmed):
            bare = reference.decode(l0, b"", bases, identity)
            if reference.record(l0[2:-2], 1, bases) != replace_header(bare):
                return False
    return True


def replace_header(found: Any) -> Any:
    """Return what a file's record says of the same payload: all but the header."""
    return dataclasses.replace(found, sequence=0, lead=0)


def misreadings() -> Iterator[tuple[Any, str]]:
    """Yield decoders with one misreading each, and what it is."""
    for source in SOURCES:
        wanted = 0
        while True:
            try:
                reference, told = decoder(source, wanted)
            except Exception:
                reference, told = None, "does not run"
            if not told:
                break
            yield reference, f"{source} {told}"
            wanted += 1


@pytest.mark.slow
def test_no_misreading_passes_all_vectors() -> None:
    tried, survived = 0, []
    for reference, told in misreadings():
        tried += 1
        if reference is None or told in HARMLESS:
            continue
        if ends(partial(passes, reference)):
            survived.append(told)
    assert tried >= LEAST
    assert not survived
