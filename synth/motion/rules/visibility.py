"""Visibility of a hand from the times of its keys alone: how long each, and how fast it is.

A model of the virtual cuer that is quick enough to plan with: the wrist goes from target to target,
the turn of the hand and the shape of the fingers blend on courses of their own; a key is seen while
the pointing tip is nearer to its placement than to any other and the fingers to its shape. Drift,
scatter and the head are left out. `codec.analysis.readability` measures the same on markers.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from codec.analysis.readability import Classes, classes_of
from codec.compiled import lightly
from codec.cuer import layout
from codec.cuer.models.face import N_FACE_PARAMETERS
from codec.cuer.movement import FLOWING, Movement
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS
from codec.cues.score import PLACEMENTS, SHAPES
from synth.motion.rules import _kernels
from synth.motion.rules.gesture import GestureSynthesiser
from synth.motion.rules.movement import FEW, LONG_AGO_S, stroke_rule

FloatArray = NDArray[np.float64]

N_PLACEMENTS = len(PLACEMENTS)

_KEY_S = 0.0015
"""Seconds that the kernel takes per key as Python."""

_STEP_S = 0.02
"""Seconds between the moments that are looked at."""

CLEAR_MM = np.array([8.0, 1.0])
"""By how many mm a place and a shape have to be nearer than any other to be seen for certain."""

_PALM = layout.marker_indices(layout.PALM)
_TIPS = layout.marker_indices([layout.longest_finger_tip(shape) for shape in SHAPES])
_KNUCKLES = layout.marker_indices(layout.KNUCKLES[1:])

_WRIST_ANGLES = 3
"""Angles of the hand that are the wrist's and the forearm's; the fingers' follow."""


@dataclass(frozen=True, slots=True)
class VisibilityModel:
    """A cuer's hand, as far as its visibility needs it.

    Attributes
    ----------
    movement : Movement
    place : ndarray, shape (54, 3)
        Wrist of each key (6 shape + placement), mm.
    tip : ndarray, shape (9, 54, 3)
        From the wrist to the tip that a shape points with, the hand turned as for each key, mm.
    knuckle : ndarray, shape (54, K, 3)
        From the wrist to the knuckles, mm.
    goal : ndarray, shape (9, 6, 3)
        Where the tip is for each key, mm.
    gram : ndarray, shape (9, 9)
        Inner products of the shapes, mean over the fingers' markers, square mm.
    arc : ndarray, shape (54, 54, 3)
        How far the middle of a stroke from key to key lies off the straight way, per mm of way.
    """

    movement: Movement
    place: FloatArray
    tip: FloatArray
    knuckle: FloatArray
    goal: FloatArray
    gram: FloatArray
    arc: FloatArray

    @classmethod
    def of(cls, cuer: GestureSynthesiser, movement: Movement = FLOWING) -> "VisibilityModel":
        """Return the model of a virtual cuer's hand."""
        angles, forearm = cuer.key_poses()
        wrist = forearm[:, 3:]
        first = len(layout.MARKERS) - layout.N_HAND
        tip = [
            cuer.body.hand(_bent(angles, shape), forearm)[:, at - first] - wrist
            for shape, at in zip(SHAPES, _TIPS, strict=True)
        ]
        knuckle = cuer.body.hand(angles, forearm)[:, _KNUCKLES - first] - wrist[:, None]
        classes = Classes(cuer.targets()[0])
        return cls._from(movement, wrist, np.array(tip), knuckle, classes, cuer.arcs)

    @classmethod
    def of_voice(cls, voice: Voice) -> "VisibilityModel":
        """Return the model of the hand of a voice without a body, from its targets.

        Its wrist turns with its place, and its ways are straight (`synth.motion.rules.bodiless`).
        """
        table, n = voice.gestures, len(SHAPES) * N_PLACEMENTS
        places = table.placement_targets.reshape(n, -1)

        def markers(shapes: NDArray[np.floating]) -> FloatArray:
            rows = np.zeros((n, len(voice.layout)), dtype=np.float32)
            rows[:, voice.hand_columns] = np.concatenate([shapes, places], axis=1)
            rows[:, voice.face_columns[N_FACE_PARAMETERS:]] = table.neutral_head
            return voice.reconstruct(rows).astype(np.float64)

        # Every shape at every place: palm by key; fingertip and knuckles relative to it.
        own = markers(np.repeat(table.shape_targets, N_PLACEMENTS, axis=0))
        palm = own[:, _PALM].mean(axis=1)
        tip = np.array(
            [
                markers(np.repeat(table.shape_targets[[shape]], n, axis=0))[:, at] - palm
                for shape, at in zip(SHAPES, _TIPS, strict=True)
            ]
        )
        still = replace(FLOWING, turn_begin_s=0.0, turn_end_s=0.0)
        knuckle = own[:, _KNUCKLES] - palm[:, None]
        return cls._from(still, palm, tip, knuckle, classes_of(voice), np.zeros((n, n, 3)))

    @classmethod
    def _from(
        cls,
        movement: Movement,
        place: FloatArray,
        tip: FloatArray,
        knuckle: FloatArray,
        classes: Classes,
        arc: FloatArray,
    ) -> "VisibilityModel":
        fingers = classes.fingers.reshape(len(SHAPES), -1)
        gram = fingers @ fingers.T / classes.fingers.shape[1]
        whole = map(np.ascontiguousarray, (place, tip, knuckle, classes.tips, gram, arc))
        return cls(movement, *whole)

    def look(
        self,
        start: FloatArray,
        end: FloatArray,
        target: FloatArray,
        key: NDArray[np.int64],
        *,
        rest_gap_s: float = DEFAULT_OPTIONS.rest_gap_s,
        asked: tuple[int, int] | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return how long each key is seen, and how fast the knuckles are on the way to it.

        Parameters
        ----------
        start, end, target : ndarray, shape (N,)
            When each key sounds, and when the hand should be there, seconds.
        key : ndarray of int, shape (N,)
            Key numbers, 6 shape + placement.
        rest_gap_s : float
            Longer gaps send the hand to rest.
        asked : (int, int), optional
            First key to look at and the one after the last, at least one; default: all. The
            others' results are of no use.

        Returns
        -------
        held : ndarray, shape (N,)
            Seconds; keys that repeat their neighbour share their time.
        peak : ndarray, shape (N,)
            Greatest speed, m/s.
        """
        held, peak = np.empty(len(key)), np.empty(len(key))
        if not len(key):
            return held, peak
        m = self.movement
        first, until = asked or (0, len(key))
        kernel = _kernels.line_seen_into
        (lightly(kernel, _KEY_S * len(key)) if len(key) <= FEW else kernel)(
            start, end, target, key, rest_gap_s, stroke_rule(m), LONG_AGO_S, _STEP_S,
            _lateness(m), max(m.stroke_s, 1e-9), m.power, self.arc, self.place, self.tip,
            self.knuckle, self.goal, self.gram, CLEAR_MM, first, until, held, peak,
        )  # fmt: skip
        return held, peak / 1000.0


@cache
def _lateness(movement: Movement) -> FloatArray:
    """Return how much later than the place the turn begins and ends, then the fingers, seconds."""
    m = movement
    return np.array([m.turn_begin_s, m.turn_end_s, m.fingers_begin_s, m.fingers_end_s])


def _bent(angles: FloatArray, shape: int) -> FloatArray:
    """Return angles whose fingers are those of a shape, wrist and forearm as they were."""
    bent = angles.copy()
    bent[:, _WRIST_ANGLES:] = angles[shape * N_PLACEMENTS, _WRIST_ANGLES:]
    return bent
