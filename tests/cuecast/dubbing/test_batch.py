"""The verb `batch`: a catalogue through several processes, restartable."""

import contextlib
import csv
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from codec.errors import CueError
from cuecast.command.cli import build_parser, main
from cuecast.demo import warming
from cuecast.demo.content import FS, make_sound
from cuecast.demo.run import as_srt
from cuecast.dubbing import batch
from cuecast.dubbing.batch import run_task
from cuecast.dubbing.catalogue import Task, read_catalogue
from cuecast.dubbing.ledger import WORK, BatchItem, BusyError
from cuecast.dubbing.workers import Processes, TaskOutcome, Work
from cuecast.media.film import write_film
from cuecast.verbs.batch import _dubbing_options
from tests.cuecast.dubbing.deadly import deadly

ROOT = Path(__file__).resolve().parents[3]
FAST = ("--no-grade", "--no-read-back", "--through", "none")
MANY = 3

pytestmark = pytest.mark.long(28)


@pytest.fixture(scope="module")
def catalogue(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two good programmes and a broken one."""
    folder = tmp_path_factory.mktemp("catalogue")
    sound, subtitles = make_sound()
    for name, start in (("one", 0), ("two", 2)):
        part = sound[start * FS : (start + 3) * FS]
        write_film(folder / f"{name}.flac", part, FS, encoder="flac")
    (folder / "a.srt").write_text(as_srt(subtitles[:1]), encoding="utf-8")
    (folder / "broken.flac").write_bytes(b"fLaC, so to speak")
    rows = ["programme,subtitles,output"]
    rows += [f"{name}.flac,a.srt,{name}-cued.flac" for name in ("one", "broken", "two")]
    (folder / "list.csv").write_text("\n".join(rows), encoding="utf-8")
    return folder / "list.csv"


class InThisProcess:
    """Workers that need no process of their own; `test_killed_workers...` has real ones."""

    def __init__(self, count: int, work: Work) -> None:
        self._work, self._tasks = work, list[Task]()

    def submit(self, task: Task) -> None:
        self._tasks.append(task)

    def outcomes(self) -> Iterator[TaskOutcome]:
        while self._tasks:
            task = self._tasks.pop(0)
            yield TaskOutcome(task, self._work(task))

    def close(self) -> None:
        assert not self._tasks


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "Processes", InThisProcess)


def run(catalogue: Path, out: Path, *options: str) -> tuple[int, list[dict[str, str]]]:
    status = main(["batch", str(catalogue), "--out", str(out), *options])
    with (out / "summary.csv").open(encoding="utf-8", newline="") as file:
        return status, list(csv.DictReader(file))


@pytest.mark.usefixtures("in_this_process")
def test_batch_is_restartable(
    catalogue: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    status, rows = run(catalogue, out, *FAST)
    assert status == 1
    assert [row["status"] for row in rows] == ["done", "failed", "done"]
    assert "not a sound or video file" in rows[1]["error"]
    assert int(rows[0]["keys"]) > 3
    assert sorted(p.name for p in out.iterdir()) == [
        "one-cued.flac",
        "one-cued.flac.json",
        "summary.csv",
        "two-cued.flac",
        "two-cued.flac.json",
    ]
    before = (out / "one-cued.flac").stat().st_mtime_ns
    capsys.readouterr()
    status, rows = run(catalogue, out, *FAST, "--json")
    assert [row["status"] for row in rows] == ["done before", "failed", "done before"]
    assert (out / "one-cued.flac").stat().st_mtime_ns == before
    assert [row["status"] for row in json.loads(capsys.readouterr().out)] == [
        row["status"] for row in rows
    ]
    assert record_of(catalogue, out, *FAST) is not None
    assert record_of(catalogue, out, *FAST, "--seed", "2") is None  # other options: done anew


def record_of(catalogue: Path, out: Path, *options: str) -> dict[str, object] | None:
    """The record of a catalogue's first programme, if a batch would leave it as it is."""
    return BatchItem(tasks_of(catalogue, out, *options)[0]).done()


def tasks_of(catalogue: Path, out: Path, *options: str) -> list[Task]:
    argv = ["batch", str(catalogue), "--out", str(out), *options]
    told = _dubbing_options(build_parser().parse_args(argv))
    return read_catalogue(catalogue, out, told)


@pytest.mark.usefixtures("in_this_process")
def test_signed_batch(catalogue: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = ["--secret", str(tmp_path / "k.key"), "--public", str(tmp_path / "k.pub")]
    assert main(["key", "new", "one", *files, "--days", "1", "--from", "2027-01-31"]) == 0
    noise = np.random.default_rng(2).normal(0, 0.05, (12 * FS, 2)).astype(np.float32)
    write_film(tmp_path / "one.flac", noise, FS, encoder="flac")
    shutil.copy(catalogue.parent / "a.srt", tmp_path)
    listed = tmp_path / "list.csv"
    signed = ("--sign", str(tmp_path / "k.key"), *FAST)
    listed.write_text("programme,subtitles\none.flac,a.srt\n", encoding="utf-8")
    assert main(["batch", str(listed), "--out", str(tmp_path / "out"), *signed]) == 2
    assert "line 2: on_air: '' is no time such as" in capsys.readouterr().err
    on_air = "2027-01-31T20:01:04Z"  # a block's begin: its key is complete after 10.24 s
    rows = ["programme,subtitles,on_air", f"one.flac,a.srt,{on_air}"]
    listed.write_text("\n".join(rows), encoding="utf-8")
    assert run(listed, tmp_path / "out", *signed)[1][0]["status"] == "done"
    assert record_of(listed, tmp_path / "out", *signed) is not None
    assert record_of(listed, tmp_path / "out", *FAST) is None  # as it is, it is not unsigned
    capsys.readouterr()
    made = str(tmp_path / "out" / "one.flac")
    whose = ["--verify", str(tmp_path / "k.pub"), "--on-air", on_air]
    assert main(["receive", made, "--json", *whose]) == 0
    told = json.loads(capsys.readouterr().out)["authenticity"]
    assert told["status"] == "verified"


def outputs(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.glob("*.flac")}


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A catalogue of short programmes, named from its own folder."""
    folder = tmp_path_factory.mktemp("many")
    sound, subtitles = make_sound()
    (folder / "a.srt").write_text(as_srt(subtitles[:1]), encoding="utf-8")
    rows = ["programme,subtitles"]
    for n in range(MANY):
        part = sound[n * FS // 2 : n * FS // 2 + 2 * FS]
        write_film(folder / f"{n}.flac", part, FS, encoder="flac")
        rows.append(f"{n}.flac,a.srt")
    (folder / "list.csv").write_text("\n".join(rows), encoding="utf-8")
    return folder / "list.csv"


@pytest.fixture(scope="module")
def undisturbed(many: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("undisturbed")
    rows = [run_task(task) for task in tasks_of(many, out, *FAST)]
    assert [row["status"] for row in rows] == MANY * ["done"]
    return outputs(out)


def workers_of(process: subprocess.Popen[bytes]) -> list[int]:
    """Processes of a batch that it has started itself."""
    found = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
    return [
        int(pid)
        for pid in found.split()
        if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]


def start(catalogue: Path, out: Path, jobs: int) -> subprocess.Popen[bytes]:
    argv = [sys.executable, "-m", "cuecast", "batch", str(catalogue), "--out", str(out), *FAST]
    return subprocess.Popen([*argv, "--jobs", str(jobs)], stdout=subprocess.DEVNULL, cwd=ROOT)


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux's /proc")
def test_killed_workers_and_batches_lose_nothing(
    many: Path, tmp_path: Path, undisturbed: dict[str, bytes]
) -> None:
    out = tmp_path / "out"
    rng = random.Random(5)
    process = start(many, out, 2)
    for kills in range(2):
        deadline = time.monotonic() + 60
        while process.poll() is None and time.monotonic() < deadline:
            if (out / WORK).exists() and list((out / WORK).glob("*.flac")):
                break
            time.sleep(0.02)
        time.sleep(rng.uniform(0, 0.5))
        if process.poll() is not None:
            break
        if kills == 1:
            process.kill()
            process.wait()
            process = start(many, out, 2)
        else:
            for pid in workers_of(process)[:1]:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
    assert process.wait() == 0
    assert main(["batch", str(many), "--out", str(out), *FAST]) == 0
    assert outputs(out) == undisturbed
    names = {f"{n}.flac" for n in range(MANY)}
    wanted = names | {f"{name}.json" for name in names} | {"summary.csv"}
    assert {p.name for p in out.iterdir()} == wanted


@pytest.mark.slow
def test_two_batches_share_the_work(
    many: Path, tmp_path: Path, undisturbed: dict[str, bytes]
) -> None:
    out = tmp_path / "out"
    processes = [start(many, out, 1) for _ in range(2)]
    assert [process.wait() for process in processes] == [0, 0]
    assert outputs(out) == undisturbed
    assert not (out / WORK).exists()


def test_item_that_kills_its_workers(tmp_path: Path) -> None:
    tasks = [Task("", str(tmp_path / name)) for name in ("good", "deadly", "fine")]
    pool = Processes(2, deadly)
    for task in tasks:
        pool.submit(task)
    ended = {}
    with contextlib.closing(pool):
        for outcome in pool.outcomes():
            ended[Path(outcome.task.output).name] = outcome
    assert ended["good"].row == ended["fine"].row == {"status": "done"}
    assert ended["deadly"].row is None
    assert ended["deadly"].reason == "its worker died (signal 9)"


def test_record_without_its_output_is_finished(tmp_path: Path) -> None:
    """Killed between the record and the move: the output is not made twice."""
    (tmp_path / "in").write_bytes(b"programme")
    item = BatchItem(Task(str(tmp_path / "in"), str(tmp_path / "out.flac")))

    def work(made: Path) -> dict[str, int]:
        made.write_bytes(b"dubbed")
        return {"keys": 3}

    record, made = item.run(work)
    assert made
    assert item.done() == record
    with item.locked():
        item.output.replace(item.folder / item.output.name)
        shutil.copytree(item.folder, tmp_path / "kept")
    shutil.copytree(tmp_path / "kept", item.folder)  # as a killed process leaves it

    def never(made: Path) -> dict[str, int]:
        raise AssertionError

    assert item.run(never) == (record, False)
    assert item.output.read_bytes() == b"dubbed"
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        ".cuecast-batch",
        "in",
        "kept",
        "out.flac",
        "out.flac.json",
    ]


def test_what_changed_is_made_anew(tmp_path: Path) -> None:
    source = tmp_path / "in"
    source.write_bytes(b"programme")
    item = BatchItem(Task(str(source), str(tmp_path / "out.flac")))
    item.run(lambda made: {"n": made.write_bytes(b"dubbed")})
    os.utime(source, (1, 1))
    assert item.done()  # touched, but still the same
    source.write_bytes(b"programmf")
    assert item.done() is None
    source.write_bytes(b"programme")
    item.output.write_bytes(b"dubbee")
    assert item.done() is None
    item.output.unlink()
    assert item.done() is None
    with pytest.raises(CueError, match="it changed while it was worked on"):
        item.run(lambda made: {"n": source.write_bytes(b"x") + made.write_bytes(b"y")})


def test_item_in_other_hands(tmp_path: Path) -> None:
    (tmp_path / "in").write_bytes(b"programme")
    item = BatchItem(Task(str(tmp_path / "in"), str(tmp_path / "out")))
    with item.locked(), pytest.raises(BusyError):
        item.run(lambda made: {})


def test_unforeseen_error_is_its_programme_s(tmp_path: Path) -> None:
    task = Task(str(tmp_path / "in"), str(tmp_path / "out"), options={"unheard": "of"})
    (tmp_path / "in").write_bytes(b"programme")
    row = run_task(task)
    assert row["status"] == "failed"
    assert row["error"].startswith("AttributeError: ")


def test_a_missing_programme_is_named(tmp_path: Path) -> None:
    row = run_task(Task(str(tmp_path / "none.mp4"), str(tmp_path / "out.mp4")))
    assert row["status"] == "failed"
    assert row["error"] == f"{tmp_path / 'none.mp4'}: No such file or directory"


def test_dask_scheduler(
    catalogue: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    distributed = pytest.importorskip("distributed", reason="needs the extra `cluster`")
    monkeypatch.setattr(warming, "warm_kernels", os.getpid)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        _, rows = run(catalogue, tmp_path / "out", "--scheduler", cluster.scheduler_address, *FAST)
    assert [row["status"] for row in rows] == ["done", "failed", "done"]
    assert "warming 1 machines" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no programmes in it"),
        ("programme,subtitles\n", "no programmes in it"),
        ("film,srt\na.mp4,a.srt\n", "line 2: needs a programme"),
        ("programme,subtitles,motion\na.mp4,a.srt,a.npz\n", "line 2: needs subtitles or motion"),
        ("programme,subtitles\na.mp4,a.srt\nb/a.mp4,b.srt\n", "line 3: another programme has"),
    ],
)
def test_malformed_catalogues(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "list.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CueError, match=message):
        read_catalogue(path, tmp_path)


def test_catalogue_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "list.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CueError, match="not a catalogue"):
        read_catalogue(tmp_path / "list.csv", tmp_path)
    assert main(["batch", str(tmp_path / "none.csv"), "--out", str(tmp_path)]) == 3
