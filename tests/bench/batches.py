"""Batches that are killed, that share a folder, and that have two workers instead of one.

Each of them makes its own catalogue of short programmes and prints its figures as JSON; exit 1
where work was lost, done twice, or left over. Linux only. Run:
``python -m tests.bench.batches killed --items 200 --kills 100``, or ``shared``, ``faster``,
``cluster`` for a Dask scheduler and workers that are killed, and ``fresh`` for workers that have
nothing compiled yet, then for two workers instead of one.
"""

import argparse
import contextlib
import json
import os
import random
import re
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from cuecast.demo.content import FS, make_sound
from cuecast.demo.run import as_srt
from cuecast.dubbing.ledger import WORK
from cuecast.media.film import write_film

ROOT = Path(__file__).resolve().parents[2]
FAST = ("--no-grade", "--no-read-back")
SECONDS = 2.0
"""Length of a programme. ``fresh`` takes another one by ``--seconds``: of programmes as short as
this one, starting the workers takes a third of the time."""

_SOURCES = 12
"""Sounds that differ; the items are copies of them."""

_PAUSE_S = (0.0, 1.0)
"""Between one kill and the next, once something is under way."""

_PATIENCE_S = 120.0
"""Longest wait for something to kill."""


def make_catalogue(folder: Path, items: int, seconds: float = SECONDS) -> Path:
    """Write a catalogue of short programmes and return its path."""
    sound, subtitles = make_sound()
    (folder / "a.srt").write_text(as_srt(subtitles[:1]), encoding="utf-8")
    rows = ["programme,subtitles"]
    length = round(seconds * FS)
    for n in range(items):
        path = folder / f"{n:03d}.flac"
        if n < _SOURCES:
            begin = n * (len(sound) - length) // _SOURCES
            write_film(path, sound[begin : begin + length], FS, encoder="flac")
        else:
            path.write_bytes((folder / f"{n % _SOURCES:03d}.flac").read_bytes())
        rows.append(f"{path.name},a.srt")
    (folder / "list.csv").write_text("\n".join(rows), encoding="utf-8")
    return folder / "list.csv"


def start(catalogue: Path, out: Path, log: IO[bytes], *options: str) -> subprocess.Popen[bytes]:
    """Begin a batch; what it tells is added to a log."""
    argv = [sys.executable, "-m", "cuecast", "batch", str(catalogue), "--out", str(out)]
    return subprocess.Popen(
        [*argv, *FAST, *options], stdout=subprocess.DEVNULL, stderr=log, cwd=ROOT
    )


def outputs(folder: Path) -> dict[str, bytes]:
    """Return what a batch made, by name."""
    return {path.name: path.read_bytes() for path in folder.glob("*.flac")}


def left_over(out: Path, items: int) -> list[str]:
    """Return what lies in the folder of a batch beside outputs, records and summary."""
    names = {f"{n:03d}.flac" for n in range(items)}
    wanted = names | {f"{name}.json" for name in names} | {"summary.csv"}
    return sorted({path.name for path in out.iterdir()} - wanted)


def made_twice(log: Path) -> list[str]:
    """Return the programmes that were made more than once, as the batches told."""
    told = re.findall(r"\] done: (\S+)", log.read_text(encoding="utf-8", errors="replace"))
    return sorted(name for name, count in Counter(told).items() if count > 1)


def children(pid: int) -> list[int]:
    """Return the workers that a process has started, from whichever of its threads."""
    found: list[str] = []
    with contextlib.suppress(OSError):
        for path in Path(f"/proc/{pid}/task").glob("*/children"):
            found += path.read_text(encoding="ascii").split()
    return [int(child) for child in found if _is_worker(int(child))]


def _is_worker(pid: int) -> bool:
    with contextlib.suppress(OSError):
        line = Path(f"/proc/{pid}/cmdline").read_bytes()
        return b"spawn_main" in line or b"forkserver" in line
    return False


def until_due(out: Path, batch: subprocess.Popen[bytes], done: float) -> None:
    """Wait until so many programmes are done and one is under way, or the batch has ended.

    So kills are spread over all programmes; between them a process may be doing anything.
    """
    deadline = time.monotonic() + _PATIENCE_S
    while time.monotonic() < deadline and batch.poll() is None:
        if len(list(out.glob("*.flac"))) >= done and any(out.glob(f"{WORK}/*.flac")):
            return
        time.sleep(0.02)


def kill(pid: int) -> bool:
    """Kill a process outright; tell whether it was there."""
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True


def undisturbed(folder: Path, items: int) -> dict[str, bytes]:
    """Return what batches make that nobody disturbs: from each sound once, for all its copies."""
    alone = folder / "alone"
    alone.mkdir()
    catalogue = make_catalogue(alone, min(items, _SOURCES))
    with (folder / "undisturbed.log").open("wb") as log:
        process = start(catalogue, alone / "out", log, "--jobs", "2")
        assert process.wait() == 0, "the undisturbed batch failed"
    made = outputs(alone / "out")
    return {f"{n:03d}.flac": made[f"{n % _SOURCES:03d}.flac"] for n in range(items)}


def verdict(
    out: Path, log: Path, wanted: dict[str, bytes], figures: dict[str, Any]
) -> dict[str, Any]:
    """Return figures together with what is wrong with the outputs."""
    made = outputs(out)
    return figures | {
        "items": len(wanted),
        "missing_or_other": sorted(n for n in wanted if made.get(n) != wanted[n]),
        "made_twice": made_twice(log),
        "left_over": left_over(out, len(wanted)),
    }


def killed(folder: Path, items: int, kills: int, seed: int) -> dict[str, Any]:
    """Kill workers and batches at random moments, start again, and compare."""
    catalogue, rng = make_catalogue(folder, items), random.Random(seed)
    wanted = undisturbed(folder, items)
    out, log, count = folder / "out", folder / "killed.log", Counter[str]()
    with log.open("ab") as told:
        process = start(catalogue, out, told, "--jobs", "2")
        while count.total() < kills:
            until_due(out, process, items * count.total() / kills)
            time.sleep(rng.uniform(*_PAUSE_S))
            if process.poll() is not None:
                break
            victims = [process.pid, *children(process.pid)]
            victim = rng.choice(victims)
            count["batch" if victim == process.pid else "worker"] += kill(victim)
            if victim == process.pid:
                process.wait()
                process = start(catalogue, out, told, "--jobs", "2")
        status = process.wait() or start(catalogue, out, told).wait()
    return verdict(out, log, wanted, {"status": status, "killed": dict(count)})


def shared(folder: Path, items: int) -> dict[str, Any]:
    """Let two batches work on one folder at once."""
    catalogue = make_catalogue(folder, items)
    wanted = undisturbed(folder, items)
    out, logs = folder / "out", [folder / f"{name}.log" for name in ("one", "two")]
    with contextlib.ExitStack() as files:
        running = [start(catalogue, out, files.enter_context(log.open("wb"))) for log in logs]
        status = max(process.wait() for process in running)
    both = folder / "both.log"
    both.write_bytes(b"".join(log.read_bytes() for log in logs))
    each = [log.read_bytes().count(b"] done: ") for log in logs]
    return verdict(out, both, wanted, {"status": status, "made_by_each": each})


def faster(folder: Path, items: int) -> dict[str, Any]:
    """Compare one worker with two: by the clock, which needs free cores, and by processor time.

    The latter says what free cores would give: two workers share what they spend together.
    """
    catalogue = make_catalogue(folder, items)
    seconds, spent = {}, {}
    for jobs in ("1", "2"):
        with (folder / f"{jobs}.log").open("wb") as log:
            began, before = time.monotonic(), children_s()
            assert start(catalogue, folder / f"out{jobs}", log, "--jobs", jobs).wait() == 0
            seconds[jobs], spent[jobs] = time.monotonic() - began, children_s() - before
    return {
        "items": items,
        "seconds": seconds,
        "processor_seconds": spent,
        "times_as_fast": seconds["1"] / seconds["2"],
        "times_as_fast_on_free_cores": 2 * spent["1"] / spent["2"],
    }


def children_s() -> float:
    """Return the processor time of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextlib.contextmanager
def dask(*arguments: str, log: IO[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    """Run a part of Dask for as long as the block."""
    process = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]],
        stdout=log,
        stderr=log,
        cwd=ROOT,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def cluster(folder: Path, items: int, kills: int, seed: int) -> dict[str, Any]:
    """Kill the workers and the scheduler of a Dask cluster while a batch uses it."""
    catalogue, rng = make_catalogue(folder, items), random.Random(seed)
    wanted = undisturbed(folder, items)
    address, scheduler, workers = cluster_of(folder, 2)
    out, log = folder / "out", folder / "cluster.log"
    count = Counter[str]()
    with contextlib.ExitStack() as parts, log.open("ab") as told:
        noise = parts.enter_context((folder / "dask.log").open("ab"))
        head = parts.enter_context(dask(*scheduler, log=noise))
        nanny = parts.enter_context(dask(*workers, log=noise))
        process = start(catalogue, out, told, "--scheduler", address)
        while count.total() < kills and process.poll() is None:
            until_due(out, process, items * count.total() / kills)
            time.sleep(rng.uniform(*_PAUSE_S))
            if count.total() % 4 == 3:
                count["scheduler"] += kill(head.pid)
                head.wait()
                head = parts.enter_context(dask(*scheduler, log=noise))
                # Workers that have lost their scheduler end; whoever runs them starts new ones.
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(nanny.pid, signal.SIGKILL)
                nanny.wait()
                nanny = parts.enter_context(dask(*workers, log=noise))
            elif alive := children(nanny.pid):
                count["worker"] += kill(rng.choice(alive))
        status = process.wait()
        again = start(catalogue, out, told, "--scheduler", address).wait() if status else 0
    return verdict(out, log, wanted, {"status": again, "first": status, "killed": dict(count)})


def cluster_of(folder: Path, workers: int) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Return a free address, and the arguments of a scheduler there and of its workers."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    return (
        address,
        ("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"),
        ("worker", address, "--nworkers", str(workers), "--nthreads", "1", "--no-dashboard",
         "--local-directory", str(folder / "dask")),
    )  # fmt: skip


def fresh(folder: Path, items: int, programme_s: float) -> dict[str, Any]:
    """Time the first item of two workers that compile first; then one worker and two, compiled."""
    catalogue = make_catalogue(folder, items, programme_s)
    os.environ["NUMBA_CACHE_DIR"] = str(folder / "compiled")
    first, seconds, status = 0.0, {}, 0
    for name, workers in (("fresh", 2), ("1", 1), ("2", 2)):
        address, head, rest = cluster_of(folder, workers)
        out = folder / f"out-{name}"
        with (folder / f"{name}.log").open("ab") as log, dask(*head, log=log), dask(*rest, log=log):
            began = time.monotonic()
            process = start(catalogue, out, log, "--scheduler", address)
            while process.poll() is None and not any(out.glob("*.flac")):
                time.sleep(0.05)
            first = first or time.monotonic() - began
            status = max(status, process.wait())
            seconds[name] = time.monotonic() - began
    return {
        "items": items,
        "programme_s": programme_s,
        "status": status,
        "first_item_s": first,
        "seconds": seconds,
        "times_as_fast": seconds["1"] / seconds["2"],
    }


def main() -> int:
    """Run one of them as told."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("killed", "shared", "faster", "cluster", "fresh"))
    parser.add_argument("--items", type=int, default=40)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if args.what == "killed":
            figures = killed(folder, args.items, args.kills, args.seed)
        elif args.what == "cluster":
            figures = cluster(folder, args.items, args.kills, args.seed)
        elif args.what == "fresh":
            figures = fresh(folder, args.items, args.seconds)
        else:
            simple = {"shared": shared, "faster": faster}
            figures = simple[args.what](folder, args.items)
    print(json.dumps(figures, indent=1))
    wrong = [figures.get(k) for k in ("status", "missing_or_other", "made_twice", "left_over")]
    return 1 if any(wrong) else 0


if __name__ == "__main__":
    sys.exit(main())
