"""What the invisible video carrier achieves: clips marked, coded as on air, received, compared.

Rows come out with the fields of `evaluate video --json`. Everything passes through files, so a clip
of any length needs constant memory.
"""

import importlib
import json
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.evaluate.options import EvaluateOptions
from cuecast.media.picture import PictureStage, rewrite_picture
from receiver.media.picture import PictureFormat, picture_format, read_lumas
from watermark.profile import SUPERFRAME_S
from watermark.quality.picture import PictureMeter, PictureQuality
from watermark.video.embed import VideoEmbedder
from watermark.video.profile import VideoProfile, find_profile
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

USUAL = (
    "h264-2M", "hevc-2M", "mpeg2-4M", "540p-h264-2M", "crop-h264-2M", "letterbox-h264-2M",
    "robust:h264-2M", "robust:h264-1M", "busy:h264-2M",
)  # fmt: skip

_FILMS = {".mp4", ".mkv", ".mov", ".ts", ".webm", ".avi", ".mpg"}


@dataclass(frozen=True, slots=True)
class VideoRow:
    """One clip through one channel; fields as in `evaluate video --json`."""

    clip: str
    channel: str
    profile: str
    net_bps: float
    superframes_sent: int
    superframes_lost: int
    l1_lost: int
    superframes_wrong: int
    tune_in_s: float | None
    ber: float
    psnr_db: float
    ssim: float
    vmaf: float | None
    flicker: float
    own_noise: float
    embed_xrt: float
    receive_xrt: float


def evaluate(options: EvaluateOptions) -> list[dict[str, Any]]:
    """Rows of `evaluate video`: every clip of a folder through every channel.

    A channel's name may begin with a profile's, as in ``robust:h264-1M``. The
    built-in material is a synthetic scene.

    Raises
    ------
    CueError
        If a channel is unknown or the folder holds no films.
    """
    clips = films_of(options.clips) if options.clips else [_built_in(options.folder)]
    rows = []
    for profile, names in _by_profile(options.channels or USUAL).items():
        rows += evaluate_video(
            clips,
            names,
            profile=profile,
            seed=options.seed,
            folder=options.folder,
            progress=lambda row: options.say(
                f"{row.clip} {row.profile}:{row.channel}: {row.superframes_lost} of "
                f"{row.superframes_sent} lost"
            ),
        )
    return [asdict(row) for row in rows]


def _by_profile(channels: Iterable[str]) -> dict[str, list[str]]:
    """Sort channels by the profile that some of them name: ``robust:h264-1M``.

    Examples
    --------
    >>> _by_profile(["h264-2M", "robust:h264-1M", "none"])
    {'standard': ['h264-2M', 'none'], 'robust': ['h264-1M']}
    """
    groups: dict[str, list[str]] = {}
    for name in channels:
        profile, colon, channel = name.rpartition(":")
        groups.setdefault(profile if colon else "standard", []).append(channel)
    return groups


def plot(results: list[dict[str, Any]], figure: Any) -> None:
    """Draw the share of superframes received, a bar per clip and channel."""
    axes = figure.subplots()
    labels = [f"{row['clip']}\n{row['channel']}" for row in results]
    shares = [
        100 * (1 - row["superframes_lost"] / max(1, row["superframes_sent"])) for row in results
    ]
    axes.barh(labels, shares)
    axes.set_xlabel("superframes received, per cent")


def films_of(folder: Path) -> list[Path]:
    """Films of a folder, by name.

    Raises
    ------
    CueError
        If there are none.
    """
    films = sorted(p for p in folder.glob("*") if p.suffix.lower() in _FILMS)
    if not films:
        raise CueError(f"{folder}: no films in it")
    return films


def _built_in(folder: Path) -> Path:
    """Write six seconds of a moving scene with grain."""
    path = folder / "scene.mkv"
    y, x = np.mgrid[:360, :640] / 360
    rng = np.random.default_rng(0)
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 640, 360, "yuv420p"
        for n in range(150):
            luma = 120 + 50 * np.sin(6 * x + n / 20) * np.cos(5 * y) + rng.normal(0, 1, x.shape)
            frame = av.VideoFrame.from_ndarray(luma.astype(np.uint8), format="gray")
            container.mux(stream.encode(frame.reformat(format="yuv420p")))
        container.mux(stream.encode(None))
    return path


def evaluate_video(
    clips: Iterable[str | Path],
    channels: Iterable[str],
    *,
    profile: str = "standard",
    seconds: float = 6.0,
    strength: float = 1.0,
    seed: int = 0,
    folder: Path | None = None,
    progress: Callable[[VideoRow], None] = lambda row: None,
) -> list[VideoRow]:
    """Mark the beginning of each clip and send it through each channel.

    Superframes are lost from the first sent to the last complete one: tuning in counts.

    Parameters
    ----------
    clips : iterable of path
        Video files.
    channels : iterable of str
        Names from `CHANNELS`.
    profile : str
        Profile of the carrier.
    seconds : float
        How much of each clip is used.
    strength : float
        Factor of the profile's step.
    seed : int
        Of the payload.
    folder : Path, optional
        For files on the way.
    progress : callable
        Told of each row.

    Raises
    ------
    CueError
        If a channel or profile is unknown or a clip cannot be read.
    """
    chosen = list(channels)
    for name in chosen:
        if name not in CHANNELS:
            raise CueError(f"unknown channel {name!r}, known: {', '.join(CHANNELS)}")
    sizes = find_profile(profile)
    rows = []
    for clip in clips:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            trial = _Trial(Path(clip), Path(scratch), sizes, seconds, strength, seed)
            for name in chosen:
                rows.append(trial.run(name))
                progress(rows[-1])
    return rows


class _Trial:
    """One clip, marked once, in a folder for what is made of it."""

    def __init__(
        self,
        clip: Path,
        folder: Path,
        profile: VideoProfile,
        seconds: float,
        strength: float,
        seed: int,
    ) -> None:
        self._clip, self._folder, self._profile = clip, folder, profile
        self._strength, self._seed = strength, seed
        original, self._marked = folder / "original.mkv", folder / "marked.mkv"
        timed: list[_Timed] = []

        def mark(form: PictureFormat) -> list[PictureStage]:
            timed.append(_Timed(self._embedder(form)))
            return [timed[0]]

        rewrite_picture(clip, original, lambda form: [], codec="ffv1", duration_s=seconds)
        self._form = rewrite_picture(original, self._marked, mark, codec="ffv1")
        report = timed[0].stage.report()
        self._sent = report.superframes
        self._embed_xrt = report.frames / float(self._form.fps) / timed[0].elapsed_s
        self._quality = _compare(original, self._marked, self._form.depth)
        self._vmaf = vmaf(original, self._marked)

    def _embedder(self, form: PictureFormat) -> VideoEmbedder:
        return VideoEmbedder(
            form.width,
            form.height,
            form.fps,
            self._payload,
            profile=self._profile.name,
            depth=form.depth,
            strength=self._strength,
        )

    def _payload(self, k: int) -> tuple[bytes, bytes]:
        rng = np.random.default_rng([self._seed, k])
        return rng.bytes(self._profile.l0_bytes), rng.bytes(self._profile.l1_bytes)

    def run(self, name: str) -> VideoRow:
        """Send the marked clip through a channel."""
        coded = self._code(CHANNELS[name])
        form = picture_format(coded)
        receiver = VideoReceiver(
            form.width, form.height, form.fps, depth=form.depth, strength=self._strength
        )
        found = []
        elapsed_s, frames = 1e-9, 0
        for _, luma in read_lumas(coded):
            began = time.process_time()
            found += receiver.process(luma)
            elapsed_s += time.process_time() - began
            frames += 1
        found += receiver.flush()
        right: set[int] = set()
        whole: set[int] = set()
        wrong = 0
        for superframe in found:
            k = round(superframe.position_s / SUPERFRAME_S)
            l0, l1 = self._payload(max(0, k))
            if superframe.l0 == l0:
                right.add(k)
                if superframe.l1 == l1:
                    whole.add(k)
            wrong += superframe.l0 not in (None, l0) or superframe.l1 not in (None, l1)
        quality = self._quality
        return VideoRow(
            clip=self._clip.name,
            channel=name,
            profile=self._profile.name,
            net_bps=self._profile.net_bps,
            superframes_sent=self._sent,
            superframes_lost=self._sent - len(right),
            l1_lost=self._sent - len(whole),
            superframes_wrong=wrong,
            tune_in_s=receiver.first_lock_s,
            ber=receiver.ber_estimate,
            psnr_db=quality.psnr_db,
            ssim=quality.ssim,
            vmaf=self._vmaf,
            flicker=quality.flicker,
            own_noise=quality.own_noise,
            embed_xrt=self._embed_xrt,
            receive_xrt=frames / float(form.fps) / elapsed_s,
        )

    def _code(self, channel: PictureChannel) -> Path:
        source = self._marked
        for generation, scale in enumerate(channel.scales):
            target = self._folder / f"coded{generation}.mkv"
            width, height = (
                2 * round(n * scale / 2) for n in (self._form.width, self._form.height)
            )
            change = channel.change if generation == 0 else None
            rewrite_picture(
                source, target, _stages(change), codec=channel.codec,
                bit_rate=channel.bit_rate, size=(width, height),
                fps=self._form.fps * channel.fps_factor,
            )  # fmt: skip
            source = target
        return source


class _Timed:
    """The embedder with a stop-watch."""

    def __init__(self, stage: VideoEmbedder) -> None:
        self.stage = stage
        self.elapsed_s = 1e-9

    def process(self, luma: Luma) -> list[Luma]:
        began = time.process_time()
        out = self.stage.process(luma)
        self.elapsed_s += time.process_time() - began
        return out

    def flush(self) -> list[Luma]:
        return self.stage.flush()


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


def _compare(original: Path, marked: Path, depth: int) -> PictureQuality:
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
