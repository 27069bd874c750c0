"""The mesh at another age, of another sex: the same markers, lips and eyes, another head.

Targets of hm08 are added to the mesh; then its skin is drawn back (by radial functions) so that
every face marker lies where it was. Lips, teeth and the surroundings of the eyes keep their
shape, because blend shapes and the rule of the lips belong to them.
"""

import gzip
from pathlib import Path

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree

from codec.errors import CueError
from lab.avatar.looks import Look
from lab.avatar.parts import FloatArray, IntArray
from synth.motion.body.mesh import Mesh

_MM_PER_UNIT = 100.0
"""Millimetres in a unit of a target: it is drawn in decimetres."""

_LIPS_MM = (8.0, 24.0)
"""Distances in mm from the lips between which the mesh begins to change."""

_EYE_MM = (18.0, 24.0)
"""Distances in mm from the middle of an eye between which it does."""

_NECK_MM = (550.0, 615.0)
"""Heights in mm, in the mesh's coordinates, between which the bust becomes the head: the bust has
targets of its own."""


def read_target(folder: Path, name: str, count: int) -> FloatArray:
    """Return the displacement (count, 3) of hm08 by a packed target, mm.

    Raises
    ------
    CueError
        If the file cannot be read.
    """
    path = folder / f"{name}.target.gz"
    moved = np.zeros((count, 3))
    try:
        for line in gzip.decompress(path.read_bytes()).decode().splitlines():
            fields = line.split()
            if len(fields) == 4 and not line.startswith("#"):
                moved[int(fields[0])] = [float(field) for field in fields[1:]]
    except (OSError, ValueError, IndexError, EOFError) as error:
        raise CueError(f"{path}: not a target of hm08: {error}") from error
    return moved * _MM_PER_UNIT


def morph(
    mesh: Mesh,
    look: Look,
    folder: Path,
    face: tuple[FloatArray, FloatArray],
    rings: IntArray,
    inside: IntArray,
    balls: list[IntArray],
) -> FloatArray:
    """Return the displacement (V, 3) of the mesh for a look, mm.

    Parameters
    ----------
    mesh : Mesh
    look : Look
    folder : Path
        Of the targets.
    face : tuple of ndarray, shape (63, 3)
        The face markers on the mesh as it is, and on the mesh with the targets added.
    rings, inside : ndarray of int
        Vertices of the lips; of teeth and tongue.
    balls : list of ndarray of int
        Those of each eye.
    """
    at, moved = mesh.vertices, summed(look.targets, folder, len(mesh.vertices))
    before, after = face
    # The whole head may be larger: the markers say how it comes back.
    back = RBFInterpolator(after, before - after, kernel="thin_plate_spline", degree=1)
    near = at[:, 1] > _NECK_MM[0]
    drawn = np.zeros_like(moved)
    drawn[near] = moved[near] + back(at[near] + moved[near])
    drawn *= _fade(at[:, 1], *_NECK_MM)[:, None]
    drawn *= _fade(cKDTree(at[rings.ravel()]).query(at)[0], *_LIPS_MM)[:, None]
    drawn[inside] = 0
    for ball in balls:
        middle = 0.5 * (at[ball].min(axis=0) + at[ball].max(axis=0))
        drawn *= _fade(np.linalg.norm(at - middle, axis=1), *_EYE_MM)[:, None]
    return drawn


def summed(targets: tuple[tuple[str, float], ...], folder: Path, count: int) -> FloatArray:
    """Return the sum (count, 3) of targets, each with its share, mm."""
    parts = [share * read_target(folder, name, count) for name, share in targets]
    return np.asarray(sum(parts, start=np.zeros((count, 3))))


def _fade(value: FloatArray, low: float, high: float) -> FloatArray:
    """Return 0 below `low`, 1 above `high`, smooth between."""
    share = np.clip((value - low) / (high - low), 0, 1)
    return np.asarray(share * share * (3 - 2 * share))
