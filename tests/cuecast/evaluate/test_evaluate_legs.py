"""The codec on three legs, on small inputs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.motion import save_motion
from codec.cuer.voice import load_voice
from codec.errors import CueError
from cuecast.evaluate import legs
from cuecast.evaluate.options import EvaluateOptions
from synth.studio.recital import perform, recital


def options(clips: Path | None, folder: Path) -> EvaluateOptions:
    return EvaluateOptions(clips, None, 0, folder, lambda line: None)


def test_three_legs_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder of motions is a leg; a score that costs more than it saves is worse, and dropped."""
    voice = load_voice()
    motion = perform(voice, recital(["Bon vin.", "Du pain."]))
    clips = tmp_path / "clips"
    clips.mkdir()
    save_motion(motion, clips / "fits.npz")
    late = np.roll(motion.params, 40, axis=0)
    save_motion(replace(motion, params=late), clips / "late.npz")
    monkeypatch.setattr(legs, "_TAKES", 1)
    monkeypatch.setattr(legs, "_SENTENCES", 1)
    monkeypatch.setattr(legs, "_SECOND_TAKES", 1)
    monkeypatch.setattr(
        legs, "_WISHES", {"337.5 bit/s": {"rate_bps": 337.5}, "4 mm": {"error_mm": 4.0}}
    )
    rows = legs.evaluate(options(clips, tmp_path))
    assert [(row["leg"], row["wish"]) for row in rows] == [
        (leg, wish)
        for leg in ("claire, by rule", legs.SECOND, "real")
        for wish in ("337.5 bit/s", "4 mm")
    ]
    assert [row["takes"] for row in rows] == [1, 1, 1, 1, 2, 2]
    assert rows[0]["with_score"] < rows[0]["without_score"]
    assert rows[4]["worst_ratio"] > 1
    assert rows[4]["worse_takes"] == 1
    assert [row["kept_takes"] for row in (rows[0], rows[4])] == [1, 1]
    assert all(row["worst_ratio_chosen"] <= legs._WORSE for row in rows)


def test_a_folder_without_takes_is_told(tmp_path: Path) -> None:
    with pytest.raises(CueError, match="no tables of landmarks"):
        list(legs.real_takes(load_voice(), tmp_path))
