"""What a look changes in the mesh: another head around the same markers, another bust.

The head is drawn back to the markers (`lab.avatar.morph`). The bust takes its own targets before
the arms are posed, so that the right forearm stays where the markers of the hand have it.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lab.avatar.limbs import Limbs, pose_limbs
from lab.avatar.looks import Look
from lab.avatar.morph import morph, summed
from lab.avatar.mouth import lip_rings
from lab.avatar.parts import FloatArray, IntArray, triangulate
from synth.motion.body.mesh import Mesh
from synth.motion.body.placing import SkinPoints

_INSIDE_MOUTH = ("helper-upper-teeth", "helper-lower-teeth", "helper-tongue")
"""Groups of the mesh inside the mouth."""

_JOINT_MM = 40.0
"""Distance in mm over which the skin around a joint says where it moves."""

_CHEST_MM, _DRAPE_MM = 505.0, 15.0
"""Height in mm below which cloth hangs freely, and standard deviation of its smoothing."""

_TURNING = ("clavicle", "upperarm01", "lowerarm01", "wrist")
"""Bones of an arm that begin at the joints of `lab.avatar.limbs`."""


def draped(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the mesh (M, 3) with the front of the trunk as cloth over it shows it: smoother.

    Parameters
    ----------
    points : ndarray, shape (M, 3)
    triangles : ndarray of int, shape (F, 3)
        Of the body.
    """
    x, y, z = points.T
    share = np.clip((_CHEST_MM - y) / 40, 0, 1) * np.clip((150 - np.abs(x)) / 30, 0, 1) * (z > 20)
    areas = np.zeros(len(points))
    a, b, c = (points[triangles[:, k]] for k in range(3))
    size = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    for k in range(3):
        np.add.at(areas, triangles[:, k], size)
    front = np.flatnonzero((z > 0) & (areas > 0) & (y > 250) & (y < 600) & (np.abs(x) < 180))
    smooth = points.copy()
    for vertex in np.flatnonzero((share > 0) & (areas > 0) & (y > 280)):
        away = ((points[front] - points[vertex]) ** 2).sum(axis=1)
        weights = areas[front] * np.exp(-away / (2 * _DRAPE_MM**2))
        mean = weights @ z[front] / weights.sum()
        smooth[vertex, 2] += share[vertex] * (mean - z[vertex])
    return smooth


@dataclass(frozen=True, slots=True)
class Wardrobe:
    """All that the looks of a cuer have in common.

    Attributes
    ----------
    mesh : Mesh
        With spread arms.
    limbs : Limbs
        As the first look poses them.
    groups : dict of str to ndarray
        Quads by group, from `lab.avatar.head.read_groups`.
    forearm : ndarray, shape (4, 3)
        Points of the forearm in the mean pose, for `pose_limbs`.
    places : SkinPoints
        Of the face markers on the mesh.
    folder : Path
        Of the targets.
    """

    mesh: Mesh
    limbs: Limbs
    groups: dict[str, IntArray]
    forearm: FloatArray
    places: SkinPoints
    folder: Path

    def wear(self, look: Look) -> tuple[FloatArray, Limbs]:
        """Return the displacement (V, 3) of the posed mesh in a look, mm, and its limbs."""
        mesh, groups = self.mesh, self.groups
        at = mesh.vertices
        bust = summed(look.bust, self.folder, len(at))
        joints = dict(mesh.joints)
        for bone in (f"{name}.{side}" for name in _TURNING for side in "RL"):
            near = np.exp(-(np.linalg.norm(at - joints[bone][0], axis=1) ** 2) / _JOINT_MM**2)
            shift = near @ bust / near.sum()
            joints[bone] = (joints[bone][0] + shift, joints[bone][1] + shift)
        clothed = draped(at + bust, triangulate(groups["body"]))
        limbs = pose_limbs(replace(mesh, vertices=clothed, joints=joints), self.forearm)
        face = (self.places.of(at), self.places.of(at + summed(look.targets, self.folder, len(at))))
        rings = lip_rings(groups["body"], at)
        inside = np.unique(np.concatenate([groups[name].ravel() for name in _INSIDE_MOUTH]))
        balls = [np.unique(groups[f"helper-{side}-eye"]) for side in "rl"]
        head = morph(mesh, look, self.folder, face, rings, inside, balls)
        # The targets are those of spread arms: the arm that is held up keeps its own.
        head *= 1 - np.clip(self.limbs.weights[:, 1:3].sum(axis=1, keepdims=True), 0, 1)
        return limbs.mesh.vertices - self.limbs.mesh.vertices + head, limbs
