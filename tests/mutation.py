"""Which changes of the core rooms no test notices: mutants of cosmic-ray, each in a forked process.

``python -m tests.mutation [--sample N] [--record FILE] [ROOM ...]``; rooms are those of `ROOMS`.
A process that has loaded all libraries forks for every mutant, so that one takes seconds, not a
start of Python. The tests of a room are those that know it, quickest to notice first. A run that is
interrupted records what it tried.

Annotations and the compiler's decorators are not mutated: they are no behaviour. Survivors that
`equivalent_mutants.txt` explains change nothing that can be seen; they are counted apart.
"""

import argparse
import ast
import difflib
import importlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import traceback
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.txt")
ROOMS = {
    "tracker": ("receiver/reception/tracking.py", "tests/receiver/reception/test_tracking.py"),
    "link": (
        "watermark/link",
        "watermark/link tests/watermark/link/test_link.py tests/watermark/link/test_combine.py",
    ),
    "bitstream": (
        "codec/superframe codec/streamfile",
        "tests/spec/test_bitstream_reference.py tests/codec/superframe/test_pinned.py "
        "tests/codec/superframe/test_score_coding.py tests/codec/streamfile/test_file_score.py "
        "tests/codec/superframe/test_superframe.py tests/codec/streamfile/test_stream.py "
        "codec/superframe codec/streamfile tests/codec/superframe "
        "tests/codec/analysis/test_phasing.py tests/codec/cuer/test_threads.py "
        "tests/spec/test_identity_reference.py tests/spec/test_misreadings.py "
        "tests/spec/test_motion_reference.py",
    ),
}
"""What is mutated, and the tests that are asked."""

MOST_CPU_S = 90
"""Seconds of processor time after which a mutant is caught: it does not end."""

MOST_BYTES = 8 << 30
"""Address space of a mutant's process."""

TOLD = 10
"""Mutants after which it is told how many were tried."""

_PYTEST = "-x -q -p no:cacheprovider -W ignore::pytest.PytestAssertRewriteWarning".split()
"""Plugins are loaded before the fork, which pytest warns of."""

_COMPILERS = ("njit", "cache", "lru_cache")
"""Decorators that only make things quick."""


@dataclass
class Mutant:
    """A change of one place, and what became of it: ``killed``, ``survived``, ``equivalent``."""

    path: str
    operator: str
    occurrence: int
    line: int
    definition: str
    before: str = ""
    after: str = ""
    outcome: str = ""
    took_s: float = 0.0


def behaviour(source: str) -> list[tuple[int, int, int, int]]:
    """Return the spans of a module that are no behaviour: line, column, last line, last column."""
    spans = []
    for node in ast.walk(ast.parse(source)):
        told: list[ast.expr | None] = []
        if isinstance(node, ast.arg | ast.AnnAssign):
            told.append(node.annotation)
        if isinstance(node, ast.FunctionDef):
            told.append(node.returns)
            told += [d for d in node.decorator_list if any(n in ast.unparse(d) for n in _COMPILERS)]
        for part in told:
            if part is not None:
                assert part.end_lineno is not None
                assert part.end_col_offset is not None
                column = part.col_offset - 1  # a decorator begins with its @
                spans.append((part.lineno, column, part.end_lineno, part.end_col_offset))
    return spans


def mutants_of(places: str) -> list[Mutant]:
    """Return all mutants of modules or of folders of them."""
    from cosmic_ray.commands.init import _all_work_items

    paths = [ROOT / place for place in places.split()]
    modules = [
        module
        for path in paths
        for module in (sorted(path.rglob("*.py")) if path.is_dir() else [path])
    ]
    spans = {str(m.relative_to(ROOT)): behaviour(m.read_text()) for m in modules}
    found = []
    for item in _all_work_items(modules, {}):
        change = item.mutations[0]
        name = str(Path(change.module_path).relative_to(ROOT))
        at, end = tuple(change.start_pos), tuple(change.end_pos)
        if any((a, b) <= at and end <= (c, d) for a, b, c, d in spans[name]):
            continue
        found.append(
            Mutant(
                name, change.operator_name, change.occurrence, at[0], change.definition_name or ""
            )
        )
    return found


class Forge:
    """Runs the tests of a room on one mutant after the other, in a copy of the project."""

    def __init__(self, copy: Path, tests: str) -> None:
        self._copy, self._tests = copy, tests.split()
        sys.dont_write_bytecode = False
        modules = copy / "modules.json"
        if self._forked(modules) != 0:
            raise SystemExit(f"the tests cannot be collected: {copy / 'tests.log'}")
        sys.dont_write_bytecode = True
        for name in json.loads(modules.read_text()):
            try:
                importlib.import_module(name)
            except Exception as error:
                print(f"{name}: {error}", file=sys.stderr)
        if self._forked() != 0:
            raise SystemExit(f"the tests fail without a mutant: {copy / 'tests.log'}")

    def test(self, mutant: Mutant) -> None:
        """Apply a mutant, see whether a test notices, and take it back."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        path = self._copy / mutant.path
        source, stamp = path.read_text(), path.stat()
        changed = mutate_code(source, get_operator(mutant.operator)(), mutant.occurrence)
        lines = list(difflib.ndiff(source.splitlines(), changed.splitlines()))
        mutant.before = "\n".join(line[2:] for line in lines if line.startswith("- ")).strip()
        mutant.after = "\n".join(line[2:] for line in lines if line.startswith("+ ")).strip()
        begin = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        try:
            path.write_text(changed)
            os.utime(path, (stamp.st_atime, stamp.st_mtime + 1 + random.random() * 1e6))
            mutant.outcome = "survived" if self._forked() == 0 else "killed"
        finally:
            path.write_text(source)
            os.utime(path, (stamp.st_atime, stamp.st_mtime))
        mutant.took_s = round(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - begin, 1)

    def _forked(self, modules: Path | None = None) -> int:
        """Run the tests in a child; return its status. The first only tells what they load."""
        child = os.fork()
        if child:
            return os.waitpid(child, 0)[1]
        status = 1
        try:
            status = self._child(modules)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(status)

    def _own(self) -> set[str]:
        """Return the names of the project's packages."""
        return {path.name for path in self._copy.iterdir() if path.is_dir()}

    def _child(self, modules: Path | None) -> int:
        import pytest

        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_CPU_S,) * 2)
        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
        log = os.open(self._copy / "tests.log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for stream in (1, 2):
            os.dup2(log, stream)
        os.chdir(self._copy)
        sys.path.insert(0, str(self._copy))
        loaded = {name for name in self._own() if name in sys.modules} - {"tests"}
        assert not loaded, f"{loaded} would be those of the original"
        sys.modules.pop("tests", None)
        only = () if modules is None else ("--collect-only",)
        status = pytest.main([*_PYTEST, *only, *self._tests])
        if modules is not None:
            own = self._own() | {"__main__"}
            names = [n for n, m in sys.modules.items() if n.partition(".")[0] not in own and m]
            modules.write_text(json.dumps(names))
        return int(status)


def reasons() -> dict[tuple[str, str, str], str]:
    """Return why mutants cannot be told from the original: by module, line before and after."""
    found = {}
    if EQUIVALENT.exists():
        for block in EQUIVALENT.read_text().split("\n\n"):
            lines = [line for line in block.splitlines() if line and not line.startswith("#")]
            if lines:
                path, before, after, reason = lines
                found[path, before.removeprefix("- "), after.removeprefix("+ ")] = reason
    return found


def examine(room: str, sample: int, seed: int, folder: Path) -> tuple[list[Mutant], int]:
    """Run the mutants of a room, or some at random; return them, and how many there are."""
    mutants = mutants_of(ROOMS[room][0])
    total = len(mutants)
    if sample:
        mutants = random.Random(seed).sample(mutants, min(sample, total))
    return judged(room, mutants, folder), total


def judged(room: str, mutants: list[Mutant], folder: Path) -> list[Mutant]:
    """Run mutants of a room until interrupted; print what survives, return what was tried."""
    explained = reasons()
    forge = Forge(copied(folder / room), ROOMS[room][1])
    for number, mutant in enumerate(mutants, start=1):
        try:
            forge.test(mutant)
        except KeyboardInterrupt:
            return mutants[: number - 1]
        if number % TOLD == 0:
            print(f"[{number}/{len(mutants)}] tried", file=sys.stderr, flush=True)
        if mutant.outcome == "survived":
            if (mutant.path, mutant.before, mutant.after) in explained:
                mutant.outcome = "equivalent"
            print(
                f"[{number}/{len(mutants)}] {mutant.outcome} {mutant.took_s} s {mutant.path}:"
                f"{mutant.line} {mutant.definition}\n- {mutant.before}\n+ {mutant.after}\n",
                flush=True,
            )
    return mutants


def keep(path: Path, room: str, tried: list[Mutant], total: int, seed: int) -> dict[str, Any]:
    """Add what was tried of a room to a record, and return its counts.

    The score leaves out the equivalent ones. What was tried earlier counts unless tried again; the
    seed is that of the last sample.
    """
    from cuecast.evaluate.records import make_record, read_record

    rows = read_record(path)["results"] if path.exists() else []
    before: dict[str, str] = next((row["outcomes"] for row in rows if row["room"] == room), {})
    outcomes = before | {f"{m.path} {m.operator} {m.occurrence}": m.outcome for m in tried}
    count = Counter(outcomes.values())
    row = {
        "room": room,
        "seed": seed,
        "mutants": total,
        "tried": len(outcomes),
        "killed": count["killed"],
        "survived": count["survived"],
        "equivalent": count["equivalent"],
        "score": round(count["killed"] / max(1, count["killed"] + count["survived"]), 3),
    }
    told: dict[str, Any] = row | {"outcomes": outcomes}
    rows = [old for old in rows if old["room"] != room] + [told]
    rows.sort(key=lambda one: list(ROOMS).index(one["room"]))
    document = make_record("mutation", (), rows, seed=seed, clips=None)
    document["command"] = "python -m tests.mutation ROOM --sample N --seed SEED --record FILE"
    told["commit"] = document["commit"]
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return row


def copied(copy: Path) -> Path:
    """Copy what git knows of the project, with the kernels that are compiled already."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True
    )
    names = [Path(name) for name in listed.stdout.decode().splitlines()]
    for name in names:
        if (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, copy / name)
    for name in {name.parent for name in names}:
        for compiled in (ROOT / name / "__pycache__").glob("*.nb[ic]"):
            (copy / name / "__pycache__").mkdir(exist_ok=True)
            shutil.copy2(compiled, copy / name / "__pycache__")
    return copy


def main() -> None:
    """Mutate the rooms that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rooms", nargs="*", metavar="ROOM")
    parser.add_argument("--sample", type=int, default=0, help="mutants of each room at most")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--record", type=Path, help="keep and add counts there")
    args = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with tempfile.TemporaryDirectory() as folder:
        record = args.record or Path(folder) / "record.json"
        rooms = {
            room: examine(room, args.sample, args.seed, Path(folder))
            for room in args.rooms or ROOMS
        }
        for room, (tried, total) in rooms.items():
            print(keep(record, room, tried, total, args.seed), flush=True)


if __name__ == "__main__":
    main()
