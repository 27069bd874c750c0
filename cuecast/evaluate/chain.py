"""The whole way as a viewer has it: dub, broadcast, receive, compare, over clips and channels.

Rows: clip, channel, keys_total, keys_correct, tune_in_s, superframes_sent, superframes_lost,
marker_rms_mm, hand_rms_mm, face_rms_mm, offset_s, odg, snr_db, dub_xrt, receive_xrt.
"""

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from codec.analysis.compare import compare_motions
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.score import Score
from codec.errors import CueError
from cuecast.demo.content import FS, LINES, make_sound
from cuecast.dubbing.dub import DubOptions, dub
from cuecast.dubbing.motions import SynthesisedMotion, whole_motion
from cuecast.dubbing.receive import receive
from cuecast.evaluate.drawing import Dot, draw_dots
from cuecast.evaluate.options import EvaluateOptions
from cuecast.media.film import write_film
from cuecast.media.rewrite import Unchanged, rewrite_sound
from receiver.media.sound import read_sound
from synth.language.subtitles import Subtitle, read_subtitles
from synth.planning.prosody.pacing import READABLE
from synth.planning.prosody.simulation import PerformerChoice
from synth.planning.scoring.text_score import Reading, score_of_subtitles
from watermark.link.superframe import SUPERFRAME_S


@dataclass(frozen=True, slots=True)
class BroadcastCodec:
    """A broadcast codec: container's suffix, FFmpeg's encoder, bit/s (0: lossless)."""

    suffix: str
    encoder: str
    bit_rate: int


CHANNELS = {
    "none": BroadcastCodec(".flac", "flac", 0),
    "aac128": BroadcastCodec(".m4a", "aac", 128_000),
    "aac96": BroadcastCodec(".m4a", "aac", 96_000),
    "mp2_192": BroadcastCodec(".mkv", "mp2", 192_000),
    "ac3_192": BroadcastCodec(".mkv", "ac3", 192_000),
    "mp3_128": BroadcastCodec(".mp3", "libmp3lame", 128_000),
    "opus_96": BroadcastCodec(".ogg", "libopus", 96_000),
}
"""Channels by name, in containers that state by how much a coder delays the sound."""

DEFAULT_CHANNELS = ("none", "aac128", "mp2_192", "ac3_192", "mp3_128")

_SOUNDS = {".wav", ".flac", ".mp3", ".m4a", ".ogg", ".mp4", ".mkv", ".ts"}
_SUBTITLES = (".srt", ".vtt", ".ttml", ".xml", ".stl")

_LINE_S = 4.0
"""Seconds of a line of subtitles, where a clip has none of its own."""


def evaluate(options: EvaluateOptions) -> list[dict[str, Any]]:
    """Take every clip the whole way through every channel.

    A clip is cued by the subtitles that lie beside it under its name; without such, by the text
    of the demonstration, a line every four seconds. Pace and performer are those of `dub`.

    Raises
    ------
    CueError
        If a channel or the folder of clips does not exist, or a clip is unusable.
    """
    names = options.channels or DEFAULT_CHANNELS
    unknown = [name for name in names if name not in CHANNELS]
    if unknown:
        raise CueError(f"no channel called {unknown[0]!r}, there are: {', '.join(CHANNELS)}")
    voice = load_voice()
    rows = []
    for clip, subtitles in clips_of(options):
        reading = Reading(pace=READABLE, performing=PerformerChoice(seed=options.seed))
        score = score_of_subtitles(subtitles, reading=reading, warn=lambda line: None)
        rows += _through(clip, score, voice, names, options)
    return rows


def clips_of(options: EvaluateOptions) -> Iterator[tuple[Path, list[Subtitle]]]:
    """Yield clips and their subtitles.

    Raises
    ------
    CueError
        If the folder holds none.
    """
    if options.clips is None:
        sound, subtitles = make_sound()
        path = options.folder / "demonstration.flac"
        write_film(path, sound, FS, encoder="flac")
        yield path, subtitles
        return
    if not options.clips.is_dir():
        raise CueError(f"{options.clips}: is not a folder of clips")
    clips = sorted(p for p in options.clips.iterdir() if p.suffix.lower() in _SOUNDS)
    if not clips:
        raise CueError(f"{options.clips}: no sound files in it")
    for clip in clips:
        beside = [clip.with_suffix(suffix) for suffix in _SUBTITLES]
        written = next((path for path in beside if path.exists()), None)
        yield clip, _usual_lines(clip) if written is None else read_subtitles(written)


def _usual_lines(clip: Path) -> list[Subtitle]:
    sound, fs = read_sound(clip)
    count = int(len(sound) / fs / _LINE_S)
    return [
        Subtitle(_LINE_S * n, _LINE_S * (n + 0.95), LINES[n % len(LINES)]) for n in range(count)
    ]


def _through(
    clip: Path, score: Score, voice: Voice, names: tuple[str, ...], options: EvaluateOptions
) -> list[dict[str, Any]]:
    source = SynthesisedMotion(score, voice, seed=options.seed)
    dubbed = options.folder / "dubbed.flac"
    began = time.process_time()
    report = dub(clip, source, voice, dubbed, DubOptions(audio_codec="flac"))
    dub_xrt = report["duration_s"] / (time.process_time() - began)
    sent = whole_motion(source, report["duration_s"])
    rows = []
    for name in names:
        options.say(f"{clip.name} through {name}")
        channel = CHANNELS[name]
        coded = options.folder / f"coded{channel.suffix}"
        rewrite_sound(
            dubbed, coded, lambda *_: Unchanged(), codec=channel.encoder, bit_rate=channel.bit_rate
        )
        row = {"clip": clip.stem, "channel": name}
        # The programme's end may cut off one more, which nobody receives.
        whole = min(report["superframes"], int(report["duration_s"] / SUPERFRAME_S + 1e-6))
        row |= _received(coded, sent, voice, whole)
        audio = report["carriers"]["audio"]
        row |= {"odg": audio.get("odg"), "snr_db": audio["snr_db"], "dub_xrt": round(dub_xrt, 1)}
        rows.append(row)
    return rows


def _received(coded: Path, sent: Motion, voice: Voice, superframes: int) -> dict[str, Any]:
    """Receive a coded programme and compare it with the motion sent.

    All `superframes` on air count: without a lock, all are lost.
    """
    began = time.process_time()
    reception = receive(coded, voice)
    spent_s = time.process_time() - began
    summary = reception.summary
    received = summary["superframes"]["received"]
    figures: dict[str, Any] = {
        "tune_in_s": summary["tune_in_s"],
        "superframes_sent": superframes,
        "superframes_received": received,
        "superframes_lost": max(superframes - received, 0),
        "receive_xrt": round(summary["duration_s"] / max(spent_s, 1e-9), 1),
        "keys_total": len(sent.score.keys) if sent.score else 0,
        "keys_correct": 0,
    }
    if reception.motion is not None:
        alike = asdict(compare_motions(sent, reception.motion, voice))
        figures |= {name: round(value, 4) for name, value in alike.items()}
    return figures


def plot(results: list[dict[str, Any]], figure: Any) -> None:
    """Draw the share of keys that arrived, a line for each channel, a dot for each clip."""
    draw_dots(
        figure,
        [
            Dot(row["channel"], row["clip"], 100 * row["keys_correct"] / max(1, row["keys_total"]))
            for row in results
        ],
        xlabel="keys that arrived, %",
    )
