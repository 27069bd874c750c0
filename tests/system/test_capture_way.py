"""From a foreign recording through the coded stream, and through a marked and coded programme."""

import json
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.layout import MARKERS
from codec.cuer.models import rigid
from cuecast.command.cli import main
from cuecast.demo.content import make_sound
from cuecast.media.film import write_film
from cuecast.media.rewrite import Unchanged, rewrite_sound
from tests.synth import studio_files as files

FS, SECONDS = 48000, 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A take of another cuer in other axes and metres, captured three seconds into a programme."""
    path = tmp_path_factory.mktemp("captured")
    foreign = 0.001 * rigid.rigid_motion(files.take("agathe").observed, [-1.57, 0, 0, 0, 900, 1200])
    labels = tuple(f"Agathe:{name}" for name in MARKERS)
    (path / "take.trc").write_text(files.trc(foreign, labels, unit="m"), encoding="utf-8")
    capture = ["capture", path / "take.trc", "-o", path / "m.npz", "--start", "3"]
    assert main([*map(str, capture), "--report", str(path / "r.json")]) == 0
    return path


def test_report(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    again = ["capture", folder / "take.trc", "-o", folder / "again.npz", "--json", "--no-keys"]
    assert main([*map(str, again), "--plot", str(folder / "p.png")]) == 0
    printed = json.loads(capsys.readouterr().out)
    written = json.loads((folder / "r.json").read_text(encoding="utf-8"))
    assert printed["residual_mm"] == written["residual_mm"]
    assert written["input"]["kind"] == "TRC"
    assert written["markers"]["found"] == 113
    assert written["keys"]["recognised"] >= 4
    assert "keys" not in printed
    assert (folder / "p.png").stat().st_size > 5000


def test_from_a_pipe(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with (folder / "take.trc").open() as pipe:
        monkeypatch.setattr("sys.stdin", pipe)
        assert main(["capture", "-", "-o", str(folder / "piped.npz"), "--start", "3"]) == 0
    assert (folder / "piped.npz").read_bytes() == (folder / "m.npz").read_bytes()
    assert "standard input: TRC" in capsys.readouterr().err


def test_through_the_stream(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["encode", str(folder / "m.npz"), "-o", str(folder / "m.cue")]) == 0
    assert main(["decode", str(folder / "m.cue"), "-o", str(folder / "d.npz")]) == 0
    capsys.readouterr()
    pair = [str(folder / "m.npz"), str(folder / "d.npz")]
    assert main(["compare", *pair, "--json", "--limit", "5"]) == 0  # measured 2
    assert json.loads(capsys.readouterr().out)["keys_total"] >= 4


def test_through_a_programme(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sound, _ = make_sound()
    write_film(folder / "a.mka", sound[: SECONDS * FS], FS, encoder="flac")
    dub = ["dub", folder / "a.mka", "--motion", folder / "m.npz", "-o", folder / "b.mka"]
    assert main([*map(str, dub), "--no-grade", "--no-read-back", "--grade", "-1"]) == 0
    rewrite_sound(
        folder / "b.mka", folder / "c.mp4", lambda *_: Unchanged(), codec="aac", bit_rate=128000
    )
    capsys.readouterr()
    assert main(["receive", str(folder / "c.mp4"), "-o", str(folder / "got.npz"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["superframes"]["lost"] <= 1  # previews show its keys all the same
    pair = [str(folder / "m.npz"), str(folder / "got.npz")]
    assert main(["compare", *pair, "--json", "--limit", "12"]) == 0
    alike = json.loads(capsys.readouterr().out)
    assert alike["keys_correct"] == alike["keys_total"] >= 3
    assert np.isfinite(alike["marker_rms_mm"])
