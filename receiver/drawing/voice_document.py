"""A voice and its avatar as the page's documents.

The voice: the matrices of the paper's two algorithms and the camera, as JSON; numbers travel as
base64 of little-endian float64, so that the page (``page/model.js``) computes from the same values.
The avatar: a JSON header and its arrays in one binary message (``page/avatar.js``).
"""

import base64
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cuer.layout import MARKERS, N_FACE, longest_finger_tip
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS
from codec.cues.score import SHAPES
from codec.superframe.resynthesis.targets import Targets
from receiver.drawing.avatar import (
    OFFSET_UNIT,
    SHARE_UNIT,
    Avatar,
    Surface,
    has_avatar,
    load_avatar,
)
from receiver.drawing.camera import ASPECT, Camera, frame_cuer
from receiver.drawing.mouth import Mouth
from receiver.drawing.movement import movement_document
from receiver.drawing.portrait import (
    FROM_LIGHT,
    LIGHT,
    SHADOW_SIDE,
    SHADOW_TEXEL_MM,
    SHADOW_WEIGHTS,
)
from receiver.drawing.skeleton import Skeleton

_FACE_ARRAYS = ("mean", "directions", "pivot", "motion_mean", "motion_directions", "weights")
_HAND_ARRAYS = (
    "angle_mean", "angle_directions", "regression", "pivot", "motion_mean", "motion_directions",
)  # fmt: skip

_BASIS_UNIT = 32767
"""Largest whole number of a signed 16-bit field."""


def _encode(array: ArrayLike) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode()


def neutral_camera(voice: Voice) -> Camera:
    """Return the camera that frames the voice's neutral posture."""
    neutral = voice.reconstruct(np.zeros((1, len(voice.layout)), dtype=np.float32))[0]
    return frame_cuer(neutral)


def voice_document(voice: Voice) -> dict[str, Any]:
    """Return what ``/voice.json`` serves.

    Parameters
    ----------
    voice : Voice

    Returns
    -------
    dict
        ``identity``, ``layout``, ``markers``, ``face_markers``, ``aspect``, ``camera``,
        ``movement`` (constants of the hand's clock, and where it is for each key, mm),
        ``rules`` (`receiver.drawing.movement`), ``looks`` (appearances of the avatar),
        ``pointing`` (marker of each shape), ``gestures`` (targets, as parameters), and the arrays
        of ``face`` and ``hand`` under the names of
        `codec.cuer.models`.
    """
    camera = neutral_camera(voice)
    return {
        "identity": voice.identity,
        "layout": list(voice.layout),
        "markers": list(MARKERS),
        "face_markers": N_FACE,
        "aspect": ASPECT,
        "camera": {
            "centre": camera.centre,
            "height_mm": camera.height_mm,
            "distance_mm": camera.distance_mm,
        },
        "movement": _movement(voice),
        "rules": movement_document(voice),
        "looks": list(load_avatar(voice).looks) if has_avatar(voice) else [],
        "pointing": [longest_finger_tip(shape) for shape in SHAPES],
        "gestures": {
            "shapes": _encode(voice.gestures.shape_targets),
            "forearms": _encode(voice.gestures.placement_targets),
            "head": _encode(voice.gestures.neutral_head),
        },
        "face": {name: _encode(getattr(voice.face, name)) for name in _FACE_ARRAYS},
        "hand": {name: _encode(getattr(voice.hand, name)) for name in _HAND_ARRAYS},
    }


def _movement(voice: Voice) -> dict[str, Any]:
    targets = Targets.of(voice)
    return asdict(targets.movement) | {
        "rest_gap_s": DEFAULT_OPTIONS.rest_gap_s, "places": targets.places.round(1).tolist(),
    }  # fmt: skip


def avatar_documents(voice: Voice) -> dict[str, bytes]:
    """Return the avatar's documents by file name: ``avatar.bin``, and ``avatar-LOOK.bin``."""
    first = load_avatar(voice)
    found = {"avatar.bin": avatar_document(first)}
    for look in first.looks[1:]:
        found[f"avatar-{look}.bin"] = avatar_document(load_avatar(voice, look))
    return found


def avatar_document(avatar: Avatar) -> bytes:
    """Return what ``/avatar.bin`` serves.

    Returns
    -------
    bytes
        Length of the header, u32 little endian; the header, JSON, padded with blanks to a
        multiple of four: for every array its name, kind, offset behind the header and length;
        then the arrays, little endian, each on a multiple of four bytes.
    """
    arrays = {
        "head_weights": avatar.head_weights.astype("<f4"),
        "eye_ranges": avatar.eye_ranges.astype("<u2"),
        "eye_middles": avatar.eye_middles.astype("<f4"),
        **_mouth_arrays(avatar.mouth),
        **_joint_arrays(avatar.skeleton),
        **_shape_arrays(avatar.shapes),
        **_surface_arrays("head", avatar.head),
        **_surface_arrays("hand", avatar.hand),
        "light": LIGHT.ravel(),
        "from_light": FROM_LIGHT.ravel(),
        "shadow": np.array([SHADOW_SIDE, SHADOW_TEXEL_MM, *SHADOW_WEIGHTS], "<f4"),
    }
    entries, body = [], b""
    for name, array in arrays.items():
        entries.append([name, array.dtype.str[1:], len(body), array.size])
        data = array.tobytes()
        body += data + bytes(-len(data) % 4)
    header = json.dumps(entries).encode()
    header += b" " * (-len(header) % 4)
    return len(header).to_bytes(4, "little") + header + body


def _mouth_arrays(mouth: Mouth) -> dict[str, Any]:
    kinds = {
        "rings": "<u2", "upper": "u1", "lower": "u1", "beside": "u1", "between": "<f4",
        "lining": "<f4", "arch": "<f4", "jaw_rest": "<f4",
    }  # fmt: skip
    arrays = {f"mouth_{name}": getattr(mouth, name).astype(kind) for name, kind in kinds.items()}
    return arrays | {"mouth_jaw": np.array([mouth.jaw], dtype="<u2")}


def _joint_arrays(skeleton: Skeleton) -> dict[str, Any]:
    names = ("roots", "shoulders", "elbow", "forearm")
    arrays = {f"joint_{name}": getattr(skeleton, name).astype("<f4") for name in names}
    return arrays | {
        "joint_vertices": skeleton.vertices.astype("<u2"),
        "joint_weights": np.rint(255 * skeleton.weights).astype("u1"),
    }  # fmt: skip


def _shape_arrays(shapes: Mapping[str, tuple[NDArray[Any], NDArray[Any]]]) -> dict[str, Any]:
    arrays: dict[str, Any] = {}
    for name, (vertices, deltas) in shapes.items():
        arrays[f"shape.{name}"] = vertices.astype("<u2")
        arrays[f"deltas.{name}"] = np.rint(deltas * OFFSET_UNIT).astype("<i2")
    return arrays


def _surface_arrays(prefix: str, surface: Surface) -> dict[str, Any]:
    """Return the arrays as they travel; the scale of the basis moves into the coefficients."""
    scale = np.abs(surface.basis).max(axis=(1, 2)) / _BASIS_UNIT
    arrays = {
        "markers": surface.markers.astype("<f4"),
        "rest": surface.rest.astype("<f4"),
        "coefficients": (surface.coefficients * scale).astype("<f4"),
        "basis": np.rint(surface.basis / scale[:, None, None]).astype("<i2"),
        "moving": surface.moving.astype("<u2"),
        "sources": surface.sources.astype("<u2"),
        "shares": np.rint(surface.shares * SHARE_UNIT).astype("u1"),
        "offsets": np.rint(surface.offsets * OFFSET_UNIT).astype("<i2"),
        "triangles": surface.triangles.astype("<u2"),
        "colours": surface.colours,
    }
    return {f"{prefix}_{name}": np.ascontiguousarray(array) for name, array in arrays.items()}
