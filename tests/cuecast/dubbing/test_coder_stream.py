"""Coders that a sound's mark is rehearsed on: those of the profile, and the output's own."""

import json
from pathlib import Path

import numpy as np
import pytest

from cuecast.command.cli import main
from cuecast.demo.content import FS, make_sound
from cuecast.demo.run import as_srt
from cuecast.dubbing.coder_stream import CoderStream, coders_for
from cuecast.media.film import write_film
from receiver.media.sound import read_sound
from watermark.audio.embed.codec_loop import RUN_IN_S, WHOLE_FRAMES

USUAL = "aac:128k,mp2:192k"


@pytest.mark.parametrize(
    ("encoder", "bit_rate", "channels", "coders"),
    [
        ("flac", 0, 2, USUAL),
        ("aac", 128_000, 2, USUAL),
        ("aac", 127_000, 2, "aac:127k,mp2:192k"),
        ("aac", 64_000, 1, "aac:64k:mono,mp2:192k"),
        ("mp2", 128_000, 2, "aac:128k,mp2:128k"),
        ("mp2", 70_000, 2, USUAL),  # no rate of MP2
        ("libopus", 96_000, 2, "aac:128k,mp2:192k,opus:96k"),
        ("libmp3lame", 320_000, 2, USUAL),
        ("ac3", 640_000, 6, USUAL),
        ("ac3", 384_000, 6, "aac:128k,mp2:192k,ac3:153k"),
        ("aac", 192_000, 6, "aac:76k,mp2:192k"),
        ("vorbis", 96_000, 2, USUAL),
    ],
)
def test_the_outputs_own_coder_joins_where_it_leaves_less(
    encoder: str, bit_rate: int, channels: int, coders: str
) -> None:
    assert coders_for("standard", encoder, bit_rate, channels) == coders


def test_marks_without_a_rehearsal_stay_without() -> None:
    assert coders_for("discreet", "aac", 64_000, 1) is None
    assert coders_for("robust", "aac", 64_000, 1) == "aac:64k"


def test_a_mono_coder_hears_the_middle() -> None:
    tone = 0.3 * np.sin(2 * np.pi * 440 * np.arange(FS) / FS)
    heard = CoderStream("aac:64k:mono").process(np.stack([tone, -tone], 1).astype(np.float32))
    assert np.abs(heard).max() < 1e-3
    heard = CoderStream("aac:64k:mono").process(np.stack([tone, 0 * tone], 1).astype(np.float32))
    assert np.array_equal(heard[:, 0], heard[:, 1])
    assert np.abs(heard[FS // 2 :]).max() == pytest.approx(0.15, rel=0.05)


@pytest.mark.parametrize("samples", [1024, 1152, 1536])
def test_coders_have_their_frames_in_the_programmes_places(samples: int) -> None:
    """Of AAC, MP2 and MP3, AC-3: an output's frames begin with its first sample."""
    assert WHOLE_FRAMES % samples == 0
    assert round(RUN_IN_S * FS) % WHOLE_FRAMES == 0


@pytest.mark.long(6)
@pytest.mark.parametrize(("source", "late"), [("a.m4a", 1), ("a.flac", 0), ("a.mp2", 0)])
def test_a_sound_in_its_own_codec_is_one_sample_later(
    tmp_path: Path, source: str, late: int
) -> None:
    """Its frames would be in the same places, and the coder would round the mark away."""
    sound, subtitles = make_sound()
    given, target = tmp_path / source, tmp_path / "out.m4a"
    write_film(given, sound[: 4 * FS], FS, encoder=ENCODERS[given.suffix], bit_rate=192_000)
    (tmp_path / "a.srt").write_text(as_srt(subtitles), encoding="utf-8")
    args = ["dub", given, "--subtitles", tmp_path / "a.srt", "-o", target, "--audio-codec", "aac"]
    assert main([*map(str, args), "--no-grade", "--no-read-back"]) == 0
    before, after = (read_sound(path)[0].mean(axis=1)[: 3 * FS] for path in (given, target))
    likeness = [float(before[FS : 2 * FS] @ after[FS + lag : 2 * FS + lag]) for lag in range(-3, 4)]
    assert int(np.argmax(likeness)) - 3 == late


ENCODERS = {".m4a": "aac", ".flac": "flac", ".mp2": "mp2"}


@pytest.mark.long(8)
@pytest.mark.parametrize(
    ("name", "encoder", "bit_rate", "channels"),
    [("a.m4a", "aac", 64_000, 1), ("a.mp3", "libmp3lame", 96_000, 2)],
)
def test_a_frugal_file_keeps_its_cuer(
    tmp_path: Path, name: str, encoder: str, bit_rate: int, channels: int
) -> None:
    """Rehearsed on the usual coders, with frames in the same places, 6 and 4 of 18 arrived."""
    sound, subtitles = make_sound()
    given, report = tmp_path / name, tmp_path / "r.json"
    write_film(given, sound[: 12 * FS, :channels], FS, encoder=encoder, bit_rate=bit_rate)
    (tmp_path / "a.srt").write_text(as_srt(subtitles), encoding="utf-8")
    args = ["dub", given, "--subtitles", tmp_path / "a.srt", "-o", tmp_path / f"out{name}"]
    assert main([*map(str, args), "--no-grade", "--report", str(report)]) == 0
    audio = json.loads(report.read_text(encoding="utf-8"))["carriers"]["audio"]
    own = f"{'aac' if encoder == 'aac' else 'mp3'}:{bit_rate // 1000}k"
    assert own in audio["margin"]["through"]
    assert audio["received"] >= 17
    assert audio["received"] + audio["lost"] == 18
