"""Derive the project's body assets from the CC0 mesh hm08.

``python -m lab.body --mesh FOLDER`` reads the mesh folder (``base.obj``, rig, weights,
face units and the two marker layouts) and writes into ``synth/assets``: ``hm08_markers.npz``, and
the arm poses and the arcs of every cuer as ``reach_NAME.npz``. The origin of all coordinates
becomes the middle between the ears.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import synth
from codec.cuer.layout import FACE_MARKERS
from codec.errors import CueError
from codec.files.npz import write_arrays
from lab.arcs import solve_arcs
from synth.motion.body.anatomy import IDENTITIES
from synth.motion.body.body import load_body
from synth.motion.body.mesh import Mesh, read_mesh
from synth.motion.body.placing import face_places, hand_places, sample_skin
from synth.motion.body.reach import solve_reach
from synth.motion.body.skeleton import ARM_BONES, FINGER_BONES, METACARPALS, NECK_BONES, frame

FloatArray = NDArray[np.float64]

ASSETS = Path(synth.__file__).parent / "assets"

_NOT_SPEECH = ("eye", "tongue", "look")

_LARYNX_CENTRE = np.array([0.0, 583.0, 69.0])
"""Middle of the larynx in mm, in the mesh's coordinates."""

_LARYNX_SPREAD_MM = np.array([16.0, 17.0, 40.0])
"""Distances in mm, by axis, over which the skin follows the larynx less and less."""


def main(arguments: list[str] | None = None) -> int:
    """Run the script."""
    parser = argparse.ArgumentParser(prog="lab.body", description=__doc__)
    parser.add_argument("--mesh", type=Path, required=True, help="folder of the hm08 mesh")
    parser.add_argument("--out", type=Path, default=ASSETS, help="folder of the assets")
    options = parser.parse_args(arguments)
    try:
        mesh = read_mesh(options.mesh)
        arrays = marker_arrays(mesh, options.mesh / "face63_hm08.json")
    except CueError as error:
        print(f"lab.body: {error}", file=sys.stderr)
        return 3
    write_arrays(options.out / "hm08_markers.npz", arrays)
    for name in IDENTITIES:
        body = load_body(name)
        wrist, forearm = solve_reach(body)
        arrays = {"wrist": wrist, "forearm": forearm, "arcs": solve_arcs(body, wrist, forearm)}
        write_arrays(options.out / f"reach_{name}.npz", arrays)
    return 0


def marker_arrays(mesh: Mesh, layout: Path) -> dict[str, NDArray[np.generic]]:
    """Return the arrays of the marker asset; `layout` lists the vertices of the face."""
    skin = sample_skin(mesh)
    frames, zero = _arm_frames(mesh)
    face, hand = face_places(mesh, skin, layout), hand_places(mesh, skin, frames)
    at = dict(zip(FACE_MARKERS, face.of(mesh.vertices), strict=True))
    origin = 0.5 * (at["EAR_R"] + at["EAR_L"])
    names = [n for n in mesh.units if not n.lower().startswith(_NOT_SPEECH)]
    units = [*(face.of(mesh.units[name]) for name in names), _larynx(face.of(mesh.vertices))]
    starts = np.array([mesh.joints[f"{bone}.R"][0] for bone in ARM_BONES])
    ends = np.array([mesh.joints[f"{bone}.R"][1] for bone in ARM_BONES])
    normals = vertex_normals(mesh)
    landmark = {
        "mouth_corner": at["LC_R"],
        "chin": at["CH0"],
        "cheekbone": at["CK2_R"],
        "larynx": _LARYNX_CENTRE,
        "ear": at["EAR_R"],
    }
    return {
        "face_rest": (face.of(mesh.vertices) - origin).astype(np.float32),
        "face_normals": unit(face.of(normals)).astype(np.float32),
        "face_weights": face.of(neck_weights(mesh)).astype(np.float32),
        "face_origins": np.array([mesh.joints[bone][0] - origin for bone in NECK_BONES]),
        "unit_names": np.array([*names, "larynxRaise"]),
        "units": np.array(units, dtype=np.float32),
        "landmark_names": np.array(list(landmark)),
        "landmarks": np.array(list(landmark.values())) - origin,
        "shoulder": mesh.joints["upperarm01.R"][0] - origin,
        "hand_rest": (hand.of(mesh.vertices) - origin).astype(np.float32),
        "hand_normals": unit(hand.of(normals)).astype(np.float32),
        "hand_weights": hand.of(arm_weights(mesh)).astype(np.float32),
        "arm_frames": frames,
        "arm_origins": starts - origin,
        "arm_lengths": np.linalg.norm(ends - starts, axis=1),
        "arm_radii": _radii(mesh, frames, starts),
        "finger_zero": zero,
    }


def _larynx(points: FloatArray) -> FloatArray:
    """Return the displacement (N, 3) of the throat when the larynx rises by 1 mm."""
    distance = (points - _LARYNX_CENTRE) / _LARYNX_SPREAD_MM
    rise = np.exp(-0.5 * (distance**2).sum(axis=1))
    return np.stack([np.zeros_like(rise), rise, 0.25 * rise], axis=1)


def vertex_normals(mesh: Mesh) -> FloatArray:
    """Return the outward normal of the skin at every vertex, shape (V, 3)."""
    corner = mesh.vertices[mesh.faces]
    across = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    normals = np.zeros_like(mesh.vertices)
    for number in range(4):
        np.add.at(normals, mesh.faces[:, number], across)
    return unit(normals)


def unit(vectors: FloatArray) -> FloatArray:
    """Return `vectors` (N, 3) at length 1; zeros stay zeros."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))


def _radii(mesh: Mesh, frames: FloatArray, starts: FloatArray) -> FloatArray:
    """Return the typical distance of the skin from each arm bone's axis, shape (22,), mm."""
    weights = arm_weights(mesh)
    radii = np.empty(len(ARM_BONES))
    for bone in range(len(ARM_BONES)):
        held = np.flatnonzero(weights[:, bone] > 0.4)
        local = (mesh.vertices[held] - starts[bone]) @ frames[bone]
        radii[bone] = np.median(np.hypot(local[:, 0], local[:, 2]))
    return radii


def neck_weights(mesh: Mesh) -> FloatArray:
    """Return weights (V, 5): facial bones count as head, everything below the neck as chest."""
    neck = np.stack([mesh.weights[bone] for bone in NECK_BONES[1:4]], axis=1)
    facial = ("head", "jaw", "oris", "levator", "special", "orbicularis", "risorius", "temporalis",
              "oculi", "tongue", "eye")  # fmt: skip
    head = sum(
        (w for bone, w in mesh.weights.items() if bone.startswith(facial)),
        start=np.zeros(len(mesh.vertices)),
    )
    total = sum(mesh.weights.values(), start=np.zeros(len(mesh.vertices)))
    chest = total - neck.sum(axis=1) - head
    weights = np.column_stack([chest, neck, head])
    return np.asarray(weights / np.maximum(total, 1e-9)[:, None])


def arm_weights(mesh: Mesh) -> FloatArray:
    """Return weights (V, 22); those of the upper arm go to the first forearm bone."""
    weights = np.stack([mesh.weights[f"{bone}.R"] for bone in ARM_BONES], axis=1)
    weights[:, 0] += mesh.weights["upperarm01.R"] + mesh.weights["upperarm02.R"]
    return np.asarray(weights / np.maximum(weights.sum(axis=1), 1e-9)[:, None])


def _arm_frames(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Return rest frames (22, 3, 3) and the fingers' zero frames in the hand (5, 3, 3)."""
    start = {bone: mesh.joints[f"{bone}.R"][0] for bone in ARM_BONES}
    along = {bone: mesh.joints[f"{bone}.R"][1] - start[bone] for bone in ARM_BONES}
    knuckle = [start[bones[0]] for bones in FINGER_BONES]
    across = knuckle[4] - knuckle[1]
    frames = {"wrist": frame(knuckle[2] - start["wrist"], across)}
    for bone in ("lowerarm01", "lowerarm02"):
        frames[bone] = frame(start["wrist"] - start["lowerarm01"], frames["wrist"][:, 0])
    ulnar = [
        -np.cross(along["finger1-1"], along["finger1-3"]),
        knuckle[2] - knuckle[1],
        knuckle[3] - knuckle[1],
        knuckle[4] - knuckle[2],
        knuckle[4] - knuckle[3],
    ]
    for bone, axis in zip(METACARPALS, ulnar[1:], strict=True):
        frames[bone] = frame(along[bone], axis)
    zero = []
    for bones, axis in zip(FINGER_BONES, ulnar, strict=True):
        for bone in bones:
            frames[bone] = frame(along[bone], axis)
        zero.append(frames["wrist"].T @ frame(frames["wrist"][:, 1], axis))
    zero[0] = frames["wrist"].T @ frames["finger1-1"]
    return np.array([frames[bone] for bone in ARM_BONES]), np.array(zero)


if __name__ == "__main__":
    sys.exit(main())
