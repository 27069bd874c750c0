"""Channels of a picture: coders, sizes, cuts and bars, logos, another rate.

In: a marked film; out: the film as it arrives. Everything passes through files, so a clip of any
length needs constant memory. Beside it: how alike a marked film and its original are, and how long
a television that is switched on at any moment waits for the first superframe.
"""

import importlib
import json
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuecast.media.picture import PictureStage, rewrite_picture
from receiver.media.picture import PictureFormat, read_lumas
from watermark.link.superframe import find_named
from watermark.quality.picture import PictureMeter, PictureQuality
from watermark.video.receive import VideoReceiver

Luma = NDArray[Any]


@dataclass(frozen=True, slots=True)
class PictureChannel:
    """What happens to a marked picture on its way.

    Attributes
    ----------
    codec : str
        FFmpeg's name of the encoder; ffv1 for none.
    bit_rate : int
        Bits per second.
    scales : tuple of float
        Size relative to the programme's, for each time that it is coded, one after the other.
    change : callable, optional
        Applied to every luma frame before coding.
    fps_factor : int
        How often each frame is shown.
    """

    codec: str = "ffv1"
    bit_rate: int = 1_000_000
    scales: tuple[float, ...] = (1.0,)
    change: Callable[[Luma], Luma] | None = None
    fps_factor: int = 1


def _contrast(luma: Luma) -> Luma:
    return np.asarray(np.clip(luma * 0.97 + 5.5, 0, 255), dtype=luma.dtype)


def _logo(luma: Luma) -> Luma:
    marked = luma.copy()
    height, width = luma.shape
    marked[height // 20 : height // 7, width * 5 // 6 : width * 19 // 20] = 200
    return marked


def _crop(luma: Luma) -> Luma:
    """Cut 2 % off each side and enlarge the rest to the old size."""
    return _resampled(luma, 0.02, 0.02)


def _letterbox(luma: Luma) -> Luma:
    """Squeeze the picture into three quarters of its height, between bars."""
    return _resampled(luma, 0.0, -1 / 6)


def _resampled(luma: Luma, across: float, down: float) -> Luma:
    """Show the picture without these parts on each side (negative: with bars), linearly."""
    rows, columns = (
        (np.arange(n) + 0.5) * (1 - 2 * part) + n * part - 0.5
        for n, part in zip(luma.shape, (down, across), strict=True)
    )
    x = np.clip(columns, 0, luma.shape[1] - 1)
    y = np.clip(rows, 0, luma.shape[0] - 1)
    left, above = (
        np.minimum(x.astype(int), luma.shape[1] - 2),
        np.minimum(y.astype(int), luma.shape[0] - 2),
    )
    wide = luma[:, left] * (1 - (x - left)) + luma[:, left + 1] * (x - left)
    weight = (y - above)[:, None]
    shown = wide[above] * (1 - weight) + wide[above + 1] * weight
    shown[(rows < -0.5) | (rows > luma.shape[0] - 0.5)] = 16
    return np.asarray(np.round(shown), dtype=luma.dtype)


CHANNELS = {
    "none": PictureChannel(),
    "h264-4M": PictureChannel("libx264", 4_000_000),
    "h264-2M": PictureChannel("libx264", 2_000_000),
    "h264-1M": PictureChannel("libx264", 1_000_000),
    "hevc-2M": PictureChannel("libx265", 2_000_000),
    "hevc-1M": PictureChannel("libx265", 1_000_000),
    "mpeg2-4M": PictureChannel("mpeg2video", 4_000_000),
    "av1-1M": PictureChannel("libsvtav1", 1_000_000),
    "540p-h264-2M": PictureChannel("libx264", 2_000_000, scales=(0.75,)),
    "540p-and-back-h264-2M": PictureChannel("libx264", 2_000_000, scales=(0.75, 1.0)),
    "50p-h264-2M": PictureChannel("libx264", 2_000_000, fps_factor=2),
    "contrast-h264-2M": PictureChannel("libx264", 2_000_000, change=_contrast),
    "logo-h264-2M": PictureChannel("libx264", 2_000_000, change=_logo),
    "crop-h264-2M": PictureChannel("libx264", 2_000_000, change=_crop),
    "letterbox-h264-2M": PictureChannel("libx264", 2_000_000, change=_letterbox),
    "twice-h264-2M": PictureChannel("libx264", 2_000_000, scales=(1.0, 1.0)),
}
"""Channels by name; rates are bits per second of the picture alone."""


def find_channel(name: str) -> PictureChannel:
    """Return the channel of that name.

    Raises
    ------
    CueError
        If there is none.
    """
    return find_named(CHANNELS, name, "channel")


def send(marked: Path, form: PictureFormat, channel: PictureChannel) -> Path:
    """Send a film of this format through a channel; return what arrives, a file beside it."""
    source = marked
    for generation, scale in enumerate(channel.scales):
        target = marked.with_name(f"coded{generation}.mkv")
        change = channel.change if generation == 0 else None
        rewrite_picture(
            source, target, _stages(change), codec=channel.codec, bit_rate=channel.bit_rate,
            size=(2 * round(form.width * scale / 2), 2 * round(form.height * scale / 2)),
            fps=form.fps * channel.fps_factor,
        )  # fmt: skip
        source = target
    return source


def _stages(change: Callable[[Luma], Luma] | None) -> Callable[[PictureFormat], list[PictureStage]]:
    """Return what makes the stages of a coding: one that changes every frame, or none."""
    stages: list[PictureStage] = [] if change is None else [_Change(change)]
    return lambda form: stages


class _Change:
    """A change of every frame by itself, as a stage."""

    def __init__(self, change: Callable[[Luma], Luma]) -> None:
        self._change = change

    def process(self, luma: Luma) -> list[Luma]:
        return [self._change(luma)]

    def flush(self) -> list[Luma]:
        return []


def compare(original: Path, marked: Path, depth: int) -> PictureQuality:
    """Measure PSNR, SSIM and flicker of a film with luma of `depth` bits."""
    meter = PictureMeter(depth)
    for (_, before), (_, after) in zip(read_lumas(original), read_lumas(marked), strict=True):
        meter.process(before, after)
    return meter.result()


def vmaf(original: Path, marked: Path) -> float | None:
    """Mean VMAF of a film against its original; None without imageio-ffmpeg's FFmpeg."""
    try:
        imageio_ffmpeg = importlib.import_module("imageio_ffmpeg")
    except ImportError:
        return None
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "vmaf.json"
        comparison = f"libvmaf=log_fmt=json:log_path={report}"
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-nostdin", "-v", "error", "-i", str(marked)]
        command += ["-i", str(original), "-lavfi", comparison, "-f", "null", "-"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            return None
        return float(json.loads(report.read_text())["pooled_metrics"]["vmaf"]["mean"])


LONGEST_TUNE_IN_S = 6.0
"""A reception that has not locked by then counts with this time."""


class LateReceivers:
    """Receivers that are switched on at different times, each until its first superframe.

    Parameters
    ----------
    tuned : callable
        Makes a receiver.
    starts_s : list of float
        When they are switched on.
    fps : float
        Frames per second of what they see.
    """

    def __init__(self, tuned: Callable[[], VideoReceiver], starts_s: list[float], fps: float):
        self._tuned, self._fps = tuned, fps
        self._starts = sorted(round(start_s * fps) for start_s in starts_s)
        self._on: list[tuple[int, VideoReceiver]] = []
        self._frames = 0
        self._locked_s: list[float] = []

    @property
    def waits_s(self) -> list[float]:
        """Seconds to the first superframe; those who still wait count with the longest time."""
        return self._locked_s + [LONGEST_TUNE_IN_S] * len(self._on)

    def process(self, luma: Luma) -> None:
        """Show a frame to all that are on."""
        while self._starts and self._starts[0] <= self._frames:
            self._on.append((self._starts.pop(0), self._tuned()))
        self._frames += 1
        waiting = []
        for start, receiver in self._on:
            receiver.process(luma)
            if receiver.first_lock_s is not None:
                self._locked_s.append(receiver.first_lock_s)
            elif self._frames - start > LONGEST_TUNE_IN_S * self._fps:
                self._locked_s.append(LONGEST_TUNE_IN_S)
            else:
                waiting.append((start, receiver))
        self._on = waiting
