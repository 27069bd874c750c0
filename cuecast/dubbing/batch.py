"""Many programmes: a catalogue goes in, a folder of dubbed programmes and a summary come out.

Finished items are not done again (`cuecast.dubbing.ledger`); several batches, on several machines
too, may work on one folder and share the work. Whatever goes wrong with a programme stands in its
row of the summary and does not stop the others.
"""

import argparse
import csv
import io
import time
from collections import Counter
from collections.abc import Callable
from contextlib import closing, redirect_stderr
from pathlib import Path
from typing import Any

from codec.errors import CueError
from cuecast.dubbing.catalogue import Task
from cuecast.dubbing.ledger import BatchItem, BusyError, clean
from cuecast.dubbing.workers import Cluster, Processes, TaskOutcome

SUMMARY = "summary.csv"
FIELDS = (
    "programme", "output", "status", "error", "duration_s", "superframes", "keys", "snr_db", "odg",
    "received", "lost", "elapsed_s",
)  # fmt: skip

_ATTEMPTS = 5
"""How often a programme is given to a worker before it counts as the one that kills them."""

_BUSY_S = 0.3
"""Pause in seconds before asking again for a programme that another batch works on."""

_BUSY = "elsewhere"


def run_task(task: Task) -> dict[str, Any]:
    """Dub one programme unless it is done; return its row of the summary."""
    began = time.perf_counter()
    notes = io.StringIO()

    def work(made: Path) -> dict[str, Any]:
        from cuecast.dubbing.job import job_of, run_job
        from cuecast.dubbing.memory import keep_freed_memory

        keep_freed_memory()
        args = argparse.Namespace(
            programme=task.programme,
            output=str(made),
            subtitles=task.subtitles or None,
            motion=task.motion or None,
            **task.options,
        )
        with redirect_stderr(notes):
            report = run_job(job_of(args))
        return report | {"notes": notes.getvalue().splitlines()}

    try:
        record, made = BatchItem(task).run(work)
    except BusyError:
        return _row(task, _BUSY)
    except CueError as error:
        return _row(task, "failed", str(error))
    except OSError as error:
        named = error.filename and error.strerror
        return _row(task, "failed", f"{error.filename}: {error.strerror}" if named else str(error))
    except Exception as error:  # what nobody foresaw is this programme's, not the batch's
        return _row(task, "failed", f"{type(error).__name__}: {error}")
    return _row(task, "done" if made else "done before", record=record) | {
        "elapsed_s": round(time.perf_counter() - began, 2)
    }


def _row(
    task: Task, status: str, error: str = "", record: dict[str, Any] | None = None
) -> dict[str, Any]:
    row = {
        "programme": task.programme,
        "output": task.output,
        "status": status,
        "error": " ".join(error.split()),
    }
    if record is None:
        return row
    audio = record["carriers"].get("audio", {})
    carriers = record.get("read_back", {"carriers": {}})["carriers"].values()
    return row | {
        "duration_s": record["duration_s"],
        "superframes": record["superframes"],
        "keys": len(record["keys"]),
        "snr_db": audio.get("snr_db"),
        "odg": audio.get("odg"),
        "received": sum(one["received"] for one in carriers),
        "lost": sum(one["lost"] for one in carriers),
    }


class _BatchRun:
    """One run over a catalogue: rows as they come in, and the remaining work."""

    def __init__(self, tasks: list[Task], folder: Path, tell: Callable[[str], None]) -> None:
        self._tasks, self._folder, self._tell = tasks, folder, tell
        self.rows: dict[str, dict[str, Any]] = {}
        self._attempts: Counter[str] = Counter()
        self._began_s, self._made = time.monotonic(), 0

    def done_before(self) -> list[Task]:
        """Note finished items; return the rest."""
        rest = []
        for task in self._tasks:
            record = BatchItem(task).done()
            if record is None:
                rest.append(task)
            else:
                self.rows[task.output] = _row(task, "done before", record=record)
        return rest

    def take(self, outcome: TaskOutcome) -> bool:
        """Note how a task ended; return whether it is to be given out again."""
        task, row = outcome.task, outcome.row
        if row is not None and row["status"] == _BUSY:
            time.sleep(_BUSY_S)
            return True
        if row is None:
            self._attempts[task.output] += 1
            if self._attempts[task.output] < _ATTEMPTS:
                self._tell(f"again: {task.output}: {outcome.reason}")
                return True
            row = _row(task, "failed", f"{outcome.reason}, {_ATTEMPTS} times")
        self.rows[task.output] = _row(task, row["status"]) | row
        self._made += row["status"] == "done"
        self._tell(self._line(self.rows[task.output]))
        self.write()
        return False

    def _line(self, row: dict[str, Any]) -> str:
        left = len(self._tasks) - len(self.rows)
        line = f"[{len(self.rows)}/{len(self._tasks)}] {row['status']}: {row['output']}"
        if row["error"]:
            line += f" {row['error']}"
        if left and self._made:
            minutes = (time.monotonic() - self._began_s) / self._made * left / 60
            line += f" ({minutes:.0f} min left)" if minutes >= 1 else " (under 1 min left)"
        return line

    def close(self) -> list[dict[str, Any]]:
        """Write the summary, whatever happened; return its rows in the order of the catalogue."""
        for task in self._tasks:
            self.rows.setdefault(task.output, _row(task, "not done"))
        self.write()
        clean(self._folder)
        return [self.rows[task.output] for task in self._tasks]

    def write(self) -> None:
        """Write the summary as it stands, unless another batch is just doing that."""
        item = BatchItem(Task("", str(self._folder / SUMMARY)))
        try:
            with item.locked():
                made = item.folder / SUMMARY
                with made.open("w", encoding="utf-8", newline="") as file:
                    writer = csv.DictWriter(file, FIELDS, extrasaction="ignore")
                    writer.writeheader()
                    rows = (self.rows.get(task.output) for task in self._tasks)
                    writer.writerows(row for row in rows if row is not None)
                made.replace(item.output)
        except BusyError:
            return


def run_batch(
    tasks: list[Task],
    folder: Path,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    tell: Callable[[str], None] = lambda line: None,
    warm: Callable[[], object] | None = None,
) -> list[dict[str, Any]]:
    """Run all tasks and write the summary.

    Parameters
    ----------
    tasks : list of Task
    folder : Path
        Of the outputs, made if it does not exist.
    jobs : int
        How many programmes at once, on this machine.
    scheduler : str, optional
        Address of a Dask scheduler that spreads them over many machines instead; these see the
        files under the same names.
    tell : callable
        Called with a line for each event.
    warm : callable, optional
        As of `cuecast.dubbing.workers.Cluster`.

    Returns
    -------
    list of dict
        Rows in the order of the catalogue.
    """
    folder.mkdir(parents=True, exist_ok=True)
    clean(folder)
    run = _BatchRun(tasks, folder.absolute(), tell)
    rest = run.done_before()
    try:
        if rest:
            pool: Processes | Cluster = (
                Processes(min(jobs, len(rest)), run_task)
                if scheduler is None
                else Cluster(scheduler, run_task, tell, warm)
            )
            with closing(pool):
                for task in rest:
                    pool.submit(task)
                for outcome in pool.outcomes():
                    if run.take(outcome):
                        pool.submit(outcome.task)
    finally:
        rows = run.close()
    return rows
