"""The upper arms of the avatar's bust: the mesh spreads them, a cuer lets them hang.

The right one points to where her elbow is while she cues, so that the forearm, which comes from
the hand's markers, goes on where it ends.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from synth.motion.body.mesh import Mesh

_HANGS = {"L": (0.26, -0.96, 0.10), "R": (-0.17, -0.93, 0.33)}
"""Directions from the shoulder to the elbow."""


def lower_arms(mesh: Mesh) -> Mesh:
    """Return the mesh with both upper arms turned about the shoulders.

    The turn grows with a vertex's share of the arm: a sum of weights, as in the mesh's own skin.
    """
    vertices = mesh.vertices.copy()
    for side, hangs in _HANGS.items():
        shoulder = mesh.joints[f"upperarm01.{side}"][0]
        arm = mesh.joints[f"lowerarm01.{side}"][0] - shoulder
        turn = _turn(arm / np.linalg.norm(arm), np.array(hangs) / np.linalg.norm(hangs))
        share = _share(mesh, side)
        some = np.flatnonzero(share > 1e-4)
        rotations = Rotation.from_rotvec(share[some, None] * turn)
        vertices[some] = rotations.apply(mesh.vertices[some] - shoulder) + shoulder
    return replace(mesh, vertices=vertices)


def _turn(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation vector that takes unit vector a to b the short way."""
    axis = np.cross(a, b)
    sine = float(np.linalg.norm(axis))
    return np.asarray(axis / sine * np.arctan2(sine, float(a @ b)))


def _share(mesh: Mesh, side: str) -> NDArray[np.float64]:
    """Return how far each vertex belongs to the arm below the shoulder, 0..1."""
    share = np.zeros(len(mesh.vertices))
    for bone in ("upperarm01", "upperarm02", "lowerarm01", "lowerarm02", "wrist"):
        share += mesh.weights[f"{bone}.{side}"]
    return np.clip(share, 0, 1)
