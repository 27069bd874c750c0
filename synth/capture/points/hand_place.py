"""Where a hand belongs that is recorded alone, as in the first corpus of the paper.

Without a head nothing says where the hand is held; its palm gives its direction, its unit
and whether it is left or right.
"""

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.voice import Voice
from codec.cues.score import PLACEMENT_NUMBER
from codec.errors import CueError
from synth.capture.points.place import (
    Registration,
    distance_ratio,
    hand_error,
    median_body,
    unit_of,
)

FloatArray = NDArray[np.float64]

LEAST_PALM_MARKERS = 4
"""Markers of the palm that give its turn and place: three, and one to doubt them by."""

_PALM = layout.marker_indices((*layout.KNUCKLES, *layout.PALM, *layout.WRIST))

_LIKELY = 5, PLACEMENT_NUMBER["side"]
"""Shape and placement of the voice in whose place such a hand is put."""


def find_hand_place(markers: FloatArray, unit: str, voice: Voice) -> Registration:
    """Return the place of a take of the hand alone: its palm is held at the side, in the middle.

    Parameters
    ----------
    markers, unit, voice
        As for `find_place`.

    Raises
    ------
    CueError
        If too little of the palm is seen, or it has the size of no hand in any unit.
    """
    body, shift = median_body(markers[:, _PALM])
    known = np.isfinite(body).all(-1)
    if known.sum() < LEAST_PALM_MARKERS:
        shown = int(np.isfinite(markers[:, _PALM]).all(-1).any(0).sum())
        raise CueError(
            f"{shown} markers of the palm are seen, {LEAST_PALM_MARKERS} needed at a time where "
            "there is no head"
        )
    rest = _palm(voice)[known]
    ratio = distance_ratio(body[known], rest)
    unit_mm = unit_of(ratio, unit, "hand")
    notes = ("no head is seen: the hand is put beside the voice's, and no key is told",)
    places = []
    # A left hand mirrored and a right one: the better fit of the hand's model decides.
    for left in (False, True):
        flip = np.array([-1.0, 1.0, 1.0]) if left else np.ones(3)
        motion, _ = rigid.estimate_motion(body[known] * unit_mm * flip, rest[None])
        motion = rigid.compose(motion[0], [0.0, 0.0, 0.0, *-shift * unit_mm * flip])
        told = (*notes, "the left hand cues: mirrored") if left else notes
        places.append(Registration(unit_mm, 1.0, False, left, motion, told))
    errors = [hand_error(place.apply(markers)[:, layout.N_FACE :], voice) for place in places]
    return places[int(errors[1] < errors[0])]


def _palm(voice: Voice) -> FloatArray:
    """Return the palm's markers of the voice's open hand at the side, mm."""
    row = np.zeros((1, len(voice.layout)))
    table = voice.gestures
    row[:, voice.hand_columns] = np.concatenate(
        [table.shape_targets[_LIKELY[0]], table.placement_targets[_LIKELY]]
    )
    return np.asarray(voice.reconstruct(row)[0, _PALM], dtype=np.float64)
