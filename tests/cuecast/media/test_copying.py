"""What of a programme is taken over beside its sound: pictures, covers, chapters, times, names."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from av.stream import Disposition

from cuecast.media.rewrite import Unchanged, rewrite_sound
from receiver.media.programme import has_stream, open_programme

FS = 48000


def unchanged(*_: object) -> Unchanged:
    return Unchanged()


def packets_of(path: Path, kind: str) -> list[bytes]:
    with av.open(str(path)) as container:
        stream = next(s for s in container.streams if s.type == kind)
        return [bytes(p) for p in container.demux(stream) if p.size]


@pytest.mark.parametrize(
    ("suffix", "encoder"), [(".mp3", "libmp3lame"), (".flac", "flac"), (".mp4", "aac")]
)
def test_a_cover_is_no_picture_and_is_copied(tmp_path: Path, suffix: str, encoder: str) -> None:
    source, target = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    noise = np.random.default_rng(0).normal(0, 0.1, (2, FS)).astype(np.float32)
    shown = av.VideoFrame.from_ndarray(np.full((64, 64, 3), 99, np.uint8), format="rgb24")
    cover: Any
    with av.open(str(source), "w") as out:
        heard: Any = out.add_stream(encoder, rate=FS)
        heard.codec_context.layout = "stereo"
        cover = out.add_stream("mjpeg", rate=25)
        cover.width = cover.height = 64
        cover.pix_fmt, cover.disposition = "yuvj420p", Disposition.attached_pic
        out.mux([*cover.encode(shown), *cover.encode(None)])
        frame = av.AudioFrame.from_ndarray(noise, "fltp", "stereo")
        frame.sample_rate = FS
        cut = av.AudioResampler(heard.codec_context.format, "stereo", FS)
        for part in cut.resample(frame):
            out.mux([*heard.encode(part), *heard.encode(None)])
    with open_programme(source) as programme:
        assert programme.picture is None
    assert not has_stream(source, "video")
    assert rewrite_sound(source, target, unchanged).left_out == ()
    covers = []
    for path in (source, target):
        with av.open(str(path)) as container:
            [stream] = container.streams.video
            assert stream.disposition == Disposition.attached_pic
            covers.append(next(bytes(p) for p in container.demux(stream) if p.size))
    assert covers[0] == covers[1]
    if suffix == ".mp4":
        told = rewrite_sound(source, tmp_path / "c.mov", unchanged).left_out
        assert told == ("stream 1 (video): mov cannot hold a cover",)


def with_pictures(path: Path, add: Callable[[Any], Any], layout: str = "stereo") -> None:
    """Write four seconds of noise beside pictures that `add` gives a stream and packets of."""
    channels = 2 if layout == "stereo" else 1
    noise = np.random.default_rng(0).normal(0, 3000, (1, 4 * channels * FS)).astype(np.int16)
    with av.open(str(path), "w") as out:
        packets = add(out)
        sound: Any = out.add_stream("pcm_s16le", rate=FS)
        sound.layout = layout
        for packet in packets:
            out.mux(packet)
        block = av.AudioFrame.from_ndarray(noise, "s16", layout)
        block.sample_rate = FS
        out.mux(sound.encode(block) + sound.encode(None))


def timed(out: Any) -> list[Any]:
    """Give pictures with a time code and two chapters."""
    picture = out.add_stream("mpeg2video", rate=25)
    picture.width = picture.height = 64
    picture.pix_fmt = "yuv420p"
    picture.metadata["timecode"] = "10:00:00:00"
    unit = {"time_base": Fraction(1, 1)}
    out.set_chapters(
        [{"id": n, "start": 2 * n, "end": 2 * n + 2, "metadata": {"title": name}, **unit}
         for n, name in enumerate(("un", "deux"))]
    )  # fmt: skip
    packets = []
    for n in range(100):
        frame = av.VideoFrame.from_ndarray(np.full((64, 64), n, np.uint8), format="gray")
        frame = frame.reformat(format="yuv420p")
        frame.pts, frame.time_base = n, Fraction(1, 25)
        packets += picture.encode(frame)
    return [*packets, *picture.encode(None)]


@pytest.mark.parametrize("suffix", [".mov", ".mkv", ".ts"])
def test_time_code_and_chapters_are_kept_where_a_container_has_them(
    tmp_path: Path, suffix: str
) -> None:
    """They are tracks of data in QuickTime, which FFmpeg reads and cannot copy."""
    source, target = tmp_path / "source.mov", tmp_path / f"target{suffix}"
    with_pictures(source, timed)
    with av.open(str(source)) as film:
        assert len(film.streams.data) == 2
    written = rewrite_sound(source, target, unchanged, codec="mp2")
    tracks = ("stream 2 (data): bin_data", "stream 3 (data): time code")
    assert written.left_out == (tracks if suffix == ".ts" else ())
    with av.open(str(target)) as film:
        if suffix != ".ts":
            tags = {name.lower(): value for name, value in film.streams.video[0].metadata.items()}
            assert tags["timecode"] == "10:00:00:00"
            assert [one["metadata"]["title"] for one in film.chapters()] == ["un", "deux"]
        assert len(film.streams.data) == (2 if suffix == ".mov" else 0)


def unwritable(out: Any) -> list[Any]:
    """Give pictures in a codec that FFmpeg can decode and not write."""
    picture = out.add_mux_stream("svq3", rate=25, width=320, height=240)
    picture.time_base = Fraction(1, 25)
    packets = [av.Packet(bytes([n]) * 300) for n in range(100)]
    for n, packet in enumerate(packets):
        packet.pts = packet.dts = n
        packet.time_base, packet.stream = Fraction(1, 25), picture
    return packets


def test_pictures_that_nobody_can_write_are_copied(tmp_path: Path) -> None:
    source, target = tmp_path / "source.mov", tmp_path / "target.mov"
    with_pictures(source, unwritable)
    assert rewrite_sound(source, target, unchanged).left_out == ()
    assert packets_of(target, "video") == packets_of(source, "video")
    assert len(packets_of(target, "video")) == 100


def test_channels_without_a_place_get_the_usual_one(tmp_path: Path) -> None:
    """MXF does not say that a single channel is the middle one, and AAC has to know."""
    source, target = tmp_path / "source.mxf", tmp_path / "target.mp4"
    with_pictures(source, timed, "mono")
    with av.open(str(source)) as film:
        assert film.streams.audio[0].layout.name == "1 channels"
    rewrite_sound(source, target, unchanged, codec="aac")
    with av.open(str(target)) as film:
        assert film.streams.audio[0].layout.name == "mono"


def test_a_broadcast_wave_keeps_its_place_in_time(tmp_path: Path) -> None:
    source, target = tmp_path / "source.wav", tmp_path / "target.wav"
    fields = {"description": "Essai", "originator": "Régie", "origination_date": "2026-11-01",
              "origination_time": "10:00:00", "originator_reference": "FR1",
              "coding_history": "A=PCM,F=48000"}  # fmt: skip
    with av.open(str(source), "w", container_options={"write_bext": "1"}) as out:
        sound: Any = out.add_stream("pcm_s24le", rate=FS)
        sound.layout = "mono"
        out.metadata.update(fields | {"time_reference": str(36_000 * FS)})
        block = av.AudioFrame.from_ndarray(np.ones((1, FS), np.int32), "s32", "mono")
        block.sample_rate = FS
        out.mux(sound.encode(block) + sound.encode(None))
    rewrite_sound(source, target, unchanged)
    chunks = []
    for path in (source, target):
        data = path.read_bytes()
        at = data.index(b"bext") + 8
        chunks.append(data[at : at + int.from_bytes(data[at - 4 : at], "little")])
    assert chunks[0] == chunks[1]
    assert int.from_bytes(chunks[1][338:346], "little") == 36_000 * FS
