"""A night of fuzzing: every target in a process of its own, mutated inputs until its time is over.

``python -m tests.fuzz.night --seconds 3600`` divides the time among all targets; ``--inputs N``
counts instead; names choose targets. What breaks a target is kept in ``tests/fuzz/found``.
"""

import argparse
import hashlib
import multiprocessing
import resource
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path
from types import FrameType

import numpy as np

from codec.errors import CueError
from tests.fuzz.mutate import mutated
from tests.fuzz.targets import TARGETS

FOUND = Path(__file__).with_name("found")
LONGEST_S = 20
MOST_MEMORY_KB = 500_000
"""By which a target may raise what the process needed after its seeds."""


class HangError(Exception):
    """An input that takes too long."""


def attempt(name: str, data: bytes) -> str:
    """Give a target an input; return what is wrong, or nothing."""

    def late(number: int, frame: FrameType | None) -> None:
        raise HangError(f"not done after {LONGEST_S} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(LONGEST_S)
    try:
        TARGETS[name].run(data)
    except CueError as error:
        return "an error of more than one line" if "\n" in str(error) else ""
    except Exception:
        return traceback.format_exc()
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return ""


def fuzz(name: str, seconds: float, inputs: int, seed: int) -> int:
    """Feed one target; return how many inputs broke it."""
    warnings.simplefilter("error")
    rng = np.random.default_rng([seed, list(TARGETS).index(name)])
    target = TARGETS[name]
    seeds = target.seeds()
    broken = done = 0
    causes: set[str] = set()
    for data in seeds:
        attempt(name, data)
    base = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.monotonic()
    while done < inputs and time.monotonic() - begin < seconds:
        data = mutated(seeds, rng, text=target.text)
        done += 1
        wrong = attempt(name, data)
        if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss > base + MOST_MEMORY_KB:
            wrong = wrong or f"more than {MOST_MEMORY_KB} kB"
            base = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        if wrong:
            broken += 1
            cause = wrong.strip().splitlines()[-1]
            if cause not in causes and len(causes) < 10:
                causes.add(cause)
                FOUND.mkdir(exist_ok=True)
                path = FOUND / f"{name}-{hashlib.sha256(data).hexdigest()[:12]}"
                path.write_bytes(data)
                print(f"{name}: {path.name}\n{wrong}", file=sys.stderr, flush=True)
    took = time.monotonic() - begin
    print(f"{name:12} {done:9} inputs {broken:5} broke it {took:7.0f} s", flush=True)
    return broken


def main() -> int:
    """Run all targets, or some; 1 if any input broke one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=[], metavar="TARGET")
    parser.add_argument("--seconds", type=float, default=3600.0, help="for all targets together")
    parser.add_argument("--inputs", type=int, default=1 << 60, help="for each target at most")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    args = parser.parse_args()
    names = args.names or list(TARGETS)
    print(f"seed {args.seed}")
    context = multiprocessing.get_context("spawn")
    failed = 0
    for name in names:
        child = context.Process(
            target=_child, args=(name, args.seconds / len(names), args.inputs, args.seed)
        )
        child.start()
        child.join()
        failed += child.exitcode != 0
    return int(failed > 0)


def _child(name: str, seconds: float, inputs: int, seed: int) -> None:
    sys.exit(fuzz(name, seconds, inputs, seed) > 0)


if __name__ == "__main__":
    sys.exit(main())
