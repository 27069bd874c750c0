"""A programme dubbed into a container of another kind, and one whose sound begins first."""

import json
import re
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from cuecast.command.cli import main
from cuecast.demo.content import FS, PICTURE_RATE, make_pictures, make_sound
from cuecast.media.copying import is_of_kind
from cuecast.media.film import write_film
from tests.cuecast.media.test_subtitle_tracks import CARRIED, make

SECONDS = 4
TEXT = "1\n00:00:00,200 --> 00:00:02,000\nBonjour à tous.\n"


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four seconds in H.264 and AAC."""
    path = tmp_path_factory.mktemp("film") / "a.mp4"
    pictures = islice(make_pictures(SECONDS), SECONDS * PICTURE_RATE)
    write_film(path, make_sound()[0][: SECONDS * FS], FS, bit_rate=128_000, pictures=pictures)
    return path


def dub(
    source: Path, target: Path, capsys: pytest.CaptureFixture[str], *options: str
) -> tuple[int, dict[str, Any], str]:
    """Return the status, the report and the last line on the standard error."""
    subtitles = target.parent / "a.srt"
    subtitles.write_text(TEXT, encoding="utf-8")
    given = ["--subtitles", str(subtitles), "-o", str(target), "--no-grade", "--json", *options]
    status = main(["dub", str(source), *given])
    told = capsys.readouterr()
    subtitles.unlink()
    return status, json.loads(told.out or "{}"), told.err.splitlines()[-1]


def codecs(path: Path) -> list[str]:
    with av.open(str(path)) as container:
        return sorted(s.codec_context.codec.canonical_name for s in container.streams)


BOTH = ("--carriers", "audio,video")


def test_both_carriers_into_another_container(
    film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Between sound and picture the file still has the old picture, which WebM does not hold."""
    target, given = tmp_path / "b.webm", ["--video-codec", "vp9", "--video-bitrate", "2000k"]
    status, report, _ = dub(film, target, capsys, *BOTH, *given)
    assert status == 0
    assert codecs(target) == ["opus", "vp9"]
    assert report["read_back"]["carriers"]["audio"]["received"] > 0
    assert [path.name for path in tmp_path.iterdir()] == ["b.webm"]


@pytest.mark.parametrize(
    ("target", "options", "message"),
    [
        ("b.webm", (), "webm cannot hold a picture in 'libx264': choose .* --video-codec"),
        ("b.webm", ("--audio-codec", "aac"), "webm cannot hold sound in 'aac'"),
        ("b.mpg", (), r"mpeg cannot hold a picture in 'libx264': .* \(mpeg cannot hold h264\)"),
        ("b.ts", ("--video-codec", "vp9"), "mpegts cannot hold a picture in 'libvpx-vp9'"),
        ("b.nonsense", (), "b.nonsense: cannot write: "),
    ],
)
def test_containers_that_do_not_hold_it(
    film: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    target: str,
    options: tuple[str, ...],
    message: str,
) -> None:
    status, _, told = dub(film, tmp_path / target, capsys, *BOTH, *options)
    assert status == 3
    assert re.search(message, told), told
    assert ".cuecast-" not in told
    assert list(tmp_path.iterdir()) == []


def test_text_that_a_stream_does_not_hold_is_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """FFmpeg would write it as bytes without a name."""
    suffix, coding, packets = CARRIED["subrip"]
    source = make(tmp_path / f"a{suffix}", [(coding, "fra", packets)])
    status, report, _ = dub(source, tmp_path / "b.ts", capsys)
    assert status == 0
    assert any("mpegts cannot hold subrip" in line for line in report["left_out"])
    with av.open(str(tmp_path / "b.ts")) as container:
        assert sorted(stream.type for stream in container.streams) == ["audio", "video"]


def test_cues_before_the_first_picture_are_heard(
    film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Superframes that the sound bears before the picture begins hold the first cues."""
    source = tmp_path / "late.mp4"
    with av.open(str(film)) as one, av.open(str(source), "w") as out:
        copies = {s.index: out.add_stream_from_template(s) for s in one.streams}
        for packet in one.demux():
            if packet.pts is not None and packet.dts is not None:
                late = round(1.5 / packet.time_base) if packet.stream.type == "video" else 0
                packet.pts, packet.dts = packet.pts + late, packet.dts + late
                packet.stream = copies[packet.stream.index]
                out.mux(packet)
    status, report, _ = dub(source, tmp_path / "b.mp4", capsys, "--offset", "1.5")
    assert status == 0
    found = report["read_back"]
    assert found["keys"]["not_on_air"]["before_the_first"] == 0
    assert found["keys"]["received"] == found["keys"]["sent"] > 3
    assert found["carriers"]["audio"]["lost"] == 0


@pytest.mark.parametrize(
    ("suffix", "source", "same"),
    [
        (".m4v", "mov,mp4,m4a,3gp,3g2,mj2", True),
        (".ogv", "ogg", True),
        (".vob", "mpeg", True),
        (".webm", "mov,mp4,m4a,3gp,3g2,mj2", False),
    ],
)
def test_kinds_of_containers(tmp_path: Path, suffix: str, source: str, same: bool) -> None:
    """Between containers of a kind nothing is lost on the way."""
    with av.open(str(tmp_path / f"a{suffix}"), "w") as output:
        assert is_of_kind(output, source) is same


@pytest.mark.parametrize(
    ("suffix", "languages", "warned"), [(".mxf", ("", ""), True), (".mov", ("fra", "eng"), False)]
)
def test_one_of_several_channels_in_tracks_of_their_own(
    suffix: str,
    languages: tuple[str, str],
    warned: bool,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As masters have them: of a stereo sound half the mark would be missing."""
    source, target = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    samples: Any = np.int16(20_000 * make_sound()[0][: SECONDS * FS])
    with av.open(str(source), "w") as out:
        picture: Any = out.add_stream("mpeg2video", rate=25)
        picture.width, picture.height, picture.pix_fmt = 320, 180, "yuv420p"
        sounds: list[Any] = [out.add_stream("pcm_s16le", rate=FS) for _ in samples.T]
        for sound, language in zip(sounds, languages, strict=True):
            sound.layout = "mono"
            sound.metadata.update({"language": language} if language else {})
        for n in range(25 * SECONDS):
            frame = av.VideoFrame(320, 180, "yuv420p")
            frame.pts, frame.time_base = n, Fraction(1, 25)
            out.mux(picture.encode(frame))
        out.mux(picture.encode(None))
        for sound, channel in zip(sounds, samples.T, strict=True):
            block = av.AudioFrame.from_ndarray(channel[None].copy(), "s16", "mono")
            block.sample_rate = FS
            out.mux(sound.encode(block) + sound.encode(None))
    subtitles = tmp_path / "a.srt"
    subtitles.write_text(TEXT, encoding="utf-8")
    given = ["--subtitles", str(subtitles), "-o", str(target), "--no-grade", "--track", "1"]
    assert main(["dub", str(source), *given]) == 0
    told = capsys.readouterr().err
    assert ("warning: 2 tracks of one channel each: track 1 alone" in told) == warned
