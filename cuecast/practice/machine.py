"""The recogniser as a participant: it reads keys off the markers and chooses a word."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.analysis.recognise import Recogniser
from codec.cuer.motion import Motion, sample_params
from codec.cuer.voice import Voice
from codec.cues.score import Score
from synth.motion.rules.movement import plan_gestures


@dataclass(frozen=True, slots=True)
class MachineReading:
    """Sums over words.

    Attributes
    ----------
    keys, shapes, placements : int
        Keys, and those whose shape and placement were recognised.
    words, right : int
        Words, and those chosen rightly.
    """

    keys: int
    shapes: int
    placements: int
    words: int
    right: int

    def __add__(self, other: "MachineReading") -> "MachineReading":
        """Return the sums of both."""
        return MachineReading(
            self.keys + other.keys,
            self.shapes + other.shapes,
            self.placements + other.placements,
            self.words + other.words,
            self.right + other.right,
        )

    def figures(self) -> dict[str, Any]:
        """Return counts and shares."""
        return {
            "words": self.words,
            "word_share": round(self.right / max(self.words, 1), 4),
            "keys": self.keys,
            "shape_share": round(self.shapes / max(self.keys, 1), 4),
            "placement_share": round(self.placements / max(self.keys, 1), 4),
        }


def read_word(
    motion: Motion, said: Score, other: Score, recogniser: Recogniser, voice: Voice
) -> MachineReading:
    """Return how one word is read, given the scores of both words of its pair.

    Both words have the same times; a word with another number of keys is compared over the keys
    that both have.
    """
    gestures = plan_gestures(said)
    markers = voice.reconstruct(sample_params(motion, gestures.reach[1:]))
    shapes = recogniser.shape_posteriors(markers)
    placements = recogniser.placement_posteriors(markers)
    right_shape, right_placement = gestures.shape[1:], gestures.placement[1:]
    wrong = plan_gestures(other)
    both = min(len(shapes), len(wrong.shape) - 1)
    return MachineReading(
        len(shapes),
        int(np.sum(shapes.argmax(1) == right_shape)),
        int(np.sum(placements.argmax(1) == right_placement)),
        1,
        int(
            _likelihood(shapes, placements, right_shape, right_placement, both)
            > _likelihood(shapes, placements, wrong.shape[1:], wrong.placement[1:], both)
        ),
    )


def _likelihood(
    shapes: NDArray[np.float64],
    placements: NDArray[np.float64],
    shape: NDArray[np.integer],
    placement: NDArray[np.integer],
    keys: int,
) -> float:
    at = np.arange(keys)
    found = np.log(shapes[at, shape[:keys]] + 1e-12) + np.log(
        placements[at, placement[:keys]] + 1e-12
    )
    return float(found.sum())
