"""Reading the MakeHuman base mesh hm08 (CC0): vertices, groups, rig, weights, face units.

All lengths are given in millimetres: the files hold decimetres.

The head and tail of a bone come from the rig's *strategy* (joint cubes, vertices, means of
vertices) on this very mesh; the ``default_position`` beside it belongs to another body.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

_MM_PER_UNIT = 100.0
"""Millimetres in a unit of the file: it is drawn in decimetres."""

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Mesh:
    """The base mesh with its rig.

    Attributes
    ----------
    vertices : ndarray, shape (V, 3)
        Millimetres; x to the viewer's right, y up, z to the viewer.
    faces : ndarray of int, shape (F, 4)
        Quads of the skin; triangles repeat their last corner.
    joints : dict of str to (head, tail)
        Ends of every bone, each of shape (3,).
    weights : dict of str to ndarray, shape (V,)
        Skin weight of every bone.
    units : dict of str to ndarray, shape (V, 3)
        Displacement of every face unit at weight 1.
    """

    vertices: FloatArray
    faces: NDArray[np.int64]
    joints: dict[str, tuple[FloatArray, FloatArray]]
    weights: dict[str, FloatArray]
    units: dict[str, FloatArray]


def read_mesh(folder: str | os.PathLike[str]) -> Mesh:
    """Read ``base.obj``, ``rig.default.json``, ``weights.default.json`` and ``faceunits``.

    Raises
    ------
    CueError
        If a file is missing or malformed.
    """
    root = Path(folder)
    try:
        vertices, groups, faces = _read_obj(root / "base.obj")
        rig = json.loads((root / "rig.default.json").read_text())
        table = json.loads((root / "weights.default.json").read_text())["weights"]
        units = {
            path.stem: _read_target(path, len(vertices))
            for path in sorted((root / "faceunits").glob("*.target"))
        }
        joints = {
            name: (_place(bone["head"], vertices, groups), _place(bone["tail"], vertices, groups))
            for name, bone in rig.items()
        }
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        raise CueError(f"{root}: not the hm08 mesh: {error!r}") from error
    weights = {name: _dense(pairs, len(vertices)) for name, pairs in table.items()}
    return Mesh(vertices, faces, joints, weights, units)


def _read_obj(path: Path) -> tuple[FloatArray, dict[str, list[int]], NDArray[np.int64]]:
    vertices: list[list[float]] = []
    groups: dict[str, list[int]] = {}
    faces: list[list[int]] = []
    group = ""
    for line in path.read_text().splitlines():
        kind, *fields = line.split() or [""]
        if kind == "v":
            vertices.append([float(field) for field in fields[:3]])
        elif kind == "g":
            group = fields[0]
        elif kind == "f":
            corners = [int(field.split("/")[0]) - 1 for field in fields]
            groups.setdefault(group, []).extend(corners)
            if group == "body":
                faces.append((corners + corners[-1:])[:4])
    return np.array(vertices) * _MM_PER_UNIT, groups, np.array(faces)


def _place(end: dict[str, Any], vertices: FloatArray, groups: dict[str, list[int]]) -> FloatArray:
    """Return the position of one end of a bone by the rig's strategy."""
    strategy = end["strategy"]
    if strategy == "CUBE":
        chosen = sorted(set(groups[end["cube_name"]]))
    elif strategy == "MEAN":
        chosen = end["vertex_indices"]
    elif strategy == "VERTEX":
        chosen = [end["vertex_index"]]
    else:
        raise ValueError(f"unknown joint strategy {strategy!r}")
    mean: FloatArray = vertices[chosen].mean(axis=0)
    return mean


def _read_target(path: Path, n: int) -> FloatArray:
    delta = np.zeros((n, 3))
    for line in path.read_text().splitlines():
        fields = line.split()
        if len(fields) == 4 and not line.startswith("#"):
            delta[int(fields[0])] = [float(field) for field in fields[1:]]
    return delta * _MM_PER_UNIT


def _dense(pairs: list[list[float]], n: int) -> FloatArray:
    weight = np.zeros(n)
    for vertex, value in pairs:
        weight[int(vertex)] = value
    return weight
