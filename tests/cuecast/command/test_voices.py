"""Coding tables of a user's own voice: trained by ``voice build``, found by the verbs."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import synth.studio.recital
from codec.cuer.motion import Motion, load_motion, save_motion
from codec.cuer.voice import Voice, load_voice, save_voice
from codec.superframe import coding as module
from codec.superframe.coding import coding_for, trained_path
from cuecast.command.cli import main
from cuecast.command.voices import coding_voice, train_voice
from synth.studio.recital import imprecise, perform, recital, sentences


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Voice]:
    """A voice of nobody else, in an empty home, trained on three sentences."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    built_in = load_voice()
    gestures = built_in.gestures
    moved = replace(gestures, neutral_head=gestures.neutral_head + np.float32(0.1))
    yield replace(built_in, gestures=moved)
    module._cached.cache_clear()


def few_examples(voice: Voice) -> Iterator[Motion]:
    yield perform(voice, recital(sentences()[:3]), seed=3)
    yield imprecise(voice, recital(sentences()[:1]), seed=7)


def test_a_voice_is_trained_once_into_the_users_folder(
    own: Voice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(synth.studio.recital, "examples", few_examples)
    steps = list[tuple[int, int]]()
    train_voice(own, progress=lambda done, total: steps.append((done, total)))
    assert steps == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert trained_path(own) == tmp_path / "data" / "cuecast" / "coding" / f"{own.identity}.npz"
    assert coding_for(own).trained
    train_voice(own, progress=lambda done, total: pytest.fail("it is trained"))
    train_voice(load_voice(), progress=lambda done, total: pytest.fail("it comes with tables"))


def test_streams_of_trained_and_derived_tables_do_not_mix(
    own: Voice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    voice, motion, stream, back = (
        str(tmp_path / name) for name in ("own.npz", "m.npz", "m.cue", "back.npz")
    )
    save_voice(own, voice)
    save_motion(perform(own, recital(sentences(held_out=True)[:1]), seed=1), motion)
    coding = ["--voice", voice]
    assert main(["encode", motion, "-o", stream, "--rate", "400", *coding]) == 0
    assert "no trained coding tables" in capsys.readouterr().err
    assert main(["decode", stream, "-o", back, *coding]) == 0
    monkeypatch.setattr(synth.studio.recital, "examples", few_examples)
    train_voice(own, progress=lambda done, total: None)
    capsys.readouterr()
    assert main(["decode", stream, "-o", back, *coding]) == 3
    assert "stream coded with tables" in capsys.readouterr().err
    assert main(["encode", motion, "-o", stream, "--rate", "400", *coding]) == 0
    assert main(["decode", stream, "-o", back, *coding]) == 0
    assert capsys.readouterr().err == ""
    sent, got = load_motion(motion).score, load_motion(back).score
    assert sent is not None
    assert got is not None
    assert [str(key) for key in got.keys] == [str(key) for key in sent.keys]
    assert main(["voice", "info", voice]) == 0
    assert str(trained_path(own)) in capsys.readouterr().out


def test_a_voice_without_tables_is_told(own: Voice, tmp_path: Path) -> None:
    save_voice(own, tmp_path / "own.npz")
    assert coding_voice(str(tmp_path / "own.npz")).identity == own.identity
