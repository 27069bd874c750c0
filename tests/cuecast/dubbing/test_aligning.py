"""The sound of a programme, stretch by stretch, and scores timed by it."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile

from codec.errors import CueError
from cuecast.command.cli import main
from cuecast.dubbing.aligning import Confidence, ProgrammeVoices, aligned_score, text_as_subtitle
from synth.language.subtitles import Subtitle
from synth.planning.alignment.recogniser import FS
from synth.units.speech.espeak_voice import render

PHONES = "b ɔ̃ ʒ u ʁ a t u s e b j ɛ̃ v ə n y".split()
TEXT = "Bonjour à tous et bienvenue."


@pytest.fixture(scope="module")
def spoken(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[float]]:
    rendering = render(PHONES)
    sound = np.concatenate([np.zeros(22050), rendering.samples, np.zeros(11025)])
    path = tmp_path_factory.mktemp("spoken") / "spoken.wav"
    noise = 1e-4 * np.random.default_rng(0).standard_normal(len(sound))
    soundfile.write(path, sound + noise, 22050)
    return path, [1.0 + phone.start for phone in rendering.phones]


def test_stretches_are_the_sound_at_their_times(tmp_path: Path) -> None:
    clicks = np.zeros((8 * 48000, 2))
    clicks[48000::48000] = 0.5
    soundfile.write(tmp_path / "clicks.wav", clicks, 48000)
    with ExitStack() as stack:
        voices = ProgrammeVoices(stack, tmp_path / "clicks.wav")
        for start, end in ((0.5, 1.5), (1.2, 2.6), (4.5, 7.5), (7.8, 12.0)):
            stretch = voices(start, end)
            assert len(stretch) == round((end - start) * FS)
            expected = [t for t in range(1, 8) if start <= t < end]
            found = np.flatnonzero(stretch > 0.05)
            assert sorted({round(start + i / FS, 2) for i in found}) == expected
        with pytest.raises(CueError, match=r"go back in time at 0\.50 s"):
            voices(0.5, 1.5)


def test_phones_start_where_they_are_said(spoken: tuple[Path, list[float]]) -> None:
    path, truth = spoken
    score = aligned_score([text_as_subtitle(TEXT, path)], path, warn=print, judged=Confidence())
    assert [p.symbol for p in score.phones] == PHONES
    starts = np.array([p.start for p in score.phones])
    # Measured: median 10 ms.
    assert np.median(np.abs(starts - truth)) <= 0.03


@pytest.mark.parametrize("timed", [False, True])
def test_words_too_few_to_be_sure(
    timed: bool, spoken: tuple[Path, list[float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Times that were given are kept; where there are none, the sound's are better than none."""
    monkeypatch.setattr("synth.planning.alignment.confidence.LEAST_EVIDENCE", 1e3)
    path, truth = spoken
    told: list[str] = []
    sure = Confidence()
    subtitle = replace(text_as_subtitle(TEXT, path), timed=timed)
    score = aligned_score([subtitle], path, warn=told.append, judged=sure)
    note = "their text is not what is said" if timed else "whether it is what is said is not sure"
    assert [note in line for line in told] == [True]
    assert sure.report()["confidence"] == 0
    assert score.phones[0].start == pytest.approx(0.0 if timed else truth[0], abs=0.06)


def test_text_without_times_that_fits_no_better_than_others(tmp_path: Path) -> None:
    path = tmp_path / "silence.wav"
    soundfile.write(path, np.zeros(3 * 8000), 8000)
    told: list[str] = []
    score = aligned_score(
        [text_as_subtitle(TEXT, path)], path, warn=told.append, judged=Confidence()
    )
    assert "not what is said" in told[0]
    assert [p.symbol for p in score.phones] == PHONES
    assert score.phones[0].start == 0


def test_from_the_command_line(spoken: tuple[Path, list[float]], tmp_path: Path) -> None:
    path, truth = spoken
    out = tmp_path / "m.npz"
    assert main(["synth", TEXT, "--align", str(path), "-o", str(out)]) == 0
    from codec.cuer.motion import load_motion

    score = load_motion(out).score
    assert score is not None
    assert abs(score.phones[0].start - truth[0]) < 0.06


def test_long_sound_needs_times(tmp_path: Path) -> None:
    soundfile.write(tmp_path / "long.wav", np.zeros(130 * 8000), 8000)
    with pytest.raises(CueError, match="aligns to 120 s of sound at most"):
        text_as_subtitle(TEXT, tmp_path / "long.wav")
    with pytest.raises(CueError, match="spans 125 s"):
        aligned_score(
            [Subtitle(0, 125, TEXT)], tmp_path / "long.wav", warn=print, judged=Confidence()
        )
