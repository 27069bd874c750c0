"""The evaluation of the aligner: label tracks, conditions, the reliability of its confidence."""

from pathlib import Path

import matplotlib.figure
import numpy as np
import pytest
import soundfile as sf

from codec.cues.phonology import PAUSE
from codec.errors import CueError
from cuecast.evaluate import alignment
from cuecast.evaluate.options import EvaluateOptions
from synth.language.text.espeak import RATE_HZ
from synth.language.text.pronounce import phonemise
from synth.units.speech.espeak_voice import render

TEXTS = ("Le chat mange une souris, sous la table du jardin.", "Nous partons demain matin.")


def options(clips: Path, *conditions: str) -> EvaluateOptions:
    return EvaluateOptions(
        clips=clips, channels=conditions, seed=1, folder=clips, say=lambda line: None
    )


def write_clip(folder: Path, name: str, text: str) -> None:
    words = phonemise(text)
    line = [s for w in words for s in (*w.phones, *([PAUSE] if w.pause else []))]
    spoken = render(line)
    sf.write(folder / f"{name}.wav", spoken.samples, RATE_HZ)
    times = iter(spoken.phones)
    lines = []
    for word in words:
        own = [next(times) for _ in word.phones]
        lines.append(f"{own[0].start:.3f}\t{own[-1].end:.3f}\t{word.text}")
    (folder / f"{name}.txt").write_text("\n".join(lines), encoding="utf-8")


def test_words_are_found_and_foreign_ones_refused(tmp_path: Path) -> None:
    for number, text in enumerate(TEXTS):
        write_clip(tmp_path, f"clip{number}", text)
    rows = alignment.evaluate(options(tmp_path, "plain", "foreign"))
    plain, foreign = rows[:2]
    assert plain["accepted"] == 2
    assert plain["words"] >= 12
    assert plain["median_ms"] < 30
    assert foreign["accepted"] == 0
    assert rows[-1]["confidence"] == "certain"
    assert rows[-1]["right"] > 0.9
    figure = matplotlib.figure.Figure()
    alignment.plot(rows, figure)
    assert figure.axes[0].lines


def test_labels_that_are_wrong_lower_what_is_right(tmp_path: Path) -> None:
    write_clip(tmp_path, "clip", TEXTS[0])
    track = tmp_path / "clip.txt"
    moved = [line.split("\t") for line in track.read_text("utf-8").splitlines()]
    track.write_text("\n".join(f"{float(a) + 0.4}\t{float(b) + 0.4}\t{w}" for a, b, w in moved))
    rows = alignment.evaluate(options(tmp_path, "plain"))
    assert rows[0]["beyond_165_ms"] > 0.8
    assert all(row["right"] < 0.5 for row in rows[1:])


def test_reliability_counts_every_word_once() -> None:
    rng = np.random.default_rng(1)
    sure = rng.uniform(size=200)
    found = [(float(s), 0.0 if rng.random() < s else 1.0) for s in sure]
    rows = alignment.reliability(found)
    steps = [row for row in rows if row["confidence"] != "certain"]
    assert sum(row["words"] for row in steps) == 200
    assert all(abs(row["told"] - row["right"]) < 0.35 for row in steps if row["words"] > 10)


@pytest.mark.parametrize(
    ("line", "says"), [("0\t1", "line 1 is not start"), ("a\tb\tc", "line 1 is not start")]
)
def test_bad_material(tmp_path: Path, line: str, says: str) -> None:
    with pytest.raises(CueError, match="no sound with a label track"):
        alignment.evaluate(options(tmp_path, "plain"))
    with pytest.raises(CueError, match="unknown condition 'loud'"):
        alignment.evaluate(options(tmp_path, "loud"))
    sf.write(tmp_path / "a.wav", np.zeros(800), 8000)
    (tmp_path / "a.txt").write_text(line)
    with pytest.raises(CueError, match=says):
        alignment.evaluate(options(tmp_path, "plain"))
