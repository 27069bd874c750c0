from pathlib import Path

import numpy as np
import pytest

from codec.cuer.voice import Voice, load_voice
from codec.errors import CueError
from synth.units.recordings.archive import (
    built_in_recordings,
    cache_folder,
    read_archive,
    write_archive,
)
from synth.units.recordings.recording import UnitRecording

TEXTS = ["Petit à petit, l'oiseau fait son nid.", "Qui dort dîne."]


@pytest.fixture(scope="module")
def voice() -> Voice:
    return load_voice("claire")


@pytest.fixture(scope="module")
def built(
    voice: Voice, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, list[UnitRecording], list[tuple[int, int]]]:
    folder = tmp_path_factory.mktemp("cache")
    steps: list[tuple[int, int]] = []
    made = built_in_recordings(
        voice, sentences=TEXTS, folder=folder, progress=lambda a, b: steps.append((a, b))
    )
    return folder, made, steps


def test_built_once_and_read_back(
    voice: Voice, built: tuple[Path, list[UnitRecording], list[tuple[int, int]]]
) -> None:
    folder, made, steps = built
    assert steps == [(1, 2), (2, 2)]
    assert len(list(folder.iterdir())) == 1

    def unexpected(done: int, total: int) -> None:
        raise AssertionError("made again")

    again = built_in_recordings(voice, sentences=TEXTS, folder=folder, progress=unexpected)
    for a, b in zip(made, again, strict=True):
        assert [p.symbol for p in a.score.phones] == [p.symbol for p in b.score.phones]
        assert np.abs(a.sound - b.sound).max() <= 2**-15
        # Kept in steps of a 16th of the standard deviation.
        assert np.abs(a.motion.params - b.motion.params).max() < 0.06
        np.testing.assert_array_equal(a.marks.sample, b.marks.sample)
        np.testing.assert_allclose(a.fits, b.fits, atol=0.01)
        np.testing.assert_array_equal(a.gestures.reach, b.gestures.reach)


def test_other_sentences_make_another_archive(
    voice: Voice, built: tuple[Path, list[UnitRecording], list[tuple[int, int]]]
) -> None:
    folder, _, _ = built
    built_in_recordings(voice, sentences=TEXTS[:1], folder=folder)
    assert len(list(folder.iterdir())) == 2


def test_a_damaged_archive_is_refused_and_made_again(
    voice: Voice, built: tuple[Path, list[UnitRecording], list[tuple[int, int]]], tmp_path: Path
) -> None:
    _, made, _ = built
    write_archive(tmp_path / "a", made)
    labels = (tmp_path / "a" / "labels.npz").read_bytes()
    (tmp_path / "a" / "labels.npz").write_bytes(labels[: len(labels) // 2])
    with pytest.raises(CueError, match="damaged or foreign"):
        read_archive(tmp_path / "a")
    (tmp_path / "a" / "labels.npz").write_bytes(labels)
    (tmp_path / "a" / "sounds.bin").write_bytes(b"no sound")
    with pytest.raises(CueError, match="damaged recordings"):
        read_archive(tmp_path / "a")

    built_in_recordings(voice, sentences=TEXTS[:1], folder=tmp_path / "cache")
    (archive,) = (tmp_path / "cache").iterdir()
    (archive / "sounds.bin").unlink()
    assert len(built_in_recordings(voice, sentences=TEXTS[:1], folder=tmp_path / "cache")) == 1


def test_refusals(
    built: tuple[Path, list[UnitRecording], list[tuple[int, int]]], tmp_path: Path
) -> None:
    with pytest.raises(CueError, match="no recording"):
        write_archive(tmp_path / "none", [])
    with pytest.raises(CueError, match="exists already"):
        write_archive(tmp_path, built[1])
    with pytest.raises(CueError, match="No such file"):
        read_archive(tmp_path / "missing")


def test_cache_folder_follows_the_environment(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "cuecast"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache_folder().name == "cuecast"
