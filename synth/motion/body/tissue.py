"""Skin that slides: what no rigid joint and no linear face unit explains.

Markers are glued to skin, not to bone. On hand and forearm the skin slides by 0.5-2 mm with the
joints nearby and with the tension of the flexors; on the face two units together do not give the
sum of their effects. The sizes come from the literature on skin markers; the pattern is seeded
and belongs to the cuer. Smooth functions of the pose, so that truth stays differentiable.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from synth.motion.body.skeleton import ANGLE_NUMBER, ARM_BONES, HAND_ANGLES

FloatArray = NDArray[np.float64]

_ALONG_MM = (0.4, 1.6)
"""Least and largest slide in mm along a bone, for a joint bent by a quarter turn."""

_ACROSS_MM = 0.4
"""Standard deviation in mm of the slide across it, for the same."""

_FOREARM_TWIST_MM = 7.0
"""Largest slide in mm around the forearm, for a quarter turn of it."""

_FOREARM_GRIP_MM = 0.9
"""Twice the standard deviation in mm of the push of a finger's muscles, bent by a quarter turn."""

_FACE_MM = 1.2
"""Displacement in mm of a point of the face where two units act together."""

_PAIRS = (
    ("jawOpen", "mouthPucker"),
    ("jawOpen", "mouthFunnel"),
    ("jawOpen", "mouthStretchLeft"),
    ("jawOpen", "mouthSmileRight"),
    ("mouthPucker", "mouthFunnel"),
    ("mouthPucker", "mouthPucker"),
    ("jawOpen", "jawOpen"),
    ("mouthLowerDownLeft", "mouthPucker"),
)
_TYPICAL = {"jawOpen": 0.3, "larynxRaise": 3.0}

_TYPICAL_UNIT = 0.4
"""Usual size of a face unit for which the table above has none."""


@dataclass(frozen=True, slots=True)
class HandTissue:
    """Slide of the hand's markers.

    Attributes
    ----------
    swing : ndarray, shape (31, N, 3)
        Shift by ``1 - cos`` of each angle, mm, in the rest pose's coordinates.
    pull : ndarray, shape (31, N, 3)
        Shift by ``sin`` of each angle.
    """

    swing: FloatArray
    pull: FloatArray

    def shift(self, angles: FloatArray) -> FloatArray:
        """Return the slide (T, N, 3), mm, for angles (T, 31) in degrees."""
        a = np.radians(angles)
        terms = np.concatenate([1.0 - np.cos(a), np.sin(a)], axis=1)
        return np.tensordot(terms, np.concatenate([self.swing, self.pull]), axes=1)


def hand_tissue(weights: FloatArray, frames: FloatArray, seed: int) -> HandTissue:
    """Return the slide of markers with skin weights (N, 22) on bones with frames (22, 3, 3)."""
    rng = np.random.default_rng([seed, 53])
    n = len(weights)
    swing, pull = np.zeros((len(HAND_ANGLES), n, 3)), np.zeros((len(HAND_ANGLES), n, 3))
    for marker, bone in enumerate(np.argmax(weights, axis=1)):
        axes = frames[bone].T
        for name in _angles_near(ARM_BONES[bone]):
            along = rng.uniform(*_ALONG_MM) * rng.choice([-1.0, 1.0])
            across = rng.normal(scale=_ACROSS_MM, size=2)
            vector = along * axes[1] + across[0] * axes[0] + across[1] * axes[2]
            swing[ANGLE_NUMBER[name], marker] = vector
        if ARM_BONES[bone].startswith("lowerarm"):
            around = rng.uniform(0.4, 1.0) * _FOREARM_TWIST_MM
            pull[ANGLE_NUMBER["forearm_twist"], marker] = around * axes[0]
            for finger in ("index", "middle", "ring", "little"):
                grip = rng.normal(scale=_FOREARM_GRIP_MM / 2, size=3)
                swing[ANGLE_NUMBER[f"{finger}_pip"], marker] = grip
    return HandTissue(swing, pull)


def _angles_near(bone: str) -> tuple[str, ...]:
    """Return the flexions of the joints at both ends of a bone."""
    if bone.startswith("finger1"):
        return {
            "1": ("thumb_flex", "thumb_mcp"),
            "2": ("thumb_mcp", "thumb_ip"),
            "3": ("thumb_ip",),
        }[bone[-1]]
    if bone.startswith("finger"):
        finger = ("index", "middle", "ring", "little")[int(bone[6]) - 2]
        ends = {"1": ("mcp", "pip"), "2": ("pip", "dip"), "3": ("dip",)}[bone[-1]]
        return tuple(f"{finger}_{end}" for end in ends)
    if bone.startswith("metacarpal"):
        finger = ("index", "middle", "ring", "little")[int(bone[-1]) - 1]
        return ("wrist_flex", f"{finger}_mcp")
    return ("wrist_flex",)


@dataclass(frozen=True, slots=True)
class FaceTissue:
    """What pairs of face units add to their sum.

    Attributes
    ----------
    first, second : ndarray of int64, shape (K,)
        Numbers of the units of each pair.
    shift_mm : ndarray, shape (K, N, 3)
        Shift for a product of 1.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    shift_mm: FloatArray

    def shift(self, units: FloatArray) -> FloatArray:
        """Return the shift (T, N, 3), mm, for unit weights (T, U)."""
        return np.tensordot(units[:, self.first] * units[:, self.second], self.shift_mm, axes=1)


def face_tissue(units: FloatArray, names: tuple[str, ...], seed: int) -> FaceTissue:
    """Return the cross terms of face units with displacements `units` (U, N, 3)."""
    rng = np.random.default_rng([seed, 59])
    first = np.array([names.index(a) for a, _ in _PAIRS])
    second = np.array([names.index(b) for _, b in _PAIRS])
    size = np.linalg.norm(units, axis=2)
    local = np.sqrt(size[first] * size[second])
    local /= local.max(axis=1, keepdims=True)
    typical = np.array(
        [_TYPICAL.get(a, _TYPICAL_UNIT) * _TYPICAL.get(b, _TYPICAL_UNIT) for a, b in _PAIRS]
    )
    direction = rng.normal(size=(len(_PAIRS), 1, 3)) + 0.5 * rng.normal(size=(*local.shape, 3))
    direction /= np.linalg.norm(direction, axis=2, keepdims=True)
    return FaceTissue(
        first, second, _FACE_MM * local[..., None] * direction / typical[:, None, None]
    )
