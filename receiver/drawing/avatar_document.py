"""An avatar as one binary message, which page and player read (``page/avatar.js``).

An `Avatar` goes in and its document comes out: a JSON header, then its arrays. An avatar made from
a file of others (`receiver.foreign`) is kept in such a document, so it is read here as well.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.errors import CueError
from receiver.drawing.avatar import (
    OFFSET_UNIT,
    SHARE_UNIT,
    Avatar,
    Surface,
    has_avatar,
    load_avatar,
)
from receiver.drawing.mouth import Mouth
from receiver.drawing.portrait import (
    FROM_LIGHT,
    LIGHT,
    SHADOW_SIDE,
    SHADOW_TEXEL_MM,
    SHADOW_WEIGHTS,
)
from receiver.drawing.skeleton import Reach, Skeleton

MAX_BYTES = 1 << 24
"""Bytes of a document at most."""

_BASIS_UNIT = 32767
"""Largest whole number of a signed 16-bit field."""

_KINDS = {"f4": "<f4", "i2": "<i2", "u2": "<u2", "u1": "u1"}


def avatar_documents(voice: Voice, own: bytes | None = None) -> dict[str, bytes]:
    """Return the avatar's documents by file name: ``avatar.bin``, and ``avatar-LOOK.bin``.

    Parameters
    ----------
    voice : Voice
    own : bytes, optional
        Document of an avatar that replaces the voice's, in all its looks.
    """
    if own is not None:
        return {"avatar.bin": own}
    if not has_avatar(voice):
        return {}
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
        "voice": np.frombuffer(avatar.voice.identity.encode(), np.uint8),
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
        "joint_places": skeleton.reach.places.astype("<f4"),
        "joint_factors": skeleton.reach.factors.astype("<f4"),
        "joint_vertices": skeleton.vertices.astype("<u2"),
        "joint_weights": np.rint(255 * skeleton.weights).astype("u1"),
    }


def _shape_arrays(shapes: Mapping[str, tuple[NDArray[Any], NDArray[Any]]]) -> dict[str, Any]:
    arrays: dict[str, Any] = {}
    for name, (vertices, deltas) in shapes.items():
        arrays[f"shape.{name}"] = vertices.astype("<u2")
        arrays[f"deltas.{name}"] = np.rint(deltas * OFFSET_UNIT).astype("<i2")
    return arrays


def _surface_arrays(prefix: str, surface: Surface) -> dict[str, Any]:
    """Return the arrays as they travel; the scale of the basis moves into the coefficients."""
    scale = np.maximum(np.abs(surface.basis).max(axis=(1, 2), initial=0), 1e-9) / _BASIS_UNIT
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


def read_avatar(data: bytes, voice: Voice) -> Avatar:
    """Return the avatar of a document.

    Parameters
    ----------
    data : bytes
    voice : Voice
        For which it was made.

    Raises
    ------
    CueError
        If it is no such document, damaged, or made for another voice.
    """
    a = _arrays(data)
    try:
        identity = a["voice"].tobytes().decode("ascii", "replace")
        if identity != voice.identity:
            raise CueError(f"avatar was made for voice {identity:.40}, not {voice.identity}")
        names = [name.removeprefix("shape.") for name in a if name.startswith("shape.")]
        joint = {k.removeprefix("joint_"): v for k, v in a.items() if k.startswith("joint_")}
        reach = Reach(_rows(joint["places"]), _rows(joint["factors"]))
        skeleton = Skeleton(
            joint["vertices"].astype(np.int64),
            joint["weights"].reshape(-1, 4) / 255,
            _rows(joint["roots"]),
            _rows(joint["shoulders"]),
            _rows(joint["elbow"])[0],
            joint["forearm"].astype(np.float64),
            reach,
        )
        avatar = Avatar(
            voice, _surface_of(a, "head"), _surface_of(a, "hand"),
            a["head_weights"].reshape(-1, 2).astype(np.float64), _mouth_of(a),
            {name: (a[f"shape.{name}"].astype(np.int64), _rows(a[f"deltas.{name}"]) / OFFSET_UNIT)
             for name in names},
            a["eye_ranges"].reshape(2, 2).astype(np.int64), _rows(a["eye_middles"]), skeleton,
            (), voice.face.mean.astype(np.float64), np.zeros((0, len(voice.face.mean), 3)),
            ("own",),
        )  # fmt: skip
        _check(avatar)
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise CueError(f"damaged avatar: {error!r}") from error
    return avatar


def _arrays(data: bytes) -> dict[str, NDArray[Any]]:
    if len(data) > MAX_BYTES:
        raise CueError(f"avatar of {len(data)} bytes, {MAX_BYTES} at most")
    length = int.from_bytes(data[:4], "little")
    try:
        entries = json.loads(data[4 : 4 + length])
        body = memoryview(data)[4 + length :]
        return {
            str(name): np.frombuffer(body, _KINDS[kind], size, offset)
            for name, kind, offset, size in entries
        }
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise CueError(f"not an avatar, or cut off: {error}") from error


def _rows(values: NDArray[Any]) -> NDArray[np.float64]:
    return values.reshape(-1, 3).astype(np.float64)


def _surface_of(a: Mapping[str, NDArray[Any]], prefix: str) -> Surface:
    own = {k.removeprefix(f"{prefix}_"): v for k, v in a.items() if k.startswith(f"{prefix}_")}
    moving = own["moving"].astype(np.int64)
    coefficients = own["coefficients"].reshape(own["markers"].size, -1).astype(np.float64)
    return Surface(
        _rows(own["markers"]),
        _rows(own["rest"]),
        coefficients,
        own["basis"].reshape(coefficients.shape[1], len(moving), 3).astype(np.float64),
        moving,
        own["sources"].reshape(-1, 3).astype(np.int64),
        _rows(own["shares"]) / SHARE_UNIT,
        _rows(own["offsets"]) / OFFSET_UNIT,
        own["triangles"].reshape(-1, 3).astype(np.int64),
        own["colours"].reshape(-1, 5),
    )


def _mouth_of(a: Mapping[str, NDArray[Any]]) -> Mouth:
    whole = {name: a[f"mouth_{name}"].astype(np.int64) for name in ("upper", "lower", "beside")}
    columns = a["mouth_rings"].size // 13
    return Mouth(
        a["mouth_rings"].reshape(13, columns).astype(np.int64),
        whole["upper"],
        whole["lower"],
        whole["beside"],
        a["mouth_between"].astype(np.float64),
        a["mouth_lining"].reshape(6, columns, 3).astype(np.float64),
        a["mouth_arch"].reshape(2, 5).astype(np.float64),
        int(a["mouth_jaw"][0]),
        a["mouth_jaw_rest"].astype(np.float64),
    )


def _check(avatar: Avatar) -> None:
    """Raise `ValueError` where numbers of vertices lie beyond the arrays, or are not finite."""
    head, hand, mouth = avatar.head, avatar.hand, avatar.mouth
    vertices = len(head.sources)
    limits = [
        (avatar.eye_ranges.sum(axis=1), vertices + 1),
        (avatar.skeleton.vertices, len(head.rest)),
        (mouth.rings, len(head.rest)),
        (np.array([mouth.jaw]), len(head.rest)),
        *((found[0], len(head.rest)) for found in avatar.shapes.values()),
    ]
    for surface in (head, hand):
        limits += [
            (surface.sources, len(surface.rest)),
            (surface.moving, len(surface.rest)),
            (surface.triangles, len(surface.sources)),
        ]
        for array in (surface.rest, surface.coefficients, surface.markers):
            if not np.isfinite(array).all():
                raise ValueError("numbers are not finite")
        if not len(surface.sources) == len(surface.colours) == len(surface.offsets):
            raise ValueError("arrays of one surface differ in length")
    # Kernels index without checks, so every number is checked once here.
    for numbers, limit in limits:
        if numbers.size and numbers.max() >= limit:
            raise ValueError(f"vertex {numbers.max()} of {limit}")
    if len(avatar.head_weights) != vertices or not np.isfinite(avatar.head_weights).all():
        raise ValueError("weights of other vertices")
