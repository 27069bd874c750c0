"""Motion made window by window, against motion made at once; the options that choose it."""

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile as sf

from codec.cuer.layout import N_FACE
from codec.cuer.motion import load_motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.score import Score
from codec.errors import CueError
from cuecast.command.arguments import REST_S
from cuecast.command.cli import main
from cuecast.dubbing import performance
from cuecast.dubbing.motions import ConcatenativeMotion, ruled_motion
from cuecast.media.film import write_film
from receiver.media.programme import open_programme
from synth.language.subtitles import Subtitle
from synth.language.text.espeak import RATE_HZ
from synth.language.text.pronounce import phonemise
from synth.motion.rules.gesture import GestureSynthesiser
from synth.motion.rules.movement import ALIGNMENTS
from synth.planning.scoring.text_score import score_of_subtitles, stream_score
from synth.planning.scoring.textgrid import read_textgrid
from synth.units.concatenation.concatenation import ConcatenativeSynthesiser
from synth.units.recordings.recording import UnitRecording
from synth.units.recordings.rendered import record
from synth.units.speech.espeak_voice import render

pytestmark = pytest.mark.long(7)

LINES = (
    Subtitle(0.6, 2.0, "Le chat boit du lait."),
    Subtitle(2.2, 3.4, "Il a bien soif !"),
    Subtitle(6.0, 7.2, "Et toi ?"),
    Subtitle(8.4, 9.6, "Moi non plus."),
)


@pytest.fixture(scope="module")
def voice() -> Voice:
    return load_voice("claire")


def test_rules_make_the_same_motion_from_pieces_as_from_the_whole(voice: Voice) -> None:
    score = score_of_subtitles(LINES)
    parts = list(ruled_motion(stream_score(LINES), GestureSynthesiser(seed=4), voice))
    made = np.concatenate([part.params for part in parts])
    whole = GestureSynthesiser(seed=4).motion(score, 0.0, len(made), voice)
    np.testing.assert_allclose(made, whole.params, atol=1e-4)
    assert tuple(k for part in parts if part.score for k in part.score.keys) == score.keys
    assert len(made) / 50 == pytest.approx(score.phones[-1].end + 1.0, abs=0.03)


@pytest.fixture(scope="module")
def recordings(voice: Voice) -> list[UnitRecording]:
    texts = ("Le chat boit du lait, il a bien soif.", "Et toi, moi non plus !")
    return list(record(texts, GestureSynthesiser(alignment="paper"), voice))


def test_windows_of_joined_units_do_not_depend_on_their_order(
    recordings: list[UnitRecording], voice: Voice
) -> None:
    units = ConcatenativeSynthesiser(recordings, voice)
    score = score_of_subtitles(LINES)
    whole = [part.motion for part in units.perform([score], start_s=0.0)]
    params = np.concatenate([part.params for part in whole])
    source = ConcatenativeMotion(score, units)
    for k in (0, 1, 2, 7, 11, 14, 3, 0):
        window = source.window(k * 0.64, 32)
        np.testing.assert_allclose(window.params, params[k * 32 : (k + 1) * 32], atol=2e-4)
    late = source.window(60.0, 8)
    np.testing.assert_allclose(late.params, np.repeat(params[-1:], 8, axis=0), atol=2e-4)
    with pytest.raises(CueError, match="nothing is said"):
        ConcatenativeMotion(Score((), ()), units)


def srt(path: Path) -> str:
    blocks = [
        f"{number}\n00:00:{s.start_s:06.3f} --> 00:00:{s.end_s:06.3f}\n{s.text}\n"
        for number, s in enumerate(LINES, 1)
    ]
    path.write_text("\n".join(blocks).replace(".", ","), encoding="utf-8")
    return str(path)


def test_options_choose_method_and_alignment(
    tmp_path: Path,
    recordings: list[UnitRecording],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(performance, "reader_recordings", lambda *_, **__: recordings)
    subtitles, speech = srt(tmp_path / "a.srt"), tmp_path / "s.wav"
    made = {}
    for name, options in {
        "plain": [],
        "attina": ["--alignment", "attina"],
        "paper": ["--alignment", "paper"],
        "rest": ["--rest-gap", "5"],
        "units": ["--pace", "readable", "--speech", str(speech)],
        "paper-units": ["--method", "units", "--alignment", "paper"],
    }.items():
        path = tmp_path / f"{name}.npz"
        assert main(["synth", "--file", subtitles, "-o", str(path), *options]) == 0
        made[name] = load_motion(path)
    np.testing.assert_array_equal(made["plain"].params, made["attina"].params)
    for name in ("paper", "rest", "units", "paper-units"):
        n = min(len(made[name].params), len(made["plain"].params))
        assert np.abs(made[name].params[:n] - made["plain"].params[:n]).max() > 0.05, name
        assert made[name].score == made["plain"].score
    assert sf.info(speech).duration == pytest.approx(made["units"].duration_s)
    wrong = ["synth", "--file", subtitles, "-o", str(tmp_path / "x.npz"), "--method", "rules"]
    assert main([*wrong, "--speech", str(tmp_path / "x.wav")]) == 2
    capsys.readouterr()
    targets = []
    for alignment in ALIGNMENTS:
        assert main(["keys", "--file", subtitles, "--json", "--alignment", alignment]) == 0
        targets.append([key["target"] for key in json.loads(capsys.readouterr().out)])
    assert all(a <= b for a, b in zip(*targets, strict=True))
    assert targets[0] != targets[1]


def test_a_plain_text_begins_at_rest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["synth", "Bonjour à tous.", "-o", str(tmp_path / "m.npz")]) == 0
    motion = load_motion(tmp_path / "m.npz")
    assert motion.score is not None
    assert motion.score.phones[0].start == pytest.approx(REST_S, abs=0.02)
    hand = load_voice().reconstruct(motion.params)[:, N_FACE:]
    moved = np.linalg.norm(hand - hand[0], axis=-1).mean(1)
    first = round(REST_S * motion.rate_hz)
    assert moved[first // 4] < 16.0  # measured 11 of 300 mm
    assert moved[first] > 50.0  # measured 145
    capsys.readouterr()
    assert main(["keys", "Bonjour à tous.", "--json"]) == 0
    keys = json.loads(capsys.readouterr().out)
    assert keys == [key.as_dict() for key in motion.score.keys]


def test_a_programme_is_dubbed_with_units(
    tmp_path: Path, recordings: list[UnitRecording], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(performance, "reader_recordings", lambda *_, **__: recordings)
    noise = np.random.default_rng(5).normal(0, 0.05, 48_000 * 11)
    sf.write(tmp_path / "p.wav", noise, 48_000)
    dub = ["dub", str(tmp_path / "p.wav"), "--subtitles", srt(tmp_path / "a.srt")]
    dub += ["--no-grade", "--no-read-back"]
    received = {}
    for method in ("rules", "units"):
        out, found = tmp_path / f"{method}.wav", tmp_path / f"{method}.npz"
        assert main([*dub, "-o", str(out), "--method", method]) == 0
        assert main(["receive", str(out), "-o", str(found)]) == 0
        received[method] = load_motion(found)
    rules, units = received["rules"], received["units"]
    assert rules.score is not None
    assert units.score is not None
    assert [str(k) for k in rules.score.keys] == [str(k) for k in units.score.keys]
    assert np.abs(rules.params - units.params).max() > 0.05


def test_keys_of_a_recording_as_a_textgrid(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "Le chat boit du lait, il a bien soif, et toi, tu viens demain ?"
    line = [s for w in phonemise(text) for s in (*w.phones, *(["_"] if w.pause else []))]
    spoken = render(line)
    sf.write(tmp_path / "a.wav", spoken.samples, RATE_HZ)
    grid = tmp_path / "a.TextGrid"
    aligned = ["--align", str(tmp_path / "a.wav"), "--textgrid", str(grid), "--json"]
    assert main(["keys", text, *aligned]) == 0
    out, notes = capsys.readouterr()
    assert "aligned: 1 of 1 subtitles" in notes
    found = read_textgrid(grid)
    assert [key.as_dict() for key in found.keys] == json.loads(out)
    errors = [abs(a.start - b.start) for a, b in zip(found.phones, spoken.phones, strict=True)]
    assert np.median(errors) < 0.02  # the grid is 20 ms


def test_the_map_of_a_transport_stream_is_followed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    noise = np.random.default_rng(5).normal(0, 0.05, (48_000 * 4, 1)).astype(np.float32)
    write_film(tmp_path / "p.ts", noise, 48_000, encoder="aac")
    with open_programme(tmp_path / "p.ts") as programme:
        ticks = round((programme.origin_s + 2.0) * 90_000)
    vtt = tmp_path / "a.vtt"
    head = f"WEBVTT\nX-TIMESTAMP-MAP=MPEGTS:{ticks},LOCAL:00:00.000"
    vtt.write_text(f"{head}\n\n00:01.000 --> 00:02.000\nOui.\n", encoding="utf-8")
    starts = []
    for name in ("p.ts", "p.mkv"):
        if name == "p.mkv":
            write_film(tmp_path / name, noise, 48_000, encoder="flac")
        dub = ["dub", str(tmp_path / name), "--subtitles", str(vtt), "--json"]
        dub += ["--no-grade", "--no-read-back"]
        assert main([*dub, "-o", str(tmp_path / f"d{name}")]) == 0
        starts.append(json.loads(capsys.readouterr().out)["keys"][0]["start"])
    assert starts == [pytest.approx(3.0, abs=0.02), 1.0]
