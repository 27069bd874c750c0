"""Pictures read and written again: luma through stages, everything else as it was."""

from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from codec.errors import CueError
from cuecast.media.picture import rewrite_picture
from cuecast.media.rewrite import Unchanged, rewrite_sound
from receiver.media.picture import PictureFormat, picture_format, read_lumas, steady_rate
from watermark.a335.carrier import A335Embedder, A335Receiver
from watermark.a335.profile import PROFILES as A335_PROFILES
from watermark.video.embed import VideoEmbedder
from watermark.video.profile import PROFILES
from watermark.video.receive import VideoReceiver

WIDTH, HEIGHT, FRAMES = 640, 360, 48


def payload(profiles: Any, name: str) -> Any:
    def give(k: int) -> tuple[bytes, bytes]:
        rng = np.random.default_rng(k)
        return rng.bytes(profiles[name].l0_bytes), rng.bytes(profiles[name].l1_bytes)

    return give


@cache
def scene(n: int) -> np.ndarray:
    y, x = np.mgrid[:HEIGHT, :WIDTH] / HEIGHT
    luma = 110 + 50 * np.sin(9 * x + n / 12) * np.cos(7 * y) + 20 * (x + y > 1)
    return np.asarray(luma, dtype=np.float32)


def write_programme(path: Path, pixel_format: str = "yuv420p", *, times: Any = None) -> None:
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, pixel_format
        sound: Any = container.add_stream("flac", rate=48_000)
        sound.layout = "mono"
        sound.metadata["language"] = "fra"
        for n in range(FRAMES):
            luma = np.clip(scene(n), 0, 255).astype(np.uint8)
            frame = av.VideoFrame.from_ndarray(luma, format="gray").reformat(format=pixel_format)
            frame.pts, frame.time_base = (times or list(range(FRAMES)))[n], Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
        tone = np.arange(48_000, dtype=np.int16)[None]
        block = av.AudioFrame.from_ndarray(tone, format="s16", layout="mono")
        block.sample_rate, block.pts = 48_000, 0
        container.mux(sound.encode(block))
        container.mux(sound.encode(None))


def packets_of_sound(path: Path) -> list[bytes]:
    with av.open(str(path)) as container:
        return [bytes(p) for p in container.demux(container.streams.audio[0]) if p.size]


def test_both_carriers_through_a_programme(tmp_path: Path) -> None:
    programme, marked = tmp_path / "in.mkv", tmp_path / "out.mkv"
    write_programme(programme)
    seconds: list[float] = []

    def stages(form: PictureFormat) -> list[Any]:
        size = form.width, form.height, form.fps
        return [
            VideoEmbedder(*size, payload(PROFILES, "robust"), profile="robust"),
            A335Embedder(*size, payload(A335_PROFILES, "1x")),
        ]

    form = rewrite_picture(
        programme, marked, stages, codec="h264", bit_rate=3_000_000, progress=seconds.append
    )
    assert (form.width, form.height, form.depth) == (WIDTH, HEIGHT, 8)
    assert form.fps == Fraction(25)
    assert sum(seconds) == pytest.approx(FRAMES / 25)
    assert picture_format(marked).codec == "h264"
    assert packets_of_sound(marked) == packets_of_sound(programme)
    with av.open(str(marked)) as container:
        assert container.streams.audio[0].metadata["language"] == "fra"
    invisible, line = VideoReceiver(WIDTH, HEIGHT, 25), A335Receiver(WIDTH, HEIGHT, 25)
    times: list[float] = []
    seen, read = [], []
    for time_s, luma in read_lumas(marked):
        times.append(time_s)
        seen += invisible.process(luma)
        read += line.process(luma)
    assert times == pytest.approx(np.arange(FRAMES) / 25, abs=0.001)
    seen += invisible.flush()
    assert [(s.l0, s.l1) for s in seen] == [payload(PROFILES, "robust")(k) for k in range(3)]
    assert [(s.l0, s.l1) for s in read] == [payload(A335_PROFILES, "1x")(k) for k in range(3)]


def test_no_stage_changes_nothing(tmp_path: Path) -> None:
    programme, copy = tmp_path / "in.mkv", tmp_path / "out.mkv"
    write_programme(programme, "yuv422p10le")
    rewrite_picture(programme, copy, lambda form: [])
    assert picture_format(copy).pixel_format == "yuv422p10le"
    assert picture_format(copy).depth == 10
    for (_, before), (_, after) in zip(read_lumas(programme), read_lumas(copy), strict=True):
        assert before.dtype == np.uint16
        np.testing.assert_array_equal(before, after)


def packets_of_picture(path: Path) -> list[bytes]:
    with av.open(str(path)) as container:
        return [bytes(p) for p in container.demux(container.streams.video[0]) if p.size]


@pytest.mark.parametrize("codec", ["h264", "hevc", "av1"])
def test_same_picture_same_bits(tmp_path: Path, codec: str) -> None:
    programme = tmp_path / "in.mkv"
    write_programme(programme)
    written = []
    for n in range(3):
        out = tmp_path / f"{n}.mkv"
        rewrite_picture(programme, out, lambda form: [], codec=codec, bit_rate=60_000)
        written.append((packets_of_picture(out), out.read_bytes()))
    assert written[0][0]
    # Matroska would give each file random numbers.
    assert written[0] == written[1] == written[2]


def kind(path: Path) -> str:
    """Four letters by which players know the picture's codec."""
    with av.open(str(path)) as container:
        return str(container.streams.video[0].codec_context.codec_tag)


def test_hevc_has_the_name_that_all_players_know(tmp_path: Path) -> None:
    programme, coded, copied = (tmp_path / f"{name}.mp4" for name in "abc")
    write_programme(tmp_path / "in.mkv")
    rewrite_picture(tmp_path / "in.mkv", programme, lambda _: [], codec="hevc", duration_s=1.0)
    assert kind(programme) == "hvc1"
    rewrite_picture(programme, coded, lambda _: [])
    assert kind(coded) == "hvc1"
    rewrite_sound(programme, copied, lambda *_: Unchanged())
    assert kind(copied) == "hvc1"
    assert packets_of_picture(copied) == packets_of_picture(programme)


@pytest.mark.parametrize("bit_rate", [None, 60_000])
def test_stages_know_the_rate_of_the_output(tmp_path: Path, bit_rate: int | None) -> None:
    """Matroska and transport streams state none: it is measured."""
    programme, target = tmp_path / "in.mkv", tmp_path / "out.mkv"
    write_programme(programme)
    assert picture_format(programme).bit_rate == 0
    told: list[int] = []

    def no_stages(form: PictureFormat) -> list[Any]:
        told.append(form.bit_rate)
        return []

    rewrite_picture(programme, target, no_stages, codec="h264", bit_rate=bit_rate)
    assert told[0] > 0 if bit_rate is None else told == [bit_rate]


def test_pictures_without_luma_are_converted(tmp_path: Path) -> None:
    programme = tmp_path / "in.mkv"
    write_programme(programme, "bgra")
    assert picture_format(programme).pixel_format == "yuv420p"
    assert next(read_lumas(programme))[1].shape == (HEIGHT, WIDTH)


def test_variable_rate_becomes_constant(tmp_path: Path) -> None:
    """Held frames are written as often as they were shown, and the mark survives that."""
    programme, marked = tmp_path / "in.mkv", tmp_path / "out.mkv"
    times = [n if n < 10 else 10 + 2 * (n - 10) for n in range(FRAMES)]
    write_programme(programme, times=times)
    shown = [luma for _, luma in read_lumas(programme)]
    assert len(shown) == times[-1] + 1
    np.testing.assert_array_equal(shown[12], shown[13])
    assert not np.array_equal(shown[11], shown[12])

    def stages(form: PictureFormat) -> list[Any]:
        give = payload(PROFILES, "robust")
        return [VideoEmbedder(form.width, form.height, form.fps, give, profile="robust")]

    form = rewrite_picture(programme, marked, stages)
    assert form.fps == 25
    with av.open(str(programme)) as container:
        size = sum(packet.size for packet in container.demux(container.streams.video[0]))
    assert form.bit_rate == pytest.approx(8 * size * 25 / len(shown), rel=0.03)
    frames = list(read_lumas(marked))
    assert [time_s for time_s, _ in frames] == pytest.approx(np.arange(len(shown)) / 25, abs=0.001)
    receiver = VideoReceiver(WIDTH, HEIGHT, 25)
    seen = [s for _, luma in frames for s in receiver.process(luma)] + receiver.flush()
    assert [(s.l0, s.l1) for s in seen] == [payload(PROFILES, "robust")(k) for k in range(5)]


def field_order(path: Path) -> str:
    """Which field of the first frame is shown first."""
    graph = av.filter.Graph()
    with av.open(str(path)) as container:
        source = graph.add_buffer(template=container.streams.video[0])
        parted, sink = graph.add("separatefields"), graph.add("buffersink")
        source.link_to(parted)
        parted.link_to(sink)
        graph.configure()
        frame = next(container.decode(video=0))
        whole = frame.to_ndarray()[:HEIGHT]
        graph.push(frame)
        field = graph.pull().to_ndarray()[: HEIGHT // 2]
    return "tff" if np.array_equal(field, whole[::2]) else "bff"


@pytest.mark.parametrize("codec", ["libx264", "mpeg2video"])
@pytest.mark.parametrize("top", [True, False])
def test_fields_keep_their_order(tmp_path: Path, codec: str, top: bool) -> None:
    """Also where the first packet is one of sound, with which all encoders open."""
    source, target = tmp_path / "fields.ts", tmp_path / "out.ts"
    noise = np.random.default_rng(1).integers(0, 255, (HEIGHT // 8, WIDTH)).astype(np.uint8)
    blocks = np.repeat(np.repeat(noise[:, ::8], 8, 0), 8, 1)
    first = 0 if top else 1
    graph = av.filter.Graph()
    pushed = graph.add("buffer", f"video_size={WIDTH}x{HEIGHT}:pix_fmt=yuv420p:time_base=1/25")
    told, pulled = graph.add("setfield", "tff" if top else "bff"), graph.add("buffersink")
    pushed.link_to(told)
    told.link_to(pulled)
    graph.configure()
    with av.open(str(source), "w") as container:
        sound: Any = container.add_stream("mp2", rate=48_000)
        stream: Any = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.codec_context.flags |= 1 << 18 | 1 << 29
        stream.codec_context.bit_rate = 4_000_000
        block = av.AudioFrame.from_ndarray(np.zeros((1, 24_000), np.int16), "s16", "mono")
        block.sample_rate, block.pts = 48_000, 0
        container.mux(sound.encode(block))
        for n in range(12):
            luma = np.empty((HEIGHT, WIDTH), np.uint8)
            for field in (0, 1):
                luma[first ^ field :: 2] = np.roll(blocks, 6 * (2 * n + field), 1)[field::2]
            frame = av.VideoFrame.from_ndarray(luma, format="gray").reformat(format="yuv420p")
            frame.pts, frame.time_base = n, Fraction(1, 25)
            graph.push(frame)
            container.mux(stream.encode(graph.pull()))
        container.mux([*stream.encode(None), *sound.encode(None)])
    order = "tff" if top else "bff"
    assert field_order(source) == order
    rewrite_picture(source, target, lambda form: [])
    assert field_order(target) == order
    with av.open(str(target)) as container:
        assert all(frame.interlaced_frame for frame in container.decode(video=0))


def test_a_turned_picture_stays_turned(tmp_path: Path) -> None:
    upright, turned, target = (tmp_path / f"{name}.mp4" for name in ("upright", "turned", "out"))
    write_programme(tmp_path / "film.mkv")
    rewrite_picture(tmp_path / "film.mkv", upright, lambda form: [], codec="mpeg4")
    with av.open(str(upright)) as given, av.open(str(turned), "w") as container:
        stream = container.add_stream_from_template(given.streams.video[0])
        stream.set_display_rotation(90)
        for packet in given.demux(given.streams.video[0]):
            if packet.dts is not None:
                packet.stream = stream
                container.mux(packet)
    rewrite_picture(turned, target, lambda form: [])
    for path in (turned, target):
        with av.open(str(path)) as container:
            assert next(container.decode(video=0)).rotation == 90


def test_lost_frames_keep_the_time(tmp_path: Path) -> None:
    programme = tmp_path / "in.mkv"
    write_programme(programme, times=[n if n < 20 else n + 7 for n in range(FRAMES)])
    shown = list(read_lumas(programme))
    assert [t for t, _ in shown] == pytest.approx(np.arange(FRAMES + 7) / 25)
    np.testing.assert_array_equal(shown[19][1], shown[26][1])


@pytest.mark.parametrize(
    ("average", "guessed", "rate"),
    [
        ("25", "25", "25"),
        ("24.99", "25", "25"),
        ("30000/1001", "30000/1001", "30000/1001"),
        ("2997/100", "2997/100", "30000/1001"),
        ("25", "50", "25"),  # fields that are coded as pictures
        ("24.3", "30", "30"),
        ("8", "60", "60"),
        ("15", "15", "15"),
        ("11.7", "1000", "24000/1001"),
        ("1000", "1000", "50"),
    ],
)
def test_rate_of_the_grid(average: str, guessed: str, rate: str) -> None:
    assert steady_rate(Fraction(average), Fraction(guessed)) == Fraction(rate)


def test_refusals(tmp_path: Path) -> None:
    nothing, target = tmp_path / "x.mkv", tmp_path / "out.mkv"
    nothing.write_bytes(b"not a film")
    with pytest.raises(CueError, match="not a sound or video file"):
        rewrite_picture(nothing, target, lambda form: [])
    sound = tmp_path / "sound.wav"
    with av.open(str(sound), "w") as container:
        stream: Any = container.add_stream("pcm_s16le", rate=48_000)
        stream.layout = "mono"
        block = av.AudioFrame.from_ndarray(np.zeros((1, 480), np.int16), "s16", "mono")
        block.sample_rate = 48_000
        container.mux(stream.encode(block))
    with pytest.raises(CueError, match="no picture in it"):
        picture_format(sound)
    programme = tmp_path / "in.mkv"
    write_programme(programme)
    with pytest.raises(CueError, match="picture codec 'nonsense': cannot be written"):
        rewrite_picture(programme, target, lambda form: [], codec="nonsense")
    with pytest.raises(CueError, match="gif cannot hold a picture in 'ffv1'"):
        rewrite_picture(programme, tmp_path / "out.gif", lambda form: [])
