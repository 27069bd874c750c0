"""The nine hand shapes of French Cued Speech as joint angles.

Which fingers are out follows the published charts (1 index; 2 index and middle together; 3
middle, ring, little; 4 four fingers, thumb in; 5 all; 6 thumb and index; 7 thumb, index, middle;
8 index and middle spread; 0 closed fist, the rest). Sizes of the angles were chosen within the
ranges measured on photographs of cuers (B. Bigi, CNRS, LPL) after removing the bias that open
fingers show there.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from synth.motion.body.skeleton import ANGLE_NUMBER, HAND_ANGLES

FloatArray = NDArray[np.float64]

_FINGERS = ("index", "middle", "ring", "little")
_OUT = {
    0: (), 1: ("index",), 2: ("index", "middle"), 3: ("middle", "ring", "little"),
    4: _FINGERS, 5: _FINGERS, 6: ("index",), 7: ("index", "middle"), 8: ("index", "middle"),
}  # fmt: skip

_STRAIGHT = {"index": (4, 6, 3), "middle": (4, 7, 4), "ring": (6, 8, 5), "little": (8, 9, 5)}
_FOLDED = {
    "index": (72, 92, 42),
    "middle": (76, 95, 42),
    "ring": (76, 94, 40),
    "little": (74, 90, 38),
}
_TOGETHER = {"index": -3.0, "middle": 0.0, "ring": 3.0, "little": 7.0}
_FANNED = {"index": 10.0, "middle": 1.0, "ring": -7.0, "little": -16.0}
_VICTORY = {"index": 15.0, "middle": -9.0}

_THUMB = {"in": (4, 10, -6, 55, 70), "over": (-18, 33, 34, 18, 72), "out": (22, -14, -6, -4, -6)}
"""Abduction, flexion, opposition at the base, then the flexion of the two outer joints."""

_THUMB_OF = {
    0: "over",
    1: "over",
    2: "over",
    3: "in",
    4: "in",
    5: "out",
    6: "out",
    7: "out",
    8: "over",
}


@cache
def shape_angles(shape: int) -> tuple[float, ...]:
    """Return the angles of a hand shape in degrees, as `HAND_ANGLES`; the wrist stays at zero.

    Examples
    --------
    >>> angles = dict(zip(HAND_ANGLES, shape_angles(1)))
    >>> angles["index_pip"], angles["middle_pip"]
    (6.0, 95.0)
    """
    angles = np.zeros(len(HAND_ANGLES))
    out = _OUT[shape]
    spread = {5: _FANNED, 8: _VICTORY}.get(shape, _TOGETHER)
    for finger in _FINGERS:
        values = _STRAIGHT[finger] if finger in out else _FOLDED[finger]
        for joint, value in zip(("mcp", "pip", "dip"), values, strict=True):
            angles[ANGLE_NUMBER[f"{finger}_{joint}"]] = value
        angles[ANGLE_NUMBER[f"{finger}_spread"]] = spread.get(finger, _TOGETHER[finger])
    names = ("thumb_abduction", "thumb_flex", "thumb_opposition", "thumb_mcp", "thumb_ip")
    for name, value in zip(names, _THUMB[_THUMB_OF[shape]], strict=True):
        angles[ANGLE_NUMBER[name]] = value
    return tuple(map(float, angles))


def all_shapes() -> FloatArray:
    """Return the angles of all nine shapes, shape (9, 31), degrees."""
    return np.array([shape_angles(shape) for shape in range(9)])
