"""A night of fuzzing: every target in a process of its own, mutated inputs until its time is over.

``python -m tests.fuzz.night --seconds 3600`` divides the time among all targets; ``--inputs N``
counts instead; names choose targets. What breaks a target is kept in ``tests/fuzz/found``;
``python -m tests.fuzz.archive TARGET FILE`` makes a regression of it.
``--record FILE`` keeps the figures as a record, with the lines of each target's rooms that some of
its inputs reach; what was recorded of other targets stays. Compiled kernels are not counted.
"""

import argparse
import hashlib
import json
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from codec.errors import CueError
from cuecast.evaluate.records import make_record, read_record
from tests.fuzz.mutate import mutated
from tests.fuzz.targets import TARGETS

ROOT = Path(__file__).parents[2]
FOUND = Path(__file__).with_name("found")
COUNTED = 1000
"""Inputs of which lines are counted: that takes several times as long."""
LONGEST_S = 20
"""Processor time that an input may take; waiting may take as much as `PATIENCE` times that."""
PATIENCE = 30
MOST_MEMORY_KB = 500_000
"""By which a target may raise what the process needed after its seeds."""


class HangError(Exception):
    """An input that takes too long."""


def attempt(name: str, data: bytes) -> str:
    """Give a target an input; return what is wrong, or nothing."""

    def late(number: int, frame: FrameType | None) -> None:
        raise HangError(f"not done after {LONGEST_S} s")

    watches = (signal.SIGPROF, signal.SIGALRM)
    before = [signal.signal(watch, late) for watch in watches]
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    signal.alarm(PATIENCE * LONGEST_S)
    try:
        TARGETS[name].run(data)
    except CueError as error:
        return "an error of more than one line" if "\n" in str(error) else ""
    except Exception:
        return traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        for watch, old in zip(watches, before, strict=True):
            signal.signal(watch, old)
    return ""


def fuzz(
    name: str, seconds: float, inputs: int, seed: int, last: Path | None = None
) -> dict[str, Any]:
    """Feed one target; return how many inputs it took, how many broke it, and what it needed.

    Each input is kept in the file `last`, if there is one, until the next: it may end the process.
    """
    warnings.simplefilter("error")
    rng = np.random.default_rng([seed, list(TARGETS).index(name)])
    target = TARGETS[name]
    seeds = target.seeds()
    broken = done = 0
    causes: set[str] = set()
    for data in seeds:
        attempt(name, data)
    base = peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.monotonic()
    while done < inputs and time.monotonic() - begin < seconds:
        data = mutated(seeds, rng, text=target.text)
        done += 1
        if last is not None:
            last.write_bytes(data)
        wrong = attempt(name, data)
        now = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        if peak <= base + MOST_MEMORY_KB < now:
            wrong = wrong or f"more than {MOST_MEMORY_KB} kB"
        peak = max(peak, now)
        if wrong:
            broken += 1
            cause = wrong.strip().splitlines()[-1]
            if cause not in causes and len(causes) < 10:
                causes.add(cause)
                tell(name, data, wrong)
    took = time.monotonic() - begin
    return {
        "target": name,
        "inputs": done,
        "broken": broken,
        "took_s": round(took),
        "grown_mb": round((peak - base) / 1000),
        "peak_mb": round(peak / 1000),
    }


def tell(name: str, data: bytes, wrong: str) -> None:
    """Keep an input that broke a target, and say what it did."""
    FOUND.mkdir(exist_ok=True)
    path = FOUND / f"{name}-{hashlib.sha256(data).hexdigest()[:12]}"
    path.write_bytes(data)
    print(f"{name}: {path.name}\n{wrong}", file=sys.stderr, flush=True)


def in_a_process(name: str, seconds: float, inputs: int, seed: int) -> dict[str, Any] | None:
    """Feed one target in a process of its own; nothing if an input ended that."""
    with tempfile.TemporaryDirectory() as folder:
        last = Path(folder) / "last"
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as child:
            try:
                return child.submit(fuzz, name, seconds, inputs, seed, last).result()
            except BrokenProcessPool:
                data = last.read_bytes() if last.exists() else b""
        tell(name, data, "it ended the process")
        return None


def covered(name: str, inputs: int, seed: int) -> dict[str, int]:
    """Return lines of a target's rooms, and how many of them some inputs reach."""
    own = [path for room in TARGETS[name].rooms for path in _modules(room)]
    with tempfile.TemporaryDirectory() as folder:
        data, report = Path(folder) / "data", Path(folder) / "report.json"
        coverage = [sys.executable, "-m", "coverage"]
        subprocess.run(
            [*coverage, "run", f"--data-file={data}", f"--include={','.join(own)}",
             "-m", "tests.fuzz.night", name, "--here",
             "--inputs", str(inputs), "--seed", str(seed)],
            check=False, capture_output=True, cwd=ROOT,
        )  # fmt: skip
        subprocess.run(
            [*coverage, "json", f"--data-file={data}", "-o", report, "-q"], check=True, cwd=ROOT
        )
        totals = json.loads(report.read_text())["totals"]
    return {"lines": totals["num_statements"], "covered": totals["covered_lines"]}


def _modules(room: str) -> list[str]:
    paths = [ROOT / room] if room.endswith(".py") else sorted((ROOT / room).rglob("*.py"))
    return [str(path) for path in paths if path.name != "_kernels.py"]


def keep(path: Path, told: dict[str, Any], seed: int) -> None:
    """Put the figures of a target into a record; rows of other runs keep their commit and seed."""
    rows = read_record(path)["results"] if path.exists() else []
    rows = [row for row in rows if row["target"] != told["target"]] + [told]
    rows.sort(key=lambda row: list(TARGETS).index(row["target"]))
    document = make_record("fuzz", (), rows, seed=seed, clips=None)
    told |= {"seed": seed, "commit": document["commit"]}
    document["command"] = "python -m tests.fuzz.night TARGET --inputs N --seed SEED --record FILE"
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def main() -> int:
    """Run all targets, or some; 1 if any input broke one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=[], metavar="TARGET")
    parser.add_argument("--seconds", type=float, default=3600.0, help="for all targets together")
    parser.add_argument("--inputs", type=int, default=1 << 60, help="for each target at most")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--record", type=Path, metavar="FILE")
    parser.add_argument("--here", action="store_true", help="in this process")
    args = parser.parse_args()
    names = args.names or list(TARGETS)
    print(f"seed {args.seed}")
    failed = 0
    for name in names:
        run = (name, args.seconds / len(names), args.inputs, args.seed)
        told = fuzz(*run) if args.here else in_a_process(*run)
        if told is None:
            failed += 1
            continue
        print(
            f"{name:12} {told['inputs']:9} inputs {told['broken']:5} broke it "
            f"{told['took_s']:7} s {told['grown_mb']:4} MB more",
            flush=True,
        )
        failed += told["broken"]
        if args.record:
            told |= covered(name, min(told["inputs"], COUNTED), args.seed)
            keep(args.record, told, args.seed)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
