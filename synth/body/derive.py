"""Derive the project's body assets from the CC0 mesh hm08.

``python -m synth.body.derive --mesh FOLDER`` reads the mesh folder (``base.obj``, rig, weights,
face units and the two marker layouts) and writes into ``synth/assets``: ``hm08_markers.npz``, and
the arm poses of every cuer as ``reach_NAME.npz``. The origin of all coordinates becomes the
middle between the ears.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from codec.layout import FACE_MARKERS, HAND_MARKERS
from codec.npz import write_arrays
from synth.body.anatomy import IDENTITIES
from synth.body.body import load_body
from synth.body.mesh import Mesh, read_mesh
from synth.body.reach import solve_reach
from synth.body.skeleton import ARM_BONES, FINGER_BONES, METACARPALS, NECK_BONES, frame

FloatArray = NDArray[np.float64]

ASSETS = Path(__file__).parents[1] / "assets"

_NOT_SPEECH = ("eye", "tongue", "look")
_LARYNX_CENTRE = np.array([0.0, 583.0, 69.0])
_LARYNX_SPREAD_MM = np.array([16.0, 17.0, 40.0])


def main(arguments: list[str] | None = None) -> int:
    """Run the script."""
    parser = argparse.ArgumentParser(prog="synth.body.derive", description=__doc__)
    parser.add_argument("--mesh", type=Path, required=True, help="folder of the hm08 mesh")
    parser.add_argument("--out", type=Path, default=ASSETS, help="folder of the assets")
    options = parser.parse_args(arguments)
    try:
        mesh = read_mesh(options.mesh)
        face = _layout(options.mesh / "face63_hm08.json", FACE_MARKERS)
        hand = _layout(options.mesh / "hand50_hm08.json", HAND_MARKERS)
    except CueError as error:
        print(f"synth.body.derive: {error}", file=sys.stderr)
        return 3
    write_arrays(options.out / "hm08_markers.npz", marker_arrays(mesh, face, hand))
    for name in IDENTITIES:
        wrist, forearm = solve_reach(load_body(name))
        write_arrays(options.out / f"reach_{name}.npz", {"wrist": wrist, "forearm": forearm})
    return 0


def _layout(path: Path, names: tuple[str, ...]) -> NDArray[np.int64]:
    """Return the vertex of each marker."""
    vertex = {m["name"]: m["vertex"] for m in json.loads(path.read_text())["markers"]}
    vertex |= {f"{n[:3]}_{n[3:]}": v for n, v in vertex.items() if n.startswith("TH")}
    missing = [name for name in names if name not in vertex]
    if missing:
        raise CueError(f"{path}: no vertex for markers {', '.join(missing)}")
    return np.array([vertex[name] for name in names])


def marker_arrays(
    mesh: Mesh, face: NDArray[np.int64], hand: NDArray[np.int64]
) -> dict[str, NDArray[np.generic]]:
    """Return the arrays of the marker asset for marker vertices `face` (63,), `hand` (50,)."""
    ears = face[[FACE_MARKERS.index("EAR_R"), FACE_MARKERS.index("EAR_L")]]
    origin = mesh.vertices[ears].mean(axis=0)
    unit_names, units = _units(mesh, face)
    frames, zero = _arm_frames(mesh)
    starts = np.array([mesh.joints[f"{bone}.R"][0] for bone in ARM_BONES])
    ends = np.array([mesh.joints[f"{bone}.R"][1] for bone in ARM_BONES])
    landmark = {
        "mouth_corner": mesh.vertices[face[FACE_MARKERS.index("LC_R")]],
        "chin": mesh.vertices[face[FACE_MARKERS.index("CH0")]],
        "cheekbone": mesh.vertices[face[FACE_MARKERS.index("CK2_R")]],
        "larynx": _LARYNX_CENTRE,
    }
    return {
        "face_rest": (mesh.vertices[face] - origin).astype(np.float32),
        "face_weights": _neck_weights(mesh)[face].astype(np.float32),
        "face_origins": np.array([mesh.joints[bone][0] - origin for bone in NECK_BONES]),
        "unit_names": np.array(unit_names),
        "units": units.astype(np.float32),
        "landmark_names": np.array(list(landmark)),
        "landmarks": np.array(list(landmark.values())) - origin,
        "shoulder": mesh.joints["upperarm01.R"][0] - origin,
        "hand_rest": (mesh.vertices[hand] - origin).astype(np.float32),
        "hand_weights": _arm_weights(mesh)[hand].astype(np.float32),
        "arm_frames": frames,
        "arm_origins": starts - origin,
        "arm_lengths": np.linalg.norm(ends - starts, axis=1),
        "finger_zero": zero,
    }


def _units(mesh: Mesh, points: NDArray[np.int64]) -> tuple[list[str], FloatArray]:
    """Return names and displacements (U, N, 3) of the speech units and the larynx."""
    names = [n for n in mesh.units if not n.lower().startswith(_NOT_SPEECH)]
    larynx = np.zeros((len(points), 3))
    distance = (mesh.vertices[points] - _LARYNX_CENTRE) / _LARYNX_SPREAD_MM
    larynx[:, 1] = np.exp(-0.5 * (distance**2).sum(axis=1))
    larynx[:, 2] = 0.25 * larynx[:, 1]
    return [*names, "larynxRaise"], np.array([*(mesh.units[n][points] for n in names), larynx])


def _neck_weights(mesh: Mesh) -> FloatArray:
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


def _arm_weights(mesh: Mesh) -> FloatArray:
    """Return weights (V, 22); what the upper arm holds goes to the first forearm bone."""
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
        knuckle[2] - knuckle[1], knuckle[3] - knuckle[1],
        knuckle[4] - knuckle[2], knuckle[4] - knuckle[3],
    ]  # fmt: skip
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
