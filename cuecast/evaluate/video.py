"""Evaluation of the invisible video carrier: clips marked, coded as on air, received, compared.

Rows come out with the fields of `evaluate video --json`. Payloads are pseudorandom, so a superframe
that comes back identifies itself, and a wrong one is noticed. Everything passes through files, so a
clip of any length needs constant memory.
"""

import os
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np

from codec.errors import CueError
from cuecast.dubbing.picture_coder import picture_channels
from cuecast.evaluate.drawing import Dot, draw_dots
from cuecast.evaluate.options import EvaluateOptions, whole_channels
from cuecast.evaluate.picture_channels import (
    CHANNELS,
    LONGEST_TUNE_IN_S,
    LateReceivers,
    Luma,
    compare,
    find_channel,
    send,
    vmaf,
)
from cuecast.evaluate.tables import wilson_interval
from cuecast.media.picture import PictureStage, rewrite_picture
from receiver.media.picture import PictureFormat, picture_format, read_lumas
from watermark.link.superframe import SUPERFRAME_S
from watermark.video.embed import VideoEmbedder
from watermark.video.profile import VideoProfile, find_profile
from watermark.video.receive import VideoReceiver

USUAL = (
    "h264-2M", "hevc-2M", "mpeg2-4M", "540p-h264-2M", "crop-h264-2M", "letterbox-h264-2M",
    "robust:h264-2M", "robust:h264-1M",
)  # fmt: skip

_FILMS = {".mp4", ".mkv", ".mov", ".ts", ".webm", ".avi", ".mpg"}


@dataclass(frozen=True, slots=True)
class VideoRow:
    """One clip through one channel; fields as in `evaluate video --json`.

    Attributes
    ----------
    clip, channel, profile : str
    net_bps : float
        Payload in bit/s.
    superframes_sent, superframes_lost : int
        Lost are those that did not arrive whole, tuning in included.
    lost_low, lost_high : float
        Wilson's interval of the share lost, 95 %.
    l0_lost, wrong : int
        Superframes without even L0; those that arrived with wrong bytes.
    tune_in_median_s, tune_in_p95_s : float or None
        Time to the first superframe from random frames of what arrives.
    offset_ms : float or None
        Median delay of the positions of superframes with the right L0; None if there are none.
    ber : float or None
        Wrong bits before correction.
    psnr_db, ssim, vmaf : float
        Of the marked picture against the original, before the channel.
    vmaf_most : float or None
        VMAF of the original against itself: below 100 where little moves.
    flicker, own_noise : float
        Change of the mark from frame to frame, and of the picture's own quietest parts.
    embed_xrt, receive_xrt : float
        Speed in multiples of real time, without the picture codec of the channel.
    fault : str
        Why the channel did not take the clip, such as a frame rate that its coder refuses; nothing
        was sent then.
    """

    clip: str
    channel: str
    profile: str
    net_bps: float
    superframes_sent: int
    superframes_lost: int
    lost_low: float
    lost_high: float
    l0_lost: int
    wrong: int
    tune_in_median_s: float | None
    tune_in_p95_s: float | None
    offset_ms: float | None
    ber: float | None
    psnr_db: float
    ssim: float
    vmaf: float | None
    vmaf_most: float | None
    flicker: float
    own_noise: float
    embed_xrt: float
    receive_xrt: float | None
    fault: str = ""


def evaluate(options: EvaluateOptions) -> list[dict[str, Any]]:
    """Rows of `evaluate video`: every clip of a folder through every channel.

    A channel's name may begin with a profile's, as in ``robust:h264-1M``, and that with the coders
    on which the mark is tried, as in ``standard+none:h264-2M``; the default is that of `dub`. The
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
    for name in whole_channels(channels, CHANNELS):
        profile, colon, channel = name.rpartition(":")
        groups.setdefault(profile if colon else "standard", []).append(channel)
    return groups


def plot(results: list[dict[str, Any]], figure: Any) -> None:
    """Draw the share of lost superframes, a line for each channel, a dot for each clip."""
    draw_dots(
        figure,
        [
            Dot(
                row["channel"],
                row["clip"],
                100 * row["superframes_lost"] / max(row["superframes_sent"], 1),
                100 * row["lost_low"],
                100 * row["lost_high"],
            )
            for row in results
        ],
        xlabel="superframes lost, % (95 % intervals)",
    )


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
    seconds: float = 10.0,
    strength: float = 1.0,
    starts: int = 8,
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
        Profile of the carrier, and after a plus sign the coders that it is tried on.
    seconds : float
        How much of each clip is used.
    strength : float
        Factor of the profile's step.
    starts : int
        Random starts of reception per row.
    seed : int
        Of payloads and starts.
    folder : Path, optional
        For files on the way.
    progress : callable
        Called with each row.

    Raises
    ------
    CueError
        If a channel or profile is unknown or a clip cannot be read.
    """
    chosen = list(channels)
    for channel in chosen:
        find_channel(channel)
    name, _, through = profile.partition("+")
    sizes = find_profile(name)
    rows = []
    for clip in clips:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            trial = _Trial(
                Path(clip), Path(scratch), sizes, through or None, seconds, strength, seed
            )
            for channel in chosen:
                rows.append(trial.run(channel, starts))
                progress(rows[-1])
    return rows


class _Trial:
    """One clip, marked once, in a folder for its versions."""

    def __init__(
        self,
        clip: Path,
        folder: Path,
        profile: VideoProfile,
        through: str | None,
        seconds: float,
        strength: float,
        seed: int,
    ) -> None:
        self._clip, self._folder, self._profile = clip, folder, profile
        self._strength, self._seed, self._through = strength, seed, through
        original, self._marked = folder / "original.mkv", folder / "marked.mkv"
        timed: list[_Stopwatch] = []

        def mark(form: PictureFormat) -> list[PictureStage]:
            timed.append(_Stopwatch(self._embedder(form)))
            return [timed[0]]

        rewrite_picture(clip, original, lambda form: [], codec="ffv1", duration_s=seconds)
        self._form = rewrite_picture(original, self._marked, mark, codec="ffv1")
        report = timed[0].stage.report()
        self._sent = report.superframes
        self._embed_xrt = report.frames / float(self._form.fps) / timed[0].elapsed_s
        self._quality = compare(original, self._marked, self._form.depth)
        self._vmaf = vmaf(original, self._marked)
        self._vmaf_most = None if self._vmaf is None else vmaf(original, original)

    def _embedder(self, form: PictureFormat) -> VideoEmbedder:
        return VideoEmbedder(
            form.width,
            form.height,
            form.fps,
            self._payload,
            profile=self._profile.name,
            depth=form.depth,
            strength=self._strength,
            channels=picture_channels(self._through, form.width, form.height, form.fps, form.depth),
        )

    def _payload(self, k: int) -> tuple[bytes, bytes]:
        rng = np.random.default_rng([self._seed, k])
        return rng.bytes(self._profile.l0_bytes), rng.bytes(self._profile.l1_bytes)

    def run(self, name: str, starts: int) -> VideoRow:
        """Send the marked clip through a channel; receive it, from `starts` random frames too."""
        try:
            arrived = send(self._marked, self._form, find_channel(name))
        except CueError as error:
            return self._row(
                name, superframes_sent=0, superframes_lost=0, l0_lost=0, wrong=0,
                tune_in_median_s=None, tune_in_p95_s=None, offset_ms=None, ber=None,
                receive_xrt=None, fault=str(error).replace(f"{self._folder}{os.sep}", ""),
            )  # fmt: skip
        form = picture_format(arrived)

        def tuned() -> VideoReceiver:
            return VideoReceiver(
                form.width, form.height, form.fps, depth=form.depth, strength=self._strength
            )

        receiver, found = _Stopwatch(tuned()), []
        late = LateReceivers(tuned, self._late_starts(starts), float(form.fps))
        frames = 0
        for _, luma in read_lumas(arrived):
            frames += 1
            found += receiver.process(luma)
            late.process(luma)
        found += receiver.flush()
        right: set[int] = set()
        whole: set[int] = set()
        offsets_ms: list[float] = []
        wrong = 0
        for superframe in found:
            k = round(superframe.position_s / SUPERFRAME_S)
            l0, l1 = self._payload(max(0, k))
            if superframe.l0 == l0:
                right.add(k)
                offsets_ms.append(1000 * (superframe.position_s - k * SUPERFRAME_S))
                if superframe.l1 == l1:
                    whole.add(k)
            wrong += superframe.l0 not in (None, l0) or superframe.l1 not in (None, l1)
        waits_s = late.waits_s or [LONGEST_TUNE_IN_S]
        return self._row(
            name,
            superframes_sent=self._sent,
            superframes_lost=self._sent - len(whole),
            l0_lost=self._sent - len(right),
            wrong=wrong,
            tune_in_median_s=float(np.median(waits_s)),
            tune_in_p95_s=float(np.quantile(waits_s, 0.95)),
            offset_ms=float(np.median(offsets_ms)) if offsets_ms else None,
            ber=receiver.stage.ber_estimate,
            receive_xrt=frames / float(form.fps) / receiver.elapsed_s,
        )

    def _row(
        self, name: str, *, superframes_sent: int, superframes_lost: int, **received: Any
    ) -> VideoRow:
        """Put the clip's own figures beside those of its reception through a channel."""
        low, high = wilson_interval(superframes_lost, superframes_sent)
        quality = self._quality
        return VideoRow(
            clip=self._clip.name,
            channel=name,
            profile=self._profile.name,
            net_bps=self._profile.net_bps,
            superframes_sent=superframes_sent,
            superframes_lost=superframes_lost,
            lost_low=low,
            lost_high=high,
            psnr_db=quality.psnr_db,
            ssim=quality.ssim,
            vmaf=self._vmaf,
            vmaf_most=self._vmaf_most,
            flicker=quality.flicker,
            own_noise=quality.own_noise,
            embed_xrt=self._embed_xrt,
            **received,
        )

    def _late_starts(self, count: int) -> list[float]:
        """Draw times at which receivers are switched on, with two seconds of picture to come."""
        longest = max(0.0, self._sent * SUPERFRAME_S - 2.0)
        return list(np.random.default_rng([self._seed, 1 << 32]).uniform(0, longest, count))


class _Stopwatch:
    """An embedder or a receiver with a stop-watch."""

    def __init__(self, stage: Any) -> None:
        self.stage = stage
        self.elapsed_s = 1e-9

    def process(self, luma: Luma) -> Any:
        began = time.process_time()
        out = self.stage.process(luma)
        self.elapsed_s += time.process_time() - began
        return out

    def flush(self) -> Any:
        return self.stage.flush()
