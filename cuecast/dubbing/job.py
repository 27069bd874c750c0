"""One programme dubbed as the options of the verb ``dub`` say, for it and for the batch."""

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from codec.authentication.announcement import SigningKey, load_signing_key
from codec.cuer.motion import load_motion
from codec.cuer.voice import Voice
from codec.cues.cueing import CueingOptions
from codec.cues.score import Score
from cuecast.command.arguments import CARRIERS
from cuecast.command.errors import UsageError
from cuecast.command.progress import note, seconds_bar
from cuecast.command.trust import seconds_of
from cuecast.command.voices import coding_voice
from cuecast.dubbing.dub import PROFILES, DubOptions, dub
from cuecast.dubbing.inputs import (
    LeftOutNotes,
    reading_of,
    subtitles_of,
    terms_of,
    unknown_report,
)
from cuecast.dubbing.motions import (
    ConcatenativeMotion,
    GivenMotion,
    MotionSource,
    SynthesisedMotion,
)
from cuecast.dubbing.read_back import shortfalls
from cuecast.dubbing.readability import in_words, watched
from cuecast.media.subtitles import choose_track, read_track, text_tracks
from receiver.media.programme import open_programme
from synth.language.subtitles import Subtitle
from synth.planning.prosody.pace_report import PaceReport
from synth.planning.scoring.text_score import score_of_subtitles


def dub_as_told(args: argparse.Namespace) -> dict[str, Any]:
    """Write the programme that the options name, and tell what is not as one would expect.

    Returns
    -------
    dict
        The report.

    Raises
    ------
    UsageError
        If options contradict each other.
    CueError
        See `cuecast.dubbing.dub.dub`.
    """
    options = options_of(args)
    duration_s = None
    if "audio" in options.carriers:
        with open_programme(args.programme, track=args.track) as programme:
            duration_s = programme.duration_s
    voice = coding_voice(args.voice)
    said: dict[str, Any] = {}
    notes: list[str] = []
    motion: MotionSource
    if args.motion is not None:
        motion = GivenMotion(load_motion(args.motion), voice)
    else:
        motion = _motion(args, voice, said, notes.append)
    passes = 1 + (len(options.carriers) > 1) + options.read_back
    with seconds_bar(duration_s and passes * duration_s, Path(args.programme).name) as advance:
        report = dub(args.programme, motion, voice, args.output, options, progress=advance)
    report |= said
    # A programme that cannot be used has one line: that it cannot.
    for line in notes:
        note(line)
    _tell(report)
    return report


def options_of(args: argparse.Namespace) -> DubOptions:
    """Return the choices about carriers and coding.

    Raises
    ------
    UsageError
        If a profile is not said as it has to be.
    """
    profiles = dict(PROFILES)
    for choice in args.profile:
        carrier, _, name = choice.partition("=")
        if carrier not in CARRIERS or not name:
            raise UsageError(f"--profile {choice!r}: say it as audio=robust")
        profiles[carrier] = name
    return DubOptions(
        tuple(args.carriers), profiles, args.key, args.track, args.audio_codec, args.audio_bitrate,
        args.video_codec, args.video_bitrate, args.grade, not args.no_grade,
        args.through, not args.no_read_back, args.replace, *_signing_of(args),
    )  # fmt: skip


def _signing_of(args: argparse.Namespace) -> tuple[SigningKey | None, float]:
    """Return the key that signs, and when the programme begins on air."""
    path, told = getattr(args, "sign", None), getattr(args, "on_air", None)
    if path is None:
        return None, 0.0
    return load_signing_key(path), time.time() if told is None else seconds_of(told)


def _tell(report: dict[str, Any]) -> None:
    """Tell what is not as one would expect."""
    for stream in report["left_out"]:
        note(f"left out: {stream}")
    for change in report["changed"]:
        note(f"changed: {change}")
    if report["keys_outside"]:
        note(
            f"warning: {report['keys_outside']} of {len(report['keys'])} keys fall outside the "
            "programme"
        )
    if "read_back" not in report:
        return
    found = report["read_back"]
    keys, through = found["keys"], found["through"]
    way = f" through {through}" if through else ""
    note(f"read back{way}: {keys['received']} of {keys['sent']} keys")
    coded_bps = {
        name: one["coded_bps"] for name, one in report["carriers"].items() if "coded_bps" in one
    }
    for line in shortfalls(found, coded_bps):
        note(f"warning: {line}")


def _motion(
    args: argparse.Namespace, voice: Voice, said: dict[str, Any], tell: Callable[[str], None]
) -> MotionSource:
    """Return the motion for the subtitles.

    `said` takes what the report tells of them, `tell` what is noted once they are dubbed.
    """
    reading = reading_of(args)
    with open_programme(args.programme, track=args.track) as programme:
        # Elsewhere the times of packets have nothing to do with those of MPEG-2.
        stream_s = programme.origin_s if programme.container.format.name == "mpegts" else None
        length_s = programme.duration_s
    left_out = LeftOutNotes()
    subtitles = _subtitles(args, stream_s, length_s, left_out)
    left_out.say()
    unknown = unknown_report(subtitles, reading)
    if unknown:
        tell(f"{len(unknown)} unknown words, pronounced by rule: the report and `keys --unknown`")
    said |= {"subtitles": {"cued": len(subtitles), "left_out": left_out.report()}}
    said |= {"unknown_words": unknown}
    options = reading.options
    pace = PaceReport(options, tell)
    if args.align:
        # Its signal processing takes as long to import as all the rest.
        from cuecast.dubbing.aligning import Confidence, aligned_score

        confidence = Confidence()
        score = aligned_score(
            subtitles, args.programme, track=args.track, reading=reading, warn=tell,
            judged=confidence, told=pace,
        )  # fmt: skip
        tell(str(confidence))
        said |= {"alignment": confidence.report()}
    else:
        score = score_of_subtitles(subtitles, warn=tell, reading=reading, told=pace)
    source = _source(args, score, voice, options)
    seen = watched(source, voice, options)
    pace.seen(seen.shown)
    figures = seen.figures()
    said |= {"pace": pace.report() | figures}
    tell(str(pace))
    tell(in_words(figures))
    return source


def _source(
    args: argparse.Namespace, score: Score, voice: Voice, options: CueingOptions
) -> MotionSource:
    """Return what performs a score."""
    # Who has nothing to say rests: for that no units are needed.
    if (args.units or args.method == "units") and score.keys:
        from cuecast.dubbing.performance import unit_synthesiser

        units = unit_synthesiser(
            voice, args.units, alignment=args.alignment, options=options, seed=args.seed
        )
        return ConcatenativeMotion(score, units)
    return SynthesisedMotion(
        score, voice, seed=args.seed, options=options, alignment=args.alignment
    )


def _subtitles(
    args: argparse.Namespace,
    stream_s: float | None,
    length_s: float | None,
    left_out: LeftOutNotes,
) -> list[Subtitle]:
    """Return what is said, from a file or from the programme itself."""
    if args.subtitles is not None:
        return subtitles_of(
            args, args.subtitles, stream_s=stream_s, length_s=length_s, left_out=left_out
        )
    track = choose_track(text_tracks(args.programme), args.subtitle_track, args.programme)
    note(f"subtitle track {track}")
    return read_track(args.programme, track, terms=terms_of(args), left_out=left_out)
