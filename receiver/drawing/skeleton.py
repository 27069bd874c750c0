"""The cuer's arm as one chain, and the motions of head and hand with what the rules add.

A pose of the parameters and an `Expression` go in; the motions of head and hand and the affine maps
of the joints come out. The forearm is that of the hand's markers. The shoulder follows its elbow,
and the upper arm joins the two. The hand follows every movement that the rules add to the skin at
which it points, so that its place on the face or the throat stays; ``page/skeleton.js`` is alike.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import HAND_MARKERS
from codec.cuer.models.rigid import (
    about,
    compose,
    inverse,
    rigid_motion,
    rotation_matrices,
    rotation_vectors,
)
from codec.cuer.voice import Voice
from receiver.drawing.movement import RULES, Expression, throat_shares

FloatArray = NDArray[np.float64]

_TIPS = [HAND_MARKERS.index(name) for name in ("F2T", "F3T")]
_WRIST = HAND_MARKERS.index("W1")
_POINTING = 16
"""Power of the distance from the wrist; it makes the farther of two finger tips the pointing
one."""


_NEAR_MM, _FAR_MM = 12.0, 120.0
"""Distances in mm: within the first a place's shift holds, beyond the second none does."""


@dataclass(frozen=True, slots=True)
class Reach:
    """How far the hand is shifted where the head's places lie elsewhere than the voice's.

    Attributes
    ----------
    places : ndarray, shape (N, 3)
        Where the voice points, head at rest, mm; none for the voice's own head.
    factors : ndarray, shape (N, 3)
        Of the weights of the places, mm.
    """

    places: FloatArray
    factors: FloatArray

    @staticmethod
    def to(places: FloatArray, moves: FloatArray) -> "Reach":
        """Return what shifts a finger that points at one of `places` (N, 3) by its `moves`."""
        own = Reach(places, moves)
        return Reach(places, np.asarray(np.linalg.solve(own._weights(places), moves)))

    def shift(self, tips: FloatArray) -> FloatArray:
        """Return the shift (T, 3) for finger tips (T, 3), head at rest."""
        return np.asarray(self._weights(tips) @ self.factors)

    def _weights(self, tips: FloatArray) -> FloatArray:
        squared = ((tips[:, None] - self.places) ** 2).sum(axis=2)
        weights = 1 / (_NEAR_MM**2 + squared)
        return np.asarray(weights / (weights.sum(axis=1, keepdims=True) + _FAR_MM**-2))


NO_REACH = Reach(np.zeros((0, 3)), np.zeros((0, 3)))


@dataclass(frozen=True, slots=True)
class Skeleton:
    """Joints of the bust.

    Attributes
    ----------
    vertices : ndarray of int, shape (N,)
        Control vertices of the head's surface that joints move.
    weights : ndarray, shape (N, 4)
        Their shares of right collar bone, upper arm and forearm, and of the left collar bone.
    roots, shoulders : ndarray, shape (2, 3)
        Inner and outer ends of the collar bones, right and left, mm.
    elbow : ndarray, shape (3,)
        Of the right arm as the surface has it at rest.
    forearm : ndarray, shape (6,)
        Motion that takes the right forearm from there into the hand's frame.
    reach : Reach
    """

    vertices: NDArray[np.int64]
    weights: FloatArray
    roots: FloatArray
    shoulders: FloatArray
    elbow: FloatArray
    forearm: FloatArray
    reach: Reach = NO_REACH

    def bend(self, control: FloatArray, joints: FloatArray) -> None:
        """Move control vertices (T, M, 3) by the maps (T, 4, 3, 4) of the joints, in place."""
        still = control[:, self.vertices]
        moved = np.zeros_like(still)
        for joint in range(joints.shape[1]):
            own = np.flatnonzero(self.weights[:, joint])
            turn, shift = joints[:, joint, :, :3], joints[:, joint, None, :, 3]
            change = still[:, own] @ turn.transpose(0, 2, 1) + shift - still[:, own]
            moved[:, own] += self.weights[own, joint, None] * change
        control[:, self.vertices] = still + moved


@dataclass(frozen=True, slots=True)
class Pose:
    """Motions of T moments.

    Attributes
    ----------
    head, hand : ndarray, shape (T, 6)
        Rotation vector, rad, and shift, mm, about the pivots of the voice's models.
    joints : ndarray, shape (T, 4, 3, 4)
        Affine maps of right collar bone, upper arm, forearm and left collar bone.
    """

    head: FloatArray
    hand: FloatArray
    joints: FloatArray


def solve(skeleton: Skeleton, voice: Voice, params: FloatArray, added: Expression | None) -> Pose:
    """Return the motions for parameters (T, P) and what the rules add to them."""
    head = voice.face.motion(params[:, voice.face_columns[7:]])
    hand = voice.hand.motion(params[:, voice.hand_columns[voice.hand.n_shape :]])
    breath = np.zeros(len(params))
    if added is not None or len(skeleton.reach.places):
        markers = voice.hand.shape(params[:, voice.hand_columns[: voice.hand.n_shape]])
        nodded = head if added is None else _nodded(voice, head, added.nod)
        hand = _carried(voice, head, nodded, hand, markers, skeleton.reach)
        head = nodded
    if added is not None:
        breath = added.breath - RULES["breath"][0]
    return Pose(head, hand, _joints(skeleton, voice, hand, breath))


def _nodded(voice: Voice, head: FloatArray, nod: FloatArray) -> FloatArray:
    """Return the head's motion, about its pivot, with a turn about the top of the neck."""
    pivot = voice.face.pivot.astype(np.float64)
    still = np.concatenate([nod, np.zeros_like(nod)], axis=1)
    return compose(about(np.array(RULES["neck_mm"]) - pivot, still), head)


def _carried(
    voice: Voice,
    before: FloatArray,
    after: FloatArray,
    hand: FloatArray,
    markers: FloatArray,
    reach: Reach,
) -> FloatArray:
    """Return the hand's motion after it followed the skin at which it points."""
    tip, shares = _pointing(voice, hand, markers)
    pivot = voice.face.pivot
    away = inverse(about(pivot, before * shares))
    moved = compose(about(pivot, after * shares), away)
    if len(reach.places):
        shift = np.zeros_like(away)
        shift[:, 3:] = reach.shift(rigid_motion(tip[:, None], away)[:, 0])
        moved = compose(about(pivot, after * shares), compose(shift, away))
    pivot = np.concatenate([np.zeros(3), voice.hand.pivot])
    return np.asarray(compose(moved, hand + pivot) - pivot)


def _pointing(voice: Voice, hand: FloatArray, markers: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the tip (T, 3) that points, and the shares (T, 6) of the head's motion there."""
    world = rigid_motion(markers[:, [*_TIPS, _WRIST]], hand) + voice.hand.pivot
    far = np.linalg.norm(world[:, :2] - world[:, 2:], axis=-1) ** _POINTING
    tip = (far[..., None] * world[:, :2]).sum(axis=1) / far.sum(axis=1)[:, None]
    throat = throat_shares(voice)
    turn, shift = (np.interp(tip[:, 1], throat[:, 0], throat[:, k])[:, None] for k in (1, 2))
    return tip, np.concatenate([np.repeat(turn, 3, axis=1), np.repeat(shift, 3, axis=1)], axis=1)


def key_poses(voice: Voice) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what the voice's keys are, placement by placement within each shape.

    Returns
    -------
    params : ndarray, shape (K, P)
    motions : ndarray, shape (K, 6)
        Of the hand about its pivot.
    tips : ndarray, shape (K, 3)
        Where the finger points, head at rest, mm.
    """
    shapes, forearms = voice.gestures.shape_targets, voice.gestures.placement_targets
    count = forearms.shape[1]
    n, first = voice.hand.n_shape, voice.face_columns[7:]
    params = np.zeros((len(shapes) * count, len(voice.layout)))
    params[:, first] = voice.gestures.neutral_head
    params[:, voice.hand_columns[:n]] = np.repeat(shapes, count, axis=0)
    params[:, voice.hand_columns[n:]] = forearms.reshape(len(params), -1)
    hand = voice.hand.motion(params[:, voice.hand_columns[n:]])
    tip, shares = _pointing(voice, hand, voice.hand.shape(params[:, voice.hand_columns[:n]]))
    away = inverse(about(voice.face.pivot, voice.face.motion(params[:, first]) * shares))
    return params, hand, rigid_motion(tip[:, None], away)[:, 0]


def _joints(skeleton: Skeleton, voice: Voice, hand: FloatArray, breath: FloatArray) -> FloatArray:
    lifted = np.concatenate([np.zeros(3), voice.hand.pivot])
    forearm = compose(hand + lifted, skeleton.forearm)
    elbow = rigid_motion(skeleton.elbow[None], forearm)[:, 0]
    lift = breath[:, None] * [0, RULES["shoulder_breath_mm"], 0]
    follow = (elbow - skeleton.elbow) * RULES["shoulder"]
    most = RULES["shoulder_most_mm"]
    follow *= most / np.sqrt(most**2 + (follow**2).sum(axis=1, keepdims=True))
    right, shoulder = _collar(skeleton.roots[0], skeleton.shoulders[0], follow + lift)
    left, _ = _collar(skeleton.roots[1], skeleton.shoulders[1], lift)
    turn, shift = rotation_matrices(forearm[:, :3]), forearm[:, 3:]
    lower = np.concatenate([turn, shift[..., None]], axis=2)
    upper = _bone(skeleton.shoulders[0], skeleton.elbow, shoulder, elbow)
    return np.stack([right, upper, lower, left], axis=1)


def _collar(root: FloatArray, end: FloatArray, moved: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the map of a collar bone whose end moves by about (T, 3), and where its end is."""
    way = end + moved - root
    length = np.linalg.norm(end - root)
    place = root + way * (length / np.linalg.norm(way, axis=1, keepdims=True))
    return _bone(root, end, np.repeat(root[None], len(moved), axis=0), place), place


def _bone(
    start: FloatArray, end: FloatArray, new_start: FloatArray, new_end: FloatArray
) -> FloatArray:
    """Return maps (T, 3, 4) of a bone: turned the short way and stretched along its axis."""
    before, after = end - start, new_end - new_start
    length, reach = np.linalg.norm(before), np.linalg.norm(after, axis=1)
    a, b = before / length, after / reach[:, None]
    across = np.cross(a, b)
    cosine = (b @ a)[:, None, None]
    x, y, z = across.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    turn = np.eye(3) + cross + cross @ cross / (1 + cosine)
    linear = turn @ (np.eye(3) + (reach / length - 1)[:, None, None] * np.outer(a, a))
    shift = new_start - linear @ start
    return np.concatenate([linear, shift[..., None]], axis=2)


def between(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the motion (6,) that takes points (N, 3) nearest to others (Kabsch 1976)."""
    a, b = before.mean(axis=0), after.mean(axis=0)
    u, _, v = np.linalg.svd((before - a).T @ (after - b))
    u[:, 2] *= np.sign(np.linalg.det(u @ v))
    turn = (u @ v).T
    return np.concatenate([rotation_vectors(turn), b - turn @ a])


def gaze_in_head(added: Expression, pose: Pose) -> FloatArray:
    """Return the eyes' turn (T, 2) that keeps the gaze where it was while the head turns."""
    return np.asarray(added.gaze + np.stack([-pose.head[:, 1], pose.head[:, 0]], axis=1))
