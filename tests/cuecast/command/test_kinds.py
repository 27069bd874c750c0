"""Files of the wrong kind: one line that says what they are and which verbs take them."""

import argparse
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from codec import Motion, compare_motions, decode_stream, encode_stream, load_voice, save_motion
from codec.errors import CueError
from cuecast.command.cli import VERBS, build_parser, main
from cuecast.command.files import WRITTEN
from cuecast.command.kinds import kind_of
from cuecast.verbs.receive import in_words
from synth import keys_of, motion_of
from watermark import PROFILES, AudioEmbedder, AudioReceiver

VOICE = load_voice("claire")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("kinds")
    still = np.zeros((64, len(VOICE.layout)), np.float32)
    motion = Motion(still, 50.0, 0.0, VOICE.layout, VOICE.identity)
    save_motion(motion, where / "m.npz")
    (where / "s.cue").write_bytes(encode_stream(motion, VOICE, rate_bps=337.5))
    np.savez(where / "other.npz", x=still)
    wavfile.write(where / "a.wav", 48_000, np.zeros((48_000, 2), np.int16))
    (where / "p.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    (where / "a.srt").write_text("1\n00:00:00,000 --> 00:00:01,000\nBonsoir.\n")
    return where


@pytest.mark.parametrize(
    "words",
    ["synth --file a.srt -o a.srt", "playout a.srt ./a.srt", "dub a.wav --subtitles a.srt -o a.wav",
     "receive a.wav --markers a.wav", "synth --file a.srt --align a.wav -o b.npz --c3d a.srt",
     "keys --file a.srt --textgrid a.srt",
     "synth --file a.srt --align a.wav -o b.npz --method units --speech a.wav",
     "dub a.wav --subtitles a.srt -o b.wav --report a.srt"],
)  # fmt: skip
def test_what_is_read_is_not_written_over(
    words: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    before = [(folder / name).read_bytes() for name in ("a.srt", "a.wav")]
    assert main(words.split()) == 2
    assert "the output would overwrite what is read" in capsys.readouterr().err
    assert [(folder / name).read_bytes() for name in ("a.srt", "a.wav")] == before


def test_two_outputs_are_two_files(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert main("dub a.wav --subtitles a.srt -o b.wav --report ./b.wav".split()) == 2
    assert "b.wav: two outputs would be written there" in capsys.readouterr().err
    assert not (folder / "b.wav").exists()


def options(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All of a parser and of its verbs."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for verb in action.choices.values():
                yield from options(verb)


def test_each_option_for_a_file_is_known_as_read_or_written() -> None:
    """One that writes has to stand in `WRITTEN`, or it could destroy what is read."""
    files = {
        action.dest
        for action in options(build_parser(VERBS))
        if re.search(r"\.\w", str(action.metavar or ""))
    }
    read = {"catalogue", "first", "second", "motion", "model", "score", "stream"}
    assert files - read <= set(WRITTEN)
    assert read <= files


@pytest.mark.parametrize(
    ("name", "kind"),
    [("m.npz", "motion"), ("s.cue", "stream"), ("other.npz", "archive"), ("a.wav", "media"),
     ("p.png", "picture"), ("a.srt", None), ("none", None), (".", None)],
)  # fmt: skip
def test_kinds(folder: Path, name: str, kind: str | None) -> None:
    assert kind_of(str(folder / name)) == kind


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            "decode m.npz -o x.npz",
            "m.npz is a motion (M.npz); decode takes a bit stream (S.cue) here. "
            "For such a file: encode, render, compare, dub --motion",
        ),
        ("inspect m.npz", "inspect takes a bit stream"),
        ("encode a.wav -o x.cue", "a.wav is a sound or video file; encode takes a motion (M.npz)"),
        ("encode s.cue -o x.cue", "For such a file: decode, inspect"),
        ("render other.npz -o x.png", "is an archive (npz or zip) without a motion; render takes"),
        ("compare m.npz s.cue", "s.cue is a bit stream (S.cue); compare takes a motion"),
        ("receive p.png", "p.png is a still picture; receive takes a sound or video file"),
        ("dub m.npz -o x.wav --subtitles a.srt", "m.npz is a motion (M.npz); dub takes a sound"),
        ("keys --file a.wav", "a.wav is a sound or video file; keys takes subtitles here"),
    ],
)
def test_wrong_files(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    given: str,
    message: str,
) -> None:
    monkeypatch.chdir(folder)
    assert main(given.split()) == 3
    told = capsys.readouterr()
    assert message in told.err
    assert told.err.count("\n") == 1
    assert not list(folder.glob("x.*"))


def test_a_programme_without_a_cuer(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "nothing.npz"
    assert main(["receive", str(folder / "a.wav"), "-o", str(out)]) == 1
    told = capsys.readouterr()
    assert told.out == "no cuer found in 1.0 s (searched: audio)\n"
    assert "nothing.npz not written: there is no motion to write" in told.err


def test_reception_in_words() -> None:
    lines = in_words({
        "duration_s": 27.0, "tune_in_s": 0.72, "superframes": {"received": 42, "lost": 1},
        "layers": {"L0": {"received": 42}, "L1": {"received": 40}}, "recovered_together": 2,
        "carriers": {"audio": {"locked": True, "ber_estimate": 0.01}, "video": {"locked": False}},
        "keys": [], "voice": "claire", "authenticity": None, "realtime_factor": 31.0,
    })  # fmt: skip
    assert lines == [
        "0 keys in 27.0 s; first found after 0.72 s",
        "42 superframes received, 1 lost; 42 of part L0; 40 of part L1",
        "audio: locked, bit error ratio 0.0100",
        "video: nothing found",
        "2 superframes only by adding carriers",
        "voice claire; 31.0 times real time",
    ]


def source(k: int) -> tuple[bytes, bytes]:
    return bytes(20), bytes(7)


@pytest.mark.parametrize(
    ("block", "message"),
    [
        (np.zeros((9, 2), np.int16), "samples are int16, .* divide by 32768"),
        (np.zeros((9, 2), bool), "samples are bool"),
        (np.zeros((9, 2), complex), "samples are complex128"),
        (np.zeros(9, np.float32), "shape .9,., expected .n, 2."),
        (np.full((9, 2), np.nan), "not finite"),
    ],
)
def test_samples_of_another_kind(block: np.ndarray, message: str) -> None:
    with pytest.raises(CueError, match=message):
        AudioEmbedder(48_000, 2, source).process(block)
    with pytest.raises(CueError, match=message):
        AudioReceiver(48_000, 2).process(block)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (b"x" * 27, "gave bytes, expected a pair"),
        ((b"x", b"y"), r"parts of \(1, 1\) bytes"),
        (None, "gave NoneType"),
    ],
)
def test_sources_of_another_kind(given: object, message: str) -> None:
    assert PROFILES["audio"]["standard"].l0_bytes == 20
    embedder = AudioEmbedder(48_000, 1, lambda k: given)  # type: ignore[arg-type, return-value]
    with pytest.raises(CueError, match=message):
        embedder.process(np.zeros((480_000, 1), np.float32))


def test_a_text_is_no_score() -> None:
    with pytest.raises(CueError, match="takes Score, not str: score_of_text makes one"):
        motion_of("Bonsoir", VOICE)  # type: ignore[arg-type]


def test_arguments_of_another_kind_are_named() -> None:
    with pytest.raises(CueError, match="score_of_text takes str, not bytes"):
        keys_of(b"Bonsoir")  # type: ignore[arg-type]
    with pytest.raises(CueError, match="encode_stream takes Motion, not str: motion_of and"):
        encode_stream("sent.npz", VOICE)  # type: ignore[arg-type]
    with pytest.raises(CueError, match="decode_stream takes bytes, not str: the content"):
        decode_stream("sent.cue", VOICE)  # type: ignore[arg-type]
    with pytest.raises(CueError, match="compare_motions takes Motion, not str"):
        compare_motions("a.npz", "b.npz", VOICE)  # type: ignore[arg-type]


def test_a_text_of_another_language_is_noted(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "Hello world"]) == 0
    assert "note: this looks like another language (en)" in capsys.readouterr().err
    assert main(["keys", "Bonsoir à tous"]) == 0
    assert "language" not in capsys.readouterr().err
