"""The verb `batch`: a catalogue through several processes, restartable."""

import csv
import json
from pathlib import Path

import pytest

from codec.errors import CueError
from cuecast.command.cli import main
from cuecast.demo.content import FS, make_sound
from cuecast.demo.run import as_srt
from cuecast.dubbing.batch import read_catalogue
from cuecast.media.film import write_film


@pytest.fixture(scope="module")
def catalogue(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two good programmes and a broken one."""
    folder = tmp_path_factory.mktemp("catalogue")
    sound, subtitles = make_sound()
    for name, start in (("one", 0), ("two", 2)):
        part = sound[start * FS : (start + 6) * FS]
        write_film(folder / f"{name}.flac", part, FS, encoder="flac")
    (folder / "a.srt").write_text(as_srt(subtitles[:1]), encoding="utf-8")
    (folder / "broken.flac").write_bytes(b"fLaC, so to speak")
    rows = ["programme,subtitles,output"]
    rows += [f"{name}.flac,a.srt,{name}-cued.flac" for name in ("one", "broken", "two")]
    (folder / "list.csv").write_text("\n".join(rows), encoding="utf-8")
    return folder / "list.csv"


def run(catalogue: Path, out: Path, *options: str) -> tuple[int, list[dict[str, str]]]:
    status = main(["batch", str(catalogue), "--out", str(out), *options])
    with (out / "summary.csv").open(encoding="utf-8", newline="") as file:
        return status, list(csv.DictReader(file))


def test_batch_is_restartable(
    catalogue: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    status, rows = run(catalogue, out, "--jobs", "2")
    assert status == 1
    assert [row["status"] for row in rows] == ["done", "failed", "done"]
    assert "not a sound or video file" in rows[1]["error"]
    assert int(rows[0]["keys"]) > 3
    assert sorted(p.name for p in out.iterdir()) == [
        "one-cued.flac", "one-cued.flac.json", "summary.csv", "two-cued.flac",
        "two-cued.flac.json",
    ]  # fmt: skip
    before = (out / "one-cued.flac").stat().st_mtime_ns
    (out / "two-cued.flac").unlink()
    capsys.readouterr()
    status, rows = run(catalogue, out, "--json")
    assert [row["status"] for row in rows] == ["done before", "failed", "done"]
    assert (out / "one-cued.flac").stat().st_mtime_ns == before
    assert [row["status"] for row in json.loads(capsys.readouterr().out)] == [
        row["status"] for row in rows
    ]
    _, rows = run(catalogue, out, "--grade", "-0.6")  # other options: done anew
    assert [row["status"] for row in rows] == ["done", "failed", "done"]


def test_dask_scheduler(catalogue: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="needs the extra `cluster`")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        _, rows = run(catalogue, tmp_path / "out", "--scheduler", cluster.scheduler_address)
    assert [row["status"] for row in rows] == ["done", "failed", "done"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no programmes in it"),
        ("programme,subtitles\n", "no programmes in it"),
        ("film,srt\na.mp4,a.srt\n", "line 2: needs programme"),
        ("programme,subtitles\na.mp4,\n", "line 2: needs programme, and subtitles or motion"),
        ("programme,subtitles,motion\na.mp4,a.srt,a.npz\n", "line 2: needs programme"),
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
