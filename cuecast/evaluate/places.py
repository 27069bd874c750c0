"""Where cuers point at each placement, and what they pass on the way: the virtual beside the real.

Real cuers (``--clips``) are measured as a reader aligns what they were asked to cue: the tip of the
pointing finger in the slowest frames of each key, against the middle of the mouth, ears
`REAL_EARS_MM` apart. Virtual cuers are measured on their markers when their hand is on target. A
stroke passes a third placement where its tip can be read there (`codec.analysis.passing`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.analysis.passing import PassedPlacement, passed_by
from codec.analysis.readability import Classes
from codec.cuer.layout import MARKER_NUMBER, RIGID_FACE, longest_finger_tip, marker_indices
from codec.cuer.models.rigid import estimate_motion, inverse_rigid_motion
from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENTS, Score
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.readability import programmes
from cuecast.evaluate.reading.reader import INDEX_POINTS, ReaderTake, teach
from cuecast.evaluate.reading.takes import real_takes
from synth.motion.body.reach import REAL_EARS_MM, REAL_MM
from synth.motion.measured.cuer import MEASURED, Performer, performer
from synth.motion.measured.plan import paced as at_real_pace
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.prosody.pacing import READABLE
from synth.planning.prosody.simulation import PerformerChoice
from synth.planning.scoring.text_score import Reading, score_of_subtitles, score_of_text
from synth.studio.recital import sentences

FloatArray = NDArray[np.float64]
Points = dict[str, list[FloatArray]]

CUERS = ("claire/minimum-jerk", "agathe/minimum-jerk", f"solange/{MEASURED}")

_SENTENCES = 24
"""Held-out sentences that each virtual cuer performs."""

_SLOWEST = 3
"""Frames of a real key that count: the slowest."""

_RATE_HZ = 50.0
"""Frames per second at which virtual cuers are looked at."""

_AT_ONCE = 1024
"""Frames that are looked at together."""

_PASSED_IN = 5
"""Programmes that are looked through for placements passed: the first ones of the readability's."""

_RIGID = marker_indices(RIGID_FACE)


def evaluate(options: EvaluateOptions) -> list[dict[str, Any]]:
    """Return a row per cuer and placement, and one per programme with placements passed.

    Parameters
    ----------
    options : EvaluateOptions
        ``clips`` names a folder of real takes; without it only virtual cuers are measured.
        ``cuers`` names virtual cuers as ``identity/law``.

    Raises
    ------
    CueError
        If the folder is of no use, or a cuer unknown.
    """
    rows: list[dict[str, Any]] = []
    if options.clips is not None:
        options.say("real cuers")
        takes = real_takes(options.clips, load_voice())
        rows += _place_rows("real", points_of_takes(takes))
    for name in options.cuers or CUERS:
        options.say(name)
        identity, law = name.split("/")
        scores = [_read(text) for text in sentences(held_out=True)[:_SENTENCES]]
        if law == MEASURED:
            scores = [at_real_pace(score) for score in scores]
        points: Points = {placement: [] for placement in REAL_MM}
        # A cuer of one seed scatters alike in each sentence.
        for seed, score in enumerate(scores, start=options.seed):
            cuer = performer(identity, law, rate_hz=_RATE_HZ, seed=seed)
            for placement, own in points_of(cuer, [score]).items():
                points[placement].extend(own)
        rows += _place_rows(name, points)
    for _, (name, subtitles) in zip(
        range(_PASSED_IN), programmes(replace(options, clips=None)), strict=False
    ):
        options.say(name)
        reading = Reading(pace=READABLE, performing=PerformerChoice(seed=options.seed))
        score = score_of_subtitles(subtitles, reading=reading)
        found = list(passed(GestureSynthesiser(rate_hz=_RATE_HZ, seed=options.seed), score))
        rows.append({"programme": name, "strokes": len(score.keys) + 1, "passed": len(found)})
    return rows


def _read(text: str) -> Score:
    return score_of_text(text, start_s=1.0, reading=Reading(pace=READABLE))


def points_of_takes(takes: Sequence[ReaderTake]) -> Points:
    """Return where a cuer of films points, mm against the mouth, per placement and key."""
    reader = teach(takes)
    points: Points = {placement: [] for placement in REAL_MM}
    for take in takes:
        line = reader.align(take)
        for number, one in enumerate(take.asked):
            at = np.flatnonzero(take.view.shown & (line == 2 * number + 2))
            if len(one.places) > 1 or not len(at):
                continue
            slowest = at[np.argsort(take.view.speed[at, 0])[:_SLOWEST]]
            finger = 0 if one.shape in INDEX_POINTS else 2
            tip = np.median(take.view.tips[slowest, finger : finger + 2], axis=0)
            points[PLACEMENTS[one.places[0]]].append(REAL_EARS_MM * tip)
    return points


def points_of(cuer: Performer, scores: Sequence[Score]) -> Points:
    """Return where a virtual cuer points when she is on target, like `points_of_takes`."""
    rest = cuer.body.face_skin.rest
    at = {name: rest[MARKER_NUMBER[name]] for name in ("LC_R", "LC_L", "EAR_R", "EAR_L")}
    mouth = 0.5 * (at["LC_R"] + at["LC_L"])
    size = REAL_EARS_MM / float(np.linalg.norm(at["EAR_R"] - at["EAR_L"]))
    points: Points = {placement: [] for placement in REAL_MM}
    for score in scores:
        markers = cuer.markers(score, 0.0, int(_RATE_HZ * (score.phones[-1].end + 1.0)))
        motion, _ = estimate_motion(rest[_RIGID], markers[:, _RIGID].astype(np.float64))
        still = inverse_rigid_motion(markers.astype(np.float64), motion)
        for key, reach_s in cuer.target_times(score):
            frame = round(reach_s * _RATE_HZ)
            if key is not None and frame < len(still):
                tip = still[frame, MARKER_NUMBER[longest_finger_tip(key.shape)]]
                points[key.placement].append(size * (tip - mouth)[:2])
    return points


def _place_rows(name: str, points: Points) -> Iterator[dict[str, Any]]:
    for placement, found in points.items():
        if found:
            mean, spread = np.mean(found, axis=0), np.std(found, axis=0)
            yield {
                "cuer": name,
                "placement": placement,
                "keys": len(found),
                "x_mm": round(float(mean[0]), 1),
                "y_mm": round(float(mean[1]), 1),
                "spread_x_mm": round(float(spread[0]), 1),
                "spread_y_mm": round(float(spread[1]), 1),
                "from_real_mm": round(float(np.linalg.norm(mean - REAL_MM[placement])), 1),
            }


def passed(cuer: GestureSynthesiser, score: Score) -> Iterator[PassedPlacement]:
    """Yield the third placements that a virtual cuer passes, in constant memory."""
    gestures, classes = cuer.gestures(score), Classes(cuer.targets()[0])
    frames = int(cuer.rate_hz * (score.phones[-1].end + 1.0))
    for first in range(0, frames, _AT_ONCE):
        count = min(_AT_ONCE, frames - first)
        times = (first + np.arange(count)) / cuer.rate_hz
        yield from passed_by(
            cuer.markers(score, first / cuer.rate_hz, count),
            times,
            classes,
            placement=gestures.placement,
            leave=gestures.leave,
            reach=gestures.reach,
        )


def plot(results: list[dict[str, Any]], figure: Any) -> None:
    """Plot where the cuers point, in the picture's plane."""
    axes = figure.subplots()
    for name in dict.fromkeys(row["cuer"] for row in results if "cuer" in row):
        rows = [row for row in results if row.get("cuer") == name]
        axes.plot([row["x_mm"] for row in rows], [row["y_mm"] for row in rows], "o", label=name)
    for placement, (x, y) in REAL_MM.items():
        axes.annotate(placement, (x, y))
    axes.set_aspect("equal")
    axes.set_xlabel("mm to the cuer's left of the mouth")
    axes.set_ylabel("mm above it")
    axes.legend()
