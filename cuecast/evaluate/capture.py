"""How well `cuecast capture` does: takes of virtual cuers through each kind of file.

Each take is written as a laboratory, a telephone or an image tracker would write it, captured into
the voice, and compared: with the true markers where the voice's own cuer performed, with the keys
that were performed by whoever it was. A key is right if it is recognised within a tenth of a second
of its time.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.analysis.compare import KEY_TOLERANCE_S
from codec.cuer.layout import MARKERS, N_FACE, RIGID_FACE, marker_indices
from codec.cuer.models import rigid
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.score import Score
from codec.errors import CueError
from cuecast.evaluate.films import as_rows, film
from cuecast.evaluate.models import cuers_named
from cuecast.evaluate.options import EvaluateOptions
from receiver.drawing.avatar import load_avatar
from receiver.export.arkit import live_link_csv
from receiver.export.markers import marker_csv, trc
from synth.capture.capture import capture_motion
from synth.capture.options import Captured, CaptureOptions
from synth.language.text.sentences import read_sentences
from synth.motion.rules.gesture import GestureSynthesiser
from synth.studio.corpora import Utterance, spoken
from synth.studio.studio import Studio
from synth.studio.take import record
from synth.units.recordings.rendered import line_of

FloatArray = NDArray[np.float64]

_CUERS = ("claire/minimum-jerk", "agathe/minimum-jerk")

_SENTENCES = 6
"""Sentences of a take."""

_FIRST = 190
"""Number of the first one in the built-in list; the voice has not learnt from it."""

_STUDIO_HZ, _CAMERA_HZ, _TELEPHONE_HZ = 120.0, 30.0, 60.0
"""Frames per second of motion capture, of a film, and of a telephone's face tracker."""

_TAIL_S = 1.0
"""Seconds after the last phone: the hand comes to rest."""

_TURN = (-1.57, 0.0, 0.0, 300.0, 900.0, 1200.0)
"""Turn in radians and shift in mm of another laboratory's axes: z up, metres away."""

_FEW = (
    "FH0", "FH1_R", "FH1_L", "NB", "EAR_R", "EAR_L", "LC_R", "LC_L", "UL0", "LL0", "CH0",
    "A00", "A12", "A21", "W1", "W3", "K2", "K3", "K5", "P3",
    *(f"F{finger}{place}" for finger in range(1, 6) for place in "1T"),
)  # fmt: skip
"""Thirty markers: what one studio's patience may be good for."""


_SKULL = marker_indices(RIGID_FACE)


@dataclass(frozen=True, slots=True)
class _Performance:
    """One sentence of one cuer."""

    identity: str
    law: str
    score: Score
    seed: int

    def cuer(self, rate_hz: float) -> GestureSynthesiser:
        return GestureSynthesiser(self.identity, law=self.law, rate_hz=rate_hz, seed=self.seed)

    @property
    def seconds(self) -> float:
        return self.score.phones[-1].end + _TAIL_S


Written = tuple[str, FloatArray]
Source = Callable[[_Performance, Voice, Path], Written]


def _studio(
    performance: _Performance, studio: Studio | None = None
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return the studio's measurements, the points that are no markers, and the truth."""
    take = record(
        performance.cuer(_STUDIO_HZ), performance.score, studio=studio, seed=performance.seed
    )
    return take.observed, take.ghosts, take.truth


def _c3d(performance: _Performance, voice: Voice, folder: Path) -> Written:
    from codec.cuer.c3d import write_c3d

    observed, ghosts, truth = _studio(performance, Studio(swaps_per_s=0.5, ghosts_per_s=0.5))
    write_c3d(folder / "take.c3d", observed, rate_hz=_STUDIO_HZ, ghosts=ghosts)
    return "take.c3d", truth.astype(np.float64)


def _trc(performance: _Performance, voice: Voice, folder: Path) -> Written:
    """Write other axes and metres."""
    observed, _, truth = _studio(performance)
    foreign = 0.001 * rigid.rigid_motion(observed, _TURN)
    (folder / "take.trc").write_text(
        trc(foreign, _STUDIO_HZ, "take").replace("\tmm\t", "\tm\t", 1), encoding="utf-8"
    )
    return "take.trc", truth.astype(np.float64)


def _noisy(performance: _Performance, voice: Voice, folder: Path) -> Written:
    observed, _, truth = _studio(performance, Studio(noise_mm=1.0, dropouts_per_s=0.3))
    times = np.arange(len(observed)) / _STUDIO_HZ
    (folder / "take.csv").write_text(marker_csv(observed, times), encoding="utf-8")
    return "take.csv", truth.astype(np.float64)


def _few(performance: _Performance, voice: Voice, folder: Path) -> Written:
    observed, _, truth = _studio(performance)
    others = np.setdiff1d(np.arange(len(MARKERS)), marker_indices(_FEW))
    observed[:, others] = np.nan
    (folder / "take.trc").write_text(trc(observed, _STUDIO_HZ, "take"), encoding="utf-8")
    return "take.trc", truth.astype(np.float64)


def _landmarks(performance: _Performance, voice: Voice, folder: Path) -> Written:
    face, hand, truth = film(
        performance.cuer(_CAMERA_HZ),
        performance.score,
        seconds=performance.seconds,
        noise_mm=3.0,
        seed=performance.seed,
    )
    (folder / "film.csv").write_text(as_rows(face, hand, _CAMERA_HZ), encoding="utf-8")
    return "film.csv", truth


def _live_link(performance: _Performance, voice: Voice, folder: Path) -> Written:
    cuer = performance.cuer(_TELEPHONE_HZ)
    frames = round(performance.seconds * _TELEPHONE_HZ)
    motion = cuer.motion(performance.score, 0.0, frames, voice)
    text = live_link_csv(motion, voice, load_avatar(voice))
    (folder / "face.csv").write_text(text, encoding="utf-8")
    return "face.csv", voice.reconstruct(motion.params).astype(np.float64)


SOURCES: dict[str, Source] = {
    "c3d-swaps-ghosts": _c3d,
    "trc-metres-z-up": _trc,
    "csv-1mm-noise": _noisy,
    "trc-30-markers": _few,
    "landmarks-3mm": _landmarks,
    "live-link": _live_link,
}
"""Ways that the takes go through, by name; ``--channels`` chooses."""


def evaluate(options: EvaluateOptions) -> list[dict[str, Any]]:
    """Return a row of figures for each cuer and source."""
    names = options.channels or tuple(SOURCES)
    for name in names:
        if name not in SOURCES:
            raise CueError(f"unknown source {name!r}; known: {', '.join(SOURCES)}")
    voice = load_voice()
    rows = []
    for cuer in cuers_named(options.cuers or _CUERS):
        for name in names:
            options.say(f"{cuer} through {name}")
            identity, law = cuer.split("/")
            takes = list(_performances(identity, law))
            rows.append({"cuer": cuer, "source": name, **_measure(takes, name, voice, options)})
    return rows


def _performances(identity: str, law: str) -> Iterator[_Performance]:
    for number, text in enumerate(read_sentences()[_FIRST : _FIRST + _SENTENCES], start=_FIRST):
        utterance = Utterance(f"corpus3/s{number:03d}", text, tuple(line_of(text)), number)
        yield _Performance(identity, law, spoken(utterance)[1], number)


def _measure(
    takes: list[_Performance], source: str, voice: Voice, options: EvaluateOptions
) -> dict[str, Any]:
    keys = right = extra = 0
    errors: list[FloatArray] = []
    residuals: dict[str, list[float]] = {}
    duration_s = spent_s = 0.0
    for take in takes:
        name, truth = SOURCES[source](take, voice, options.folder)
        begun = time.process_time()
        found = capture_motion(options.folder / name, voice, CaptureOptions())
        spent_s += time.process_time() - begun
        duration_s += found.motion.duration_s
        if take.identity == voice.name:
            errors.append(_errors(found, truth, take, source, voice))
        if "keys" in found.report:
            keys += len(take.score.keys)
            good, got = _right(take.score, found.motion)
            right, extra = right + good, extra + got - good
        for part, value in found.report["residual_mm"].items():
            if value is not None:
                residuals.setdefault(_group(part), []).append(value)
    face, hand = np.concatenate(errors).T if errors else (np.array([]), np.array([]))
    if source == "live-link":
        hand = np.array([])
    return {
        "sentences": len(takes),
        "seconds": round(duration_s, 1),
        "face_mm": _mean(face),
        "hand_mm": _mean(hand),
        "residual_face_mm": _mean(residuals.get("face", [])),
        "residual_hand_mm": _mean(residuals.get("hand", [])),
        "keys": keys or None,
        "keys_right": round(right / keys, 4) if keys else None,
        "keys_extra": round(extra / keys, 4) if keys else None,
        "realtime_factor": round(duration_s / max(spent_s, 1e-9), 1),
        "data": f"virtual cuer, sentences {_FIRST + 1} to {_FIRST + _SENTENCES} of the list",
    }


def _group(part: str) -> str:
    return "hand" if part in ("hand", "fingers", "palm", "wrist and forearm") else "face"


def _errors(
    found: Captured, truth: FloatArray, take: _Performance, source: str, voice: Voice
) -> FloatArray:
    """Return the mean distances of face and hand from the truth, frame by frame, (T, 2), mm.

    All in the head's frame: the middle pose of a take is not that of another. Of a film, those in
    the picture's plane.
    """
    rate_hz = {"landmarks-3mm": _CAMERA_HZ, "live-link": _TELEPHONE_HZ}.get(source, _STUDIO_HZ)
    params = found.motion.params
    at = np.round(np.arange(len(params)) / found.motion.rate_hz * rate_hz).astype(int)
    at = at[at < len(truth)]
    ours, true = (
        _in_head(markers, truth[0, _SKULL])
        for markers in (voice.reconstruct(params[: len(at)]).astype(np.float64), truth[at])
    )
    gap = ours - true
    if source.startswith("landmarks"):
        gap = gap[..., :2]
    far = np.linalg.norm(gap, axis=-1)
    return np.stack([far[:, :N_FACE].mean(1), far[:, N_FACE:].mean(1)], axis=1)


def _in_head(markers: FloatArray, skull: FloatArray) -> FloatArray:
    motion, _ = rigid.estimate_motion(skull, markers[:, _SKULL])
    return rigid.inverse_rigid_motion(markers, motion)


def _right(score: Score, motion: Motion) -> tuple[int, int]:
    """Return how many performed keys were recognised at their time, and how many in all."""
    got = list(motion.score.keys) if motion.score else []
    total = len(got)
    right = 0
    for key in score.keys:
        for other in got:
            if (other.shape, other.placement) == (key.shape, key.placement) and (
                abs(other.start - key.start) <= KEY_TOLERANCE_S
            ):
                got.remove(other)
                right += 1
                break
    return right, total


def _mean(values: Any) -> float | None:
    return round(float(np.mean(values)), 3) if len(values) else None
