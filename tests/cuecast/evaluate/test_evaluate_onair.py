"""Filmed cuers on air: three ways side by side."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.motion import save_motion
from codec.cuer.voice import load_voice
from codec.errors import CueError
from cuecast.evaluate import onair
from cuecast.evaluate.options import EvaluateOptions
from synth.capture.capture import capture_motion
from synth.capture.options import CaptureOptions
from synth.studio.recital import perform, recital

TOOL = Path(__file__).resolve().parents[4] / "shared" / "tools" / "real_cuers.py"


def options(clips: Path | None, folder: Path) -> EvaluateOptions:
    return EvaluateOptions(clips, None, 0, folder, lambda line: None)


def test_three_ways_of_one_take(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    motion = perform(load_voice(), recital(["Bon vin."]))
    late = np.roll(motion.params, 40, axis=0)
    save_motion(replace(motion, params=late), tmp_path / "late.npz")
    monkeypatch.setattr(onair, "_RUNS", 2)
    rows = {row["way"]: row for row in onair.evaluate(options(tmp_path, tmp_path))}
    assert list(rows) == list(onair.WAYS)
    assert all(row["takes"] == 1 for row in rows.values())
    assert rows["no score"]["worst_ratio"] == 1.0
    assert rows["no score"]["keys"] == 0
    assert rows["keys"]["keys"] == rows["score and previews"]["keys"] > 0
    assert rows["keys"]["marker_rms_mm"] < rows["score and previews"]["marker_rms_mm"]


def test_lost_keys_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    voice = load_voice()
    motion = perform(voice, recital(["Bon vin."]))
    monkeypatch.setattr(onair, "_RUNS", 1)
    monkeypatch.setattr(onair, "LOST", 1.0)
    found = onair.on_air(motion, voice, "score and previews")
    assert found.lost == found.keys > 0


def test_a_folder_without_takes_is_named(tmp_path: Path) -> None:
    with pytest.raises(CueError, match="no tables of landmarks"):
        onair.evaluate(options(tmp_path, tmp_path))


@pytest.mark.slow
@pytest.mark.skipif(not TOOL.exists(), reason="needs the real cuers in ../shared")
# The shared tool leaves its table open.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_real_takes_on_air(tmp_path: Path) -> None:
    """Each eighth of 64 takes: with keys as good as without a score, and hardly a key lost."""
    spec = importlib.util.spec_from_file_location("real_cuers", TOOL)
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    voice, names = load_voice(), tool.utterances()[::8]
    tool.main(["csv", str(tmp_path), *names])
    for name in names:
        wanted = CaptureOptions(aspect=16 / 9, frame_rate_hz=30.0)
        save_motion(
            capture_motion(tmp_path / f"{name}.csv", voice, wanted).motion, tmp_path / f"{name}.npz"
        )
    rows = {row["way"]: row for row in onair.evaluate(options(tmp_path, tmp_path))}
    found = rows["keys"]
    assert found["takes"] == len(names)
    assert found["marker_rms_mm"] <= 6.5
    assert found["hand_cueing_mm"] <= 11.0
    assert found["mean_ratio"] <= 1.0
    assert found["worst_ratio"] <= 1.04
    assert found["keys_lost_share"] <= 0.0025
    assert found["keys_wrong"] == 0
