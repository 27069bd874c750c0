"""The avatar's arms: lowered, bent and bound to joints.

The mesh spreads its arms; a cuer lets the left one hang and holds the right one up. The right arm
is brought into the mean pose of her cueing, with the upper arm stretched to her length, so that the
joints have little left to turn. There the forearm is that of the hand's markers.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from lab.avatar.parts import FloatArray
from receiver.foreign.arms import short_way, swung
from synth.motion.body.mesh import Mesh

LEFT_HANGS = (0.26, -0.96, 0.10)
"""Unit vector from the left shoulder to the elbow."""

JOINTS = ("clavicleRight", "upperArmRight", "lowerArmRight", "clavicleLeft")
"""Right and left are the cuer's own."""

_UPPER = ("upperarm01", "upperarm02")
_LOWER = ("lowerarm01", "lowerarm02", "wrist")
_CAP_SHARE = 0.35
"""Share of the shoulder's cap that follows the upper arm; the rest follows the collar bone."""

_LOWERED_DEG = 14.0
"""Sinking of the collar bones with the arms, in degrees: the mesh spreads its arms by 45 degrees,
which lifts the shoulders. The acromion is then .35 heads below the chin, as in the ANSUR survey
(Gordon et al. 1989)."""


@dataclass(frozen=True, slots=True)
class Limbs:
    """The mesh with its arms posed, and what carries them.

    Attributes
    ----------
    mesh : Mesh
    weights : ndarray, shape (V, 4)
        Share of each of `JOINTS` in every vertex; the trunk holds the rest.
    roots : ndarray, shape (2, 3)
        Inner ends of the collar bones, right and left, in the mesh's coordinates.
    shoulders : ndarray, shape (2, 3)
    forearm : ndarray, shape (4, 3)
        Elbow, wrist and two more points of the forearm in the mesh's coordinates.
    right : ndarray of bool, shape (V,)
        Vertices of the right arm from the shoulder's cap on.
    lower : ndarray of bool, shape (V,)
        Those of its forearm and hand, without the elbow.
    """

    mesh: Mesh
    weights: FloatArray
    roots: FloatArray
    shoulders: FloatArray
    forearm: FloatArray
    right: NDArray[np.bool_]
    lower: NDArray[np.bool_]


def pose_limbs(mesh: Mesh, forearm: FloatArray) -> Limbs:
    """Return the mesh with the left arm hanging and the right one held up.

    Parameters
    ----------
    mesh : Mesh
    forearm : ndarray, shape (4, 3)
        Where elbow, wrist and the points one unit towards the little finger and out of the back of
        the forearm, all of `forearm_points`, are in the mean pose, in the mesh's coordinates.
    """
    vertices = mesh.vertices.copy()
    weights = np.zeros((len(vertices), len(JOINTS)))
    roots, shoulders = [], []
    for side in "RL":
        upper, lower = _share(mesh, side, _UPPER), _share(mesh, side, _LOWER)
        lower += sum(w for name, w in mesh.weights.items() if _of_hand(name, side))
        cap = _share(mesh, side, ("shoulder01",))
        collar = _share(mesh, side, ("clavicle",)) + (1 - _CAP_SHARE) * cap
        shoulder = mesh.joints[f"upperarm01.{side}"][0]
        elbow = mesh.joints[f"lowerarm01.{side}"][0]
        root = mesh.joints[f"clavicle.{side}"][0]
        sink = _sink(root)
        whole = np.clip(collar + _CAP_SHARE * cap + upper + lower, 0, 1)
        vertices = sink(vertices, whole)
        shoulder, elbow, *points = sink(np.array([shoulder, elbow, *forearm_points(mesh)]), 1.0)
        share = np.clip(upper + lower, 0, 1)
        wanted = (
            forearm[0]
            if side == "R"
            else shoulder + np.array(LEFT_HANGS) * np.linalg.norm(elbow - shoulder)
        )
        turn = short_way(elbow - shoulder, wanted - shoulder)
        vertices = swung(vertices, shoulder, elbow, wanted, share, turn)
        if side == "R":
            before = swung(np.array(points), shoulder, elbow, wanted, np.ones(4), turn)
            vertices = _bend(vertices, before, forearm, lower)
            weights[:, 0], weights[:, 1] = collar, upper + _CAP_SHARE * cap
            weights[:, 2] = lower
        else:
            weights[:, 3] = collar + cap * _CAP_SHARE + share
        roots.append(root)
        shoulders.append(shoulder)
    right = weights[:, 1:3].sum(axis=1) > 0.5
    return Limbs(
        replace(mesh, vertices=vertices),
        np.clip(weights, 0, 1),
        np.array(roots),
        np.array(shoulders),
        forearm,
        right,
        weights[:, 2] > 0.95,
    )


def forearm_points(mesh: Mesh) -> FloatArray:
    """Return elbow, wrist and two points beside the elbow of the right forearm, shape (4, 3)."""
    elbow, wrist = mesh.joints["lowerarm01.R"][0], mesh.joints["wrist.R"][0]
    along = wrist - elbow
    across = np.cross(along, [0.0, 1.0, 0.0])
    across *= 50 / np.linalg.norm(across)
    out = np.cross(along, across)
    out *= 50 / np.linalg.norm(out)
    return np.array([elbow, wrist, elbow + across, elbow + out])


def _of_hand(name: str, side: str) -> bool:
    return name.startswith(("finger", "metacarpal")) and name.endswith(f".{side}")


def _share(mesh: Mesh, side: str, bones: tuple[str, ...]) -> FloatArray:
    """Return how far each vertex belongs to some bones of a side, 0..1."""
    found = [mesh.weights[f"{bone}.{side}"] for bone in bones]
    return np.asarray(np.clip(np.sum(found, axis=0), 0, 1))


def _sink(root: FloatArray) -> Callable[[FloatArray, ArrayLike], FloatArray]:
    """Return the turn of a collar bone about its inner end, by a share (N,) of `_LOWERED_DEG`."""
    turn = np.array([0, 0, -np.sign(root[0]) * np.radians(_LOWERED_DEG)])

    def sink(points: FloatArray, share: ArrayLike) -> FloatArray:
        turns = Rotation.from_rotvec(np.broadcast_to(share, len(points))[:, None] * turn)
        return np.asarray(turns.apply(points - root) + root)

    return sink


def _bend(
    points: FloatArray, before: FloatArray, after: FloatArray, share: FloatArray
) -> FloatArray:
    """Turn a forearm about the elbow by `share` (N,): points `before` (4, 3) get to `after`."""
    rotation, _ = Rotation.align_vectors(after[1:] - after[0], before[1:] - before[0])
    turns = Rotation.from_rotvec(share[:, None] * rotation.as_rotvec())
    slid = share[:, None] * (after[0] - before[0])
    return np.asarray(turns.apply(points - before[0]) + before[0] + slid)
