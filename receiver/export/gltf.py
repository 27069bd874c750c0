"""The avatar in motion as a binary glTF 2.0 file, for Blender, three.js and others.

Head and hand are meshes whose shape lies in morph targets (the directions of the avatar's map);
the hand moves as a node. The neck follows the head by shares of its turn and shift, which blending
two matrices gives badly: joints stand at several shares, each vertex lies between two of them.
Everything is animated over time. Khronos, glTF 2.0 specification, sections 3.6, 3.7, 3.11 and 4.4.
"""

import json
import struct
from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from codec.cuer.motion import Motion, sample_params
from receiver.drawing.avatar import Avatar, Surface, vertex_normals
from receiver.drawing.movement import RULES, express
from receiver.drawing.skeleton import Skeleton, gaze_in_head, solve

_HEAD, _HAND, _FIRST_JOINT = 1, 2, 3
"""Numbers of the nodes."""

_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_KINDS = {"f4": 5126, "u2": 5123, "u1": 5121}
_SHARES = np.linspace(0, 1, 6)
"""Shares of the head's turn at which joints stand: the chest, the neck, the head."""

_BONES = ("clavicleRight", "upperArmRight", "lowerArmRight", "clavicleLeft")

_LIP_RANK = 16
"""Directions kept of the lips' corrections, chosen for an error below 0.05 mm."""

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
        self,
        values: ArrayLike,
        kind: str = "<f4",
        *,
        target: int | None = None,
        normalised: bool = False,
        bounds: bool = False,
    ) -> int:
        """Append an array (N,) or (N, C); return the number of its accessor."""
        array = np.ascontiguousarray(values, dtype=kind)
        rows = array.reshape(len(array), -1)
        view: dict[str, Any] = {
            "buffer": 0,
            "byteOffset": len(self.data),
            "byteLength": array.nbytes,
        }
        if target is not None:
            view["target"] = target
        accessor: dict[str, Any] = {
            "bufferView": len(self.views),
            "componentType": _KINDS[array.dtype.str[1:]],
            "count": len(rows),
            "type": _TYPES[rows.shape[1]],
        }
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
    build: _Builder,
    surface: Surface,
    name: str,
    targets: NDArray[np.float64],
    influences: tuple[NDArray[np.float64], NDArray[np.int64]] | None,
) -> dict[str, Any]:
    """Return a mesh with morph targets (R, V, 3), and four weights and joints of each vertex."""
    rest = surface.refine(surface.rest[None])[0]
    colours = surface.colours.astype(np.float64) / 255
    rgba = np.concatenate([colours[:, :3] ** 2.2, colours[:, 4:]], axis=1)
    attributes = {
        "POSITION": build.add(rest, target=_ARRAY_BUFFER, bounds=True),
        "NORMAL": build.add(_unit_normals(rest, surface.triangles), target=_ARRAY_BUFFER),
        "COLOR_0": build.add(np.rint(rgba * 255), "u1", target=_ARRAY_BUFFER, normalised=True),
    }
    if influences is not None:
        attributes["WEIGHTS_0"] = build.add(influences[0], target=_ARRAY_BUFFER)
        attributes["JOINTS_0"] = build.add(influences[1], "u1", target=_ARRAY_BUFFER)
    return {
        "name": name,
        "primitives": [
            {
                "attributes": attributes,
                "material": 0,
                "indices": build.add(surface.triangles.ravel(), "<u2", target=_INDEX_BUFFER),
                "targets": [
                    {"POSITION": build.add(t, target=_ARRAY_BUFFER, bounds=True)} for t in targets
                ],
            }
        ],
        "weights": [0.0] * len(targets),
    }


def _influences(avatar: Avatar) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return weights and joints, shape (V, 4): two of the neck's and up to two of the arms'."""
    head, skeleton = avatar.head, avatar.skeleton
    control = np.zeros((len(head.rest), skeleton.weights.shape[1]))
    control[skeleton.vertices] = skeleton.weights
    arms = (control[head.sources] * head.shares[..., None]).sum(axis=1)
    best = np.argsort(-arms, axis=1)[:, :2]
    kept = np.take_along_axis(arms, best, axis=1)
    total = arms.sum(axis=1, keepdims=True)
    kept *= total / np.maximum(kept.sum(axis=1, keepdims=True), 1e-9)
    place = avatar.head_weights[:, 0] * (len(_SHARES) - 1)
    below = np.minimum(place.astype(int), len(_SHARES) - 2)
    neck = np.stack([np.maximum(0, below + 1 - place), place - below], axis=1)
    weights = np.concatenate([neck * (1 - total), kept], axis=1)
    joints = np.concatenate([below[:, None], below[:, None] + 1, best + len(_SHARES)], axis=1)
    return weights, joints * (weights > 0)


def _bones(skeleton: Skeleton) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the arms' joints begin, shape (4, 3), and axes (4, 3, 3), the second along."""
    right, left = skeleton.roots
    starts = np.array([right, skeleton.shoulders[0], skeleton.elbow, left])
    along = np.array([skeleton.shoulders[0], skeleton.elbow, right, skeleton.shoulders[1]]) - starts
    frames = []
    for way in along:
        axes = np.linalg.svd(way[None])[2]
        axes[0] = way / np.linalg.norm(way)
        frames.append(np.column_stack([np.cross(axes[0], axes[1]), axes[0], axes[1]]))
    return starts, np.array(frames)


def _expression_targets(avatar: Avatar, names: Iterable[str]) -> NDArray[np.float64]:
    """Return displacements (R, V, 3): of the blend shapes, then of both eyes to a side and up."""
    found = [
        _on_surface(avatar.head, avatar.shapes[name][0], avatar.shapes[name][1][None])[0]
        for name in names
    ]
    rest = avatar.head.refine(avatar.head.rest[None])[0]
    aside, up = np.zeros_like(rest), np.zeros_like(rest)
    for (first, count), middle in zip(avatar.eye_ranges, avatar.eye_middles, strict=True):
        x, y, z = (rest[first : first + count] - middle).T
        aside[first : first + count] = np.stack([z, 0 * x, -x], axis=1)
        up[first : first + count] = np.stack([0 * x, z, -y], axis=1)
    return np.array([*found, aside, up])


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
    added = express(voice, partial(sample_params, motion), motion.times_s)
    pose = solve(avatar.skeleton, voice, params, added)
    weights = avatar.shape_weights(added, pose)
    shapes = _expression_targets(avatar, weights)
    expression = np.column_stack([*weights.values(), gaze_in_head(added, pose)])
    lips, pressed = _lips(avatar, shape)
    head_targets = np.concatenate([_directions(avatar.head), lips, shapes])
    meshes = [
        _mesh(build, avatar.head, "head", head_targets, _influences(avatar)),
        _mesh(build, avatar.hand, "hand", _directions(avatar.hand), None),
    ]
    head_weights = (shape - avatar.head.markers).reshape(len(params), -1)
    head_weights = head_weights @ avatar.head.coefficients
    head_weights = np.concatenate([head_weights, pressed, expression], axis=1)
    still = voice.hand.shape(params[:, voice.hand_columns[:12]])
    hand_weights = (still - avatar.hand.markers).reshape(len(params), -1)
    hand_weights = hand_weights @ avatar.hand.coefficients
    times = build.add(np.arange(len(params)) / motion.rate_hz, bounds=True)
    animation: dict[str, Any] = {"name": "cueing", "samplers": [], "channels": []}

    def animate(node: int, path: str, values: NDArray[np.float64]) -> None:
        number = build.add(values.ravel() if path == "weights" else values)
        animation["channels"].append(
            {"sampler": len(animation["samplers"]), "target": {"node": node, "path": path}}
        )
        animation["samplers"].append({"input": times, "output": number})

    order = np.argsort(avatar.head_weights[:, 0])
    shifts = np.interp(_SHARES, *avatar.head_weights[order].T)
    carried = [
        (_FIRST_JOINT + k, pose.head * np.repeat([turn, shift], 3), voice.face.pivot)
        for k, (turn, shift) in enumerate(zip(_SHARES, shifts, strict=True))
    ]
    side, _, front = added.trunk.T / RULES["lean_mm"]
    turned = Rotation.from_rotvec(np.stack([front, np.zeros_like(front), -side], axis=1))

    def leant(places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return places of the upright figure, shape (T, 3), where they are as it leans."""
        head = voice.face.pivot
        return np.asarray(turned.apply(places - head) + head + added.trunk)

    for node, moved, pivot in (*carried, (_HAND, pose.hand, voice.hand.pivot)):
        animate(node, "rotation", (turned * Rotation.from_rotvec(moved[:, :3])).as_quat())
        animate(node, "translation", leant(moved[:, 3:] + pivot))
    starts, axes = _bones(avatar.skeleton)
    first_bone = _FIRST_JOINT + len(_SHARES)
    for k, (start, frame) in enumerate(zip(starts, axes, strict=True)):
        maps = pose.joints[:, k]
        # glTF animates no matrices: a bone's map is a rotation with a stretch along the bone's
        # axes.
        linear = maps[:, :, :3] @ frame
        stretch = np.linalg.norm(linear, axis=1)
        upright = Rotation.from_matrix(linear / stretch[:, None])
        animate(first_bone + k, "rotation", (turned * upright).as_quat())
        animate(first_bone + k, "scale", stretch)
        animate(first_bone + k, "translation", leant(maps[:, :, :3] @ start + maps[:, :, 3]))
    animate(_HEAD, "weights", head_weights)
    animate(_HAND, "weights", hand_weights)
    bind = np.tile(np.eye(4), (len(_SHARES) + len(starts), 1, 1))
    bind[: len(_SHARES), :3, 3] = -voice.face.pivot
    # Inverse bind of a bone: x -> R^T (x - start).
    bind[len(_SHARES) :, :3, :3] = axes.transpose(0, 2, 1)
    bind[len(_SHARES) :, :3, 3] = -(axes.transpose(0, 2, 1) @ starts[..., None])[..., 0]
    joints = [_FIRST_JOINT + k for k in range(len(bind))]
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
            *({"name": name, "translation": start.tolist()} for name, start in zip(
                _BONES, starts, strict=True,
            )),
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
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(data)),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(data), b"BIN\0"),
            data,
        ]
    )
