"""Whoever misreads how files, movement or markers are described notices: `stream.json` tells."""

# ruff: noqa: E501 (names of misreadings quote whole statements)

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

from spec.reference.language_vectors import TABLES as AMERICAN
from spec.reference.language_vectors import coding
from spec.reference.stream_vectors import DATA, moved
from spec.reference.tables import using
from tests.spec.misreading import Misreading, ends

ROOT = Path(__file__).parents[2]
SOURCES = ("markers", "joining", "motion", "files")
DOCUMENT = json.loads((ROOT / "spec/vectors/stream.json").read_text(encoding="utf-8"))
LANGUAGE = json.loads((ROOT / "spec/vectors/language.json").read_text(encoding="utf-8"))
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
        # Equal weights: the place beyond the row's is not reached; all modes but 0 read alike.
        "files choices: return [(consonants, weights), (vowels, [1] * len(vowels))] / 1 1: one more",
        "files parameters: decoded = [record(payload, 0 if out.line else 1, scales) for / 2 1: one more",
        # All kinds of keys have as many columns.
        "files weights: width = len(kind[0]) / 1 0: one more",
        # The first byte of tick numbers is 0.
        "files read: out = File(data[5:13].hex(), int.from_bytes(data[13:17], 'bi / 3 13: one more",
        "files read: out = File(data[5:13].hex(), int.from_bytes(data[13:17], 'bi / 5 17: one more",
        # A record that is cut short is refused behind the last one too.
        "files cut: if place + length > len(data): / 1 place + length: Sub",
        # A line begins with a pause; the last symbol of a row is its limit.
        "files tell: before = 0 / 1 0: one more",
        "files length: while (symbol := decoder.symbol(row, 32)[0]) == 32: / 1 32: one more",
        # Both sides of the border of a series agree; head and forearm have as many parameters.
        "markers moved: a, b = (math.sin(n) / n, (1 - math.cos(n)) / n ** 2) if n >  / 1 n > 1e-06: GtE",
        "markers markers: n_head = voice['face.motion_directions'].shape[0] / 1 0: one more",
        "motion moving: arm = widths[0] + widths[1] / 2 1: one more",
        "motion moving: group = (('fingers', widths[0]), ('head', widths[1]), ('', w / 2 1: one more",
        # The size of what is no array is not used; numbers have fewer decimals.
        "motion read_coding: kind, size = {'<f4': ('f', 4), '<i2': ('h', 2)}.get(describe / 3 0: one more",
        "motion constants: return {name: round(value, 6) for name, value in zip(NAMES,  / 1 6: one more",
        # Far past is far past, and far future is far future.
        "motion strokes: found = [Stroke(0, -2 ** 40, -2 ** 40)] / 2 2: one more",
        "motion strokes: found = [Stroke(0, -2 ** 40, -2 ** 40)] / 3 40: one more",
        "motion strokes: found = [Stroke(0, -2 ** 40, -2 ** 40)] / 4 2: one more",
        "motion strokes: found = [Stroke(0, -2 ** 40, -2 ** 40)] / 5 40: one more",
        "motion strokes: found.append(to_rest(100 * before.end, 2 ** 40)) / 3 2: one more",
        "motion strokes: found.append(to_rest(100 * before.end, 2 ** 40)) / 4 40: one more",
        # Nothing precedes the first key's stroke.
        "motion strokes: for g in range(1, len(found)): / 1 1: one more",
        # Who leaves late reaches behind the stroke before: that rule is the stricter one.
        "motion strokes: found[g].reach = max(found[g].reach, found[g].leave + 1, fou / 1 1: one more",
        "motion strokes: found[g].reach = max(found[g].reach, found[g].leave + 1, fou / 2 found[g].leave + 1: Sub",
        # At the border what is added is 0, or the whole.
        "motion held: if h < natural: / 1 h < natural: LtE",
        "motion travelled: if begin > time: / 1 begin > time: GtE",
        "motion travelled: if not begun and time >= begin + lasts: / 2 time >= begin + lasts: Gt",
        "motion mouths: if sound.number and f < 1: / 2 f < 1: LtE",
        # Without coefficients what they add is 0; a part in 65536 is below the tolerance.
        "motion drawn: if told.step == 63: / 1 63: one more",
        "motion residual: channels[c][t] += norm * wave * value / 65536 / 3 65536: one more",
    }
)
"""Changes that change nothing: each with its reason, by function, statement and place in it."""

NOT_SHOWN = frozenset(
    {
        "motion strokes: found[g].reach = max(found[g].reach, found[g].leave + 1, fou / 5 1: one more",
        "motion strokes: found[g].reach = max(found[g].reach, found[g].leave + 1, fou / 6 found[g - 1].reach + 1: Sub",
    }
)
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
                change.visit(fresh)
                tree, told = ast.fix_missing_locations(fresh), change.told
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
        told = all(says(modules, case) for case in DOCUMENT["cases"])
        return told and moves(modules) and draws(modules)
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
        "span": [found.first_tick, found.ticks, found.l0, found.l1],
        "learns": found.learns,
        "line": found.line,
        "payloads": [payload.hex() for payload in found.payloads],
        "keys": [[cue.number, cue.start, cue.end] for cue in files.keys(found)],
    }


def moves(modules: dict[str, Any]) -> bool:
    """Return whether a reader gives the strokes of another language, whose placements move."""
    joining, motion = modules["joining"], modules["motion"]
    with using(AMERICAN):
        for case in (case for case in LANGUAGE["cases"] if "strokes" in case):
            scores = {0: case["score"]}
            cues = joining.keys_of(joining.line_of(scores), scores)
            gap = motion.REST_GAPS[case["score"]["rest_gap"]]
            found = motion.strokes(cues, gap, coding())
            if [[one.number, one.leave, one.reach] for one in found[1:]] != case["strokes"]:
                return False
    return True


def draws(modules: dict[str, Any]) -> bool:
    """Return whether a reader gives the markers of the files that are drawn."""
    files, motion, markers = (modules[name] for name in ("files", "motion", "markers"))
    voice = markers.read_voice(DATA / "voices" / "claire.npz")
    arrays = motion.read_coding(DATA / "coding" / f"{markers.identity(voice)}.npz")
    scales = [
        [
            [int(arrays[f"{basis}.scales"].at(c, f)) for f in range(32)]
            for c in range(arrays[f"{basis}.scales"].shape[0])
        ]
        for basis in motion.BASES
    ]
    for case in reversed(DRAWN):
        found = files.read(bytes.fromhex(case["file"]))
        frames = files.parameters(found, scales, moved(arrays, case))
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
        yield found, f"{source} {told}"
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
