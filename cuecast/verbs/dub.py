"""Put a cuer into the sound of a programme.

The output keeps the container, the picture and the parameters of the sound; every other stream
is copied as it stands.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cuecast.command.arguments import (
    CARRIERS,
    USUAL_GRADE,
    add_json,
    add_key,
    add_motion,
    add_pace,
    add_reading,
    add_seed,
    add_subtitle_terms,
    add_voice,
    bit_rate,
    carrier_list,
    grade,
    natural,
    print_json,
)
from cuecast.command.errors import UsageError
from cuecast.command.files import write_json
from cuecast.command.progress import note, seconds_bar
from cuecast.dubbing.inputs import (
    LeftOutNotes,
    reading_of,
    subtitles_of,
    terms_of,
    unknown_report,
)

if TYPE_CHECKING:
    from codec.cuer.voice import Voice
    from cuecast.dubbing.aligning import Confidence
    from cuecast.dubbing.motions import MotionSource
    from synth.subtitles import Subtitle

SUMMARY = "the programme with its cuer inside"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("programme", metavar="PROGRAMME", help="sound or video file")
    source = parser.add_mutually_exclusive_group()
    source.add_argument(
        "--subtitles", metavar="SUBS",
        help="what is said; - reads a pipe (default: the programme's own French subtitles)",
    )  # fmt: skip
    source.add_argument(
        "--subtitle-track", metavar="N|LANG", help="which of the programme's own, from 0"
    )
    source.add_argument("--motion", metavar="M.npz", help="motion of the cuer")
    parser.add_argument("-o", "--output", required=True, metavar="OUT")
    parser.add_argument(
        "--carriers",
        type=carrier_list,
        default=("audio",),
        metavar="LIST",
        help=f"of {', '.join(CARRIERS)}",
    )
    parser.add_argument(
        "--align", action="store_true", help="time the cues by the voices of the programme"
    )
    parser.add_argument("--report", metavar="R.json", help="what was done; - prints it")
    parser.add_argument("--track", type=natural, default=0, metavar="N", help="which sound, from 0")
    parser.add_argument(
        "--profile", action="append", default=[], metavar="CARRIER=NAME",
        help="such as audio=robust, video=high, a335=2x",
    )  # fmt: skip
    for kind, example in (("audio", "192k"), ("video", "4000k")):
        parser.add_argument(f"--{kind}-codec", metavar="NAME", help="of the output, if another")
        parser.add_argument(
            f"--{kind}-bitrate", type=bit_rate, metavar="BPS", help=f"such as {example}"
        )
    parser.add_argument(
        "--grade", type=grade, default=USUAL_GRADE, metavar="ODG",
        help="how much of the mark a listener may notice, from 0 (nothing) to -4 (BS.1387)",
    )  # fmt: skip
    parser.add_argument(
        "--through", metavar="CODER",
        help="the broadcaster's coder, such as aac:64k: the mark is rehearsed through it; or none "
        "(default: aac:64k for robust, else none)",
    )  # fmt: skip
    parser.add_argument("--no-grade", action="store_true", help="do not run the quality meter")
    add_json(parser)
    add_voice(parser)
    add_seed(parser)
    add_key(parser)
    add_motion(parser)
    add_reading(parser)
    add_pace(parser)
    add_subtitle_terms(parser)


def run(args: argparse.Namespace) -> int:
    """Write the programme and the report."""
    carriers = args.carriers
    from codec.cuer.motion import load_motion
    from cuecast.command.voices import coding_voice
    from cuecast.dubbing.aligning import Confidence
    from cuecast.dubbing.dub import PROFILES, DubOptions, dub
    from cuecast.dubbing.motions import GivenMotion, MotionSource
    from receiver.media.programme import open_programme

    profiles = dict(PROFILES)
    for choice in args.profile:
        carrier, _, name = choice.partition("=")
        if carrier not in CARRIERS or not name:
            raise UsageError(f"--profile {choice!r}: say it as audio=robust")
        profiles[carrier] = name
    duration_s = None
    if "audio" in carriers:
        with open_programme(args.programme, track=args.track) as programme:
            duration_s = programme.duration_s
    voice = coding_voice(args.voice)
    confidence = Confidence()
    said: dict[str, Any] = {}
    motion: MotionSource
    if args.motion is not None:
        motion = GivenMotion(load_motion(args.motion), voice)
    else:
        motion = _motion(args, voice, confidence, said)
    options = DubOptions(
        carriers, profiles, args.key, args.track, args.audio_codec, args.audio_bitrate,
        args.video_codec, args.video_bitrate, args.grade, not args.no_grade,
        args.through,
    )  # fmt: skip
    passes = 1 + (len(carriers) > 1)
    with seconds_bar(duration_s and passes * duration_s, Path(args.programme).name) as advance:
        report = dub(args.programme, motion, voice, args.output, options, progress=advance)
    if args.align and args.motion is None:
        report["alignment"] = confidence.report()
    report |= said
    for stream in report["left_out"]:
        note(f"left out: {stream}")
    if args.report is not None:
        write_json(args.report, report)
    if args.json:
        print_json(report)
    else:
        note(f"{args.output}: {len(report['keys'])} keys, {report['superframes']} superframes")
        for name, figures in report["carriers"].items():
            shown = {key: value for key, value in figures.items() if key != "silent_s"}
            note(f"{name}: " + ", ".join(f"{key} {value}" for key, value in shown.items()))
    return 0


def _motion(
    args: argparse.Namespace, voice: "Voice", confidence: "Confidence", said: dict[str, Any]
) -> "MotionSource":
    """Return the motion for the subtitles; `said` takes what the report tells of them."""
    from cuecast.dubbing.motions import JoinedMotion, SynthesisedMotion
    from cuecast.dubbing.readability import in_words, readability
    from receiver.media.programme import open_programme
    from synth.prosody.pace_report import PaceReport
    from synth.scoring.text_score import score_from_subtitles

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
        note(f"{len(unknown)} unknown words, pronounced by rule: the report and `keys --unknown`")
    said |= {"subtitles": {"cued": len(subtitles), "left_out": left_out.report()}}
    said |= {"unknown_words": unknown}
    options = reading.options
    pace = PaceReport(options, note)
    if args.align:
        from cuecast.dubbing.aligning import aligned_score

        score = aligned_score(
            subtitles, args.programme, track=args.track, reading=reading, warn=note,
            judged=confidence, told=pace,
        )  # fmt: skip
        note(str(confidence))
    else:
        score = score_from_subtitles(subtitles, warn=note, reading=reading, told=pace)
    figures = readability(score, voice, options)
    said |= {"pace": pace.report() | figures}
    note(str(pace))
    note(in_words(figures))
    # Who has nothing to say rests: for that no units are needed.
    if (args.units or args.method == "units") and score.keys:
        from cuecast.dubbing.performance import unit_synthesiser

        units = unit_synthesiser(
            voice, args.units, alignment=args.alignment, options=options, seed=args.seed
        )
        return JoinedMotion(score, units)
    return SynthesisedMotion(
        score, voice, seed=args.seed, options=options, alignment=args.alignment
    )


def _subtitles(
    args: argparse.Namespace,
    stream_s: float | None,
    length_s: float | None,
    left_out: LeftOutNotes,
) -> "list[Subtitle]":
    """Return what is said, from a file or from the programme itself."""
    if args.subtitles is not None:
        return subtitles_of(
            args, args.subtitles, stream_s=stream_s, length_s=length_s, left_out=left_out
        )
    from cuecast.media.subtitles import choose_track, read_track, text_tracks

    track = choose_track(text_tracks(args.programme), args.subtitle_track, args.programme)
    note(f"subtitle track {track}")
    return read_track(args.programme, track, terms=terms_of(args), left_out=left_out)
