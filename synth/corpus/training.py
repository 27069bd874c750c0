"""Training frames of a voice: the virtual cuer performs the corpora, with labels."""

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import Score
from codec.training.fit import TrainingSet
from synth.corpus.scores import drill, isolated_sounds, shape_transitions
from synth.gesture import GestureSynthesiser

_TAIL_S = 1.5
_DRILL_LINES = 30
_ROUNDS = 4


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
        numbers(labels.shape), numbers(labels.placement), numbers(labels.phone),
    )  # fmt: skip
