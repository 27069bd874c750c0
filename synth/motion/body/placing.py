"""Where the markers are glued: places on the mesh, evenly spaced over face, throat and hand.

The face's layout is a list of vertices (``face63_hm08.json`` beside the mesh); throat, lower lip,
hand and forearm are placed here, at the point of the skin nearest to a place that is described by
anatomy: along a bone, around a bone, or along the midline of the throat. A place is a mean of a
quad's corners, so spacing does not depend on the mesh.
"""

import json
import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import (
    FACE_MARKERS,
    FINGERS,
    FOREARM,
    HAND_MARKERS,
    KNUCKLES,
    PALM,
    SIDES,
    WRIST,
)
from codec.errors import CueError
from synth.motion.body.mesh import Mesh
from synth.motion.body.skeleton import ARM_BONES

FloatArray = NDArray[np.float64]

_PER_EDGE = 6
"""Candidate places along an edge of the mesh."""

_THROAT_TOP = np.array([0.0, 616.0, 131.0])
"""Where the throat's middle line begins under the chin, in mm of the mesh."""

_THROAT_BOTTOM_Y = 548.0
"""Height in mm at which it ends."""

_THROAT_HALF_WIDTH_MM = 23.0
"""Distance in mm of the throat's outer lines from the middle one."""

_LOWER_LIP = {"LL1_R": np.array([-9.8, 651.0, 153.5]), "LL1_L": np.array([9.8, 651.0, 153.5])}
_SIDE_ANGLES_DEG = {1: 80.0, 2: -80.0, 3: -80.0, 4: 80.0, 5: 80.0}

_WRIST_ANGLES_DEG = (-80.0, -27.0, 27.0, 80.0)
"""Places around the wrist, in degrees from the back of the hand."""

_FOREARM_RINGS = (0.30, 0.55, 0.80)
"""Rings of markers along the forearm, as shares of its length from the wrist."""

_FOREARM_ANGLES_DEG = (-95.0, -32.0, 32.0, 95.0)
"""Places around each ring, in degrees from the back of the hand."""


@dataclass(frozen=True, slots=True)
class SkinPoints:
    """Points on the skin.

    Attributes
    ----------
    corners : ndarray of int64, shape (N, 4)
        Vertices of the quad of each point.
    shares : ndarray, shape (N, 4)
        Part of each corner; rows sum to one.
    """

    corners: NDArray[np.int64]
    shares: FloatArray

    def of(self, values: FloatArray) -> FloatArray:
        """Return per-vertex `values` (V, ...) at the points, shape (N, ...)."""
        return np.asarray(np.einsum("nc,nc...->n...", self.shares, values[self.corners]))

    def chosen(self, numbers: NDArray[np.int64]) -> "SkinPoints":
        """Return the points of those numbers."""
        return SkinPoints(self.corners[numbers], self.shares[numbers])


def sample_skin(mesh: Mesh) -> SkinPoints:
    """Return a dense grid of points on the skin, all vertices included."""
    step = np.linspace(0.0, 1.0, _PER_EDGE)
    u, v = (grid.ravel() for grid in np.meshgrid(step, step))
    shares = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=1)
    corners = np.repeat(mesh.faces, len(shares), axis=0)
    return SkinPoints(corners, np.tile(shares, (len(mesh.faces), 1)))


def face_places(mesh: Mesh, skin: SkinPoints, layout: str | os.PathLike[str]) -> SkinPoints:
    """Return the 63 face markers on `skin`.

    Raises
    ------
    CueError
        If the layout file is missing, malformed or lacks a marker.
    """
    points = skin.of(mesh.vertices)
    try:
        with open(layout, encoding="utf-8") as file:
            listed = {m["name"]: int(m["vertex"]) for m in json.load(file)["markers"]}
        place = {
            name: mesh.vertices[listed[name]] for name in FACE_MARKERS if not name.startswith("TH")
        }
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise CueError(f"{layout}: not a layout of the face: {error!r}") from error
    place |= _LOWER_LIP | _throat(points)
    numbers = [_nearest(points, place[name]) for name in FACE_MARKERS]
    return skin.chosen(np.array(numbers))


def _throat(points: FloatArray) -> dict[str, FloatArray]:
    """Return six rows from under the chin to the breastbone, evenly along the midline."""
    midline = _midline(points)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(midline, axis=0), axis=1))])
    place = {}
    for row, at in enumerate(np.linspace(0.0, length[-1], 6)):
        centre = np.array([np.interp(at, length, midline[:, axis]) for axis in range(3)])
        place[f"TH{row}_C"] = centre
        for side, x in (("R", -_THROAT_HALF_WIDTH_MM), ("L", _THROAT_HALF_WIDTH_MM)):
            beside = points[np.abs(points[:, 0] - x) < 3.0]
            place[f"TH{row}_{side}"] = beside[_nearest(beside[:, 1:], centre[1:])]
    return place


def _midline(points: FloatArray) -> FloatArray:
    """Return the points (N, 3) of the skin's middle from chin to breastbone, in order."""
    x, y, z = points.T
    chosen = points[(np.abs(x) < 0.2) & (y > _THROAT_BOTTOM_Y - 2.0) & (z > 50.0)]
    chosen = chosen[chosen[:, 1] < _THROAT_TOP[1] + 1.5]
    path, left = [_THROAT_TOP], chosen[chosen[:, 2] <= _THROAT_TOP[2]]
    while len(left) and path[-1][1] > _THROAT_BOTTOM_Y:
        number = _nearest(left, path[-1])
        path.append(left[number])
        left = np.delete(left, number, axis=0)
    return np.array(path)


def _nearest(points: FloatArray, point: FloatArray) -> int:
    return int(np.argmin(np.linalg.norm(points - point, axis=1)))


def hand_places(mesh: Mesh, skin: SkinPoints, frames: FloatArray) -> SkinPoints:
    """Return the 50 hand markers on `skin`, given the bones' rest frames (22, 3, 3)."""
    spots: dict[str, tuple[str, float, float]] = {}
    for number, names in enumerate(FINGERS, start=1):
        bones = [f"finger{number}-{part}" for part in (1, 2, 3)]
        along = [(bones[0], 0.5), (bones[1], 0.5), (bones[2], 0.15), (bones[2], 0.75)]
        spots |= {n: (bone, at, 0.0) for n, (bone, at) in zip(names, along, strict=True)}
        spots[KNUCKLES[number - 1]] = (bones[1 if number == 1 else 0], 0.0, 0.0)
        spots[SIDES[number - 1]] = (bones[1], 0.5, _SIDE_ANGLES_DEG[number])
    for number, name in enumerate(PALM, start=1):
        spots[name] = (f"metacarpal{number}", 0.5, (number - 2) * 4.0)
    for name, angle in zip(WRIST, _WRIST_ANGLES_DEG, strict=True):
        spots[name] = ("wrist", 0.0, angle)
    for name in FOREARM:
        ring, place = int(name[1]), int(name[2])
        spots[name] = ("forearm", _FOREARM_RINGS[ring], _FOREARM_ANGLES_DEG[place])
    points = skin.of(mesh.vertices)
    numbers = [_around_bone(mesh, skin, points, frames, *spots[name]) for name in HAND_MARKERS]
    return skin.chosen(np.array(numbers))


def _around_bone(
    mesh: Mesh,
    skin: SkinPoints,
    points: FloatArray,
    frames: FloatArray,
    bone: str,
    part: float,
    angle_deg: float,
) -> int:
    """Return the point at `part` of a bone's length, turned from dorsal towards ulnar."""
    held: tuple[str, ...]
    if bone == "forearm":
        start, end = mesh.joints["lowerarm01.R"][0], mesh.joints["wrist.R"][0]
        number, held = ARM_BONES.index("lowerarm01"), ("lowerarm01", "lowerarm02")
    else:
        start, end = mesh.joints[f"{bone}.R"]
        number, held = ARM_BONES.index(bone), (bone, *_neighbours(bone))
    weight = np.sum([mesh.weights[f"{name}.R"] for name in held], axis=0)
    candidates = np.flatnonzero(skin.of(weight) > 0.35)
    local = (points[candidates] - start) @ frames[number]
    radius = np.hypot(local[:, 0], local[:, 2])
    turn = np.degrees(np.arctan2(local[:, 0], local[:, 2])) - angle_deg
    turn = np.radians((turn + 180.0) % 360.0 - 180.0)
    away = np.hypot(local[:, 1] - part * np.linalg.norm(end - start), radius * turn)
    away[np.abs(turn) > 0.9] = np.inf
    return int(candidates[np.argmin(away)])


def _neighbours(bone: str) -> tuple[str, ...]:
    """Return the bones whose skin may carry a marker of `bone` too."""
    if bone == "wrist":
        return ("lowerarm02",)
    if bone.startswith("metacarpal"):
        return ("wrist", *(f"metacarpal{m}" for m in range(1, 5)))
    finger, part = int(bone[6]), int(bone[8])
    if part > 1:
        return (f"finger{finger}-{part - 1}",)
    return (f"metacarpal{finger - 1}",) if finger > 1 else ("wrist",)
