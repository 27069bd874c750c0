"""One programme dubbed as the options of the verb ``dub`` say, for it and for the batch."""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from codec.authentication.announcement import SigningKey, load_signing_key
from codec.cuer.motion import load_motion
from codec.cuer.voice import Voice
from codec.cues.score import Score
from cuecast.command.arguments import CARRIERS
from cuecast.command.errors import UsageError
from cuecast.command.progress import note, seconds_bar
from cuecast.command.trust import seconds_of
from cuecast.command.voices import coding_voice
from cuecast.dubbing.dub import PROFILES, DubOptions, dub
from cuecast.dubbing.inputs import LeftOutNotes, reading_of, subtitles_of, terms_of, unknown_report
from cuecast.dubbing.margin_report import NOT_REHEARSED, in_words
from cuecast.dubbing.motions import (
    ConcatenativeMotion,
    GivenMotion,
    MotionSource,
    SynthesisedMotion,
)
from cuecast.dubbing.read_back import shortfalls
from cuecast.dubbing.readability import in_words as readability_in_words
from cuecast.dubbing.readability import watched, watched_plan
from cuecast.media.subtitles import choose_track, read_track, text_tracks
from receiver.media.programme import Programme, open_programme
from synth.language.subtitles import Subtitle
from synth.language.subtitles.read import Terms
from synth.planning.prosody.pace_report import PaceReport
from synth.planning.scoring.text_score import Reading, score_of_subtitles


@dataclass(frozen=True, slots=True, kw_only=True)
class DubJob:
    """A programme to dub: its text, the performance, the output.

    Attributes
    ----------
    programme, output : str
        Files.
    voice : str
        Name of a virtual cuer, or the file of a voice.
    motion : str, optional
        File of a motion, instead of everything that follows but `options`.
    subtitles : str, optional
        File of subtitles; default: a track of the programme.
    subtitle_track : str, optional
        Which track.
    terms : Terms
        How subtitles are read.
    reading : Reading
        How their text is read and cued, when and by whom.
    align : bool
        Whether the cues follow the programme's voices instead of the subtitles' times.
    concatenative : bool
        Whether recorded units perform the cues, instead of rules.
    units : str, optional
        Folder of the units, if not the built-in ones; implies `concatenative`.
    options : DubOptions
        Carriers and coding.
    """

    programme: str
    output: str
    voice: str
    motion: str | None
    subtitles: str | None
    subtitle_track: str | None
    terms: Terms
    reading: Reading
    align: bool
    concatenative: bool
    units: str | None
    options: DubOptions


def job_of(args: argparse.Namespace) -> DubJob:
    """Return the job that the options of the verb ``dub`` describe.

    Raises
    ------
    UsageError
        If options contradict each other.
    CueError
        If a signing key or a lexicon cannot be read.
    """
    return DubJob(
        programme=args.programme,
        output=args.output,
        voice=args.voice,
        motion=args.motion,
        subtitles=args.subtitles,
        subtitle_track=args.subtitle_track,
        terms=terms_of(args),
        reading=reading_of(args),
        align=args.align,
        concatenative=bool(args.units) or args.method == "units",
        units=args.units,
        options=_options_of(args),
    )


def run_job(job: DubJob) -> dict[str, Any]:
    """Write the programme of a job, and note whatever is not as one would expect.

    Returns
    -------
    dict
        The report.

    Raises
    ------
    UsageError
        If the programme has no such subtitle track.
    CueError
        See `cuecast.dubbing.dub.dub`.
    """
    options = job.options
    duration_s = None
    notes: list[str] = []
    if "audio" in options.carriers:
        with open_programme(job.programme, track=options.track) as programme:
            duration_s = programme.duration_s
            if programme.format.channels == 1:
                notes += _single_channels(programme, options.track)
    voice = coding_voice(job.voice)
    said: dict[str, Any] = {}
    motion: MotionSource
    if job.motion is not None:
        motion = GivenMotion(load_motion(job.motion), voice)
    else:
        motion = _motion(job, voice, said, notes.append)
    passes = 1 + (len(options.carriers) > 1) + options.read_back
    with seconds_bar(duration_s and passes * duration_s, Path(job.programme).name) as advance:
        report = dub(job.programme, motion, voice, job.output, options, progress=advance)
    report |= said
    # A programme that cannot be used has one line: that it cannot.
    for line in notes:
        note(line)
    _tell(report)
    return report


def _single_channels(programme: Programme, track: int) -> list[str]:
    """Return a warning if a sound may be half of a stereo one, as in masters."""
    language = programme.sound.metadata.get("language")
    count = sum(
        sound.codec_context is not None
        and sound.codec_context.layout.nb_channels == 1
        and sound.metadata.get("language") == language
        for sound in programme.container.streams.audio
    )
    if count == 1:
        return []
    return [
        f"warning: {count} tracks of one channel each: track {track} alone is marked, and stereo "
        "made of two loses much of that: join them before, split them after"
    ]


def _options_of(args: argparse.Namespace) -> DubOptions:
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
    sign, on_air_s = _signing_of(args)
    return DubOptions(
        carriers=tuple(args.carriers),
        profiles=profiles,
        key=args.key,
        track=args.track,
        audio_codec=args.audio_codec,
        audio_bit_rate=args.audio_bitrate,
        video_codec=args.video_codec,
        video_bit_rate=args.video_bitrate,
        grade=args.grade,
        graded=not args.no_grade,
        through=args.through,
        video_through=args.video_through,
        read_back=not args.no_read_back,
        replace=args.replace,
        mend=args.mend,
        sign=sign,
        on_air_s=on_air_s,
    )


def _signing_of(args: argparse.Namespace) -> tuple[SigningKey | None, float]:
    """Return the key that signs, and when the programme begins on air."""
    path, told = getattr(args, "sign", None), getattr(args, "on_air", None)
    if path is None:
        return None, 0.0
    return load_signing_key(path), time.time() if told is None else seconds_of(told)


def _tell(report: dict[str, Any]) -> None:
    """Print warnings."""
    for stream in report["left_out"]:
        note(f"left out: {stream}")
    for change in report["changed"]:
        note(f"changed: {change}")
    if report["keys_outside"]:
        note(
            f"warning: {report['keys_outside']} of {len(report['keys'])} keys fall outside the "
            "programme"
        )
    for line in in_words(report["carriers"].get("audio", {}).get("margin", NOT_REHEARSED)):
        note(f"warning: {line}" if line.startswith("margin") else line)
    if "read_back" not in report:
        return
    found = report["read_back"]
    keys, through = found["keys"], found["through"]
    way = f" through {through}" if through else ""
    note(f"read back{way}: {keys['received']} of {keys['sent']} keys{_elsewhere(keys)}")
    coded_bps = {
        name: one["coded_bps"] for name, one in report["carriers"].items() if "coded_bps" in one
    }
    for line in shortfalls(found, coded_bps):
        note(f"warning: {line}")


def _elsewhere(keys: dict[str, Any]) -> str:
    """Return in words what became of the keys that no superframe could hold."""
    reasons = {
        "before_the_first": "before the first superframe",
        "in_silence": "in silence",
        "after_the_last": "after the last superframe",
    }
    found = keys["not_on_air"]
    words = [f"{found[name]} {where}" for name, where in reasons.items() if found[name]]
    return f"; {keys['outside']} not on air: {', '.join(words)}" if words else ""


def _motion(
    job: DubJob, voice: Voice, said: dict[str, Any], tell: Callable[[str], None]
) -> MotionSource:
    """Return the motion for the subtitles.

    `said` takes their part of the report, `tell` notes once they are dubbed.
    """
    reading = job.reading
    with open_programme(job.programme, track=job.options.track) as programme:
        # Elsewhere the times of packets have nothing to do with those of MPEG-2.
        player_s, length_s = programme.player_s, programme.duration_s
        begin_s = programme.origin_s - player_s
        stream_s = begin_s if programme.container.format.name == "mpegts" else None
    left_out = LeftOutNotes()
    subtitles = _subtitles(job, stream_s, player_s, length_s, left_out)
    left_out.say()
    unknown = unknown_report(subtitles, reading)
    if unknown:
        tell(f"{len(unknown)} unknown words, pronounced by rule: the report and `keys --unknown`")
    said |= {"subtitles": {"cued": len(subtitles), "left_out": left_out.report()}}
    said |= {"unknown_words": unknown}
    options = reading.options
    pace = PaceReport(options, tell)
    if job.align:
        # Its signal processing takes as long to import as all the rest.
        from cuecast.dubbing.aligning import Confidence, aligned_score

        confidence = Confidence()
        score = aligned_score(
            subtitles,
            job.programme,
            track=job.options.track,
            reading=reading,
            warn=tell,
            judged=confidence,
            on_word=pace,
        )
        tell(str(confidence))
        said |= {"alignment": confidence.report()}
    else:
        score = score_of_subtitles(subtitles, warn=tell, reading=reading, on_word=pace)
    source = _source(job, score, voice)
    if isinstance(source, SynthesisedMotion):
        seen = watched_plan(score, reading.performing, options)
    else:
        seen = watched(source, voice, options)
    pace.seen(seen.shown)
    figures = seen.figures()
    said |= {"pace": pace.report() | figures}
    tell(str(pace))
    tell(readability_in_words(figures))
    return source


def _source(job: DubJob, score: Score, voice: Voice) -> MotionSource:
    """Return what performs a score."""
    # Who has nothing to say rests: for that no units are needed.
    options, performer = job.reading.options, job.reading.performing
    if job.concatenative and score.keys:
        from cuecast.dubbing.performance import unit_synthesiser

        units = unit_synthesiser(
            voice, job.units, alignment=performer.alignment, options=options, seed=performer.seed
        )
        return ConcatenativeMotion(score, units)
    return SynthesisedMotion(
        score, voice, seed=performer.seed, options=options, alignment=performer.alignment
    )


def _subtitles(
    job: DubJob,
    stream_s: float | None,
    player_s: float,
    length_s: float | None,
    left_out: LeftOutNotes,
) -> list[Subtitle]:
    """Return the subtitles, from a file or from the programme itself."""
    if job.subtitles is not None:
        return subtitles_of(
            job.subtitles,
            job.terms,
            stream_s=stream_s,
            player_s=player_s,
            length_s=length_s,
            left_out=left_out,
        )
    track = choose_track(text_tracks(job.programme), job.subtitle_track, job.programme)
    note(f"subtitle track {track}")
    return read_track(job.programme, track, terms=job.terms, left_out=left_out)
