"""The carriers of the picture: what `dub` does to luma."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from cuecast.dubbing.picture_coder import picture_channels
from cuecast.dubbing.read_back import Sent
from cuecast.media.picture import PictureStage, rewrite_picture
from receiver.media.picture import PictureFormat
from watermark.a335.carrier import A335Embedder
from watermark.a335.carrier import find_profile as find_line_profile
from watermark.video.embed import VideoEmbedder
from watermark.video.profile import find_profile as find_video_profile

CARRIERS = ("video", "a335")
"""In the order of writing: the line has to stay as it was written."""


SourceOf = Callable[[int, int], Callable[[int], tuple[bytes, bytes]]]
"""Gives the source of payloads of superframe k for sizes of L0 and L1 in bytes."""


@dataclass(frozen=True, slots=True)
class PictureOptions:
    """Choices about the picture.

    Attributes
    ----------
    profiles : dict of str to str
        Profile of each carrier that is wanted, by its name in `CARRIERS`.
    key : int
        Key of the invisible mark.
    codec, bit_rate : optional
        Of the output, if not those of the programme.
    through : str, optional
        Coders that the mark is tried on, see `picture_channels`.
    """

    profiles: dict[str, str]
    key: int = 0
    codec: str | None = None
    bit_rate: int | None = None
    through: str | None = None


def dub_picture(
    programme: str | os.PathLike[str],
    source_of: SourceOf,
    target: str | os.PathLike[str],
    options: PictureOptions,
    *,
    sent: Sent,
    progress: Callable[[float], None] = lambda seconds: None,
    tell: Callable[[str], None] = lambda line: None,
) -> dict[str, dict[str, Any]]:
    """Write `programme` with marked pictures to `target`.

    Superframes sent are noted in `sent`; `tell` is called with omitted parts of the programme.

    Returns
    -------
    dict
        Report of each carrier, by name.

    Raises
    ------
    CueError
        If there is no picture, or it cannot be marked or written.
    """
    made: dict[str, Any] = {}

    def make_stages(form: PictureFormat) -> Sequence[PictureStage]:
        for name in CARRIERS:
            if name in options.profiles:
                made[name] = _embedder(name, form, source_of, options, sent)
        return list(made.values())

    form = rewrite_picture(
        programme,
        target,
        make_stages,
        codec=options.codec,
        bit_rate=options.bit_rate,
        progress=progress,
        tell=tell,
    )
    return {name: _figures(name, embedder, form) for name, embedder in made.items()}


def _embedder(
    name: str, form: PictureFormat, source_of: SourceOf, options: PictureOptions, sent: Sent
) -> PictureStage:
    size = form.width, form.height, form.fps
    if name == "video":
        video = find_video_profile(options.profiles[name])
        source = sent.noting(name, source_of(video.l0_bytes, video.l1_bytes))
        channels = picture_channels(options.through, *size, form.depth, most_bps=form.bit_rate)
        return VideoEmbedder(
            *size, source, profile=video.name, key=options.key, depth=form.depth, channels=channels
        )
    line = find_line_profile(options.profiles[name])
    source = sent.noting(name, source_of(line.l0_bytes, line.l1_bytes))
    return A335Embedder(*size, source, profile=line.name, depth=form.depth)


def _figures(name: str, embedder: Any, form: PictureFormat) -> dict[str, Any]:
    if name == "video":
        report = embedder.report()
        return {
            "coded_bps": form.bit_rate,
            "net_bps": round(report.net_bps, 1),
            "gross_bps": round(report.gross_bps, 1),
            "psnr_db": round(report.psnr_db, 2),
            "superframes": report.superframes,
            "steps": list(report.steps),
            "l0_alone": report.lone,
        }
    profile = embedder.profile
    return {
        "coded_bps": form.bit_rate,
        "net_bps": round(profile.net_bps, 1),
        "gross_bps": round(8 * profile.body_bytes * float(form.fps), 1),
        "skipped_frames": embedder.skipped,
    }
