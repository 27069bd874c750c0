"""The gesture table: where the parameters of a cuer go for each shape, placement and phone.

A receiver that knows only the score turns it into motion by moving from target to target
(`codec.superframe.resynthesis`); the table is part of the voice.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.language import Language
from codec.cues.score import SHAPES
from codec.errors import CueError

N_SHAPES = len(SHAPES)


@dataclass(frozen=True, slots=True)
class GestureTable:
    """Targets in the parameters of one voice.

    Attributes
    ----------
    shape_targets : ndarray of float32, shape (9, 12)
        Hand parameters of each shape; sizes are those of French.
    placement_targets : ndarray of float32, shape (9, 6, nmH)
        Forearm parameters of each shape at each placement of the language, head at
        rest: the arm reaches so that the pointing finger is there.
    viseme_targets : ndarray of float32, shape (38, 7)
        Face parameters of each phone of the language.
    neutral_head : ndarray of float32, shape (nmF,)
        Head parameters of a head at rest.

    Examples
    --------
    >>> from codec import load_voice
    >>> table = load_voice("claire").gestures
    >>> table.shape_targets.shape, table.placement_targets.shape[:2]
    ((9, 12), (9, 6))
    """

    shape_targets: NDArray[np.float32]
    placement_targets: NDArray[np.float32]
    viseme_targets: NDArray[np.float32]
    neutral_head: NDArray[np.float32]

    def __post_init__(self) -> None:
        n_forearm = self.placement_targets.shape[-1] if self.placement_targets.ndim else 0
        expected: dict[str, tuple[int, ...]] = {
            "shape_targets": (len(self.shape_targets), 12),
            "placement_targets": (*self._keys(), n_forearm),
            "viseme_targets": (len(self.viseme_targets), 7),
            "neutral_head": (self.neutral_head.size,),
        }
        for name, shape in expected.items():
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float32)
            if array.shape != shape or not np.isfinite(array).all():
                raise CueError(f"gesture table: {name} has shape {array.shape}, expected {shape}")
            object.__setattr__(self, name, array)

    def _keys(self) -> tuple[int, int]:
        """Return how many shapes, and how many placements there are."""
        placements = self.placement_targets.shape[1] if self.placement_targets.ndim > 1 else 0
        return len(self.shape_targets), placements

    def check(self, language: Language) -> None:
        """Check that there are as many targets as the language has.

        Raises
        ------
        CueError
            If there are more or fewer.
        """
        found = *self._keys(), len(self.viseme_targets)
        wanted = language.n_shapes, language.n_placements, language.n_phones
        if found != wanted:
            raise CueError(
                "gesture table of {} shapes, {} placements and {} phones; ".format(*found)
                + "{} has {}, {} and {}".format(language.name, *wanted)
            )
