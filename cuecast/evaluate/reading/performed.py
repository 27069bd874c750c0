"""Takes of virtual cuers: landmarks of a simulated film, or of a rendered one that was tracked."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from codec.cuer.voice import Voice
from codec.cues.score import Score
from codec.streamfile.stream import decode_stream, encode_stream
from cuecast.evaluate.films import ASPECT, film
from cuecast.evaluate.reading.reader import ReaderTake, asked
from cuecast.evaluate.reading.takes import seen_in
from cuecast.evaluate.reading.view import RATE_HZ, view
from cuecast.media.film import write_film
from receiver.drawing.render import draw
from synth.capture.sources.landmark_table import read_landmarks
from synth.capture.tracker.video import track
from synth.motion.measured.cuer import performer

_TRACKER_MM = 0.8
"""Noise of a tracker's landmarks of the hand in mm, as in `cuecast.evaluate.readability`."""

_TAIL_S = 1.0
"""Seconds after the last phone: the hand comes to rest."""

_CODED_BPS = 337.5
"""Rate in bit/s at which a film's cuer has travelled: that of the usual sound profile."""

_MOTION_HZ = 50.0
"""Frames per second of the coded motion."""

_PICTURES_HZ = 25
"""Pictures per second of a film, as on television."""

_SIZE = (360, 480)
"""Width and height of its pictures; trackers look at fewer pixels of a hand than that."""

_FS = 48_000
"""Sampling rate in Hz of a film's silence."""


def simulated_takes(cuer: str, scores: Sequence[Score], *, seed: int = 0) -> list[ReaderTake]:
    """Return takes of ``identity/law`` as a tracker of the usual noise would see her joints."""
    identity, law = cuer.split("/")
    takes = []
    for number, score in enumerate(scores, start=seed):
        actor = performer(identity, law, rate_hz=RATE_HZ, seed=number)
        face, hand, _ = film(
            actor, score, seconds=score.phones[-1].end + _TAIL_S, noise_mm=_TRACKER_MM, seed=number
        )
        seen = view(*(points[..., :2] * [ASPECT, -1.0] for points in (face, hand)))
        takes.append(ReaderTake(f"{cuer} {number}", seen, asked(score.keys)))
    return takes


def filmed_takes(
    voice: Voice,
    scores: Sequence[Score],
    *,
    tracker: str,
    folder: Path,
    seed: int = 0,
    size: tuple[int, int] = _SIZE,
) -> list[ReaderTake]:
    """Return takes of the avatar: a rule-based performance, coded, decoded, drawn, filmed, tracked.

    Parameters
    ----------
    voice : Voice
    scores : sequence of Score
    tracker : str
        Interpreter that has the image tracker, as `synth.capture.tracker.video.find_tracker` says.
    folder : Path
        For the films.
    seed : int
    size : tuple of int
        Width and height of the pictures.
    """
    takes = []
    for number, score in enumerate(scores, start=seed):
        seconds = score.phones[-1].end + _TAIL_S
        actor = performer(voice.name, "minimum-jerk", rate_hz=_MOTION_HZ, seed=number)
        motion = actor.motion(score, 0.0, round(seconds * actor.rate_hz), voice)
        motion = decode_stream(encode_stream(motion, voice, rate_bps=_CODED_BPS), voice)
        times = np.arange(0.0, seconds, 1.0 / _PICTURES_HZ)
        path = folder / f"read-{number}.mkv"
        write_film(
            path,
            np.zeros((round(_FS * seconds), 1), np.float32),
            _FS,
            encoder="flac",
            pictures=draw(motion, voice, times, style="avatar", size=size),
            picture_rate=_PICTURES_HZ,
        )
        aspect = track(path, tracker, path.with_suffix(".csv"))
        seen = seen_in(read_landmarks(path.with_suffix(".csv")), aspect)
        takes.append(ReaderTake(path.stem, seen, asked(score.keys)))
    return takes
