"""Whoever misreads how files, movement or markers are described notices: `stream.json` tells."""

import ast
import json
import sys
import types
import zlib
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from spec.reference.stream_vectors import DATA, moved
from tests.spec.misreading import Misreading, ends

ROOT = Path(__file__).parents[2]
SOURCES = ("markers", "joining", "motion", "files")
DOCUMENT = json.loads((ROOT / "spec/vectors/stream.json").read_text(encoding="utf-8"))
DRAWN = [case for case in DOCUMENT["cases"] if "markers" in case]
LEAST = 80
"""Misreadings of each source that have to be tried at least."""

SECONDS = 60
"""Of processor time after which a reader that does not end counts as one that fails: several times
what the reference takes."""

TOLERANCE_MM = 0.01
"""By which markers may differ from those of the specification."""

HARMLESS = frozenset(
    {
        # No key has shape 9, none a number above 53; both modes but 0 read alike.
        "files 16 9: one more",
        *(f"files {n} 54: one more" for n in (251, 259)),
        "files 233 1: one more",
        # All kinds of keys have as many columns.
        "files 266 0: one more",
        # Equal weights: the place beyond the row's is not reached.
        "files 219 1: one more",
        # The first byte of tick numbers is 0.
        "files 45 13: one more",
        "files 47 17: one more",
        # A record that is cut short is refused behind the last one too.
        "files 86 place + length: Sub",
        # A line begins with a pause; the last symbol of a row is its limit.
        "files 104 0: one more",
        "files 126 32: one more",
        # Both sides of the border of a series agree; head and forearm have as many parameters.
        "markers 43 n > 1e-06: GtE",
        "markers 58 0: one more",
        *(f"motion {n} 1: one more" for n in (138, 144)),
        # The size of what is no array is not used; numbers have fewer decimals.
        "motion 12 0: one more",
        "motion 15 6: one more",
        # Far past is far past, and far future is far future.
        *(f"motion {n} 2: one more" for n in (28, 30, 93)),
        *(f"motion {n} 40: one more" for n in (29, 31, 94)),
        # Nothing precedes the first key's stroke.
        "motion 95 1: one more",
        # Who leaves late reaches behind the stroke before: that rule is the stricter one.
        "motion 99 1: one more",
        "motion 100 found[g].leave + 1: Sub",
        # At the border what is added is 0, or the whole.
        "motion 123 h < natural: LtE",
        "motion 167 begin > time: GtE",
        "motion 176 time >= begin + lasts: Gt",
        "motion 209 f < 1: LtE",
        # Without coefficients what they add is 0.
        "motion 258 63: one more",
        # A part in 65536 is below the tolerance.
        "motion 250 65536: one more",
    }
)
"""Changes that change nothing: each with its reason."""

NOT_SHOWN = frozenset({"motion 103 1: one more", "motion 104 found[g - 1].reach + 1: Sub"})
"""Changes that no vector shows: strokes that end together end up to 0.4 ms after one another."""


@cache
def plain(name: str) -> ast.Module:
    """Return the source of a module of the reference."""
    path = ROOT / "spec/reference" / f"{name}.py"
    return ast.parse(path.read_text(encoding="utf-8"))


def reader(source: str, wanted: int) -> tuple[dict[str, Any], str]:
    """Return the reference with one misreading in a source, and what it is; '' behind the last."""
    modules: dict[str, Any] = {}
    told = ""
    with patch.dict(sys.modules):
        for name in SOURCES[SOURCES.index(source) :]:
            tree = plain(name)
            if name == source:
                change = Misreading(wanted)
                fresh = ast.parse(ast.unparse(tree))
                tree, told = ast.fix_missing_locations(change.visit(fresh)), change.told
            module = types.ModuleType(f"spec.reference.{name}")
            module.__dict__["__file__"] = str(ROOT / "spec/reference" / f"{name}.py")
            sys.modules[module.__name__] = module
            exec(compile(tree, name, "exec"), module.__dict__)
            modules[name] = module
    for name in SOURCES:
        modules.setdefault(name, __import__(f"spec.reference.{name}", fromlist=[name]))
    return modules, told


def passes(modules: dict[str, Any]) -> bool:
    """Return whether a reader gives all vectors."""
    try:
        return all(says(modules, case) for case in DOCUMENT["cases"]) and draws(modules)
    except Exception:
        return False


def says(modules: dict[str, Any], case: dict[str, Any]) -> bool:
    """Return whether a reader gives what a file says, or refuses it for the right reason."""
    files = modules["files"]
    data = bytes.fromhex(case["file"])
    data = zlib.decompress(data) if case.get("packed") else data
    try:
        found = files.read(data)
    except files.MalformedError as error:
        return not case["valid"] and str(error) == case["section"]
    return bool(case["valid"]) and case == {
        **case,
        "coding": found.coding,
        "span": [found.first_tick, found.ticks, found.l0, found.l1], "learns": found.learns,
        "line": found.line, "payloads": [payload.hex() for payload in found.payloads],
        "keys": [[cue.number, cue.start, cue.end] for cue in files.keys(found)],
    }  # fmt: skip


def draws(modules: dict[str, Any]) -> bool:
    """Return whether a reader gives the markers of the files that are drawn."""
    files, motion, markers = (modules[name] for name in ("files", "motion", "markers"))
    voice = markers.read_voice(DATA / "voices" / "claire.npz")
    coding = motion.read_coding(DATA / "coding" / f"{markers.identity(voice)}.npz")
    scales = [
        [
            [int(coding[f"{basis}.scales"].at(c, f)) for f in range(32)]
            for c in range(coding[f"{basis}.scales"].shape[0])
        ]
        for basis in motion.BASES
    ]
    for case in reversed(DRAWN):
        found = files.read(bytes.fromhex(case["file"]))
        frames = files.parameters(found, scales, moved(coding, case))
        for t, points in case["markers"].items():
            drawn = markers.markers(voice, frames[int(t)])
            for m, point in zip(DOCUMENT["shown"], points, strict=True):
                gaps = [abs(a - b) for a, b in zip(drawn[m], point, strict=True)]
                # Not a number is no marker either.
                if not max(gaps) < TOLERANCE_MM:
                    return False
    return True


def misreadings(source: str) -> Iterator[tuple[dict[str, Any] | None, str]]:
    """Yield readers with one misreading each, and what it is."""
    wanted = 0
    while True:
        found: dict[str, Any] | None
        try:
            found, told = reader(source, wanted)
        except Exception:
            found, told = None, "does not run"
        if not told:
            return
        yield found, f"{source} {wanted} {told}"
        wanted += 1


@pytest.mark.slow
def test_the_reference_itself_passes() -> None:
    assert passes(reader("markers", -1)[0])


@pytest.mark.slow
@pytest.mark.parametrize("source", SOURCES)
def test_no_misreading_passes_all_vectors(source: str) -> None:
    tried, survived = 0, []
    for modules, told in misreadings(source):
        tried += 1
        if modules is None or told in HARMLESS | NOT_SHOWN:
            continue
        if ends(partial(passes, modules), SECONDS):
            survived.append(told)
    assert tried >= LEAST
    assert not survived
