"""Many programmes: a catalogue goes in, a folder of dubbed programmes and a summary come out.

The catalogue is CSV with a header: ``programme`` and ``subtitles`` or ``motion``, and optionally
``output``; relative paths start at the catalogue. What is done is not done again: each output has
a report beside it that remembers from what it was made.
"""

import csv
import importlib
import json
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from codec.errors import CueError
from codec.files.whole import whole_file
from cuecast.command.files import write_json
from watermark.audio.profile import USUAL_GRADE

SUMMARY = "summary.csv"
FIELDS = (
    "programme", "output", "status", "error", "duration_s", "superframes", "keys", "snr_db", "odg",
    "elapsed_s",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Task:
    """One programme of a catalogue: what to dub with what into which file, with which options.

    Attributes
    ----------
    programme, output : str
        Paths.
    subtitles, motion : str
        Paths, one of them empty.
    voice : str
        Name or file.
    carriers : tuple of str
    grade : float
        What the mark aims at.
    seed, key : int
    """

    programme: str
    output: str
    subtitles: str
    motion: str
    voice: str = "claire"
    carriers: tuple[str, ...] = ("audio",)
    grade: float = USUAL_GRADE
    seed: int = 0
    key: int = 0

    @property
    def report(self) -> Path:
        """Where the report of this programme stands."""
        return Path(f"{self.output}.json")

    def fingerprint(self) -> dict[str, Any]:
        """Return what decides whether an output is still the one of this task."""
        stamps = {}
        for path in filter(None, (self.programme, self.subtitles, self.motion)):
            found = Path(path).stat()
            stamps[path] = [found.st_size, found.st_mtime_ns]
        return {**json.loads(json.dumps(asdict(self))), "inputs": stamps}


def read_catalogue(path: str | os.PathLike[str], folder: Path, **options: Any) -> list[Task]:
    """Read a catalogue.

    Parameters
    ----------
    path : path
        CSV.
    folder : Path
        Of the outputs.
    **options
        Further fields of every `Task`.

    Raises
    ------
    CueError
        If it is not a catalogue, or two programmes would have the same output.
    """
    home = Path(path).parent
    tasks: dict[str, Task] = {}
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file, strict=True))
    except (OSError, UnicodeError, csv.Error) as error:
        raise CueError(f"{path}: not a catalogue: {error}") from error
    for number, row in enumerate(rows, 2):
        cells = {
            name: (row.get(name) or "").strip() for name in ("programme", "subtitles", "motion")
        }
        if not cells["programme"] or bool(cells["subtitles"]) == bool(cells["motion"]):
            raise CueError(f"{path}: line {number}: needs programme, and subtitles or motion")
        programme, subtitles, motion = (str(home / c) if c else "" for c in cells.values())
        name = (row.get("output") or "").strip() or Path(cells["programme"]).name
        output = str(folder / Path(name).name)
        if output in tasks:
            raise CueError(f"{path}: line {number}: another programme has the output {output}")
        tasks[output] = Task(programme, output, subtitles, motion, **options)
    if not tasks:
        raise CueError(f"{path}: no programmes in it")
    return list(tasks.values())


def run_task(task: Task) -> dict[str, Any]:
    """Dub one programme unless it is done; return its row of the summary.

    What is wrong with a programme stands in the row and does not stop the others.
    """
    row: dict[str, Any] = {"programme": task.programme, "output": task.output, "error": ""}
    began = time.perf_counter()
    try:
        report = _done(task)
        row["status"] = "done before" if report is not None else "done"
        if report is None:
            report = _dub(task)
    except (CueError, OSError) as error:
        return row | {"status": "failed", "error": " ".join(str(error).split())}
    audio = report["carriers"].get("audio", {})
    return row | {
        "duration_s": report["duration_s"],
        "superframes": report["superframes"],
        "keys": len(report["keys"]),
        "snr_db": audio.get("snr_db"),
        "odg": audio.get("odg"),
        "elapsed_s": round(time.perf_counter() - began, 2),
    }


def _done(task: Task) -> dict[str, Any] | None:
    """Return the report of an earlier run if it was of the same task."""
    if not (task.report.exists() and Path(task.output).exists()):
        return None
    try:
        document = json.loads(task.report.read_text(encoding="utf-8"))
        same = document["task"] == task.fingerprint()
    except (ValueError, KeyError, TypeError):
        return None
    return dict(document) if same else None


def _dub(task: Task) -> dict[str, Any]:
    from codec.cuer.motion import load_motion
    from codec.cuer.voice import load_voice
    from cuecast.dubbing.dub import DubOptions, dub
    from cuecast.dubbing.motions import GivenMotion, MotionSource, SynthesisedMotion
    from synth.scoring.text_score import score_from_subtitles
    from synth.subtitles import read_subtitles

    fingerprint = task.fingerprint()
    voice = load_voice(task.voice)
    motion: MotionSource
    if task.motion:
        motion = GivenMotion(load_motion(task.motion), voice)
    else:
        score = score_from_subtitles(read_subtitles(task.subtitles), warn=lambda line: None)
        motion = SynthesisedMotion(score, voice, seed=task.seed)
    options = DubOptions(carriers=task.carriers, grade=task.grade, key=task.key)
    report = dub(task.programme, motion, voice, task.output, options)
    write_json(str(task.report), report | {"task": fingerprint})
    return report


def run_batch(
    tasks: list[Task],
    folder: Path,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Callable[[dict[str, Any]], None] = lambda row: None,
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
    progress : callable
        Told the row of every programme as it ends.

    Returns
    -------
    list of dict
        Rows in the order of the catalogue.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows: dict[str, dict[str, Any]] = {}
    with _executor(jobs, scheduler) as executor:
        futures: list[Future[dict[str, Any]]] = [executor.submit(run_task, t) for t in tasks]
        for future in as_completed(futures):
            row = future.result()
            rows[row["output"]] = row
            progress(row)
            _write_summary(folder, [rows[t.output] for t in tasks if t.output in rows])
    return [rows[task.output] for task in tasks]


@contextmanager
def _executor(jobs: int, scheduler: str | None) -> Iterator[Executor]:
    if scheduler is None:
        with ProcessPoolExecutor(jobs, get_context("spawn")) as executor:
            yield executor
        return
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise CueError("--scheduler needs the extra `cluster` (Dask)") from error
    try:
        client = distributed.Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise CueError(f"no scheduler answers at {scheduler}") from error
    with client:
        yield client.get_executor()


def _write_summary(folder: Path, rows: list[dict[str, Any]]) -> None:
    with (
        whole_file(folder / SUMMARY) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        writer = csv.DictWriter(file, FIELDS)
        writer.writeheader()
        writer.writerows(rows)
