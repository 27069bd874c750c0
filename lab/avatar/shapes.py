"""Blend shapes of the avatar that no marker drives, and the eyes that turn.

Face units of the mesh come in, displacements of the head's control vertices go out, sparse. Names
are ARKit's where ARKit has one; left and right are the cuer's own.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.avatar.parts import FloatArray, IntArray, Part
from synth.motion.body.mesh import Mesh

SHAPES = (
    "browDownLeft", "browDownRight", "browInnerUp", "browOuterUpLeft", "browOuterUpRight",
    "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "eyeBlinkLeft", "eyeBlinkRight",
    "eyeLookDownLeft", "eyeLookDownRight", "eyeLookUpLeft", "eyeLookUpRight", "eyeSquintLeft",
    "eyeSquintRight", "eyeWideLeft", "eyeWideRight", "noseSneerLeft", "noseSneerRight",
)  # fmt: skip
"""Units of the mesh that are sent as they are."""

_CLOSED = 0.72
"""Weight of the mesh's own blink at which the lids meet; beyond it they cut each other."""

_UNIT = 256
"""Displacements are whole parts of a millimetre by this."""

_LEAST_MM = 0.05
"""Smaller displacements are left out."""

_BREATH_MM = np.array([0.0, 3.2, 4.2])
"""Rise and advance in mm of the upper chest in a full breath; mean of quiet breathing of adults
(De Groote et al. 1997, J. Appl. Physiol. 83)."""

_TONGUE_TIP_MM = 10.0
"""Rise in mm of the tongue's tip to the upper teeth."""


def mesh_shapes(mesh: Mesh, tongue: IntArray, balls: IntArray) -> dict[str, FloatArray]:
    """Return the displacements (V, 3) of all vertices of the mesh by each shape, mm.

    Parameters
    ----------
    mesh : Mesh
    tongue, balls : ndarray of int
        Vertices of the tongue; of both eyeballs, which turn instead.
    """
    found = {}
    for name in SHAPES:
        moved = mesh.units[name].copy()
        moved[balls] = 0
        found[name] = _CLOSED * moved if name.startswith("eyeBlink") else moved
    x, y, z = mesh.vertices.T
    high = np.exp(-(((y - 470) / 75) ** 2)) * np.clip((575 - y) / 70, 0, 1)
    front = np.clip((z + 20) / 90, 0, 1) * np.clip((190 - np.abs(x)) / 70, 0, 1)
    front[np.concatenate([tongue, balls])] = 0
    found["breath"] = (high * front)[:, None] * _BREATH_MM
    rise = np.zeros_like(mesh.vertices)
    length = np.clip((z[tongue] - 105) / (z[tongue].max() - 105), 0, 1)
    rise[tongue] = (length**2)[:, None] * [0, _TONGUE_TIP_MM, 0.2 * _TONGUE_TIP_MM]
    found["tongueUp"] = rise
    return found


def shape_arrays(
    shapes: dict[str, FloatArray], control: IntArray, change: FloatArray
) -> dict[str, NDArray[Any]]:
    """Return names, counts, vertices and displacements of the shapes.

    Parameters
    ----------
    shapes : dict of str to ndarray, shape (V, 3)
    control : ndarray of int, shape (M,)
        Vertices of the mesh that are control vertices.
    change : ndarray, shape (3, 3)
        From the mesh's millimetres to the asset's.
    """
    vertices, deltas = [], []
    for moved in shapes.values():
        own = moved[control] @ change
        some = np.flatnonzero(np.abs(own).max(axis=1) > _LEAST_MM)
        vertices.append(some)
        deltas.append(own[some])
    return {
        "shape_names": np.array(list(shapes)),
        "shape_counts": np.array([len(some) for some in vertices], dtype=np.uint16),
        "shape_vertices": np.concatenate(vertices).astype(np.uint16),
        "shape_deltas": np.rint(_UNIT * np.concatenate(deltas)).astype(np.int16),
    }


def eye_arrays(part: Part, place: FloatArray, anchors: list[int]) -> dict[str, NDArray[Any]]:
    """Return range and middle of both eyeballs on the surface.

    Parameters
    ----------
    part : Part
        The head; sources number the control vertices.
    place : ndarray, shape (M, 3)
        The control mesh at rest in the frame of the asset.
    anchors : list of int
        Control vertex that carries each eyeball: the cuer's right, then her left.
    """
    points = part.place(place)
    ranges, middles = [], []
    for anchor in anchors:
        of_eye = np.flatnonzero((part.sources == anchor).all(axis=1))
        if np.ptp(of_eye) + 1 != len(of_eye):
            raise ValueError("the vertices of an eyeball are not in one run")
        ranges.append([of_eye[0], len(of_eye)])
        middles.append(0.5 * (points[of_eye].min(axis=0) + points[of_eye].max(axis=0)))
    return {
        "eye_ranges": np.array(ranges, dtype=np.uint16),
        "eye_middles": np.array(middles, dtype=np.float32),
    }
