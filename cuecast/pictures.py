"""The carriers of the picture: what `dub` does to luma, and what `receive` finds in it."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, dropwhile, islice
from typing import Any

from codec.errors import CueError
from cuecast.media.picture import (
    Luma,
    PictureFormat,
    PictureStage,
    picture_format,
    read_lumas,
    rewrite_picture,
)
from watermark.a335.carrier import A335Embedder, A335Receiver
from watermark.a335.carrier import find_profile as find_line_profile
from watermark.profile import SUPERFRAME_S
from watermark.received import ReceivedSuperframe
from watermark.video.embed import VideoEmbedder
from watermark.video.profile import find_profile as find_video_profile
from watermark.video.receive import VideoReceiver

CARRIERS = ("video", "a335")
"""In the order in which they are written: the line has to stay as it was written."""

_TRIAL_S = 12.0
"""If nothing is found in so much picture, there is nothing in it."""

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
    """

    profiles: dict[str, str]
    key: int = 0
    codec: str | None = None
    bit_rate: int | None = None


def dub_picture(
    programme: str | os.PathLike[str],
    source_of: SourceOf,
    target: str | os.PathLike[str],
    options: PictureOptions,
    *,
    progress: Callable[[float], None] = lambda seconds: None,
) -> dict[str, dict[str, Any]]:
    """Write `programme` with marked pictures to `target`.

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
    form = picture_format(programme)

    def make_stages(form: PictureFormat) -> Sequence[PictureStage]:
        for name in CARRIERS:
            if name in options.profiles:
                made[name] = _embedder(name, form, source_of, options)
        return list(made.values())

    rewrite_picture(
        programme, target, make_stages, codec=options.codec, bit_rate=options.bit_rate,
        progress=progress,
    )  # fmt: skip
    return {name: _figures(name, embedder, form) for name, embedder in made.items()}


def _embedder(
    name: str, form: PictureFormat, source_of: SourceOf, options: PictureOptions
) -> PictureStage:
    size = form.width, form.height, form.fps
    if name == "video":
        video = find_video_profile(options.profiles[name])
        return VideoEmbedder(
            *size, source_of(video.l0_bytes, video.l1_bytes), profile=video.name,
            key=options.key, depth=form.depth,
        )  # fmt: skip
    line = find_line_profile(options.profiles[name])
    source = source_of(line.l0_bytes, line.l1_bytes)
    return A335Embedder(*size, source, profile=line.name, depth=form.depth)


def _figures(name: str, embedder: Any, form: PictureFormat) -> dict[str, Any]:
    if name == "video":
        report = embedder.report()
        return {
            "net_bps": round(report.net_bps, 1),
            "gross_bps": round(report.gross_bps, 1),
            "psnr_db": round(report.psnr_db, 2),
            "superframes": report.superframes,
        }
    profile = embedder.profile
    return {
        "net_bps": round(profile.net_bps, 1),
        "gross_bps": round(8 * profile.body_bytes * float(form.fps), 1),
        "skipped_frames": embedder.skipped,
    }


@dataclass(frozen=True, slots=True)
class FoundInPicture:
    """What a carrier of the picture held.

    Attributes
    ----------
    superframes : tuple of ReceivedSuperframe
        In order of time, their place counted from the first picture.
    first_lock_s : float
        When the carrier was found.
    ber_estimate : float or None
        Share of wrong bits before correction, where the carrier knows it.
    """

    superframes: tuple[ReceivedSuperframe, ...]
    first_lock_s: float
    ber_estimate: float | None


def search_picture(
    programme: str | os.PathLike[str], *, key: int = 0, start_s: float = 0.0
) -> dict[str, FoundInPicture]:
    """Find the carriers in the picture of a film; a film without them costs a short look.

    Parameters
    ----------
    programme : path
    key : int
        Key of the invisible mark.
    start_s : float
        Second at which the receiver is switched on.

    Raises
    ------
    CueError
        If the picture is malformed.
    """
    form = picture_format(programme)
    receivers = _receivers(form, key)
    found: dict[str, list[ReceivedSuperframe]] = {name: [] for name in receivers}
    shown: Iterator[tuple[float, Luma]] = dropwhile(
        lambda pair: pair[0] < start_s, read_lumas(programme)
    )
    first = next(shown, None)
    if first is None:
        return {}
    lumas = chain([first], shown)

    def take(pairs: Iterator[tuple[float, Luma]]) -> None:
        for _, luma in pairs:
            for name, receiver in receivers.items():
                found[name] += [moved(s, first[0]) for s in receiver.process(luma)]

    take(islice(lumas, round(_TRIAL_S * form.fps)))
    for name in list(receivers):
        if not any(superframe.l0 for superframe in found[name]):
            del receivers[name]
    if receivers:
        take(lumas)
        for name, receiver in receivers.items():
            if hasattr(receiver, "flush"):
                found[name] += [moved(s, first[0]) for s in receiver.flush()]
    return {
        name: FoundInPicture(
            tuple(s for s in found[name] if s.l0),
            receiver.first_lock_s or 0.0,
            getattr(receiver, "ber_estimate", None),
        )
        for name, receiver in receivers.items()
    }


def moved(superframe: ReceivedSuperframe, delay_s: float) -> ReceivedSuperframe:
    """Return `superframe` that much later, without the ratios, which are large."""
    return replace(superframe, position_s=superframe.position_s + delay_s, ratios=None)


def _receivers(form: PictureFormat, key: int) -> dict[str, Any]:
    """Return the receivers that serve a picture of this size."""
    kinds: dict[str, Callable[[], Any]] = {
        "video": lambda: VideoReceiver(
            form.width, form.height, form.fps, key=key, depth=form.depth
        ),
        "a335": lambda: A335Receiver(form.width, form.height, form.fps, depth=form.depth),
    }
    receivers = {}
    for name, make in kinds.items():
        try:
            receivers[name] = make()
        except CueError:  # too small a picture: this carrier cannot be in it
            continue
    return receivers


def richest(
    superframes: Sequence[ReceivedSuperframe],
) -> list[ReceivedSuperframe]:
    """Choose from superframes of several carriers, for each time on air, the one that tells most.

    Examples
    --------
    >>> poor = ReceivedSuperframe(b"a", None, 0.65, 1.0)
    >>> rich = ReceivedSuperframe(b"a", b"b", 0.64, 1.0)
    >>> richest([poor, rich]) == [rich]
    True
    """
    best: dict[int, ReceivedSuperframe] = {}
    for superframe in superframes:
        slot = round(superframe.position_s / SUPERFRAME_S)
        if slot not in best or _payload(superframe) > _payload(best[slot]):
            best[slot] = superframe
    return [best[slot] for slot in sorted(best)]


def _payload(superframe: ReceivedSuperframe) -> int:
    return len(superframe.l0 or b"") + len(superframe.l1 or b"")
