"""Dubbing: a programme goes in, the same programme with its cuer inside comes out.

Motion -> superframes, each on air before it is due -> the carriers of sound and picture -> the
programme's own container and codecs (`cuecast.media`).

The sound may start before or after the picture. Superframes count from the first sample, scores
and reports on the programme's clock; `_Delayed` stands between the two.
"""

import math
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from codec.errors import CueError
from codec.motion import Motion
from codec.superframe import SuperframeEncoder
from codec.voice import Voice
from cuecast.marking import MarkingStage
from cuecast.media.programme import SoundFormat
from cuecast.media.rewrite import rewrite_sound
from cuecast.motions import RATE_HZ, MotionSource
from cuecast.pictures import PictureOptions, dub_picture
from watermark.profile import SUPERFRAME_S, find_profile

LEAD = 2
"""A superframe is on air this many superframes before its motion is due."""

FRAMES = 32
"""Frames of motion in a superframe."""

assert FRAMES / RATE_HZ == SUPERFRAME_S

PROFILES = {"audio": "standard", "video": "standard", "a335": "1x"}
"""Profile of each carrier unless told otherwise."""


@dataclass(frozen=True, slots=True)
class DubOptions:
    """Choices of `dub` that have a default.

    Attributes
    ----------
    carriers : tuple of str
        Of `CARRIERS`.
    profiles : dict of str to str
        Name of the profile of each carrier.
    key : int
        Key of the watermark.
    track : int
        Which of the programme's sounds, from 0.
    audio_codec, audio_bit_rate, video_codec, video_bit_rate : optional
        Of the output, if not those of the programme.
    grade : float
        Objective difference grade (ITU-R BS.1387) that the mark aims at.
    graded : bool
        Whether to grade the marked sound with the quality meter.
    """

    carriers: tuple[str, ...] = ("audio",)
    profiles: dict[str, str] = field(default_factory=lambda: dict(PROFILES))
    key: int = 0
    track: int = 0
    audio_codec: str | None = None
    audio_bit_rate: int | None = None
    video_codec: str | None = None
    video_bit_rate: int | None = None
    grade: float = -0.4
    graded: bool = True


def dub(
    programme: str | os.PathLike[str],
    motion: MotionSource,
    voice: Voice,
    target: str | os.PathLike[str],
    options: DubOptions = DubOptions(),
    *,
    progress: Callable[[float], None] = lambda seconds: None,
) -> dict[str, Any]:
    """Write `programme` with its cuer inside to `target`.

    Parameters
    ----------
    programme, target : path
    motion : MotionSource
        Times on the programme's clock.
    voice : Voice
        That of `motion`.
    options : DubOptions
    progress : callable
        Told how many seconds of sound each block brought.

    Returns
    -------
    dict
        The report, under the names of the command line's JSON.

    Raises
    ------
    CueError
        If the programme is malformed, or its sound cannot carry anything.
    """
    if not options.carriers:
        raise CueError("no carrier: nothing to dub into")
    carriers: dict[str, dict[str, Any]] = {}
    picture = {name: options.profiles[name] for name in options.carriers if name != "audio"}
    report: dict[str, Any] = {}
    seconds: list[float] = []

    def advance(length_s: float) -> None:
        seconds.append(length_s)
        progress(length_s)

    with tempfile.TemporaryDirectory(prefix=".cuecast-", dir=Path(target).parent) as folder:
        marked = Path(programme)
        if "audio" in options.carriers:
            marked = Path(folder) / Path(target).name if picture else Path(target)
            report, carriers["audio"] = _dub_sound(
                programme, motion, voice, marked, options, progress
            )
        if picture:
            carriers |= dub_picture(
                marked, lambda *sizes: superframe_source(motion, voice, *sizes), target,
                PictureOptions(picture, options.key, options.video_codec, options.video_bit_rate),
                progress=advance,
            )  # fmt: skip
            report = report or _picture_report(seconds)
    return report | {
        "keys": [key.as_dict() for key in motion.score.keys],
        "carriers": carriers,
        "voice": voice.identity,
    }


def _dub_sound(
    programme: str | os.PathLike[str],
    motion: MotionSource,
    voice: Voice,
    target: Path,
    options: DubOptions,
    progress: Callable[[float], None],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Mark the sound; return what the report says of the programme and of the carrier."""
    stages: list[MarkingStage] = []
    profile = find_profile(options.profiles["audio"])

    def make_stage(sound: SoundFormat, start_s: float) -> MarkingStage:
        delayed = _Delayed(motion, start_s)
        source = superframe_source(delayed, voice, profile.l0_bytes, profile.l1_bytes)
        stages.append(
            MarkingStage(
                sound, source, name=os.fspath(programme), profile=profile.name,
                key=options.key, grade=options.grade, graded=options.graded,
            )
        )  # fmt: skip
        return stages[-1]

    written = rewrite_sound(
        programme, target, make_stage, track=options.track, codec=options.audio_codec,
        bit_rate=options.audio_bit_rate, progress=progress,
    )  # fmt: skip
    report = {
        "duration_s": round(written.duration_s, 3),
        "superframes": stages[0].superframes,
        "clipped_samples": written.clipped,
        "left_out": list(written.left_out),
    }
    return report, stages[0].report()


def _picture_report(seconds: list[float]) -> dict[str, Any]:
    duration_s = math.fsum(seconds)
    superframes = int(duration_s / SUPERFRAME_S)
    return {"duration_s": round(duration_s, 3), "superframes": superframes, "left_out": []}


def superframe_source(
    motion: MotionSource, voice: Voice, l0_bytes: int, l1_bytes: int
) -> Callable[[int], tuple[bytes, bytes]]:
    """Return the function that gives an embedder the payloads (L0, L1) on air in superframe k.

    Times of `motion` count from the beginning of what the carrier lies in.
    """
    encoder = SuperframeEncoder(voice, l0_bytes=l0_bytes, l1_bytes=l1_bytes, lead=LEAD)

    def source(k: int) -> tuple[bytes, bytes]:
        index = k + LEAD
        superframe = encoder.encode(motion.window(index * SUPERFRAME_S, FRAMES), index)
        return superframe.l0, superframe.l1

    return source


class _Delayed:
    """A motion on the clock of a sound that starts at `start_s` on the programme's clock."""

    def __init__(self, motion: MotionSource, start_s: float) -> None:
        self._motion = motion
        self._start_s = start_s
        self.score = motion.score.shifted(-start_s)
        self.rate_hz = motion.rate_hz

    def window(self, start_s: float, frames: int) -> Motion:
        """Return the motion from `start_s` of the sound on."""
        motion = self._motion.window(start_s + self._start_s, frames)
        return replace(motion, start_s=start_s, score=self.score)
