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
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.media.picture import PictureStage, rewrite_picture
from receiver.media.picture import PictureFormat, picture_format, read_lumas
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
    filters : str
        FFmpeg's filters before anything else; they need the program of imageio-ffmpeg.
    preset : str
        Of the encoder, if not its own.
    gop : int, optional
        Most frames between two that stand alone, if not one second's.
    sought : bool
        Whether the coder is asked for other rates until it spends its own.
    """

    codec: str = "ffv1"
    bit_rate: int = 1_000_000
    scales: tuple[float, ...] = (1.0,)
    change: Callable[[Luma], Luma] | None = None
    fps_factor: int = 1
    filters: str = ""
    preset: str = ""
    gop: int | None = None
    sought: bool = False


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


def _h264(filters: str) -> PictureChannel:
    return PictureChannel("libx264", 2_000_000, filters=filters)


def _mpeg2(lines: int, columns: int, bit_rate: int, more: str = "") -> PictureChannel:
    """Return standard definition; `more`: filters behind the change of size."""
    filters = f"scale={columns}:{lines}:flags=bicubic{more}"
    return PictureChannel("mpeg2video", bit_rate, filters=filters)


def _cut(left: float, top: float, right: float = 0.0, bottom: float = 0.0) -> PictureChannel:
    """Return a cut of these parts of the picture, which is enlarged to its old size."""
    kept = f"iw*{1 - left - right:g}:ih*{1 - top - bottom:g}:iw*{left:g}:ih*{top:g}"
    # The size before the cut, as far as a filter can know it.
    size = f"round(iw/{1 - left - right:g}/2)*2:round(ih/{1 - top - bottom:g}/2)*2"
    return _h264(f"crop={kept}:exact=1,scale={size}:flags=bicubic,setsar=1")


_TICKER = (
    r"split[a][b];[b]crop=iw*3/4:ih/12:iw/8+mod(n*6\,iw/8):ih/3,negate,scale=iw*4/3:-2[c];"
    "[a][c]overlay=0:main_h*0.88,format=yuv420p"
)
"""A band at the bottom with detail that runs to the left: another part of the picture, inverted."""

CHANNELS = {
    "none": PictureChannel(),
    "h264-4M": PictureChannel("libx264", 4_000_000),
    "h264-2M": PictureChannel("libx264", 2_000_000),
    "h264-veryfast-2M": PictureChannel("libx264", 2_000_000, preset="veryfast", gop=25),
    "h264-1M": PictureChannel("libx264", 1_000_000),
    "hevc-2M": PictureChannel("libx265", 2_000_000),
    "hevc-1500k": PictureChannel("libx265", 1_500_000),
    "hevc-1M": PictureChannel("libx265", 1_000_000),
    "mpeg2-4M": PictureChannel("mpeg2video", 4_000_000),
    "mpeg2-3M": PictureChannel("mpeg2video", 3_000_000),
    "576p-mpeg2-4M": _mpeg2(576, 720, 4_000_000),
    "576p-mpeg2-3M": _mpeg2(576, 720, 3_000_000),
    "576i-mpeg2-4M": _mpeg2(576, 720, 4_000_000, ",setfield=tff"),
    "528p-mpeg2-4M": _mpeg2(528, 720, 4_000_000),
    "480p-mpeg2-4M": _mpeg2(480, 720, 4_000_000),
    "360p-mpeg2-4M": _mpeg2(360, 640, 4_000_000),
    "av1-1M": PictureChannel("libsvtav1", 1_000_000, sought=True),
    "vp9-1500k": PictureChannel("libvpx-vp9", 1_500_000),
    "hqdn3d-h264-2M": _h264("hqdn3d=4:3:6:4.5"),
    "hqdn3d-spatial-h264-2M": _h264("hqdn3d=4:3:0.01:0.01"),
    "hqdn3d-temporal-h264-2M": _h264("hqdn3d=0.01:0.01:6:4.5"),
    "nlmeans-h264-2M": _h264("nlmeans"),
    "rgb-h264-2M": _h264("format=rgb24,format=yuv420p"),
    "gamma-h264-2M": _h264("eq=gamma=1.1"),
    "ticker-h264-2M": _h264(_TICKER),
    "crop-left-2-h264-2M": _cut(0.02, 0),
    "crop-right-3-h264-2M": _cut(0, 0, 0.03),
    "crop-top-3-h264-2M": _cut(0, 0.03),
    "crop-corner-5-h264-2M": _cut(0.05, 0.05),
    "540p-h264-2M": PictureChannel("libx264", 2_000_000, scales=(0.75,)),
    "540p-and-back-h264-2M": PictureChannel("libx264", 2_000_000, scales=(0.75, 1.0)),
    "50p-h264-2M": PictureChannel("libx264", 2_000_000, fps_factor=2),
    "contrast-h264-2M": PictureChannel("libx264", 2_000_000, change=_contrast),
    "logo-h264-2M": PictureChannel("libx264", 2_000_000, change=_logo),
    "crop-h264-2M": PictureChannel("libx264", 2_000_000, change=_crop),
    "letterbox-h264-2M": PictureChannel("libx264", 2_000_000, change=_letterbox),
    "twice-h264-2M": PictureChannel("libx264", 2_000_000, scales=(1.0, 1.0)),
}
"""Channels by name; rates are bits per second of the picture alone. To `hqdn3d` 0 means the
default, so that 0.01 stands for none."""


def find_channel(name: str) -> PictureChannel:
    """Return the channel of that name.

    Raises
    ------
    CueError
        If there is none.
    """
    return find_named(CHANNELS, name, "channel")


def send(marked: Path, form: PictureFormat, channel: PictureChannel) -> Path:
    """Send a film of this format through a channel; return what arrives, a file beside it.

    Raises
    ------
    CueError
        If the channel has filters and there is no program for them, or it fails.
    """
    source = marked
    if channel.filters:
        source = marked.with_name("filtered.mkv")
        _ffmpeg(
            ["-i", str(marked), "-vf", channel.filters, "-c:v", "ffv1", "-y", str(source)],
            "channels with filters",
        )
        filtered = picture_format(source)
        form = replace(form, width=filtered.width, height=filtered.height)
    for generation, scale in enumerate(channel.scales):
        target = marked.with_name(f"coded{generation}.mkv")
        change = channel.change if generation == 0 else None
        code = partial(
            rewrite_picture,
            source,
            target,
            _stages(change),
            codec=channel.codec,
            gop=channel.gop,
            preset=channel.preset,
            size=(2 * round(form.width * scale / 2), 2 * round(form.height * scale / 2)),
            fps=form.fps * channel.fps_factor,
        )
        code(bit_rate=channel.bit_rate)
        if channel.sought:
            _seek_rate(code, target, channel.bit_rate)
        source = target
    return source


SOUGHT_TIMES, SOUGHT_ERROR = 4, 0.05
"""Times that a coder is asked again, and the error of its rate that is good enough."""


def _seek_rate(code: Callable[..., PictureFormat], target: Path, bit_rate: int) -> None:
    """Code again, asking for other rates, until the file has this one.

    The rate control of SVT-AV1 spends half to four fifths of its rate in a film's first ten
    seconds, which no broadcast consists of.
    """
    asked = float(bit_rate)
    for _ in range(SOUGHT_TIMES):
        frames = sum(1 for _ in read_lumas(target))
        seconds = frames / float(picture_format(target).fps)
        spent = 8 * target.stat().st_size / max(seconds, 1e-3)
        # No more than four times the rate: a still picture has no use for it.
        before, asked = asked, min(asked * bit_rate / spent, 4.0 * bit_rate)
        if asked == before or abs(spent / bit_rate - 1) <= SOUGHT_ERROR:
            return
        code(bit_rate=round(asked))


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
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "vmaf.json"
        comparison = f"libvmaf=log_fmt=json:log_path={report}"
        try:
            _ffmpeg(
                ["-i", str(marked), "-i", str(original), "-lavfi", comparison, "-f", "null", "-"],
                "VMAF",
            )
        except CueError:
            return None
        return float(json.loads(report.read_text())["pooled_metrics"]["vmaf"]["mean"])


def _ffmpeg(arguments: list[str], what: str) -> None:
    """Run FFmpeg as the package imageio-ffmpeg brings it: with all filters, which PyAV's lacks.

    Raises
    ------
    CueError
        If the package is absent or FFmpeg fails.
    """
    try:
        program = importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe()
    except ImportError as error:
        raise CueError(f"{what}: need the package imageio-ffmpeg") from error
    command = [program, "-nostdin", "-v", "error", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise CueError(f"{what}: FFmpeg failed: {(done.stderr.splitlines() or [''])[-1]}")


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
