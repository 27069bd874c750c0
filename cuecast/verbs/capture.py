"""Make the motion of a cuer from a recording of a real one.

Markers as C3D, TRC, Qualisys TSV or CSV; face weights of Live Link Face; landmarks of an image
tracker as CSV; or a video, if a tracker is installed. Speakers of any size and left-handed ones are
brought to the voice; keys are recognised, so that the motion can be coded and dubbed.
"""

import argparse
import json
import math
import shutil
import sys
import tempfile
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from cuecast.command.arguments import add_json, add_voice, aspect, positive, print_json
from cuecast.command.files import PIPE, write_json
from cuecast.command.progress import note, seconds_bar

if TYPE_CHECKING:
    from collections.abc import Iterator

    from codec.cuer.voice import Voice
    from codec.cues.score import Score
    from synth.capture.options import CaptureOptions
    from synth.capture.tracker.live import LiveFrame

SUMMARY = "motion from motion capture, landmarks or a video of an interpreter"

_USUAL_ASPECT = 16 / 9
"""Width over height of a film that states none: that of television."""

_LONGEST_PATH = 1024
"""Characters; a longer text is no name of a file."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "input", nargs="?", metavar="IN", help="recording of a cuer; - reads a pipe"
    )
    parser.add_argument("-o", "--output", metavar="M.npz", help="motion")
    parser.add_argument("--rate", type=positive, default=50.0, metavar="HZ", help="of the motion")
    parser.add_argument(
        "--start",
        type=float,
        metavar="S",
        help="time of the first frame on the programme's clock, if not as the file says",
    )
    parser.add_argument(
        "--live",
        action="store_true",
        help="a table of landmarks as it comes: a line of JSON per frame, a quarter second late",
    )
    parser.add_argument("--report", metavar="R.json", help="how well it went; - prints it")
    parser.add_argument("--plot", metavar="P.png", help="a picture of the same")
    markers = parser.add_argument_group("markers")
    markers.add_argument(
        "--map",
        metavar="FILE",
        help="labels and our markers: CSV with two columns, or JSON; others go by name",
    )
    markers.add_argument(
        "--propose-map",
        metavar="FILE",
        help="for labels that name no marker: write a map (CSV or .json) by where the points are; "
        "with --output the motion goes by it",
    )
    markers.add_argument("--subject", metavar="NAME", help="only labels such as NAME:FH0")
    markers.add_argument(
        "--calibration", metavar="TAKE", help="the same speaker and markers, her face at rest"
    )
    markers.add_argument(
        "--markers-chart",
        metavar="P.png|P.svg",
        help="draw where the 113 markers sit on a cuer, and do nothing else if there is no IN",
    )
    landmarks = parser.add_argument_group("landmarks")
    landmarks.add_argument(
        "--frame-rate", type=positive, metavar="HZ", help="of frames that are numbered, not timed"
    )
    landmarks.add_argument(
        "--aspect",
        type=aspect,
        metavar="W/H",
        help="width of the picture over its height, such as 16/9",
    )
    landmarks.add_argument(
        "--tracker", metavar="PYTHON", help="of an environment with MediaPipe 0.10.21, for a video"
    )
    keys = parser.add_argument_group("keys").add_mutually_exclusive_group()
    keys.add_argument(
        "--score", metavar="T.TextGrid", help="transcript with times, if that is known"
    )
    keys.add_argument(
        "--text",
        metavar="TEXT|FILE",
        help="transcript without times: French, or phones apart by spaces",
    )
    keys.add_argument("--no-keys", action="store_true", help="do not recognise keys")
    add_json(parser)
    add_voice(parser)


def run(args: argparse.Namespace) -> int:
    """Write the motion and its report."""
    from codec.cuer.motion import save_motion
    from codec.cuer.voice import load_voice
    from synth.capture.capture import capture_motion

    if not args.input and not args.markers_chart:
        note("cuecast capture: a recording or --markers-chart is needed")
        return 2
    if bool(args.input) != bool(args.output) and not (args.input and args.propose_map):
        note("cuecast capture: a recording goes with --output")
        return 2
    if args.propose_map and (args.live or not args.input):
        note("cuecast capture: --propose-map needs a recording of markers")
        return 2
    voice = load_voice(args.voice)
    if args.markers_chart:
        _draw_chart(Path(args.markers_chart), voice)
        if not args.input:
            return 0
    if args.live:
        return _live(args, voice)
    with _as_file(args.input) as path:
        options = _options(args)
        if args.propose_map:
            options = _proposed(args, path, voice, options)
            if not args.output:
                return 0
        with seconds_bar(None, Path(args.input).name) as advance:
            captured = capture_motion(path, voice, replace(options, progress=advance))
    if args.plot:
        from cuecast.evaluate.tables import PAGE_IN, write_plot

        write_plot(Path(args.plot), captured.report, plot_capture, size_in=PAGE_IN)
    save_motion(captured.motion, args.output)
    if args.report:
        write_json(args.report, captured.report)
    if args.json:
        print_json(captured.report)
    else:
        for line in told(captured.report):
            note(line)
    return 0


def _draw_chart(path: Path, voice: "Voice") -> None:
    from codec.errors import CueError
    from cuecast.command.markers_chart import SIZE_IN, draw_markers
    from cuecast.evaluate.tables import PLOTS, write_plot

    if path.suffix not in PLOTS:
        raise CueError(f"{path}: a chart ends in {', '.join(PLOTS)}")
    write_plot(path, {}, lambda _, figure: draw_markers(voice, figure), size_in=SIZE_IN)


def _live(args: argparse.Namespace, voice: "Voice") -> int:
    """Write the parameters of frames as they come: time and params, one JSON object a line."""
    from synth.capture.sources.landmark_table import USUAL_RATE_HZ, landmark_frames
    from synth.capture.tracker.live import LiveLandmarks

    live: LiveLandmarks | None = None
    count = 0
    with _lines_from(args.input) as lines, _written_to(args.output) as out:
        rate_hz = args.frame_rate or USUAL_RATE_HZ
        for frame in landmark_frames(lines, name=args.input, rate_hz=args.frame_rate):
            if live is None:
                aspect = 1.0 if frame.in_pixels else args.aspect or _USUAL_ASPECT
                live = LiveLandmarks(voice, aspect=aspect, rate_hz=rate_hz)
            hands = {name: hand[0] for name, hand in frame.hands.items()}
            for done in live.process(float(frame.times[0]), frame.face[0], hands):
                count += _line(out, done)
        for done in live.flush() if live is not None else ():
            count += _line(out, done)
    note(f"{args.input}: parameters of {count} frames")
    return 0 if count else 1


def _line(out: IO[str], frame: "LiveFrame") -> int:
    params = [round(float(value), 4) for value in frame.params]
    told: dict[str, object] = {"time": round(frame.time_s, 4), "params": params}
    points = frame.points.ravel().tolist()
    if all(map(math.isfinite, points)):
        told["points"] = [round(value, 2) for value in points]
    out.write(json.dumps(told) + "\n")
    out.flush()
    return 1


@contextmanager
def _lines_from(path: str) -> "Iterator[IO[str]]":
    if path == PIPE:
        yield sys.stdin
        return
    with open(path, encoding="utf-8-sig") as file:
        yield file


@contextmanager
def _written_to(path: str) -> "Iterator[IO[str]]":
    if path == PIPE:
        yield sys.stdout
        return
    with open(path, "w", encoding="utf-8") as file:
        yield file


@contextmanager
def _as_file(path: str) -> "Iterator[str]":
    """Give the path of a file, for ``-`` of one with the standard input's content."""
    if path != PIPE:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="cuecast-") as folder:
        spooled = Path(folder) / "standard input"
        with spooled.open("wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        yield str(spooled)


def _proposed(
    args: argparse.Namespace, path: str, voice: "Voice", options: "CaptureOptions"
) -> "CaptureOptions":
    """Write a proposed map, report it, and return the options with it."""
    from codec.errors import CueError
    from synth.capture.points.labels import write_map
    from synth.capture.points.propose import SURE, propose_map
    from synth.capture.sources.readers import read_markers

    recording = read_markers(path, "a map is proposed for markers")
    try:
        found = propose_map(recording, voice, mapping=options.mapping, subject=args.subject)
    except CueError as error:
        raise CueError(f"{path}: {error}") from error
    mapping = {**options.mapping, **found.sure}
    unsure = [pair for pair in found.pairs if pair[2] < SURE]
    write_map(args.propose_map, mapping, unsure=unsure)
    note(
        f"{args.propose_map}: {len(found.sure)} of {found.points} labels are sure, "
        f"{found.points - len(found.sure)} left out, {found.known} were known; "
        f"from the models, mm: face {found.face_mm:.2f}, hand {found.hand_mm:.2f}"
    )
    if args.json and not args.output:
        fields = ("label", "marker", "confidence")
        pairs = [dict(zip(fields, pair, strict=True)) for pair in found.pairs]
        print_json({**asdict(found), "pairs": pairs, "sure": len(found.sure)})
    return replace(options, mapping=mapping)


def _options(args: argparse.Namespace) -> "CaptureOptions":
    from synth.capture.options import CaptureOptions
    from synth.capture.points.labels import read_map
    from synth.planning.scoring.textgrid import read_textgrid

    return CaptureOptions(
        rate_hz=args.rate,
        start_s=args.start,
        mapping=read_map(args.map) if args.map else {},
        subject=args.subject,
        calibration=Path(args.calibration) if args.calibration else None,
        score=read_textgrid(args.score) if args.score else None,
        text=_transcript(args.text) if args.text else None,
        keys=not args.no_keys,
        frame_rate_hz=args.frame_rate,
        aspect=args.aspect,
        tracker=args.tracker,
    )


def _transcript(text: str) -> "Score":
    """Return the phones of a text, or of the file that holds it."""
    from codec.errors import CueError
    from synth.capture.cues.transcript import read_transcript

    path = Path(text)
    try:
        if len(text) < _LONGEST_PATH and path.is_file():
            text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise CueError(f"{path}: cannot read the text: {error}") from error
    return read_transcript(text)


def told(report: dict[str, Any]) -> list[str]:
    """Return a report in a few lines."""
    source = report["input"]
    lines = [
        f"{source['file']}: {source['kind']}, {source['duration_s']:.2f} s, "
        f"{source['rate_hz']:g} frames/s"
    ]
    if "markers" in report:
        lines += _of_markers(report)
    errors = {part: mm for part, mm in report.get("residual_mm", {}).items() if mm is not None}
    if errors:
        lines.append("residual, mm: " + ", ".join(f"{k} {v:.2f}" for k, v in errors.items()))
    keys = report.get("keys", {})
    if keys.get("recognised"):
        lines.append(f"{keys['recognised']} keys recognised, confidence {keys['confidence']:.2f}")
    elif "given" in keys:
        shown = f", agreement {keys['agreement']:.2f}" if "agreement" in keys else ""
        left = f", {keys['left_out']} left out" if keys.get("left_out") else ""
        lines.append(f"{keys['given']} keys given{left}{shown}")
    return [*lines, *report["notes"]]


def _of_markers(report: dict[str, Any]) -> list[str]:
    found, gaps, repairs = report["markers"], report["gaps"], report["repairs"]
    return [
        f"{found['found']} of 113 markers ({found['of_face']} face, {found['of_hand']} hand), "
        f"{len(found['unused'])} other labels, {found['unnamed']} unnamed",
        f"head {report['place']['head_size']:.3f} and hand {report['speaker']['hand_size']:.3f} "
        "times the voice's",
        f"hidden {100 * gaps['hidden_share']:.1f} %, longest gap {gaps['longest_s']:.2f} s; "
        f"{repairs['renamed']} renamed, {repairs['recovered']} recovered, "
        f"{repairs['dropped']} dropped",
    ]


def plot_capture(report: dict[str, Any], figure: Any) -> None:
    """Draw a report of `synth.capture` into a figure of matplotlib."""
    errors, hidden = (figure.add_subplot(1, 2, number) for number in (1, 2))
    parts = {name: mm for name, mm in report.get("residual_mm", {}).items() if mm is not None}
    errors.barh(list(parts), list(parts.values()))
    errors.invert_yaxis()
    errors.set_xlabel("distance from the models, mm")
    worst = report.get("gaps", {}).get("most_hidden", {})
    hidden.barh(list(worst), [100 * share for share in worst.values()])
    hidden.invert_yaxis()
    hidden.set_xlabel("hidden, % of the frames (the worst)")
    figure.suptitle(f"{report['input']['file']}, {report['input']['duration_s']:.1f} s")
