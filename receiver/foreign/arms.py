"""A foreign figure's arms as a cuer holds them: the left one hangs, the right one is held up.

The figure in the file's pose (T, A or any other) comes in; out go its vertices with the arms posed,
and the `Skeleton` that moves them while she cues. The forearm keeps the figure's own length: it
turns about the wrist until the upper arm is as long as it is, over all keys.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from codec.cuer.models.rigid import inverse, rigid_motion
from codec.cuer.voice import Voice
from receiver.drawing.skeleton import Reach, Skeleton
from receiver.foreign.hand import ELBOW, WRIST, ForeignHand, swing
from receiver.foreign.names import RIGHT_FINGERS
from receiver.foreign.scene import Scene

FloatArray = NDArray[np.float64]

_LEFT_HANGS = np.array([0.26, -0.96, 0.10])
"""Unit vector of the hanging arm."""

_BEND_RAD = 0.6
"""Turn of the forearm about the wrist that counts as much as an upper arm twice as long."""

_RIGHT = ("rightUpperArm", "rightLowerArm", "rightHand", *RIGHT_FINGERS)


@dataclass(frozen=True, slots=True)
class Arms:
    """Arms posed.

    Attributes
    ----------
    points : ndarray, shape (V, 3)
        All vertices in the frame of the voice's face model.
    in_hand : ndarray, shape (V, 3)
        The same in the frame of its hand model; only the right forearm belongs there.
    skeleton : Skeleton
        With the weights of all vertices that arms move.
    stretch : float
        Largest change of the upper arm's length over all keys, as a share.
    """

    points: FloatArray
    in_hand: FloatArray
    skeleton: Skeleton
    stretch: float


def pose_arms(
    scene: Scene,
    points: FloatArray,
    place: Mapping[str, FloatArray],
    voice: Voice,
    motions: FloatArray,
    joints: FloatArray,
    reach: Reach,
) -> Arms:
    """Pose both arms.

    Parameters
    ----------
    scene : Scene
    points : ndarray, shape (V, 3)
        Its vertices in the frame of the voice's face model.
    place : mapping of str to ndarray, shape (3,)
        Joint of every bone there.
    voice : Voice
    motions : ndarray, shape (K, 6)
        Motions of the hand for all keys, about its pivot.
    joints : ndarray, shape (22, 3)
        The cuer's own joints in the hand's frame.
    reach : Reach
    """
    lifted = motions + np.concatenate([np.zeros(3), voice.hand.pivot])
    lower = float(np.linalg.norm(place["rightHand"] - place["rightLowerArm"]))
    shoulder = place["rightUpperArm"]
    upper = float(np.linalg.norm(place["rightLowerArm"] - shoulder))
    elbow, stretch = _find_elbow(lifted, joints, shoulder, lower, upper)
    usual = lifted.mean(axis=0)
    wrist_at, elbow_at = rigid_motion(np.array([[joints[WRIST], elbow]]), usual[None])[0]
    hand = ForeignHand.of(scene, points, place)
    palm = hand.bones(joints[None])["rightHand"][0, :, :3]
    palm = Rotation.from_rotvec(usual[:3]).as_matrix() @ palm
    posed = _pose_right(scene, points, place, elbow_at, wrist_at, palm)
    posed = _hang_left(scene, posed, place)
    back = inverse(usual[None])
    in_hand = rigid_motion(posed[None], back)[0]
    weights = np.stack(
        [
            scene.share("rightShoulder"),
            scene.share("rightUpperArm"),
            scene.share(*_RIGHT[1:]),
            _left(scene) + scene.share("leftShoulder"),
        ],
        axis=1,
    )
    weights = np.rint(255 * np.clip(weights, 0, 1)) / 255
    moving = np.flatnonzero(weights.any(axis=1))
    roots = np.array([_root(place, side) for side in ("right", "left")])
    shoulders = np.array([shoulder, place["leftUpperArm"]])
    skeleton = Skeleton(moving, weights[moving], roots, shoulders, elbow_at, back[0], reach)
    return Arms(posed, in_hand, skeleton, stretch)


def _root(place: Mapping[str, FloatArray], side: str) -> FloatArray:
    """Return the inner end of a collar bone."""
    shoulder = place[f"{side}UpperArm"]
    root = place.get(f"{side}Shoulder")
    if root is None or np.linalg.norm(root - shoulder) < 20:
        both = 0.5 * (place["rightUpperArm"] + place["leftUpperArm"])
        return np.asarray(both + 0.15 * (shoulder - both))
    return root


def _left(scene: Scene) -> FloatArray:
    return np.asarray(
        sum(
            (w for bone, w in scene.weights.items() if bone.startswith("left") and _is_arm(bone)),
            np.zeros(len(scene.points)),
        )
    )


def _is_arm(bone: str) -> bool:
    return not any(part in bone for part in ("Leg", "Foot", "Toe", "Eye", "Shoulder"))


def _find_elbow(
    lifted: FloatArray, joints: FloatArray, shoulder: FloatArray, lower: float, upper: float
) -> tuple[FloatArray, float]:
    """Return the elbow (3,) in the hand's frame, and the largest stretch of the upper arm."""
    wrist = joints[WRIST]
    way = (joints[ELBOW] - wrist) / np.linalg.norm(joints[ELBOW] - wrist)

    def stretches(turn: FloatArray) -> FloatArray:
        at = wrist + lower * Rotation.from_rotvec(turn).apply(way)
        there = rigid_motion(np.repeat(at[None, None], len(lifted), axis=0), lifted)[:, 0]
        return np.asarray(np.linalg.norm(there - shoulder, axis=1) / upper - 1)

    def cost(turn: FloatArray) -> float:
        return float((stretches(turn) ** 2).mean() + (turn @ turn) / _BEND_RAD**2)

    best = minimize(cost, np.zeros(3), method="Nelder-Mead", options={"maxiter": 400}).x
    elbow = wrist + lower * Rotation.from_rotvec(best).apply(way)
    return np.asarray(elbow), float(np.abs(stretches(best)).max())


def _pose_right(
    scene: Scene,
    points: FloatArray,
    place: Mapping[str, FloatArray],
    elbow: FloatArray,
    wrist: FloatArray,
    palm: FloatArray,
) -> FloatArray:
    """Turn the arm about the shoulder, the forearm about the elbow and its own axis."""
    start, joint = place["rightUpperArm"], place["rightLowerArm"]
    share = np.clip(scene.share(*_RIGHT), 0, 1)
    below = np.clip(scene.share(*_RIGHT[1:]), 0, 1)
    first = short_way(joint - start, elbow - start)
    out = swung(points, start, joint, elbow, share, first)
    at = swung(place["rightHand"][None], start, joint, elbow, np.ones(1), first)[0]
    second = short_way(at - elbow, wrist - elbow)
    out = elbow + Rotation.from_rotvec(below[:, None] * second).apply(out - elbow)
    turned = (Rotation.from_rotvec(second) * Rotation.from_rotvec(first)).as_matrix()
    u, _, v = np.linalg.svd(palm @ turned.T)
    axis = wrist - elbow
    length = np.linalg.norm(axis)
    axis = axis / length
    x, y, z, w = Rotation.from_matrix(u @ v).as_quat()
    twist = 2 * np.arctan2(np.array([x, y, z]) @ axis, w)
    twist = (twist + np.pi) % (2 * np.pi) - np.pi
    along = np.clip((out - elbow) @ axis / length, 0, 1)
    turn = (below * along * twist)[:, None] * axis
    return np.asarray(elbow + Rotation.from_rotvec(turn).apply(out - elbow))


def _hang_left(scene: Scene, points: FloatArray, place: Mapping[str, FloatArray]) -> FloatArray:
    start, joint = place["leftUpperArm"], place["leftLowerArm"]
    goal = start + _LEFT_HANGS / np.linalg.norm(_LEFT_HANGS) * np.linalg.norm(joint - start)
    share = np.clip(_left(scene), 0, 1)
    return swung(points, start, joint, goal, share, short_way(joint - start, goal - start))


def short_way(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the rotation vector (3,) that turns a direction into another."""
    a, b = before / np.linalg.norm(before), after / np.linalg.norm(after)
    return np.asarray(Rotation.from_matrix(swing(a[None], b[None])[0]).as_rotvec())


def swung(
    points: FloatArray,
    start: FloatArray,
    joint: FloatArray,
    goal: FloatArray,
    share: FloatArray,
    turn: FloatArray,
) -> FloatArray:
    """Stretch an arm and turn it about the shoulder by `share` (N,): the joint gets to `goal`."""
    axis = joint - start
    length = np.linalg.norm(axis)
    axis = axis / length
    ratio = np.linalg.norm(goal - start) / length - 1
    along = np.clip((points - start) @ axis, 0, length)
    stretched = points + (share * along * ratio)[:, None] * axis
    return np.asarray(start + Rotation.from_rotvec(share[:, None] * turn).apply(stretched - start))
