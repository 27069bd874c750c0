"""Whoever misreads the specification notices: wrong decoders fail the vectors.

The reference decoder is changed in one place at a time, as a reader could err: a number by one, a
comparison at its border, a sign, a range. Each change has to be seen by a vector.
"""

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
        # Defaults of what the decoder always sets.
        *(f"superframe {n} 0: one more" for n in range(108, 113)),
        # The ends of tails of 2, 4 and 9 bits fall alike with 8 and 9 to the byte.
        "range_decoder 1 8: one more",
        # What is left out by the mask is zero after the shift.
        "superframe 131 1: one more",
        # More bytes than nine bits lie in.
        "superframe 171 2: one more",
        # At step 63 no class of these bases is above 0.
        *(f"superframe {n} 63: one more" for n in (185, 206)),
        # What has no timing by rule has no pace; the second of two phones is never missing.
        "superframe 319 0: one more",
        "superframe 339 38: one more",
        # A compact superframe has no coefficients: how many zeros, and of which basis.
        *(f"superframe {n} 32: one more" for n in (327, 332)),
        *(f"superframe {n} 0: one more" for n in (329, 334)),
        # No length by rule is above 26 ticks.
        "superframe 359 32: one more",
        # Coefficients are listed by channel before they are sorted, and sorting keeps that order.
        "superframe 488 0: one more",
        # Equal only for the coefficient itself, whose index is still 0.
        "superframe 510 j < i: LtE",
        # A limit of 0 leaves one symbol and takes nothing off the code.
        "superframe 389 15: one more",
        "superframe 390 cell < 15: LtE",
        # The last symbol of the row is that limit.
        "superframe 425 32: one more",
        # Zero has gone by then.
        "superframe 559 0: one more",
        "superframe 560 q < 0: LtE",
        # Borders that a code meets once in 2**24: the end of an interval, or of the coder's range.
        "range_decoder 23 255: one more",
        "range_decoder 36 256: one more",
        "range_decoder 62 self.code + self.slack < unit * start + new_range: LtE",
        "range_decoder 66 self.range < 2 ** 24: LtE",
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
            tree = ast.fix_missing_locations(change.visit(tree))
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
            "header": header, "slow": found.slow, "setting": setting,
            "previews": found.previews, "score": found.score,
            "indices": {str(i): q for i, q in enumerate(found.indices) if q},
            "values": {str(i): v for i, v in enumerate(found.values) if v},
        }  # fmt: skip
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
            yield reference, f"{source} {wanted} {told}"
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
