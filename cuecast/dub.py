"""Dubbing: a programme goes in, the same programme with its cuer in the sound comes out.

Motion -> superframes, each on air before it is due -> the audio carrier -> the programme's own
container and codec (`cuecast.media.rewrite`).

The sound may start before or after the picture. Superframes count from the first sample, scores
and reports on the programme's clock; `_Delayed` stands between the two.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from codec.motion import Motion
from codec.score import Score
from codec.superframe import SuperframeEncoder
from codec.voice import Voice
from cuecast.marking import MarkingStage
from cuecast.media.programme import SoundFormat
from cuecast.media.rewrite import Rewritten, rewrite_sound
from cuecast.motions import RATE_HZ, MotionSource
from watermark.profile import SUPERFRAME_S, find_profile

LEAD = 2
"""A superframe is on air this many superframes before its motion is due."""

FRAMES = 32
"""Frames of motion in a superframe."""

assert FRAMES / RATE_HZ == SUPERFRAME_S


@dataclass(frozen=True, slots=True)
class DubOptions:
    """Choices of `dub` that have a default.

    Attributes
    ----------
    profile : str
        Name of the carrier's profile.
    key : int
        Key of the watermark.
    track : int
        Which of the programme's sounds, from 0.
    audio_codec, audio_bit_rate : optional
        Of the output, if not those of the programme.
    grade : float
        Objective difference grade (ITU-R BS.1387) that the mark aims at.
    graded : bool
        Whether to grade the marked sound with the quality meter.
    """

    profile: str = "standard"
    key: int = 0
    track: int = 0
    audio_codec: str | None = None
    audio_bit_rate: int | None = None
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
    stages: list[MarkingStage] = []

    def make_stage(sound: SoundFormat, start_s: float) -> MarkingStage:
        source = superframe_source(_Delayed(motion, start_s), voice, profile=options.profile)
        stages.append(
            MarkingStage(
                sound, source, name=os.fspath(programme), profile=options.profile,
                key=options.key, grade=options.grade, graded=options.graded,
            )
        )  # fmt: skip
        return stages[-1]

    written = rewrite_sound(
        programme, target, make_stage, track=options.track, codec=options.audio_codec,
        bit_rate=options.audio_bit_rate, progress=progress,
    )  # fmt: skip
    return _report(written, stages[0], motion.score, voice)


def superframe_source(
    motion: MotionSource, voice: Voice, *, profile: str = "standard"
) -> Callable[[int], tuple[bytes, bytes]]:
    """Return the function that gives the embedder the payloads (L0, L1) on air in superframe k.

    Times of `motion` count from the first sample of the sound.
    """
    sizes = find_profile(profile)
    encoder = SuperframeEncoder(voice, l0_bytes=sizes.l0_bytes, l1_bytes=sizes.l1_bytes, lead=LEAD)

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


def _report(written: Rewritten, stage: MarkingStage, score: Score, voice: Voice) -> dict[str, Any]:
    return {
        "duration_s": round(written.duration_s, 3),
        "superframes": stage.superframes,
        "keys": [key.as_dict() for key in score.keys],
        "carriers": {"audio": stage.report()},
        "voice": voice.identity,
        "clipped_samples": written.clipped,
        "left_out": list(written.left_out),
    }
