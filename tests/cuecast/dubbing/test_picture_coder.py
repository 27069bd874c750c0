"""Coders of pictures on which a mark is tried, and the cleaner of noise among them."""

import math
import subprocess
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from codec.errors import CueError
from cuecast.dubbing.denoiser import Denoiser
from cuecast.dubbing.picture_coder import PictureStream, picture_channels
from watermark.video.embed import VideoEmbedder

RATE = Fraction(25)


def frames(count: int, width: int = 320, height: int = 180, depth: int = 8) -> list[Any]:
    y, x = np.mgrid[:height, :width]
    rng = np.random.default_rng(0)
    kind = np.uint8 if depth == 8 else np.uint16
    return [
        (
            (120 + 60 * np.sin(x / 20 + n / 5) * np.cos(y / 15) + rng.normal(0, 3, x.shape))
            * 2 ** (depth - 8)
        ).astype(kind)
        for n in range(count)
    ]


@pytest.mark.parametrize(
    ("coder", "width", "height", "depth"),
    [("h264:300k", 321, 181, 8), ("mpeg2:900k", 320, 180, 10)],
)
def test_every_frame_comes_back_in_order(coder: str, width: int, height: int, depth: int) -> None:
    stream = PictureStream(coder, width, height, RATE, depth)
    sent = frames(30, width, height, depth)
    decoded = [out for frame in sent for out in stream.process(frame)] + stream.flush()
    assert [frame.shape for frame in decoded] == [(height, width)] * 30
    for n in range(30):
        errors = [
            float(np.mean((decoded[n] - (other >> (depth - 8)).astype(float)) ** 2))
            for other in sent[max(0, n - 2) : n + 3]
        ]
        assert int(np.argmin(errors)) == min(n, 2)


@pytest.mark.parametrize("through", ["h264", "theora:300k", "h264:300k+aac:64k", "h264:0k"])
def test_unknown_coders_are_refused(through: str) -> None:
    with pytest.raises(CueError, match="picture coder"):
        picture_channels(through, 320, 180, RATE, 8)


def test_rate_without_a_choice_is_at_most_the_files(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    monkeypatch.setattr(
        "cuecast.dubbing.picture_coder.PictureStream", lambda coder, *_, **__: made.append(coder)
    )
    picture_channels(None, 1280, 720, RATE, 8)
    picture_channels(None, 1280, 720, RATE, 8, most_bps=900_000)
    picture_channels(None, 720, 576, RATE, 8, most_bps=800_000)
    # Each one plainly and behind the cleaner, for a trial and a rehearsal.
    assert [coder for coder in made if "h264" in coder] == [
        *4 * ["h264:2000k"], *4 * ["h264:900k"], *4 * ["h264:800k"]
    ]  # fmt: skip
    assert picture_channels("none", 320, 180, RATE, 8) == []


@pytest.mark.parametrize(
    ("width", "height", "fps", "coders", "widest"),
    [
        (640, 360, 25, ["h264:1000k"], [1]),
        (720, 576, 25, ["h264:1342k"], [1]),
        (1280, 720, 24, ["h264:2000k"], [2]),
        (960, 540, 60, ["h264:2700k", "h264:2000k"], [1, 2]),
        (1920, 1080, 50, ["h264:9000k", "h264:2000k"], [1, 2]),
    ],
)
def test_rates_without_a_choice(
    monkeypatch: pytest.MonkeyPatch,
    width: int,
    height: int,
    fps: int,
    coders: list[str],
    widest: list[int],
) -> None:
    made: list[str] = []
    monkeypatch.setattr(
        "cuecast.dubbing.picture_coder.PictureStream", lambda coder, *_, **__: made.append(coder)
    )
    channels = picture_channels(None, width, height, Fraction(fps), 8)
    # For L0 alone, behind the cleaner.
    tried, rehearsed = made[::2], made[1::2]
    assert tried == rehearsed
    assert [coder for coder in tried if "h264" in coder] == [*coders, "h264:2000k"]
    assert sum("mpeg2" in coder for coder in tried) == 1
    modern = sum("av1" in coder for coder in tried)
    assert modern == (width > 640)
    assert sum(not channel.whole for channel in channels) == 2 + modern
    wholes = [channel for channel in channels if channel.whole]
    assert [channel.widest for channel in wholes] == widest
    # At the lower of two rates L1 may not cost any price, nor the higher one its L1.
    assert [math.isfinite(channel.price) for channel in wholes] == [False, True][: len(wholes)]
    assert [channel.lone for channel in wholes] == [True, False][: len(wholes)]
    assert not any(channel.lone for channel in channels if not channel.whole)


@pytest.mark.parametrize("rate", [Fraction(25), Fraction(2997, 125), Fraction(12), Fraction(120)])
def test_pictures_are_tried_in_standard_definition(rate: Fraction) -> None:
    *_, small = picture_channels(None, 961, 541, rate, 10)
    assert not small.whole
    assert small.widest == 1
    sent = frames(8, 961, 541, 10)
    decoded = [out for frame in sent for out in small.coder.process(frame)] + small.coder.flush()
    assert [frame.shape for frame in decoded] == [(360, 640)] * 8


def test_a_portrait_is_tried_in_standard_definition_with_all_its_cells() -> None:
    *_, small = picture_channels(None, 720, 1280, Fraction(25), 8)
    sent = frames(4, 720, 1280, 8)
    decoded = [out for frame in sent for out in small.coder.process(frame)] + small.coder.flush()
    assert [frame.shape for frame in decoded] == [(570, 320)] * 4
    VideoEmbedder(320, 570, 25, lambda k: (bytes(20), bytes(140)))


def test_cleaner_spares_what_stands_out() -> None:
    edge = np.full((40, 60), 60, dtype=np.uint8)
    edge[:, 30:] = 180
    assert np.array_equal(Denoiser().process(edge)[0], edge)
    noisy = edge + np.random.default_rng(1).integers(-3, 4, (8, 40, 60))
    cleaner = Denoiser()
    cleaned = [cleaner.process(f.astype(np.uint8))[0] for f in noisy][-1]
    assert np.std(cleaned - edge.astype(float)) < 0.5 * np.std(noisy[-1] - edge)


def test_cleaner_is_that_of_ffmpeg(tmp_path: Any) -> None:
    package = pytest.importorskip("imageio_ffmpeg", reason="brings the filter hqdn3d")
    sent = frames(6)
    # Not as "gray": FFmpeg 9 takes that for full range and scales it to 16..235 and back.
    raw, size = tmp_path / "raw", ["-f", "rawvideo", "-pix_fmt", "yuv420p", "-s", "320x180"]
    raw.write_bytes(b"".join(frame.tobytes() + bytes([128]) * (320 * 90) for frame in sent))
    command = [package.get_ffmpeg_exe(), "-v", "error", *size, "-i", str(raw)]
    command += ["-vf", "hqdn3d=4:3:6:4.5", "-f", "rawvideo", "-"]
    found = subprocess.run(command, capture_output=True, check=True).stdout
    theirs = np.frombuffer(found, np.uint8).reshape(-1, 270, 320)[:, :180]
    cleaner = Denoiser()
    for frame, wanted in zip(sent, theirs, strict=True):
        difference = cleaner.process(frame)[0] - wanted.astype(float)
        assert abs(difference).max() <= 1
        assert abs(difference).mean() < 0.05  # measured 0.02
