"""A speaker's own sounds: transcripts, alignment, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
import soundfile

from codec.cuer.voice import load_voice
from codec.errors import CueError
from cuecast.command.cli import main
from synth.motion.rules.gesture import GestureSynthesiser
from synth.units.recordings.archive import read_archive
from synth.units.recordings.rendered import line_of
from synth.units.recordings.speaker import FS, Refusal, SpokenFile, read_transcripts, record_speaker
from synth.units.speech.espeak_voice import render

TEXTS = {
    "a": "Le petit chat mange une souris grise.",
    "b": "Rien ne sert de courir, il faut partir à point.",
    "c": "Bonjour, madame, quelle belle journée.",
}
WORDS = Path(__file__).resolve().parents[4] / "shared/data/speech/gcompris_fr"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three good recordings and their texts; silence around them."""
    rng = np.random.default_rng(0)
    for name, text in TEXTS.items():
        sound = np.pad(render(line_of(text), words_per_minute=120).samples, 8000)
        soundfile.write(
            tmp_path / f"{name}.wav", sound + 1e-4 * rng.standard_normal(len(sound)), 22050
        )
        (tmp_path / f"{name}.txt").write_text(text + "\n", "utf-8")
    return tmp_path


def test_recordings_of_a_speaker(folder: Path) -> None:
    voice = load_voice("claire")
    cuer = GestureSynthesiser(alignment="paper")
    made = list(record_speaker(read_transcripts(folder), cuer, voice))
    for parts, text in zip(made, TEXTS.values(), strict=True):
        assert not isinstance(parts, Refusal)
        (recording,) = parts
        assert [p.symbol for p in recording.score.phones] == [s for s in line_of(text) if s != "_"]
        truth = render(line_of(text), words_per_minute=120).phones
        starts = np.array([p.start for p in recording.score.phones])
        # Silence before the speech is cut to what a group keeps. Measured: medians of 9 to 14 ms.
        away = starts - np.array([p.start for p in truth])
        assert 0.0 < starts[0] < 0.25
        assert np.median(np.abs(away - np.median(away))) < 0.03
        first, last = round(starts[0] * FS), round(recording.score.phones[-1].end * FS)
        assert np.sqrt(np.mean(recording.sound[first:last] ** 2)) == pytest.approx(0.08, rel=0.1)


def test_what_does_not_fit_is_refused_with_a_reason(folder: Path) -> None:
    noise = 0.1 * np.random.default_rng(1).standard_normal(3 * FS)
    soundfile.write(folder / "noise.wav", noise, FS)
    soundfile.write(folder / "short.wav", noise[:2000], FS)
    soundfile.write(folder / "long.wav", np.tile(noise, 12), FS)
    soundfile.write(folder / "endless.wav", np.zeros(250 * 8000), 8000)
    (folder / "text.wav").write_text("no sound")
    text = TEXTS["a"]
    utterances = [
        SpokenFile(folder / f"{name}.wav", words)
        for name, words in (
            ("noise", text), ("short", text), ("long", "Bonjour."), ("endless", text),
            ("text", text), ("missing", text), ("a", "..."), ("a", text),
        )
    ]  # fmt: skip
    items = list(record_speaker(utterances, GestureSynthesiser(), load_voice("claire")))
    reasons = {item.path.name: item.reason for item in items if isinstance(item, Refusal)}
    assert reasons["noise.wav"] == "its text does not fit its sound"
    assert "too short for its text" in reasons["short.wav"]
    assert "too long for its text" in reasons["long.wav"]
    assert reasons["endless.wav"] == "longer than 240 s"
    assert reasons["text.wav"] == reasons["missing.wav"] == "not a readable sound"
    assert reasons["a.wav"] == "its text has no phone"
    assert sum(not isinstance(item, Refusal) for item in items) == 1


def test_transcripts_in_a_table(tmp_path: Path) -> None:
    (tmp_path / "t.tsv").write_text("path\ttext\tnote\nx/1.ogg\tUn chat.\t-\n", "utf-8")
    assert read_transcripts(tmp_path) == [SpokenFile(tmp_path / "x/1.ogg", "Un chat.")]
    (tmp_path / "t.tsv").write_text("file\twords\n1.ogg\tUn chat.\n", "utf-8")
    with pytest.raises(CueError, match="no columns 'path' and 'text'"):
        read_transcripts(tmp_path)
    (tmp_path / "t.tsv").unlink()
    with pytest.raises(CueError, match="no sounds with transcripts"):
        read_transcripts(tmp_path)


def test_from_the_command_line(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    units = tmp_path / "units"
    assert main(["voice", "build", "--recordings", str(folder), "-o", str(units), "--json"]) == 0
    assert '"recordings": 3' in capsys.readouterr().out
    assert len(read_archive(units)) == 3
    out, speech = tmp_path / "m.npz", tmp_path / "s.wav"
    said = ["synth", "Le chat part.", "--units", str(units), "-o", str(out)]
    assert main([*said, "--speech", str(speech)]) == 0
    sound, fs = soundfile.read(speech)
    assert fs == FS
    assert sound.std() > 0.005
    assert main([*said, "--method", "rules"]) == 2
    assert main(["voice", "build", "--recordings", str(folder)]) == 2
    assert main(["voice", "build", "--recordings", str(folder), "-o", str(units)]) == 3
    assert "exists already" in capsys.readouterr().err


def test_a_real_speaker() -> None:
    if not WORDS.exists():
        pytest.skip("needs the recordings gcompris_fr of ../shared/data/speech")
    utterances = read_transcripts(WORDS)
    chosen = [u for u in utterances if "words" in u.path.parts][:12]
    items = list(record_speaker(chosen, GestureSynthesiser(), load_voice("claire")))
    # Measured on the first 40: none refused.
    assert sum(not isinstance(item, Refusal) for item in items) >= 11
