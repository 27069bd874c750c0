"""The evaluation of the video carrier on a small synthetic clip."""

import sys
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from codec.errors import CueError
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.picture_channels import CHANNELS, send
from cuecast.evaluate.video import evaluate, evaluate_video, films_of, plot
from receiver.media.picture import picture_format, read_lumas
from watermark.quality.picture import PictureMeter, ssim


def write_clip(path: Path, frames: int, fps: int = 25) -> None:
    y, x = np.mgrid[:360, :640] / 360
    rng = np.random.default_rng(0)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=fps)
        stream.width, stream.height, stream.pix_fmt = 640, 360, "yuv420p"
        for n in range(frames):
            luma = 120 + 50 * np.sin(6 * x + n / 20) * np.cos(5 * y) + rng.normal(0, 1, x.shape)
            frame = av.VideoFrame.from_ndarray(luma.astype(np.uint8), format="gray")
            container.mux(stream.encode(frame.reformat(format="yuv420p")))
        container.mux(stream.encode(None))


def test_rows(tmp_path: Path) -> None:
    clip = tmp_path / "clip.mkv"
    write_clip(clip, 52)
    told: list[str] = []
    rows = evaluate_video(
        [clip],
        ["none", "540p-h264-2M"],
        profile="robust+none",
        seconds=2,
        starts=1,
        progress=lambda row: told.append(row.channel),
    )
    assert told == ["none", "540p-h264-2M"]
    for row in rows:
        assert (row.clip, row.superframes_sent, row.superframes_lost) == ("clip.mkv", 3, 0)
        assert (row.l0_lost, row.wrong) == (0, 0)
        assert row.lost_high == pytest.approx(0.5615, abs=1e-4)
        assert row.net_bps == 600
        assert row.psnr_db > 50.5
        assert row.ssim > 0.99
        assert row.flicker < row.own_noise
        assert row.tune_in_median_s is not None
        assert row.tune_in_median_s == row.tune_in_p95_s
        assert row.tune_in_median_s < 1
        assert row.offset_ms is not None
        assert abs(row.offset_ms) < 10
        assert row.vmaf is None or row.vmaf > 90
    assert rows[0].ber is not None
    assert rows[1].ber is not None
    assert rows[0].ber <= rows[1].ber


def test_a_rate_that_a_coder_refuses(tmp_path: Path) -> None:
    write_clip(tmp_path / "clip.mkv", 16, fps=13)
    rows = evaluate_video([tmp_path / "clip.mkv"], ["mpeg2-4M", "none"], profile="robust+none")
    assert [(row.superframes_sent, row.superframes_lost) for row in rows] == [(0, 0), (2, 0)]
    assert rows[0].fault.startswith("mpeg2video in matroska cannot be written with 640x360")
    assert "13 frames/s" in rows[0].fault
    assert not rows[1].fault
    assert rows[0].psnr_db == rows[1].psnr_db


def test_unknown_channel() -> None:
    with pytest.raises(CueError, match="unknown channel 'pigeon', known: none, h264-4M"):
        evaluate_video([], ["pigeon"])
    assert evaluate_video([], list(CHANNELS)) == []


def test_filters_need_their_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    write_clip(tmp_path / "clip.mkv", 2)
    form = picture_format(tmp_path / "clip.mkv")
    with pytest.raises(CueError, match="filters: need the package imageio-ffmpeg"):
        send(tmp_path / "clip.mkv", form, CHANNELS["gamma-h264-2M"])


def test_filters_before_the_coder(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg", reason="FFmpeg with all filters is optional")
    write_clip(tmp_path / "clip.mkv", 3)
    form = picture_format(tmp_path / "clip.mkv")
    for name, width, height in (
        ("576i-mpeg2-4M", 720, 576),
        ("hqdn3d-h264-2M", 640, 360),
        ("ticker-h264-2M", 640, 360),
        ("crop-left-2-h264-2M", 640, 360),
    ):
        arrived = send(tmp_path / "clip.mkv", form, CHANNELS[name])
        found = picture_format(arrived)
        assert (found.width, found.height) == (width, height)
        assert sum(1 for _ in read_lumas(arrived)) == 3


def test_frugal_broadcast(tmp_path: Path) -> None:
    write_clip(tmp_path / "clip.mkv", 30, fps=50)
    form = picture_format(tmp_path / "clip.mkv")
    arrived = send(tmp_path / "clip.mkv", form, CHANNELS["h264-veryfast-2M"]).read_bytes()
    # x264 writes its settings into the first frame; those of veryfast: one reference, subme 2.
    for setting in (b"ref=1", b"subme=2", b"keyint=25 ", b"vbv_maxrate=2000", b"vbv_bufsize=2000"):
        assert setting in arrived


@pytest.mark.parametrize("thrift", [0.5, 0.0])
def test_a_thrifty_coder_is_asked_for_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, thrift: float
) -> None:
    asked: list[int] = []

    def rewrite(source: Path, target: Path, *_: Any, bit_rate: int, **__: Any) -> None:
        asked.append(bit_rate)
        # Of a second and a fifth: a part of what is asked for, or the same whatever it is.
        target.write_bytes(bytes(round(0.15 * (thrift * bit_rate or 100_000))))

    write_clip(tmp_path / "clip.mkv", 30)
    form = picture_format(tmp_path / "clip.mkv")
    lumas = [(0.0, np.zeros((2, 2)))] * 30
    monkeypatch.setattr("cuecast.evaluate.picture_channels.rewrite_picture", rewrite)
    monkeypatch.setattr("cuecast.evaluate.picture_channels.read_lumas", lambda path: iter(lumas))
    monkeypatch.setattr("cuecast.evaluate.picture_channels.picture_format", lambda path: form)
    send(tmp_path / "clip.mkv", form, CHANNELS["av1-1M"])
    assert asked == [1_000_000, 2_000_000 if thrift else 4_000_000]


def test_rows_of_the_verb(tmp_path: Path) -> None:
    said: list[str] = []
    write_clip(tmp_path / "clip.mkv", 40)
    options = EvaluateOptions(tmp_path, ("none",), 3, tmp_path, said.append)
    (row,) = evaluate(options)
    assert (row["clip"], row["channel"], row["net_bps"]) == ("clip.mkv", "none", 2000)
    assert (row["superframes_sent"], row["superframes_lost"]) == (2, 0)
    figure = pytest.importorskip("matplotlib.figure", reason="plots are optional").Figure()
    plot([row], figure)
    (axes,) = figure.axes
    (drawn,) = axes.containers
    dots, _, (interval,) = drawn.lines
    assert dots.get_xdata().tolist() == [0]
    assert interval.get_segments()[0][:, 0] == pytest.approx([0, 100 * row["lost_high"]])
    assert 100 * row["lost_high"] > 50
    assert [label.get_text() for label in axes.get_yticklabels()] == ["none"]
    assert said == ["clip.mkv standard:none: 0 of 2 lost"]
    with pytest.raises(CueError, match="no films in it"):
        films_of(tmp_path / "nowhere")


def test_picture_meter() -> None:
    rng = np.random.default_rng(1)
    meter = PictureMeter(ssim_every=1)
    for n in range(4):
        frame = rng.integers(0, 200, (64, 64)).astype(np.uint8)
        meter.process(frame, frame + np.uint8(1 + n % 2))
    quality = meter.result()
    assert quality.psnr_db == pytest.approx(10 * np.log10(255**2 / 2.5))
    assert quality.flicker == pytest.approx(1)
    assert quality.own_noise > 10
    assert 0.9 < quality.ssim < 1
    black, white = np.zeros((32, 32), np.float32), np.full((32, 32), 255, np.float32)
    assert ssim(black, black) == pytest.approx(1)
    assert ssim(black, white) < 0.001
    with pytest.raises(CueError, match="test has shape"):
        meter.process(frame, frame[1:])
    with pytest.raises(CueError, match="nothing to compare"):
        PictureMeter().result()
