"""Where the landmarks of image trackers lie among our markers.

The 21 landmarks of a hand are joints and finger ends inside it, our markers stand on its skin: each
landmark is a weighted mean of markers of its digit and of the palm, by least squares on the virtual
cuer's own joints while she cues. The landmarks of a face are numbered as in MediaPipe's face mesh;
those that lie at or between our markers are listed. How far a landmark lies beside them is measured
on each take.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from synth.motion.body.body import load_body
from synth.motion.body.skeleton import ARM_BONES, FINGER_BONES
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.drills import drill

FloatArray = NDArray[np.float64]

N_HAND_LANDMARKS = 21
"""Landmarks of a hand, as MediaPipe numbers them."""

MOST_FACE_LANDMARKS = 478
"""Landmarks of a face, those of the irises among them."""

_LESSON_HZ, _LESSON_FRAMES = 12.5, 500
"""Frames per second and number of the performance that the map is learnt from."""

_RIDGE_MM2 = 0.5
"""Weight of the ridge in mm2."""

_SUM_WEIGHT = 1e4
"""Weight of the equation that a landmark's weights sum to one: in effect infinite."""


def _both(right: int, left: int, *stems: str) -> dict[int, tuple[str, ...]]:
    """Return the entries of two landmarks that mirror each other."""
    return {
        number: tuple(stem if stem in layout.MARKERS else f"{stem}_{side}" for stem in stems)
        for number, side in ((right, "R"), (left, "L"))
    }


FIRM_LANDMARKS = {
    10: ("FH0",), 151: ("FH0",), 9: ("FH0", "NB"), 8: ("NB",), 168: ("NB",), 6: ("NB",),
    197: ("NB", "NW_R", "NW_L"), 195: ("NB", "NW_R", "NW_L"), 5: ("NW_R", "NW_L"),
    4: ("NW_R", "NW_L"), 1: ("NW_R", "NW_L"), 2: ("NW_R", "NW_L"),
    **_both(234, 454, "EAR"), **_both(127, 356, "EAR"), **_both(109, 338, "FH1"),
    **_both(67, 297, "FH1"), **_both(103, 332, "FH2"), **_both(54, 284, "FH2"),
    **_both(33, 263, "FH2", "NW"), **_both(133, 362, "NB", "NW"),
    **_both(49, 279, "NW"), **_both(48, 278, "NW"), **_both(64, 294, "NW"),
}  # fmt: skip
"""Landmarks that move with the skull, and the markers whose mean is nearest."""

SOFT_LANDMARKS = {
    0: ("UL0",), **_both(37, 267, "UL0", "UL1"), **_both(39, 269, "UL1"),
    **_both(40, 270, "UL1", "UL2"), **_both(185, 409, "UL2", "LC"), **_both(61, 291, "LC"),
    17: ("LL0",), **_both(84, 314, "LL0", "LL1"), **_both(181, 405, "LL1"),
    **_both(91, 321, "LL1", "LL2"), **_both(146, 375, "LL2", "LC"),
    200: ("CH1",), 199: ("CH0",), 175: ("CH0", "CH2"), 152: ("CH2",), 18: ("LL0", "CH1"),
    **_both(214, 434, "JW2"), **_both(172, 397, "JW0"), **_both(136, 365, "JW1"),
    **_both(150, 379, "JW2"), **_both(149, 378, "JW2"),
    **_both(50, 280, "CK1", "CK2"), **_both(205, 425, "CK1", "CK3"), **_both(187, 411, "CK0"),
    **_both(105, 334, "BRW"), **_both(66, 296, "BRW"), **_both(92, 322, "NL1"),
}  # fmt: skip
"""Landmarks that move with lips, jaw and cheeks."""

FACE_LANDMARKS = tuple({**FIRM_LANDMARKS, **SOFT_LANDMARKS})
"""Numbers of the landmarks of the face that are used."""

WIDTH_LANDMARKS = ((234, 454), (127, 356), (54, 284), (61, 291))
"""Pairs that give the size of the face, best first."""


@dataclass(frozen=True, slots=True)
class LandmarkMap:
    """Landmarks as weighted means of markers.

    Attributes
    ----------
    weights : ndarray of float64, shape (L, K)
        Rows sum to 1; K is 63 for the face, 50 for the hand.
    firm : ndarray of bool, shape (L,)
        Landmarks that move with the skull, or none of the hand's.
    """

    weights: FloatArray
    firm: NDArray[np.bool_]


@cache
def face_map() -> LandmarkMap:
    """Return the map of `FACE_LANDMARKS`."""
    weights = np.zeros((len(FACE_LANDMARKS), layout.N_FACE))
    every = {**FIRM_LANDMARKS, **SOFT_LANDMARKS}
    for row, number in enumerate(FACE_LANDMARKS):
        for name in every[number]:
            weights[row, layout.FACE_MARKERS.index(name)] = 1.0 / len(every[number])
    return LandmarkMap(weights, np.array([n in FIRM_LANDMARKS for n in FACE_LANDMARKS]))


@cache
def hand_map() -> LandmarkMap:
    """Return the map of the 21 landmarks of a hand."""
    joints, markers = lesson()
    weights = np.zeros((N_HAND_LANDMARKS, layout.N_HAND))
    for number in range(N_HAND_LANDMARKS):
        own = near_markers(number)
        x = markers[:, own].transpose(0, 2, 1).reshape(-1, len(own))
        y = joints[:, number].reshape(-1)
        system = np.vstack(
            [
                x / np.sqrt(len(x)),
                np.sqrt(_RIDGE_MM2) * np.eye(len(own)),
                _SUM_WEIGHT * np.ones((1, len(own))),
            ]
        )
        target = np.concatenate([y / np.sqrt(len(x)), np.zeros(len(own)), [_SUM_WEIGHT]])
        weights[number, own] = np.linalg.lstsq(system, target)[0]
    return LandmarkMap(weights, np.zeros(N_HAND_LANDMARKS, dtype=bool))


def near_markers(number: int) -> NDArray[np.intp]:
    """Return the markers that carry a landmark of the hand."""
    palm = (*layout.KNUCKLES[1:], *layout.PALM)
    if number == 0:
        names = (*layout.WRIST, *palm)
    else:
        digit = (number - 1) // 4 + 1
        names = (*layout.FINGERS[digit - 1], f"S{digit}", f"K{digit}", *palm)
    return np.array([layout.HAND_MARKERS.index(name) for name in dict.fromkeys(names)])


@cache
def lesson() -> tuple[FloatArray, FloatArray]:
    """Return joints (T, 21, 3) and markers (T, 50, 3) of the virtual cuer cueing nonsense."""
    cuer = GestureSynthesiser("claire", rate_hz=_LESSON_HZ)
    pose = cuer.pose(drill(8), 0.0, _LESSON_FRAMES)
    return joints_of(pose.angles, pose.forearm), cuer.body.hand(pose.angles, pose.forearm)


def joints_of(angles: FloatArray, forearm: FloatArray, identity: str = "claire") -> FloatArray:
    """Return the 21 landmarks of a hand in some poses of a virtual cuer, shape (T, 21, 3), mm.

    Wrist; then four of each digit from its root to its end, thumb first.
    """
    body = load_body(identity)
    turns, places = body.arm_bones(angles, forearm)
    out = [places[:, ARM_BONES.index("wrist")]]
    for bones in FINGER_BONES:
        numbers = [ARM_BONES.index(bone) for bone in bones]
        out += [places[:, number] for number in numbers]
        last = numbers[-1]
        out.append(places[:, last] + turns[:, last, :, 1] * body.arm_lengths[last])
    return np.stack(out, axis=1)
