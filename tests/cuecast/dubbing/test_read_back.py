"""What is written is read back: reports are true, and a cuer that is there already is noticed."""

import contextlib
import io
import json
from collections.abc import Callable
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import soundfile

from cuecast.command.cli import main
from cuecast.demo.content import FS, PICTURE_RATE, make_pictures, make_sound
from cuecast.demo.run import as_srt
from cuecast.dubbing.read_back import Sent, shortfalls, true_psnr_db
from cuecast.media.encode import usual_codec
from cuecast.media.film import write_film
from cuecast.media.picture import light_of, rewrite_picture
from receiver.media.programme import SoundFormat

pytestmark = pytest.mark.long(16)

LINES = 3
"""Subtitles that are cued: the last one begins when the sound is over."""

Run = Callable[..., tuple[int, dict[str, Any], str]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six seconds of sound, the same with a picture, and subtitles that go on longer."""
    path = tmp_path_factory.mktemp("programmes")
    sound, subtitles = make_sound()
    write_film(path / "a.flac", sound[: 6 * FS], FS, encoder="flac")
    (path / "a.srt").write_text(as_srt(subtitles[:LINES]), encoding="utf-8")
    return path


def dub(folder: Path, source: Path, target: Path, *options: str) -> tuple[int, dict[str, Any]]:
    """Dub with the subtitles of the folder; return the status and the report."""
    report = target.parent / "report.json"
    report.unlink(missing_ok=True)
    status = main(
        ["dub", str(source), "--subtitles", str(folder / "a.srt"), "--no-grade",
         "-o", str(target), "--report", str(report), *options]
    )  # fmt: skip
    return status, json.loads(report.read_text(encoding="utf-8")) if report.exists() else {}


@pytest.fixture
def run(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Run:
    def call(source: Path, target: str, *options: str) -> tuple[int, dict[str, Any], str]:
        status, report = dub(folder, source, tmp_path / target, *options)
        return status, report, capsys.readouterr().err

    return call


@pytest.fixture(scope="module")
def dubbed(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, dict[str, Any], str]:
    """The sound dubbed: the file, its report and what was noted."""
    target, notes = tmp_path_factory.mktemp("dubbed") / "b.flac", io.StringIO()
    with contextlib.redirect_stderr(notes):
        status, report = dub(folder, folder / "a.flac", target)
    assert status == 0
    return target, report, notes.getvalue()


def test_report_is_what_a_receiver_finds(dubbed: tuple[Path, dict[str, Any], str]) -> None:
    target, report, err = dubbed
    audio = report["read_back"]["carriers"]["audio"]
    assert audio == {"sent": 9, "received": 9, "lost": 0, "share": 1.0}
    keys = report["read_back"]["keys"]
    assert keys["received"] == keys["sent"] > 10
    late = [key for key in report["keys"] if key["start"] >= report["duration_s"]]
    assert report["keys_outside"] == len(late) > 0  # the subtitles outlast the programme
    assert f"warning: {len(late)} of {len(report['keys'])} keys fall outside" in err
    assert {p.name for p in target.parent.iterdir()} == {"b.flac", "report.json"}


def test_channel_that_the_mark_does_not_survive(folder: Path, run: Run) -> None:
    status, report, err = run(folder / "a.flac", "b.flac", "--through", "mp2:32k")
    audio = report["read_back"]["carriers"]["audio"]
    assert audio["received"] < 0.98 * audio["sent"]
    assert f"warning: audio: only {audio['received']} of 9 superframes" in err
    margin = report["carriers"]["audio"]["margin"]
    assert len(margin["superframes"]) == audio["sent"]
    assert margin["least"] < 1.5
    assert "warning: margin below 1.5 from 00:00 to 00:0" in err
    assert "would help: " in err
    assert status == (0 if audio["received"] else 1)


def test_dubbed_already(dubbed: tuple[Path, dict[str, Any], str], run: Run, tmp_path: Path) -> None:
    status, _, err = run(dubbed[0], "c.flac")
    assert status == 3
    assert "it has a cuer already, in audio" in err
    assert not (tmp_path / "c.flac").exists()
    untried = ["--through", "none"]
    status, report, _ = run(dubbed[0], "c.flac", "--replace", "--seed", "4", *untried)
    assert status == 0
    assert report["read_back"]["carriers"]["audio"]["share"] == 1.0
    assert run(dubbed[0], "d.flac", "--key", "7", *untried)[0] == 0  # another mark beside it


def test_a_signed_cuer_that_is_replaced_is_reported(folder: Path, run: Run, tmp_path: Path) -> None:
    files = ["--secret", str(tmp_path / "k.key"), "--public", str(tmp_path / "k.pub")]
    assert main(["key", "new", "one", *files, "--days", "1", "--from", "2027-01-31"]) == 0
    sign = ["--sign", str(tmp_path / "k.key"), "--on-air", "2027-01-31T20:00:00Z"]
    untried = ["--no-read-back", "--through", "none"]
    line = "the cuer that is replaced is signed, the new one is not"
    status, report, err = run(folder / "a.flac", "b.flac", *untried, *sign)
    assert status == 0
    assert line not in err + str(report)
    again = ["--replace", "--seed", "4", *untried]
    status, report, err = run(tmp_path / "b.flac", "c.flac", *again)
    assert status == 0
    assert [left for left in report["left_out"] if line in left]
    assert line in err
    status, report, err = run(tmp_path / "b.flac", "d.flac", *again, *sign)
    assert status == 0
    assert line not in err + str(report)


def test_earlier_cuer_that_would_stay(folder: Path, run: Run, tmp_path: Path) -> None:
    film = tmp_path / "film.mkv"
    sound = make_sound()[0][: 4 * FS]
    pictures = islice(make_pictures(4), 4 * PICTURE_RATE)
    write_film(film, sound, FS, encoder="aac", bit_rate=128000, pictures=pictures)
    status, report, _ = run(film, "b.mkv", "--carriers", "a335", "--video-bitrate", "4000k")
    assert status == 0
    assert report["read_back"]["carriers"]["a335"]["share"] == 1.0
    assert report["carriers"]["a335"]["psnr_db"] == true_psnr_db(film, tmp_path / "b.mkv")
    status, _, err = run(tmp_path / "b.mkv", "c.mkv", "--replace")
    assert status == 3
    assert "in a335 would stay: add it to --carriers" in err


def test_psnr_is_that_of_the_coded_picture(tmp_path: Path) -> None:
    """Against numpy on the pictures of PyAV itself."""
    one, other = tmp_path / "a.mkv", tmp_path / "b.mkv"
    rng = np.random.default_rng(1)
    pictures = [rng.integers(0, 256, (64, 64, 3), dtype=np.uint8) for _ in range(10)]
    write_film(one, np.zeros((FS // 2, 1), np.float32), FS, encoder="flac", pictures=pictures)
    rewrite_picture(one, other, lambda form: [], bit_rate=60_000)
    with av.open(str(one)) as a, av.open(str(other)) as b:
        x, y = (
            np.stack([f.to_ndarray()[:64].astype(float) for f in c.decode(video=0)]) for c in (a, b)
        )
    wanted = 10 * np.log10(255**2 / np.mean((x - y) ** 2))
    assert true_psnr_db(one, other) == pytest.approx(wanted, abs=0.02)


def test_the_container_decides_the_codec(folder: Path, run: Run, tmp_path: Path) -> None:
    status, report, err = run(folder / "a.flac", "b.wav")
    assert status == 0
    assert soundfile.info(tmp_path / "b.wav").subtype == "PCM_16"
    assert report["changed"] == ["sound: flac is now pcm_s16le"]
    assert "changed: sound: flac is now pcm_s16le" in err


@pytest.mark.parametrize(
    ("codec", "form", "suffix", "wanted"),
    [
        ("flac", "s32", ".wav", "pcm_s24le"),
        ("pcm_f32le", "flt", ".wav", "pcm_f32le"),
        ("aac", "fltp", ".WAV", "pcm_s16le"),
        ("pcm_s16le", "s16", ".aiff", "pcm_s16be"),
        ("vorbis", "fltp", ".ogg", "vorbis"),
        ("flac", "s16", ".mp3", "libmp3lame"),
        ("mp2float", "fltp", ".ts", "mp2float"),
        ("flac", "s16", ".mkv", "flac"),
        ("pcm_u8", "u8", ".wav", "pcm_s16le"),
        ("pcm_s8", "u8p", ".aiff", "pcm_s16be"),
        ("pcm_u8", "u8", ".mkv", "pcm_s16le"),
        ("pcm_mulaw", "s16", ".wav", "pcm_mulaw"),
    ],
)
def test_usual_codecs(codec: str, form: str, suffix: str, wanted: str) -> None:
    assert usual_codec(SoundFormat(codec, 48000, 2, "stereo", form, 0), suffix) == wanted


def test_logarithmic_sound_keeps_its_cuer(folder: Path, run: Run, tmp_path: Path) -> None:
    status, report, _ = run(folder / "a.flac", "b.wav", "--audio-codec", "pcm_mulaw")
    assert status == 0
    assert soundfile.info(tmp_path / "b.wav").subtype == "ULAW"
    keys = report["read_back"]["keys"]
    assert keys["received"] == keys["sent"] > 0


def test_sound_of_a_telephone_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, target = tmp_path / "a.wav", tmp_path / "b.wav"
    soundfile.write(source, np.zeros(8000), 8000, "ULAW")
    (tmp_path / "a.srt").write_text("1\n00:00:00,100 --> 00:00:00,900\nOui.\n", encoding="utf-8")
    given = ["--subtitles", str(tmp_path / "a.srt"), "-o", str(target)]
    assert main(["dub", str(source), *given]) == 3
    assert "sound of 8000 Hz cannot carry a cuer" in capsys.readouterr().err.splitlines()[-1]
    assert not target.exists()


def test_colours_chapters_and_attachments_stay(tmp_path: Path) -> None:
    source, target = tmp_path / "a.mkv", tmp_path / "b.mkv"
    with av.open(str(source), "w") as out:
        stream: Any = out.add_stream("libx265", rate=25)
        stream.width = stream.height = 64
        stream.pix_fmt = "yuv420p10le"
        stream.options = {
            "x265-params": "log-level=none:hdr10=1:max-cll=1000,400:master-display="
            "G(13250,34500)B(7500,3000)R(34000,16000)WP(15635,16450)L(10000000,50)"
        }
        context = stream.codec_context
        context.colorspace, context.color_primaries, context.color_trc = 9, 9, 18
        chapter: Any = {
            "id": 0,
            "start": 0,
            "end": 500,
            "time_base": Fraction(1, 1000),
            "metadata": {"title": "Un"},
        }
        out.set_chapters([chapter])
        out.add_attachment("a.ttf", "font/ttf", b"abc")
        for n in range(25):
            frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), n, np.uint8), format="rgb24")
            frame.pts, frame.time_base = n, Fraction(1, 25)
            out.mux(stream.encode(frame.reformat(format="yuv420p10le")))
        out.mux(stream.encode(None))
    told: list[str] = []
    rewrite_picture(source, target, lambda form: [], tell=told.append)
    assert told == []
    with av.open(str(source)) as a, av.open(str(target)) as b:
        for name in ("colorspace", "color_primaries", "color_trc", "color_range"):
            before, after = (getattr(c.streams.video[0].codec_context, name) for c in (a, b))
            assert before == after, name
        assert b.chapters()[0]["metadata"] == {"title": "Un"}
        assert [s.type for s in b.streams] == ["video", "attachment"]
        lights = [light_of(next(c.decode(video=0))) for c in (a, b)]
    assert lights[0] == lights[1]
    assert "max-cll=1000,400" in lights[0]
    assert "L(10000000,50)" in lights[0]


def test_only_what_can_be_carried_is_expected() -> None:
    sent = Sent()
    source = sent.noting("audio", lambda k: (bytes([k]), b""), first=-2)
    for k in range(6):
        source(k)
    sent.silent = [(0.64, 1.28)]
    assert sorted(sent.expected("audio", 2.56)) == [-2, -1, 0, 2, 3]
    assert sorted(sent.expected("audio", 2.5)) == [-2, -1, 0, 2]


def test_shortfalls() -> None:
    good = {"sent": 100, "received": 98, "share": 0.98}
    none = {"sent": 0, "received": 0, "share": None}
    assert shortfalls({"carriers": {"audio": good, "video": none}}) == []
    bad = {"carriers": {"audio": good | {"received": 97, "share": 0.97}}}
    assert len(shortfalls(bad)) == 1
    assert "kbit/s" not in shortfalls(bad)[0]
    bad = {"carriers": {"audio": good, "video": good | {"received": 0, "share": 0.0}}}
    (line,) = shortfalls(bad, {"video": 57_600})
    assert line.startswith("video: only 0 of 100")
    assert "57 kbit/s" in line
