"""Build a voice: the virtual cuer performs, the models are fitted, the voice file is written.

``python -m lab.voice [--identity claire] [--out spec/data/voices]``
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from codec.cuer.gestures import GestureTable
from codec.cuer.layout import HAND_MARKERS, MARKERS, N_FACE, N_HAND, longest_finger_tip
from codec.cuer.voice import Voice, save_voice
from codec.cues.score import SHAPES, Score
from codec.errors import CueError
from codec.files.data import DATA
from codec.training.fit import TrainingSet, fit_voice
from synth.motion.body.anatomy import IDENTITIES
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.drills import drill, isolated_sounds, shape_transitions

FloatArray = NDArray[Any]

VOICES = DATA / "voices"

_TIP_WEIGHT = 7.0
"""Weight of the pointing fingertip against other markers: it is what touches the face."""


def build_voice(identity: str = "claire", *, law: str = "minimum-jerk", seed: int = 0) -> Voice:
    """Return the voice of a virtual cuer.

    Parameters
    ----------
    identity, law, seed
        As for `synth.motion.rules.gesture.GestureSynthesiser`.

    Raises
    ------
    CueError
        If there is no such cuer or law.
    """
    hand, face, joint = training_sets(identity, law=law, seed=seed)
    voice = fit_voice(identity, hand=hand, face=face, joint=joint)
    return replace(voice, gestures=exact_targets(voice, GestureSynthesiser(identity, law=law)))


def exact_targets(voice: Voice, cuer: GestureSynthesiser) -> GestureTable:
    """Return the gesture table from the cuer's own targets instead of means over held frames.

    The hand parameters of a shape are its mean over the placements where it occurs; the forearm
    is then fitted per placement, with the tip of the pointing finger weighing most.
    """
    keys, visemes = cuer.targets()
    params = voice.invert(keys.reshape(-1, len(MARKERS), 3), rate_hz=1.0).params
    per_key = params.reshape(*keys.shape[:2], -1)
    hand, head = (_columns(voice, part) for part in ("hand", "head"))
    shapes = np.array([per_key[s, _placements(s)][:, hand].mean(axis=0) for s in SHAPES])
    places = np.array(
        [
            [_fit_forearm(voice, per_key[s, p], shapes[s], keys[s, p], s) for p in range(6)]
            for s in SHAPES
        ]
    )
    face = voice.invert(visemes, rate_hz=1.0).params[:, _columns(voice, "face")]
    return GestureTable(shapes, places, face, params[:, head].mean(axis=0))


def _placements(shape: int) -> slice:
    """Return the placements at which a shape occurs: the closed fist rests, the others cue."""
    return slice(0, 1) if shape == 0 else slice(1, None)


def _columns(voice: Voice, part: str) -> list[int]:
    return [i for i, name in enumerate(voice.layout) if name.startswith(f"{part}.")]


def _fit_forearm(
    voice: Voice, start: FloatArray, shape: FloatArray, markers: FloatArray, number: int
) -> FloatArray:
    """Return the forearm parameters that bring the hand in `shape` closest to `markers`."""
    row = np.array(start, dtype=np.float64)
    row[_columns(voice, "hand")] = shape
    forearm = _columns(voice, "forearm")
    weight = np.ones((N_HAND, 1))
    weight[HAND_MARKERS.index(longest_finger_tip(number))] = _TIP_WEIGHT

    def misfit(x: FloatArray) -> FloatArray:
        row[forearm] = x
        found = voice.hand.reconstruct(row[None, voice.hand_columns])[0]
        return np.asarray((weight * (found - markers[N_FACE:])).ravel())

    return np.asarray(least_squares(misfit, row[forearm]).x)


_TAIL_S = 1.5
"""Seconds after the last key: the hand comes to rest."""

_DRILL_LINES = 30
"""Lines of keys in random order."""

_ROUNDS = 4
"""Times that every transition between two shapes occurs."""


def training_sets(
    identity: str = "claire", *, law: str = "minimum-jerk", rate_hz: float = 50.0, seed: int = 0
) -> tuple[TrainingSet, TrainingSet, TrainingSet]:
    """Return hand, face and joint training material (corpora 1, 2 and drill lines).

    Parameters
    ----------
    identity, law, rate_hz, seed
        As for `GestureSynthesiser`.
    """
    free = GestureSynthesiser(identity, law=law, rate_hz=rate_hz, seed=seed, free_space=True)
    cueing = GestureSynthesiser(identity, law=law, rate_hz=rate_hz, seed=seed + 1)
    return (
        perform(free, shape_transitions(rounds=_ROUNDS)),
        perform(cueing, isolated_sounds()),
        perform(cueing, drill(_DRILL_LINES, seed=seed)),
    )


def perform(cuer: GestureSynthesiser, score: Score) -> TrainingSet:
    """Return all frames of `score` performed by `cuer`, labelled where a target is held."""
    end = max([0.0, *(p.end for p in score.phones), *(k.end for k in score.keys)]) + _TAIL_S
    n_frames = int(np.ceil(end * cuer.rate_hz))
    labels = cuer.labels(score, 0.0, n_frames)

    def numbers(line: NDArray[np.int8]) -> NDArray[np.int64]:
        return line.astype(np.int64)

    return TrainingSet(
        cuer.markers(score, 0.0, n_frames),
        numbers(labels.shape),
        numbers(labels.placement),
        numbers(labels.phone),
    )


def main(arguments: list[str] | None = None) -> int:
    """Run the script."""
    parser = argparse.ArgumentParser(prog="lab.voice", description=__doc__)
    parser.add_argument("--identity", default="claire", help=f"one of {', '.join(IDENTITIES)}")
    parser.add_argument("--out", type=Path, default=VOICES, help="folder of the voice file")
    options = parser.parse_args(arguments)
    try:
        voice = build_voice(options.identity)
    except CueError as error:
        print(f"lab.voice: {error}", file=sys.stderr)
        return 2
    options.out.mkdir(parents=True, exist_ok=True)
    save_voice(voice, options.out / f"{options.identity}.npz")
    print(voice.identity)
    return 0


if __name__ == "__main__":
    sys.exit(main())
