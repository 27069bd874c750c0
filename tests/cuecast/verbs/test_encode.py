"""What `cuecast encode` says of the score."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.motion import Motion, save_motion
from codec.cuer.voice import load_voice
from cuecast.command.cli import main
from synth.motion.rules.performance import motion_of
from synth.planning.scoring.text_score import score_of_text


@pytest.fixture(scope="module")
def motion() -> Motion:
    return motion_of(score_of_text("Un bon vin blanc.", start_s=0.5), load_voice())


def encoded(motion: Motion, folder: Path, capsys: pytest.CaptureFixture[str], *more: str) -> str:
    save_motion(motion, folder / "m.npz")
    words = ["encode", str(folder / "m.npz"), "-o", str(folder / "m.cue"), "--rate", "337.5"]
    assert main([*words, *more]) == 0
    out, notes = capsys.readouterr()
    return out + notes


def test_a_score_that_helps(
    motion: Motion, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert encoded(motion, tmp_path, capsys) == ""
    document = json.loads(encoded(motion, tmp_path, capsys, "--json"))
    assert document["score"] == "kept"
    assert document["score_cost_percent"] < 0
    assert document["bytes"] == (tmp_path / "m.cue").stat().st_size


def test_a_score_that_does_not(
    motion: Motion, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The motion of another sentence, as far as its score is concerned."""
    other = replace(motion, params=np.roll(motion.params, 40, axis=0)[:, ::-1].copy())
    told = encoded(other, tmp_path, capsys)
    assert told.startswith("score and keys left out: with them its error would be ")
    assert "% greater (--keep-score)" in told
    document = json.loads(encoded(other, tmp_path, capsys, "--json"))
    assert document["score"] == "left out"
    assert document["score_cost_percent"] > 1
    kept = json.loads(encoded(other, tmp_path, capsys, "--json", "--keep-score"))
    assert (kept["score"], kept["score_cost_percent"]) == ("kept", None)
    none = json.loads(encoded(replace(other, score=None), tmp_path, capsys, "--json"))
    assert none["score"] == "none"
    dropped = json.loads(encoded(motion, tmp_path, capsys, "--json", "--drop-score"))
    assert (dropped["score"], dropped["score_cost_percent"]) == ("left out", None)


def test_two_wishes_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["encode", "m.npz", "-o", "m.cue", "--keep-score", "--drop-score"]) == 2
    assert main(["encode", "m.npz", "-o", "-", "--json"]) == 2
    assert "share the standard output" in capsys.readouterr().err
