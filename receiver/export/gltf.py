"""The avatar in motion as a binary glTF 2.0 file, for Blender, three.js and others.

Head and hand are meshes whose shape lies in morph targets (the directions of the avatar's map);
the hand moves as a node. The neck follows the head by shares of its turn and shift, which blending
two matrices gives badly: joints stand at several shares, each vertex lies between two of them.
Everything is animated over time. Khronos, glTF 2.0 specification, sections 3.6, 3.7, 3.11 and 4.4.
"""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from codec.cuer.motion import Motion
from receiver.drawing.avatar import Avatar, Surface, eyes_closed, vertex_normals

_HEAD, _HAND, _FIRST_JOINT = 1, 2, 3
"""Numbers of the nodes."""

_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_KINDS = {"f4": 5126, "u2": 5123, "u1": 5121}
_SHARES = np.linspace(0, 1, 6)
"""Shares of the head's turn at which joints stand: the chest, the neck, the head."""

_LIP_RANK = 16
"""Directions in which the lips' corrections are kept, chosen for an error below 0.05 mm."""

_MOST_LIP_FRAMES, _BATCH = 2000, 64
"""Frames that these directions are learnt from, at most, and frames computed at once."""

_ARRAY_BUFFER, _INDEX_BUFFER = 34962, 34963
"""Targets of buffers, numbers of glTF 2.0."""


class _Builder:
    """Collects arrays into one buffer with its views and accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(
        self, values: ArrayLike, kind: str = "<f4", *, target: int | None = None,
        normalised: bool = False, bounds: bool = False,
    ) -> int:  # fmt: skip
        """Append an array (N,) or (N, C); return the number of its accessor."""
        array = np.ascontiguousarray(values, dtype=kind)
        rows = array.reshape(len(array), -1)
        view: dict[str, Any] = {
            "buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes,
        }  # fmt: skip
        if target is not None:
            view["target"] = target
        accessor: dict[str, Any] = {
            "bufferView": len(self.views), "componentType": _KINDS[array.dtype.str[1:]],
            "count": len(rows), "type": _TYPES[rows.shape[1]],
        }  # fmt: skip
        if normalised:
            accessor["normalized"] = True
        if bounds:
            accessor["min"] = rows.min(axis=0).tolist()
            accessor["max"] = rows.max(axis=0).tolist()
        self.data += array.tobytes()
        self.data += bytes(-len(self.data) % 4)
        self.views.append(view)
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _mesh(
    build: _Builder, surface: Surface, name: str, targets: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
) -> dict[str, Any]:  # fmt: skip
    """Return a mesh with morph targets (R, V, 3), and joints if it has weights (V,)."""
    rest = surface.refine(surface.rest[None])[0]
    colours = surface.colours.astype(np.float64) / 255
    rgba = np.concatenate([colours[:, :3] ** 2.2, colours[:, 4:]], axis=1)
    attributes = {
        "POSITION": build.add(rest, target=_ARRAY_BUFFER, bounds=True),
        "NORMAL": build.add(_unit_normals(rest, surface.triangles), target=_ARRAY_BUFFER),
        "COLOR_0": build.add(np.rint(rgba * 255), "u1", target=_ARRAY_BUFFER, normalised=True),
    }
    if weights is not None:
        place = weights * (len(_SHARES) - 1)
        below = np.minimum(place.astype(int), len(_SHARES) - 2)
        none = np.zeros_like(weights)
        pairs = np.stack([np.maximum(0, below + 1 - place), place - below, none, none], axis=1)
        attributes["WEIGHTS_0"] = build.add(pairs, target=_ARRAY_BUFFER)
        joints = np.stack([below, below + 1, none, none], axis=1) * (pairs > 0)
        attributes["JOINTS_0"] = build.add(joints, "u1", target=_ARRAY_BUFFER)
    return {
        "name": name,
        "primitives": [{
            "attributes": attributes, "material": 0,
            "indices": build.add(surface.triangles.ravel(), "<u2", target=_INDEX_BUFFER),
            "targets": [
                {"POSITION": build.add(t, target=_ARRAY_BUFFER, bounds=True)} for t in targets
            ],
        }],
        "weights": [0.0] * len(targets),
    }  # fmt: skip


def _unit_normals(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return normals that all have a length, also where triangles have no area."""
    normals = vertex_normals(points, triangles)
    normals[np.linalg.norm(normals, axis=1) < 0.5] = [0.0, 0.0, 1.0]
    return normals


def _directions(surface: Surface) -> NDArray[np.float64]:
    """Return the displacement of the surface by each direction of its map, (R, V, 3)."""
    return _on_surface(surface, surface.moving, surface.basis)


def _on_surface(
    surface: Surface, vertices: NDArray[np.int64], moved: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return displacements (R, V, 3) of the surface by those (R, N, 3) of control vertices."""
    control = np.zeros((len(moved), len(surface.rest), 3))
    control[:, vertices] = moved
    return np.asarray(surface.refine(control) - surface.offsets)


def _lips(
    avatar: Avatar, shape: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return displacements (R, V, 3) and weights (T, R) that keep the lips off each other.

    What the rule of `Mouth` corrects, in its principal directions over the motion.
    """
    rings, corrections = avatar.mouth.rings.ravel(), []
    for start in range(0, len(shape), _BATCH):
        control = avatar.head.control(shape[start : start + _BATCH])
        before = control[:, rings]
        avatar.mouth.solve(control)
        corrections.append((control[:, rings] - before).reshape(len(control), -1))
    all_frames = np.concatenate(corrections)
    step = max(1, len(all_frames) // _MOST_LIP_FRAMES)
    _, _, directions = np.linalg.svd(all_frames[::step], full_matrices=False)
    kept = directions[:_LIP_RANK]
    displaced = _on_surface(avatar.head, rings, kept.reshape(len(kept), -1, 3))
    return displaced, all_frames @ kept.T


def glb(motion: Motion, avatar: Avatar) -> bytes:
    """Return a ``.glb`` file of the motion; lengths in metres, y up, facing +z.

    Parameters
    ----------
    motion : Motion
    avatar : Avatar
        Of the motion's voice.
    """
    voice, build = avatar.voice, _Builder()
    params = motion.params.astype(np.float64)
    shape = voice.face.shape(params[:, voice.face_columns[:7]])
    blink = sum(
        _on_surface(avatar.head, vertices, moved[None])
        for vertices, moved in map(avatar.shapes.__getitem__, ("eyeBlinkLeft", "eyeBlinkRight"))
    )
    lips, pressed = _lips(avatar, shape)
    head_targets = np.concatenate([_directions(avatar.head), lips, blink])
    meshes = [
        _mesh(build, avatar.head, "head", head_targets, avatar.head_weights[:, 0]),
        _mesh(build, avatar.hand, "hand", _directions(avatar.hand), None),
    ]
    head_weights = (shape - avatar.head.markers).reshape(len(params), -1)
    closed = eyes_closed(motion.times_s)[:, None]
    head_weights = head_weights @ avatar.head.coefficients
    head_weights = np.concatenate([head_weights, pressed, closed], axis=1)
    still = voice.hand.shape(params[:, voice.hand_columns[:12]])
    hand_weights = (still - avatar.hand.markers).reshape(len(params), -1)
    hand_weights = hand_weights @ avatar.hand.coefficients
    times = build.add(np.arange(len(params)) / motion.rate_hz, bounds=True)
    animation: dict[str, Any] = {"name": "cueing", "samplers": [], "channels": []}

    def animate(node: int, path: str, values: NDArray[np.float64]) -> None:
        number = build.add(values.ravel() if path == "weights" else values)
        animation["channels"].append({
            "sampler": len(animation["samplers"]), "target": {"node": node, "path": path},
        })  # fmt: skip
        animation["samplers"].append({"input": times, "output": number})

    head = voice.face.motion(params[:, voice.face_columns[7:]])
    forearm = voice.hand.motion(params[:, voice.hand_columns[12:]])
    order = np.argsort(avatar.head_weights[:, 0])
    shifts = np.interp(_SHARES, *avatar.head_weights[order].T)
    carried = [
        (_FIRST_JOINT + k, head * np.repeat([turn, shift], 3), voice.face.pivot)
        for k, (turn, shift) in enumerate(zip(_SHARES, shifts, strict=True))
    ]
    for node, moved, pivot in (*carried, (_HAND, forearm, voice.hand.pivot)):
        animate(node, "rotation", Rotation.from_rotvec(moved[:, :3]).as_quat())
        animate(node, "translation", moved[:, 3:] + pivot)
    animate(_HEAD, "weights", head_weights)
    animate(_HAND, "weights", hand_weights)
    bind = np.tile(np.eye(4), (len(_SHARES), 1, 1))
    bind[:, :3, 3] = -voice.face.pivot
    joints = [_FIRST_JOINT + k for k in range(len(_SHARES))]
    document = {
        "asset": {"version": "2.0", "generator": "cuecast"},
        "scene": 0,
        "scenes": [{"nodes": [0, _HEAD]}],
        "nodes": [
            {"name": voice.name, "children": [_HAND, *joints], "scale": [0.001] * 3},
            {"name": "head", "mesh": 0, "skin": 0},
            {"name": "hand", "mesh": 1},
            *(
                {"name": f"neck {share:.1f}", "translation": voice.face.pivot.tolist()}
                for share in _SHARES
            ),
        ],
        "skins": [{
            "joints": joints,
            "inverseBindMatrices": build.add(bind.transpose(0, 2, 1).reshape(-1, 16)),
        }],
        "meshes": meshes,
        "materials": [{
            "name": "skin", "alphaMode": "BLEND",
            "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.6},
        }],
        "animations": [animation],
        "accessors": build.accessors,
        "bufferViews": build.views,
        "buffers": [{"byteLength": len(build.data)}],
    }  # fmt: skip
    return _container(json.dumps(document).encode(), bytes(build.data))


def _container(text: bytes, data: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    return b"".join([
        struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(data)),
        struct.pack("<I4s", len(text), b"JSON"), text,
        struct.pack("<I4s", len(data), b"BIN\0"), data,
    ])  # fmt: skip
