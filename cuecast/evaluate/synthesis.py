"""How well the concatenated cuer cues: recognised keys, phasing, speed, on held-out sentences.

The recogniser learns the targets of the recordings; the sentences synthesised are those of the
list that were not recorded. Data: the virtual cuer. Source: Gibert, Bailly, Elisei 2004,
sections 4 (recogniser) and 5.1 (the check of the synthesis by it).
"""

import itertools
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.analysis.phases import extents, strokes
from codec.analysis.recognise import Recogniser, fit_recogniser
from codec.cuer.layout import MARKER_NUMBER
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.score import Key, Score
from cuecast.dubbing.performance import unit_synthesiser
from cuecast.evaluate.methods import compare_methods
from cuecast.evaluate.options import EvaluateOptions
from synth.language.text.sentences import read_sentences
from synth.motion.rules.gesture import GestureSynthesiser
from synth.motion.rules.movement import Gestures, plan_gestures
from synth.planning.scoring.text_score import score_of_text
from synth.units.concatenation.units import cut_dikeys
from synth.units.recordings.recording import UnitRecording
from synth.units.recordings.sentences import choose_sentences

ALIGNMENT = "paper"

_COMPARED = 24
"""Sentences that compare rules and units."""

_SPEED_PERCENTILE = 99.9
"""Percentile of recorded speeds that joins are held against."""


def evaluate(options: EvaluateOptions) -> dict[str, Any]:
    """Synthesise sentences that were not recorded and recognise their keys.

    Parameters
    ----------
    options : EvaluateOptions
        ``clips`` may name a folder whose text files hold other sentences.
    """
    voice = load_voice()
    options.say("reading the recordings, or making them on first use")
    synthesiser = unit_synthesiser(voice)
    recogniser = learn(synthesiser.recordings, voice)
    texts = held_out_sentences(options)
    options.say(f"synthesising {len(texts)} sentences")
    scores = [score_of_text(text, start_s=1.5) for text in texts]
    started = time.process_time()
    made = [list(synthesiser.perform([score])) for score in scores]
    spent_s = time.process_time() - started
    motions = [part.motion for parts in made for part in parts]
    spoken_s = sum(motion.duration_s for motion in motions)
    shape, placement = recognised(motions, recogniser, voice)
    labels = [unit.label for score in scores for unit in cut_dikeys(_gestures(score))]
    missing = [label not in synthesiser.dikeys.names for label in labels]
    return {
        "shape_accuracy": _share(shape),
        "placement_accuracy": _share(placement),
        **phase_errors(motions, voice, recogniser),
        "realtime_factor": round(spoken_s / spent_s, 1),
        "keys": len(shape),
        "sentences": len(texts),
        "missing_dikeys": _share(np.array(missing)),
        "joins_too_fast": joins_too_fast(motions, synthesiser.recordings, voice),
        **head_ratios(motions, synthesiser.recordings, voice),
        "methods": compare_methods(texts[:_COMPARED], synthesiser.recordings, recogniser, voice),
        "data": f"virtual cuer {voice.name}, {len(synthesiser.recordings)} recordings",
    }


def held_out_sentences(options: EvaluateOptions) -> list[str]:
    """Return the sentences of the list, or of a folder's text files, that were not recorded."""
    listed = read_sentences()
    chosen = set(choose_sentences(listed)[0])
    if options.clips is not None:
        listed = [s for path in sorted(options.clips.glob("*.txt")) for s in read_sentences(path)]
    return [text for text in listed if text not in chosen]


def learn(recordings: Sequence[UnitRecording], voice: Voice) -> Recogniser:
    """Return a recogniser of the targets of `recordings`."""
    frames, shapes, placements = [], [], []
    for recording in recordings:
        g = recording.gestures
        at = _frame(recording.motion, g.reach[1:])
        frames.append(voice.reconstruct(recording.motion.params[at]))
        shapes.append(g.shape[1:])
        placements.append(g.placement[1:])
    return fit_recogniser(
        np.concatenate(frames), np.concatenate(shapes), np.concatenate(placements)
    )


def recognised(
    motions: Sequence[Motion], recogniser: Recogniser, voice: Voice
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return for every key whether its shape, and its placement, is recognised at its target."""
    shape, placement = [], []
    for motion in motions:
        gestures = _gestures(_score(motion))
        at = _frame(motion, gestures.reach[1:])
        markers = voice.reconstruct(motion.params[at])
        shape.append(recogniser.shape_posteriors(markers).argmax(1) == gestures.shape[1:])
        found = recogniser.placement_posteriors(markers).argmax(1)
        placement.append(found == gestures.placement[1:])
    return np.concatenate(shape), np.concatenate(placement)


def phase_errors(
    motions: Sequence[Motion], voice: Voice, recogniser: Recogniser
) -> dict[str, float | None]:
    """Return how far the hand's arrivals lie from those of the rule: median, 90th percentile, ms.

    Arrivals are measured alike on the synthesis and on the cuer who follows the rule, to a frame:
    at placements where the hand stops, for shapes where they begin to be recognised. A key that
    repeats the placement or shape before it has no arrival.
    """
    cuer = GestureSynthesiser(voice.name, alignment=ALIGNMENT)
    errors: dict[str, list[float]] = {"phase_error": [], "shape_phase_error": []}
    for motion in motions:
        score = _score(motion)
        rule = _arrivals(
            cuer.markers(score, motion.start_s, len(motion.params)), motion, recogniser
        )
        made = _arrivals(voice.reconstruct(motion.params), motion, recogniser)
        for name, found in made.items():
            errors[name] += [abs(at - rule[name][k]) for k, at in found.items() if k in rule[name]]
    result: dict[str, float | None] = {}
    for name, values in errors.items():
        middle, high = 1000 * np.percentile(values, (50, 90)) if values else (None, None)
        result[f"{name}_ms"] = None if middle is None else round(float(middle), 1)
        result[f"{name}_p90_ms"] = None if high is None else round(float(high), 1)
    return result


def _arrivals(
    markers: NDArray[np.float32], motion: Motion, recogniser: Recogniser
) -> dict[str, dict[Key, float]]:
    """Return when the hand arrives at the placements and shapes of its keys, seconds."""
    score, rate_hz, start_s = _score(motion), motion.rate_hz, motion.start_s
    gestures = _gestures(score)
    kept = itertools.pairwise(gestures.placement)
    moved = [now != before for before, now in kept if now]
    moving = {key for key, moves in zip(score.keys, moved, strict=True) if moves}
    posteriors = recogniser.shape_posteriors(markers)
    shapes = extents(posteriors, score, rate_hz=rate_hz, start_s=start_s)
    placements = strokes(markers, score, rate_hz=rate_hz, start_s=start_s)
    return {
        "phase_error": {s.key: s.end_s for s in placements if s.key in moving},
        "shape_phase_error": {s.key: s.start_s for s in shapes},
    }


def head_ratios(
    motions: Sequence[Motion], recordings: Sequence[UnitRecording], voice: Voice
) -> dict[str, float]:
    """Return how far and how fast the head moves, against the recordings.

    Extent is the 99th percentile of the nose's distance from its median, speed the 99.9th
    percentile of its speed.
    """
    nose = MARKER_NUMBER["NB"]

    def figures(moving: Sequence[Motion]) -> NDArray[np.float64]:
        paths = [voice.reconstruct(m.params)[:, nose].astype(np.float64) for m in moving]
        away = np.concatenate(paths)
        away = np.linalg.norm(away - np.median(away, axis=0), axis=1)
        steps = [np.linalg.norm(np.diff(p, axis=0), axis=1) * moving[0].rate_hz for p in paths]
        speed = np.percentile(np.concatenate(steps), _SPEED_PERCENTILE)
        return np.array([np.percentile(away, 99), speed])

    extent, speed = figures(motions) / figures([r.motion for r in recordings])
    return {
        "head_extent_ratio": round(float(extent), 3),
        "head_speed_ratio": round(float(speed), 3),
    }


def joins_too_fast(
    motions: Sequence[Motion], recordings: Sequence[UnitRecording], voice: Voice
) -> float:
    """Return the share of joins at which a marker exceeds the recordings' 99.9th percentile."""
    recorded = np.concatenate([_speeds(r.motion, voice).ravel() for r in recordings])
    limit = float(np.percentile(recorded, _SPEED_PERCENTILE))
    fast = []
    for motion in motions:
        speed = _speeds(motion, voice)
        at = np.minimum(_frame(motion, _gestures(_score(motion)).reach[1:]), len(speed) - 1)
        fast.append(np.maximum(speed[at].max(axis=1), speed[np.maximum(at - 1, 0)].max(axis=1)))
    return _share(np.concatenate(fast) > limit)


def _speeds(motion: Motion, voice: Voice) -> NDArray[np.float32]:
    """Return the speed of every marker between frames, mm/s, shape (T - 1, 113)."""
    step = np.diff(voice.reconstruct(motion.params), axis=0) * np.float32(motion.rate_hz)
    return np.asarray(np.linalg.norm(step, axis=2), dtype=np.float32)


def _score(motion: Motion) -> Score:
    assert motion.score is not None
    return motion.score


def _gestures(score: Score) -> Gestures:
    return plan_gestures(score, alignment=ALIGNMENT)


def _frame(motion: Motion, time_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the number of the frame nearest to each time."""
    frame = np.rint((time_s - motion.start_s) * motion.rate_hz).astype(np.int64)
    return np.clip(frame, 0, len(motion.params) - 1)


def _share(hits: NDArray[np.bool_]) -> float:
    return round(float(np.mean(hits)), 4)
