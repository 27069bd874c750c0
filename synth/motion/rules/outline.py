"""Strokes and phones that a performance depends on, to find where two performances differ.

A frame depends on the strokes under way, on the target that the hand rests at, and on the phones
nearby. Where these agree in two scores, so do the frames, but for rounding.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.movement import Movement
from synth.motion.rules.coarticulation import REACH_S, PhoneLine

FloatArray = NDArray[np.float64]

_OUT_OF_STEP_S = 0.02
"""Most seconds that one finger is later or earlier than the others."""


@dataclass(frozen=True, slots=True)
class Outline:
    """Strokes and phones of a score, as one cuer performs it.

    Attributes
    ----------
    leave, reach : ndarray, shape (G,)
        When each gesture leaves the target before and reaches its own, seconds.
    targets : ndarray, shape (G, C)
        Target of each gesture, in any units.
    slack_s : float
        Greatest lateness or earliness of a part of the body, against the gesture.
    phones : PhoneLine
    """

    leave: FloatArray
    reach: FloatArray
    targets: FloatArray
    slack_s: float
    phones: PhoneLine

    def differs(
        self, other: "Outline", times: FloatArray, *, face: bool = True
    ) -> NDArray[np.bool_]:
        """Return at which times the performances differ.

        Parameters
        ----------
        other : Outline
            Of the same cuer.
        times : ndarray, shape (T,)
            Ascending, seconds.
        face : bool
            Whether the face counts too, besides head and hand.

        Returns
        -------
        ndarray of bool, shape (T,)
        """
        one, two = self.phones, other.phones
        if self.targets.shape != other.targets.shape or not np.array_equal(one.number, two.number):
            return np.ones(len(times), dtype=np.bool_)
        changed = (self.leave != other.leave) | (self.reach != other.reach)
        changed |= (self.targets != other.targets).any(axis=1)
        # A target is left with the stroke to the next one.
        until = np.append(np.maximum(self.reach, other.reach)[1:], np.inf)
        since = np.minimum(self.leave, other.leave)
        moved = face & ((one.start != two.start) | (one.end != two.end))
        begins = np.append(
            since[changed] - self.slack_s, np.minimum(one.start, two.start)[moved] - REACH_S
        )
        ends = np.append(
            until[changed] + self.slack_s, np.maximum(one.end, two.end)[moved] + REACH_S
        )
        edges = np.zeros(len(times) + 1, dtype=np.int64)
        np.add.at(edges, np.searchsorted(times, begins, side="left"), 1)
        np.add.at(edges, np.searchsorted(times, ends, side="right"), -1)
        return np.asarray(np.cumsum(edges[:-1]) > 0)


def slack_of(movement: Movement) -> float:
    """Return the greatest time between a part of the body and its gesture, seconds."""
    m = movement
    parts = (
        m.fingers_begin_s,
        m.fingers_end_s,
        m.head_begin_s,
        m.head_end_s,
        m.turn_begin_s,
        m.turn_end_s,
    )
    return max(map(abs, parts)) + _OUT_OF_STEP_S
