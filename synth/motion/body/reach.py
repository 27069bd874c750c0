"""Where the hand goes: placements relative to the head, and the arm that reaches them.

A placement is a point of the head's frame at rest. For every placement the solver finds one
posture of forearm and wrist, with the back of the hand to the viewer, the fingers up and towards
the face, the elbow at the end of the upper arm, and the skin of the widest hand outside the head;
every hand shape then shifts the wrist so that the tip of its pointing finger is on the point.

Target distances follow measurements of two French cuers' fingertips (mouth corner (-39, +9) mm
from the mouth's centre, chin (-15, +42), cheekbone (-61, -30), throat (-22, +118), side
(-133, -19); y down) moved to the landmarks of this face.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from codec.cuer.layout import HAND_MARKERS, longest_finger_tip
from codec.cues.score import PLACEMENTS
from synth.motion.body.body import Body
from synth.motion.body.shapes import shape_angles
from synth.motion.body.skeleton import ANGLE_NUMBER

FloatArray = NDArray[np.float64]

_OFFSETS = {
    "side": ("mouth_corner", (-84.0, 16.0, 6.0)),
    "mouth": ("mouth_corner", (-9.0, -4.0, 9.0)),
    "chin": ("chin", (-12.0, -6.0, 10.0)),
    "cheek": ("cheekbone", (-6.0, 5.0, 11.0)),
    "throat": ("larynx", (-12.0, 8.0, 16.0)),
    "rest": ("chin", (-95.0, -200.0, 55.0)),
}
"""Landmark and offset from it, mm, of the pointing finger's tip marker."""

_SLOPE_EXTRA_DEG = {"cheek": 6.0, "throat": -14.0, "chin": -4.0, "rest": -22.0, "side": 12.0}
_WRIST = ("wrist_flex", "wrist_deviation", "forearm_twist")
_WRIST_COLUMNS = [ANGLE_NUMBER[name] for name in _WRIST]

_CLEARANCE_MM = 5.0
"""Distance in mm that the hand's skin keeps from the head's."""

_WIDEST_SHAPE = 5
"""The open hand: who reaches a place with it reaches it with every shape."""

_EASY_WRIST_DEG = np.array([5.0, 0.0, 0.0])
"""Angles in degrees at which a wrist is at ease: slightly bent back."""


def placement_target(body: Body, placement: str) -> FloatArray:
    """Return the point of the resting head, shape (3,), mm, that the finger tip goes to."""
    landmark, offset = _OFFSETS[placement]
    shift = body.habits.placement_shift_mm.get(placement, (0.0, 0.0, 0.0))
    return np.asarray(body.landmarks[landmark] + np.array(offset) + np.array(shift))


def solve_reach(body: Body) -> tuple[FloatArray, FloatArray]:
    """Solve all shapes and placements.

    Returns
    -------
    wrist : ndarray, shape (9, 6, 3)
        Wrist flexion, deviation and forearm twist, degrees.
    forearm : ndarray, shape (9, 6, 6)
        Rotation vector, rad, and position of the wrist joint, mm.
    """
    wrist = np.empty((9, len(PLACEMENTS), 3))
    forearm = np.empty((9, len(PLACEMENTS), 6))
    for number, placement in enumerate(PLACEMENTS):
        posture = _solve(body, 0 if placement == "rest" else _WIDEST_SHAPE, placement)
        for shape in range(9):
            x = _moved_to_target(body, shape, posture, placement)
            wrist[shape, number], forearm[shape, number] = x[:3], x[3:]
    return wrist, forearm


def _solve(body: Body, shape: int, placement: str) -> FloatArray:
    target = placement_target(body, placement)
    tip = HAND_MARKERS.index(longest_finger_tip(shape))
    angles = np.array(shape_angles(shape))
    along, dorsal = _wanted_axes(body, placement)
    arm = body.arm
    forearm_mm = float(np.linalg.norm(arm.origins[2] - arm.origins[0]))
    shoulder = body.landmarks["shoulder"]
    skull = np.array([0.0, -8.0, 25.0]), np.array([72.0, 112.0, 88.0])

    def residuals(x: FloatArray) -> FloatArray:
        angles[_WRIST_COLUMNS] = x[:3]
        turns, _ = body.arm_bones(angles[None], x[None, 3:])
        points = body.hand(angles[None], x[None, 3:])[0]
        hand, forearm = turns[0, 2], turns[0, 1]
        elbow = x[6:] - forearm_mm * forearm[:, 1]
        reach = np.linalg.norm(elbow - shoulder) - body.anatomy.upper_arm_mm
        inside = 1.0 - np.linalg.norm((points - skull[0]) / (skull[1] + _CLEARANCE_MM), axis=1)
        inside[tip] = 0.0
        return np.concatenate(
            [
                points[tip] - target,
                9.0 * (hand[:, 1] - along),
                9.0 * (hand[:, 2] - dorsal),
                6.0 * (forearm[:, 1] - along)[:2],
                (x[:3] - _EASY_WRIST_DEG) * 0.5,
                [0.12 * reach, 0.04 * max(0.0, elbow[1] - shoulder[1] + 60.0)],
                40.0 * np.maximum(inside, 0.0),
            ]
        )

    start = np.concatenate([np.zeros(6), target - 180.0 * along])
    solution = least_squares(
        residuals, start, x_scale=np.array([10.0] * 3 + [0.2] * 3 + [20.0] * 3)
    )
    return np.asarray(solution.x)


def _moved_to_target(body: Body, shape: int, x: FloatArray, placement: str) -> FloatArray:
    """Return posture `x` with the wrist shifted so that the tip of `shape` is on the target."""
    angles = np.array(shape_angles(shape))
    angles[_WRIST_COLUMNS] = x[:3]
    tip = HAND_MARKERS.index(longest_finger_tip(shape))
    point = body.hand(angles[None], x[None, 3:])[0, tip]
    return np.concatenate([x[:6], x[6:] + placement_target(body, placement) - point])


def _wanted_axes(body: Body, placement: str) -> tuple[FloatArray, FloatArray]:
    """Return the wished directions of the fingers and of the back of the hand."""
    slope = np.radians(body.habits.hand_slope_deg + _SLOPE_EXTRA_DEG.get(placement, 0.0))
    turn = np.radians(body.habits.palm_turn_deg)
    along = np.array([np.cos(slope), np.sin(slope), -0.22])
    along /= np.linalg.norm(along)
    dorsal = np.array([-np.sin(turn), 0.0, np.cos(turn)])
    dorsal -= along * (dorsal @ along)
    return along, dorsal / np.linalg.norm(dorsal)
