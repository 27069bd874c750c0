"""Ten odd programmes: each is dubbed, read back, and its report is true."""

import functools
import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from cuecast.command.cli import main
from cuecast.demo.content import FS, make_pictures, make_sound
from cuecast.demo.run import as_srt

pytestmark = pytest.mark.slow

SECONDS = 8


@functools.cache
def sound() -> NDArray[np.float32]:
    found: NDArray[np.float32] = make_sound()[0][: SECONDS * FS]
    return found


@functools.cache
def pictures() -> list[NDArray[np.uint8]]:
    return [frame for frame, _ in zip(make_pictures(SECONDS), range(SECONDS * 25), strict=False)]


def write(
    path: Path, *, codec: str = "libx264", coder: str = "aac", layout: str = "stereo",
    tracks: int = 1, fps: int = 25, turn: bool = False, uneven: bool = False,
    prepare: Callable[[Any, Any], None] = lambda container, stream: None,
) -> Path:  # fmt: skip
    """Write a film of FFmpeg's."""
    with av.open(str(path), "w") as out:
        shown: Any = out.add_stream(codec, rate=fps)
        frames = [np.rot90(f).copy() if turn else f for f in pictures()]
        shown.height, shown.width = frames[0].shape[:2]
        if codec == "mpeg2video" and path.suffix == ".mxf":
            shown.height, shown.width = 576, 720
        shown.pix_fmt = "yuv420p10le" if codec == "libx265" else "yuv420p"
        shown.bit_rate = 3_000_000
        if codec == "libx265":
            shown.options = {"x265-params": "log-level=none"}
        heard: list[Any] = []
        for _ in range(tracks):
            stream: Any = out.add_stream(coder, rate=FS)
            stream.layout, stream.bit_rate = layout, 384_000 if layout != "stereo" else 160_000
            heard.append(stream)
        prepare(out, shown)
        for n in range(SECONDS * fps):
            if uneven and n % 5 in (1, 2):
                continue
            picture = av.VideoFrame.from_ndarray(frames[n * 25 // fps], format="rgb24")
            if (picture.width, picture.height) != (shown.width, shown.height):
                picture = picture.reformat(shown.width, shown.height)
            picture.pts, picture.time_base = n, Fraction(1, fps)
            out.mux(shown.encode(picture))
        for number, stream in enumerate(heard):
            _sounded(out, stream, layout, number)
        out.mux(shown.encode(None))
    return path


def _sounded(out: Any, stream: Any, layout: str, number: int) -> None:
    plain = sound() * (1.0 if number == 0 else 0.5)
    if layout != "stereo":
        centre = plain.mean(axis=1, keepdims=True)
        plain = np.hstack([plain, centre, 0 * centre, 0.3 * plain])
    form = stream.codec_context.format.name
    resampler = av.AudioResampler(form, layout, FS, frame_size=stream.frame_size or 1920)
    frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(plain.T), "fltp", layout)
    frame.sample_rate, frame.pts, frame.time_base = FS, 0, Fraction(1, FS)
    for part in [*resampler.resample(frame), *resampler.resample(None)]:
        out.mux(stream.encode(part))
    out.mux(stream.encode(None))


def with_chapters(container: Any, stream: Any) -> None:
    container.set_chapters(
        [{"id": n, "start": 1000 * n, "end": 1000 * n + 1000, "time_base": Fraction(1, 1000),
          "metadata": {"title": str(n)}} for n in range(3)]
    )  # fmt: skip


def with_light(container: Any, stream: Any) -> None:
    context = stream.codec_context
    context.colorspace, context.color_primaries, context.color_trc = 9, 9, 18


Made = tuple[Callable[[Path], Path], list[str]]

ODD: dict[str, Made] = {
    "no sound": (lambda p: write(p / "a.mp4", tracks=0), ["--carriers", "video"]),
    "uneven": (lambda p: write(p / "a.mp4", uneven=True), ["--carriers", "audio,video"]),
    "light": (
        lambda p: write(p / "a.mp4", codec="libx265", prepare=with_light),
        ["--carriers", "video"],
    ),
    "chapters": (lambda p: write(p / "a.mkv", prepare=with_chapters), []),
    "three sounds": (lambda p: write(p / "a.mkv", tracks=3), ["--track", "1"]),
    "surround": (lambda p: write(p / "a.mkv", coder="ac3", layout="5.1(side)"), []),
    "mxf": (lambda p: write(p / "a.mxf", codec="mpeg2video", coder="pcm_s16le"), []),
    "portrait": (lambda p: write(p / "a.mp4", turn=True), ["--carriers", "audio,video"]),
    "24 frames": (lambda p: write(p / "a.mp4", fps=24), ["--carriers", "audio,video"]),
}


@pytest.mark.parametrize("name", ODD)
def test_report_of_an_odd_programme_is_true(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, options = ODD[name]
    source = make(tmp_path)
    target, report = tmp_path / f"b{source.suffix}", tmp_path / "r.json"
    (tmp_path / "a.srt").write_text(as_srt(make_sound()[1]), encoding="utf-8")
    status = main(
        ["dub", str(source), "--subtitles", str(tmp_path / "a.srt"), "-o", str(target),
         "--no-grade", "--report", str(report), *options]
    )  # fmt: skip
    told = json.loads(report.read_text(encoding="utf-8"))
    print(
        name, status, {k: v for k, v in told.items() if k in ("read_back", "left_out", "changed")}
    )
    track = options[options.index("--track") + 1] if "--track" in options else "0"
    capsys.readouterr()
    main(["receive", str(target), "--json", "--track", track])
    found = json.loads(capsys.readouterr().out)
    best = max(one["received"] for one in told["read_back"]["carriers"].values())
    assert abs(found["superframes"]["received"] - best) <= 3
    assert status == (0 if best else 1)
    assert best >= 0.8 * (SECONDS / 0.64 - 1), told["read_back"]
    with av.open(str(source)) as a, av.open(str(target)) as b:
        assert [s.type for s in a.streams] == [s.type for s in b.streams]
        assert len(a.chapters()) == len(b.chapters())
        if name == "light":
            one, other = (c.streams.video[0].codec_context for c in (a, b))
            assert (one.color_trc, one.color_primaries) == (other.color_trc, other.color_primaries)


def test_damaged_tail_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = write(tmp_path / "a.mkv")
    data = source.read_bytes()
    source.write_bytes(data[: len(data) * 3 // 4])
    (tmp_path / "a.srt").write_text(as_srt(make_sound()[1]), encoding="utf-8")
    status = main(
        ["dub", str(source), "--subtitles", str(tmp_path / "a.srt"), "-o", str(tmp_path / "b.mkv"),
         "--no-grade"]
    )  # fmt: skip
    assert status == 3
    assert "truncated" in capsys.readouterr().err
    assert not (tmp_path / "b.mkv").exists()
