"""The verb `evaluate`: its tables, and the chain on a short clip."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from codec.cuer.voice import load_voice
from cuecast.command.cli import main
from cuecast.demo.content import FS, make_sound
from cuecast.evaluate.chain import _received
from cuecast.evaluate.records import read_record
from cuecast.evaluate.tables import write_results
from cuecast.media.film import write_film
from synth.motion.rules.performance import motion_of
from synth.planning.scoring.text_score import score_of_text


def test_results_are_written(tmp_path: Path) -> None:
    rows: list[dict[str, Any]] = [
        {"clip": "a", "odg": -0.5},
        {"clip": "b", "odg": None, "note": "é"},
    ]
    table, document = write_results(tmp_path / "new", "audio", rows)
    assert json.loads(document.read_text(encoding="utf-8")) == rows
    with table.open(encoding="utf-8", newline="") as file:
        assert list(csv.reader(file)) == [
            ["clip", "odg", "note"],
            ["a", "-0.5", ""],
            ["b", "", "é"],
        ]


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clips")
    sound, _ = make_sound()
    write_film(folder / "talk.flac", sound[: 9 * FS], FS, encoder="flac")
    return folder


def test_chain(clips: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv: list[str | Path] = [
        "evaluate",
        "chain",
        "--clips",
        clips,
        "--channels",
        "none,mp2_192",
        "--json",
    ]
    argv += ["--out", tmp_path, "--record", tmp_path / "r.json"]
    assert main([*map(str, argv)]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [(row["clip"], row["channel"]) for row in rows] == [
        ("talk", "none"),
        ("talk", "mp2_192"),
    ]
    for row in rows:
        assert row["superframes_lost"] == 0
        assert row["keys_correct"] == row["keys_total"] > 5
    assert json.loads((tmp_path / "chain.json").read_text(encoding="utf-8")) == rows
    assert (tmp_path / "chain.csv").exists()
    assert (tmp_path / "chain.png").read_bytes()[:4] == b"\x89PNG"
    record = read_record(tmp_path / "r.json")
    assert record["results"] == rows
    assert [clip["name"] for clip in record["clips"]] == ["talk"]


def test_what_is_never_found_has_lost_everything(clips: Path) -> None:
    voice = load_voice()
    sent = motion_of(score_of_text("Bonsoir"), voice)
    row = _received(clips / "talk.flac", sent, voice, 12)
    assert (row["superframes_sent"], row["superframes_lost"]) == (12, 12)
    assert (row["keys_total"], row["keys_correct"], row["tune_in_s"]) == (4, 0, None)


@pytest.mark.parametrize(
    ("argv", "status", "message"),
    [
        (["nonsense"], 2, ""),
        (["chain", "--clips", "nowhere"], 3, "nowhere: is not a folder of clips"),
        (["chain", "--channels", "smoke"], 3, "no channel called 'smoke'"),
    ],
)
def test_errors(
    argv: list[str], status: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", *argv]) == status
    assert message in capsys.readouterr().err


def test_empty_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "chain", "--clips", str(tmp_path)]) == 3
    assert "no sound files in it" in capsys.readouterr().err
