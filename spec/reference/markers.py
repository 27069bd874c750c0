"""spec/voice.md in plain numbers, from the text: a voice file, parameters to markers, its identity.

Standard library only, slow on purpose.
"""

import ast
import hashlib
import math
import struct
import zipfile
from dataclasses import dataclass
from pathlib import Path

Vector = tuple[float, float, float]

ARRAYS = (
    "face.mean", "face.directions", "face.pivot", "face.motion_mean", "face.motion_directions",
    "face.weights", "hand.angle_mean", "hand.angle_directions", "hand.regression", "hand.pivot",
    "hand.motion_mean", "hand.motion_directions", "hand.deviations", "gestures.shape_targets",
    "gestures.placement_targets", "gestures.viseme_targets", "gestures.neutral_head",
)  # fmt: skip
"""(O2) Their order."""

N_FACE, N_HAND, N_SHAPE, N_ARTICULATION = 63, 50, 12, 7


@dataclass
class Array:
    """Numbers of an array, one after the other, and its shape."""

    shape: tuple[int, ...]
    numbers: list[float]
    data: bytes

    def at(self, *index: int) -> float:
        """Return one number; the last index runs fastest."""
        place = 0
        for size, i in zip(self.shape, index, strict=True):
            place = place * size + i
        return self.numbers[place]


def read_voice(path: Path) -> dict[str, Array]:
    """(O1) Return the arrays of a voice file."""
    arrays = {}
    with zipfile.ZipFile(path) as archive:
        for name in ARRAYS:
            data = archive.read(f"{name}.npy")
            end = 10 + int.from_bytes(data[8:10], "little")
            described = ast.literal_eval(data[10:end].decode("ascii"))
            assert described["descr"] == "<f4"
            assert not described["fortran_order"]
            count = (len(data) - end) // 4
            numbers = list(struct.unpack(f"<{count}f", data[end:]))
            arrays[name] = Array(tuple(described["shape"]), numbers, data[end:])
    return arrays


def identity(voice: dict[str, Array]) -> str:
    """(O3) Return the identity of a voice."""
    digest = hashlib.sha256(b"cuecast-voice-1")
    for name in ARRAYS:
        digest.update(f"{name}{voice[name].shape}".encode("ascii") + voice[name].data)
    return digest.hexdigest()[:16]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def moved(q: Vector, motion: list[float]) -> Vector:
    """(O6) Return a point turned and moved."""
    r = (motion[0], motion[1], motion[2])
    n = math.sqrt(sum(x * x for x in r))
    a, b = (math.sin(n) / n, (1 - math.cos(n)) / n**2) if n > 1e-6 else (1.0, 0.5)
    once = cross(r, q)
    twice = cross(r, once)
    x, y, z = (q[k] + a * once[k] + b * twice[k] + motion[3 + k] for k in range(3))
    return x, y, z


def motion_of(voice: dict[str, Array], part: str, parameters: list[float]) -> list[float]:
    """(O7) Return the motion of head or forearm."""
    mean, directions = voice[f"{part}.motion_mean"], voice[f"{part}.motion_directions"]
    return [
        mean.at(k) + sum(p * directions.at(i, k) for i, p in enumerate(parameters))
        for k in range(6)
    ]


def markers(voice: dict[str, Array], parameters: list[float]) -> list[Vector]:
    """(O4, O8, O9) Return the 113 markers of one frame."""
    n_head = voice["face.motion_directions"].shape[0]
    face, rest = parameters[:N_ARTICULATION], parameters[N_ARTICULATION:]
    hand, rest = rest[:N_SHAPE], rest[N_SHAPE:]
    head, forearm = rest[:n_head], rest[n_head:]
    return face_markers(voice, face, head) + hand_markers(voice, hand, forearm)


def face_markers(voice: dict[str, Array], face: list[float], head: list[float]) -> list[Vector]:
    """(O8) Return the markers of the face."""
    motion = motion_of(voice, "face", head)
    pivot = voice["face.pivot"].numbers
    found = []
    for i in range(N_FACE):
        q = [
            voice["face.mean"].at(i, k)
            - pivot[k]
            + sum(p * voice["face.directions"].at(j, i, k) for j, p in enumerate(face))
            for k in range(3)
        ]
        own = [motion[k] * voice["face.weights"].at(i, k) for k in range(6)]
        x, y, z = moved((q[0], q[1], q[2]), own)
        found.append((x + pivot[0], y + pivot[1], z + pivot[2]))
    return found


def hand_markers(voice: dict[str, Array], hand: list[float], forearm: list[float]) -> list[Vector]:
    """(O9) Return the markers of hand and forearm."""
    motion = motion_of(voice, "hand", forearm)
    pivot = voice["hand.pivot"].numbers
    directions = voice["hand.angle_directions"]
    angles = [
        mean + sum(p * directions.at(i, a) for i, p in enumerate(hand))
        for a, mean in enumerate(voice["hand.angle_mean"].numbers)
    ]
    row = [1.0, *(math.cos(a) for a in angles), *(math.sin(a) for a in angles)]
    regression = voice["hand.regression"]
    found = []
    for i in range(N_HAND):
        q = [sum(v * regression.at(j, i, k) for j, v in enumerate(row)) for k in range(3)]
        x, y, z = moved((q[0], q[1], q[2]), motion)
        found.append((x + pivot[0], y + pivot[1], z + pivot[2]))
    return found
