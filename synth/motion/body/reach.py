"""Where the hand goes: placements relative to the head, and the arm that reaches them.

A placement is a point of the head's frame at rest. For every placement the solver finds one
posture of forearm and wrist, with the back of the hand to the viewer, the fingers up and towards
the face, the elbow at the end of the upper arm, and the skin of the widest hand outside the head;
every hand shape then shifts the wrist so that the tip of its pointing finger is on the point.

In the picture's plane placements are where real French cuers put the pointing tip against the
middle of the mouth (`PLACES_MM`), at the size of this head; in depth they are before this skin.
"""

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import FACE_MARKERS, HAND_MARKERS, longest_finger_tip
from codec.cues.score import PLACEMENTS
from synth.motion.body.body import Body
from synth.motion.body.shapes import all_shapes, shape_angles
from synth.motion.body.skeleton import ANGLE_NUMBER

FloatArray = NDArray[np.float64]

REAL_MM = {
    "side": (-72.0, -12.0),
    "mouth": (-37.0, -9.0),
    "chin": (-15.0, -41.0),
    "cheek": (-61.0, 32.0),
    "throat": (-24.0, -107.0),
}
"""Where real cuers' pointing tips are against the middle of the mouth, mm, x to the cuer's left and
y up, ears `REAL_EARS_MM` apart: means of four groups of takes by two French cuers (side and throat)
and of 64 takes of one (`cuecast evaluate places`). Sides are widely spread."""

REAL_EARS_MM = 153.0
"""Distance in mm between the ears to which real takes are scaled."""

PLACES_MM = {
    "side": (-82.0, -16.0),
    "mouth": (-34.0, -9.0),
    "chin": (-13.0, -42.0),
    "cheek": (-60.0, 33.0),
    "throat": (-21.0, -103.0),
    "rest": (-97.0, -232.0),
}
"""Places of the pointing finger's tip marker, as `REAL_MM`: at the real means, but for the side,
which keeps some mm more from the mouth, for ways between throat and cheek pass between them."""

_DEPTH_MM = {
    "side": ("LC_R", 6.0),
    "mouth": ("LC_R", 9.0),
    "chin": ("CH0", 10.0),
    "cheek": ("CK2_R", 11.0),
    "throat": ("TH5_C", 22.0),
    "rest": ("CH0", 55.0),
}
"""Marker of the skin there, and by how many mm the tip is before it."""

_SLOPE_EXTRA_DEG = {"cheek": 6.0, "throat": -6.0, "chin": -4.0, "rest": -12.0, "side": 12.0}
_WRIST = ("wrist_flex", "wrist_deviation", "forearm_twist")
_WRIST_COLUMNS = [ANGLE_NUMBER[name] for name in _WRIST]

_TWIST_DEG = {"rest": -5.0, "side": 2.0, "mouth": 0.0, "chin": -1.0, "cheek": 3.0, "throat": -3.0}
"""Turn of the forearm's bones at each placement."""

_ARCH_PER_FLEXION = 0.08
"""Turn of a finger's bone in the palm for its flexion."""

_CLEARANCE_MM = 5.0
"""Distance in mm that the hand's skin keeps from the head's."""

_WIDEST_SHAPE = 5
"""Number of the open hand: who reaches a place with it reaches it with every shape."""

_CUEING, _RESTING = (14.0, 24.0, 0.5), (20.0, 9.0, 0.2)
"""Weights in mm of the wished directions of fingers and back of the hand, and of the wrist's ease,
in mm per degree: a cueing hand is flat to the viewer; a resting one points up, so that its fingers
do not unfold across the throat on the way to the face."""

_EASY_WRIST_DEG = np.array([5.0, 0.0, 0.0])
"""Angles in degrees at which a wrist is at ease: slightly bent back."""


def placement_target(body: Body, placement: str) -> FloatArray:
    """Return the point of the resting head, shape (3,), mm, that the finger tip goes to."""
    face = dict(zip(FACE_MARKERS, body.face_skin.rest, strict=True))
    mouth = 0.5 * (face["LC_R"] + face["LC_L"])
    size = float(np.linalg.norm(face["EAR_R"] - face["EAR_L"])) / REAL_EARS_MM
    marker, before = _DEPTH_MM[placement]
    x, y = size * np.array(PLACES_MM[placement])
    point = np.array([mouth[0] + x, mouth[1] + y, face[marker][2] + before])
    shift = body.habits.placement_shift_mm.get(placement, (0.0, 0.0, 0.0))
    return np.asarray(point + np.array(shift))


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


def key_poses(
    wrist: FloatArray, forearm: FloatArray, shape: NDArray[np.int64], placement: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """Return hand angles (G, 31), degrees, and forearm poses (G, 6) of keys, head at rest.

    Parameters
    ----------
    wrist, forearm : ndarray
        As `solve_reach` gives them.
    shape, placement : ndarray of int, shape (G,)
        Of each key.
    """
    angles = all_shapes()[shape]
    angles[:, _WRIST_COLUMNS] = wrist[shape, placement]
    twist = np.array([_TWIST_DEG[name] for name in PLACEMENTS])
    angles[:, ANGLE_NUMBER["forearm_twist"]] += twist[placement]
    for finger in ("ring", "little"):
        flexion = angles[:, ANGLE_NUMBER[f"{finger}_mcp"]]
        angles[:, ANGLE_NUMBER[f"arch_{finger}"]] += _ARCH_PER_FLEXION * flexion
    return angles, forearm[shape, placement].copy()


def _solve(body: Body, shape: int, placement: str) -> FloatArray:
    target = placement_target(body, placement)
    tip = HAND_MARKERS.index(longest_finger_tip(shape))
    angles = np.array(shape_angles(shape))
    along, dorsal = _wanted_axes(body, placement)
    arm = body.arm
    forearm_mm = float(np.linalg.norm(arm.origins[2] - arm.origins[0]))
    shoulder = body.landmarks["shoulder"]
    weight = _RESTING if placement == "rest" else _CUEING
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
        # Least squares over x: three angles of the wrist, rotation and place of the forearm. Rows:
        # the tip on its target, the hand's and the forearm's axes as wanted, an easy wrist, an
        # upper arm of its own length, and no point within the skull, an ellipsoid.
        return np.concatenate(
            [
                points[tip] - target,
                weight[0] * (hand[:, 1] - along),
                weight[1] * (hand[:, 2] - dorsal),
                6.0 * (forearm[:, 1] - along)[:2],
                weight[2] * (x[:3] - _EASY_WRIST_DEG),
                [0.12 * reach, 0.04 * max(0.0, elbow[1] - shoulder[1] + 60.0)],
                40.0 * np.maximum(inside, 0.0),
            ]
        )

    from scipy.optimize import least_squares

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
