"""Dubbing: a programme goes in, the same programme with its cuer inside comes out.

Motion -> superframes, each on air before it is due -> the carriers of sound and picture -> the
programme's own container and codecs (`cuecast.media`).

Superframe k is on air from k * 0.64 s of the programme's clock on in every carrier, so that sound
and picture bear the same ones. A sound that starts before or after the picture stays unmarked up to
its first whole superframe.
"""

import math
import os
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.authentication.announcement import SigningKey
from codec.cuer.voice import Voice
from codec.cues.score import Key
from codec.errors import CueError
from codec.files.whole import folder_beside
from cuecast.dubbing.coder_stream import (
    FRAME_SHIFT,
    FS,
    Breath,
    coders_for,
    is_rehearsed,
    make_rehearsal,
)
from cuecast.dubbing.margin_report import margin_figures
from cuecast.dubbing.marking import MarkingStage
from cuecast.dubbing.motions import MotionSource
from cuecast.dubbing.payloads import LEAD, superframe_source
from cuecast.dubbing.read_back import Sent, earlier_marks, read_back, true_psnr_db
from cuecast.dubbing.signing import Signing
from cuecast.media.encode import SoundEncoder, SoundTarget, choose_target, encoder_of, usual_codec
from cuecast.media.rewrite import Stage, rewrite_sound
from receiver.media.programme import SoundFormat, open_programme
from watermark.audio.signal.profile import find_profile
from watermark.link.superframe import SUPERFRAME_S

Samples = NDArray[np.float32]

PROFILES = {"audio": "standard", "video": "standard", "a335": "1x"}
"""Profile of each carrier by default."""


@dataclass(frozen=True, slots=True, kw_only=True)
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
    grade : float, optional
        Objective difference grade (ITU-R BS.1387) that the mark aims at, if not the profile's own.
    graded : bool
        Whether to grade the marked sound with the quality meter.
    through : str, optional
        Coders of the broadcast, see `cuecast.dubbing.coder_stream.chains_of`.
    video_through : str, optional
        Those of its picture, see `cuecast.dubbing.picture_coder.picture_channels`.
    read_back : bool
        Whether to receive the output and report the share that arrives.
    replace : bool
        Whether to write over the cuer of a programme that has one already.
    mend : bool
        Whether damaged frames of the sound become silence; without it, they are refused.
    sign : SigningKey, optional
        Signs the cues.
    on_air_s : float
        When a signed programme begins on air, seconds since 1970 (UTC).

    Examples
    --------
    >>> DubOptions(carriers=("audio", "video"), through="aac:128k").profiles["audio"]
    'standard'
    """

    carriers: tuple[str, ...] = ("audio",)
    profiles: dict[str, str] = field(default_factory=lambda: dict(PROFILES))
    key: int = 0
    track: int = 0
    audio_codec: str | None = None
    audio_bit_rate: int | None = None
    video_codec: str | None = None
    video_bit_rate: int | None = None
    grade: float | None = None
    graded: bool = True
    through: str | None = None
    video_through: str | None = None
    read_back: bool = False
    replace: bool = False
    mend: bool = False
    sign: SigningKey | None = None
    on_air_s: float = 0.0


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
        Called with the seconds of sound that each block brought.

    Returns
    -------
    dict
        The report, under the names of the command line's JSON.

    Raises
    ------
    CueError
        If the programme is malformed, or its sound cannot carry anything.

    Examples
    --------
    >>> from codec import load_voice
    >>> from cuecast import SynthesisedMotion
    >>> from synth import score_of_text
    >>> voice = load_voice("claire")
    >>> source = SynthesisedMotion(score_of_text("Oui"), voice)
    >>> dub("missing.mkv", source, voice, "out.mkv")
    Traceback (most recent call last):
    codec.errors.CueError: missing.mkv: No such file or directory
    """
    if not options.carriers:
        raise CueError("no carrier: nothing to dub into")
    told = _check_earlier(programme, voice, options)
    carriers: dict[str, dict[str, Any]] = {}
    sound_profile = find_profile(options.profiles["audio"])
    picture = {name: options.profiles[name] for name in options.carriers if name != "audio"}
    if picture:
        # The carriers of pictures take a tenth of a second to import.
        from cuecast.dubbing.pictures import PictureOptions, dub_picture
        from cuecast.media.picture import keeps_picture
        from receiver.media.picture import picture_format

        picture_format(programme)  # before the sound's work is done for nothing
    report: dict[str, Any] = {}
    signing = None if options.sign is None else Signing(options.sign, options.on_air_s)
    seconds: list[float] = []
    sent = Sent()

    def advance(length_s: float) -> None:
        seconds.append(length_s)
        progress(length_s)

    between = tempfile.TemporaryDirectory(prefix=".cuecast-", dir=folder_beside(target))
    with _named_as(target, between.name), between as folder:
        marked = Path(programme)
        if "audio" in options.carriers:
            marked, sounding = Path(target), options
            if picture:
                marked = Path(folder) / marked.name
                if not keeps_picture(programme, target):  # until its own is coded
                    marked = marked.with_suffix(".mkv")
                    codec = _codec_for(programme, target, options, folder)
                    sounding = replace(options, audio_codec=codec)
            report, carriers["audio"] = _dub_sound(
                programme, motion, voice, marked, sounding, sent, signing, progress
            )
        if picture:
            carriers |= dub_picture(
                marked,
                lambda *sizes: superframe_source(
                    motion, voice, *sizes, beside=sound_profile, signing=signing
                ),
                target,
                PictureOptions(
                    picture,
                    options.key,
                    options.video_codec,
                    options.video_bit_rate,
                    options.video_through,
                ),
                sent=sent,
                progress=advance,
                tell=told.append,
            )
            report = report or _picture_report(seconds)
    report["left_out"] += told
    report |= _told_keys(motion.score.keys, report["duration_s"])
    report |= {"carriers": carriers, "voice": voice.identity}
    if options.read_back and Path(target).is_file():
        _read_back(programme, target, motion, voice, options, sent, report, progress)
    return report


@contextmanager
def _named_as(target: str | os.PathLike[str], folder: str) -> Iterator[None]:
    """Let errors name the output, not the file in a folder that its first pass writes."""
    try:
        yield
    except CueError as error:
        message = re.sub(re.escape(folder) + r"/[^:]*", lambda _: os.fspath(target), str(error))
        raise CueError(message) from error


def _codec_for(
    programme: str | os.PathLike[str],
    target: str | os.PathLike[str],
    options: DubOptions,
    folder: str,
) -> str:
    """Return the sound codec of the output, which has to hold it."""
    suffix = Path(target).suffix
    with (
        open_programme(programme, track=options.track) as opened,
        av.open(f"file:{folder}/a{suffix}", "w") as output,
    ):
        codec = options.audio_codec or usual_codec(opened.format, suffix)
        SoundEncoder(output, opened.format, choose_target(opened.format, codec=codec))
    return codec


def _check_earlier(
    programme: str | os.PathLike[str], voice: Voice, options: DubOptions
) -> list[str]:
    """Refuse a programme that has a cuer already, unless she is to be replaced in full.

    Return its part of the report.
    """
    earlier = earlier_marks(programme, voice, key=options.key, track=options.track)
    if not earlier:
        return []
    names = " and ".join(earlier)
    if not options.replace:
        raise CueError(
            f"{programme}: it has a cuer already, in {names}: take the programme without her, "
            "or write over her with --replace"
        )
    kept = sorted(set(earlier) - set(options.carriers))
    if kept:
        raise CueError(
            f"{programme}: the cuer that it has in {' and '.join(kept)} would stay: "
            f"add it to --carriers"
        )
    if any(earlier.values()) and options.sign is None:
        return [
            "the cuer that is replaced is signed, the new one is not: sets that verify report it; "
            "sign it with --sign"
        ]
    return []


def _told_keys(keys: Sequence[Key], duration_s: float) -> dict[str, Any]:
    """Keys of the report, and how many of them fall outside of the programme."""
    outside = sum(key.end <= 0 or key.start >= duration_s for key in keys)
    return {"keys": [key.as_dict() for key in keys], "keys_outside": outside}


def _read_back(
    programme: str | os.PathLike[str],
    target: str | os.PathLike[str],
    motion: MotionSource,
    voice: Voice,
    options: DubOptions,
    sent: Sent,
    report: dict[str, Any],
    progress: Callable[[float], None],
) -> None:
    """Add a receiver's findings in the output to the report."""
    carriers = report["carriers"]
    report["read_back"] = read_back(
        target, sent, motion.score.keys, voice, lead=LEAD, key=options.key, track=options.track,
        duration_s=report["duration_s"], through=_channel(options.through), progress=progress,
    )  # fmt: skip
    if set(carriers) - {"audio"}:
        true_db = true_psnr_db(programme, target)
        for name in set(carriers) - {"audio"}:
            if "psnr_db" in carriers[name]:
                carriers[name]["mark_psnr_db"] = carriers[name]["psnr_db"]
            carriers[name]["psnr_db"] = true_db
    for name, figures in report["read_back"]["carriers"].items():
        carriers[name] |= {"received": figures["received"], "lost": figures["lost"]}


def _channel(through: str | None) -> str | None:
    return None if through == "none" else through


def _dub_sound(
    programme: str | os.PathLike[str],
    motion: MotionSource,
    voice: Voice,
    target: Path,
    options: DubOptions,
    sent: Sent,
    signing: Signing | None,
    progress: Callable[[float], None],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Mark the sound; return the report's parts on the programme and on the carrier."""
    stages: list[MarkingStage] = []
    begins_s: list[float] = []
    profile = find_profile(options.profiles["audio"])

    is_rehearsed(profile.name, options.through)  # an unknown coder is refused at once
    coders: list[str] = []

    def make_stage(sound: SoundFormat, start_s: float, coding: SoundTarget) -> Stage:
        own = coding.encoder, coding.bit_rate, sound.channels
        coder = options.through or coders_for(profile.name, *own)
        coders.append(coder or "none")
        first = max(-LEAD, math.ceil(start_s / SUPERFRAME_S - 1e-6))
        source = superframe_source(
            motion, voice, profile.l0_bytes, profile.l1_bytes, first=first, signing=signing
        )
        source = sent.noting("audio", source, first)
        begins_s.append(max(first * SUPERFRAME_S, start_s))
        skipped_s = begins_s[0] - start_s
        late = FRAME_SHIFT if coding.bit_rate and encoder_of(sound.codec) == coding.encoder else 0
        stages.append(
            MarkingStage(
                sound,
                source,
                name=os.fspath(programme),
                profile=profile.name,
                key=options.key,
                grade=options.grade,
                graded=options.graded,
                rehearsal=make_rehearsal(profile, options.key, coder, round(skipped_s * FS) + late),
            )
        )
        breath = Breath(sound.channels) if coding.encoder == "aac" else None
        return _From(stages[-1], round(skipped_s * sound.fs), late, breath)

    written = rewrite_sound(
        programme,
        target,
        make_stage,
        track=options.track,
        codec=options.audio_codec,
        bit_rate=options.audio_bit_rate,
        mend=options.mend,
        progress=progress,
    )
    report = {
        "duration_s": round(written.duration_s, 3),
        "superframes": stages[0].superframes,
        "clipped_samples": written.clipped,
        "left_out": list(written.left_out),
        "changed": list(written.changed),
    }
    figures = stages[0].report()
    figures["silent_s"] = [
        [round(t + begins_s[0], 3) for t in span] for span in figures["silent_s"]
    ]
    sent.sound_start_s = written.start_s
    sent.silent = [(a, b) for a, b in figures["silent_s"]]
    if margins := stages[0].margins():
        figures["margin"] = margin_figures(
            margins,
            begins_s[0],
            through=coders[0],
            profile=profile.name,
            grade=profile.grade if options.grade is None else options.grade,
        )
    return report, figures


def _picture_report(seconds: list[float]) -> dict[str, Any]:
    duration_s = math.fsum(seconds)
    superframes = int(duration_s / SUPERFRAME_S)
    return {
        "duration_s": round(duration_s, 3),
        "superframes": superframes,
        "left_out": [],
        "changed": [],
    }


class _From:
    """A stage that begins its work after some samples, which pass unmarked.

    The first sample comes out `late` times more.
    """

    def __init__(self, stage: Stage, samples: int, late: int, breath: Breath | None) -> None:
        self._stage, self._left, self._late = stage, max(0, samples), late
        self._breath = breath

    def process(self, block: Samples) -> Samples:
        again = np.repeat(block[:1], self._late, axis=0)
        self._late -= len(again)
        passed, block = block[: self._left], block[self._left :]
        self._left -= len(passed)
        marked = [self._stage.process(block)] if len(block) else []
        return self._breathed(np.concatenate([again, passed, *marked]))

    def flush(self) -> Samples:
        return self._breathed(self._stage.flush())

    def _breathed(self, block: Samples) -> Samples:
        return block if self._breath is None else self._breath.on(block)
