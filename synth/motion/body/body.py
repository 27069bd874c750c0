"""The virtual cuer's forward model: a pose in, points of her skin out.

A `BodyPose` holds face-unit weights, the head's turn and shift, the hand's angles and the forearm's
rigid motion, each per frame. `Body.markers` gives the 113 markers, `Body.points` any skin.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.models.rigid import rotation_matrices
from codec.errors import CueError
from codec.files.npz import read_arrays
from synth.motion.body.anatomy import Anatomy, Habits, identity
from synth.motion.body.skeleton import (
    ARM_BONES,
    FINGER_BONES,
    NECK_SHARE,
    ArmRig,
    arm_parents,
    frame,
)
from synth.motion.body.skin import Skin, stretch
from synth.motion.body.tissue import FaceTissue, HandTissue, face_tissue, hand_tissue

FloatArray = NDArray[np.float64]

_MAX_ASSET_BYTES = 20_000_000
"""Bytes of an asset, unpacked, at most: a bound against damaged files."""

_SLOPE_DEG = 64.0
"""Angle of the resting forearm above the horizontal, in degrees; chosen by eye."""

REFERENCE_FOREARM = frame(
    np.array([np.cos(np.radians(_SLOPE_DEG)), np.sin(np.radians(_SLOPE_DEG)), -0.05]),
    np.array([1.0, -0.4, 0.0]),
)
"""Frame of the forearm at rotation vector zero: a raised arm, back of the hand to the viewer."""


@dataclass(frozen=True, slots=True)
class BodyPose:
    """A run of poses.

    Attributes
    ----------
    units : ndarray, shape (T, U)
        Weights of the face units, as named by `Body.unit_names`.
    head : ndarray, shape (T, 6)
        Rotation vector, rad, and shift, mm, of the head.
    angles : ndarray, shape (T, 31)
        Degrees, columns as `synth.motion.body.skeleton.HAND_ANGLES`.
    forearm : ndarray, shape (T, 6)
        Rotation vector, rad, from `REFERENCE_FOREARM`, and position of the wrist joint, mm.
    """

    units: FloatArray
    head: FloatArray
    angles: FloatArray
    forearm: FloatArray

    def __post_init__(self) -> None:
        lengths = {len(self.units), len(self.head), len(self.angles), len(self.forearm)}
        if len(lengths) != 1:
            raise CueError(f"the parts of a pose have {sorted(lengths)} frames, not one length")

    def __len__(self) -> int:
        return len(self.units)


@dataclass(frozen=True, slots=True)
class Body:
    """One cuer's body.

    Attributes
    ----------
    name : str
    anatomy : Anatomy
    habits : Habits
    arm : ArmRig
    face_skin, hand_skin : Skin
        The 63 and 50 markers.
    face_tissue, hand_tissue : FaceTissue, HandTissue
        How the skin slides.
    face_normals, hand_normals : ndarray, shapes (63, 3) and (50, 3)
        Outward normals of the skin at the markers, at rest.
    arm_lengths, arm_radii : ndarray, shape (22,)
        Length and thickness of each arm bone with its flesh, mm.
    units : ndarray, shape (U, 63, 3)
        Displacement of the face markers by each unit at weight 1, mm.
    unit_names : tuple of str
    landmarks : dict of str to ndarray
        Points of the head at rest that placements refer to, and the right shoulder.
    """

    name: str
    anatomy: Anatomy
    habits: Habits
    arm: ArmRig
    face_skin: Skin
    hand_skin: Skin
    face_tissue: FaceTissue
    hand_tissue: HandTissue
    face_normals: FloatArray
    hand_normals: FloatArray
    arm_lengths: FloatArray
    arm_radii: FloatArray
    units: FloatArray
    unit_names: tuple[str, ...]
    landmarks: dict[str, FloatArray]

    def markers(
        self, pose: BodyPose, neck: tuple[FloatArray, FloatArray] | None = None
    ) -> FloatArray:
        """Return the 113 markers, shape (T, 113, 3), mm; `neck` is that of the pose, if known."""
        face = self.face(pose.units, pose.head, neck)
        return np.concatenate([face, self.hand(pose.angles, pose.forearm)], axis=1)

    def face(
        self, units: FloatArray, head: FloatArray, neck: tuple[FloatArray, FloatArray] | None = None
    ) -> FloatArray:
        """Return the 63 markers of head and throat, shape (T, 63, 3), mm."""
        shift = np.tensordot(units, self.units, axes=1) + self.face_tissue.shift(units)
        return self.face_skin.place_moved(shift, *(neck or self.neck(head)))

    def hand(self, angles: FloatArray, forearm: FloatArray) -> FloatArray:
        """Return the 50 markers of hand and forearm, shape (T, 50, 3), mm."""
        bones = self.arm_bones(angles, forearm)
        return self.hand_skin.place_moved(self.hand_tissue.shift(angles), *bones)

    def normals(self, pose: BodyPose) -> FloatArray:
        """Return the outward normals of the skin at the markers, shape (T, 113, 3)."""
        face = self.face_skin.turned(self.face_normals, self.neck(pose.head)[0])
        bones = self.arm_bones(pose.angles, pose.forearm)
        return np.concatenate([face, self.hand_skin.turned(self.hand_normals, bones[0])], axis=1)

    def arm_bones(self, angles: FloatArray, forearm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return frames (T, 22, 3, 3) and places (T, 22, 3) of the arm's bones."""
        turn = rotation_matrices(forearm[:, :3]) @ REFERENCE_FOREARM
        return self.arm.pose(angles, turn, forearm[:, 3:])

    def neck(self, head: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return frames (T, 5, 3, 3) and places (T, 5, 3) of chest, neck and head.

        The head's turn and shift grow from joint to joint: the throat follows partly.
        """
        origins = self.face_skin.origins
        share = np.cumsum(NECK_SHARE)
        turns = rotation_matrices(share[:, None] * head[:, None, :3])
        places = np.empty((len(head), len(share), 3))
        places[:, 0] = origins[0]
        for bone in range(1, len(share)):
            step = turns[:, bone - 1] @ (origins[bone] - origins[bone - 1])
            places[:, bone] = places[:, bone - 1] + step + NECK_SHARE[bone] * head[:, 3:]
        return turns, places


@cache
def load_body(name: str = "claire") -> Body:
    """Return a cuer's body, built from the mesh asset and her proportions."""
    anatomy, habits = identity(name)
    raw = load_asset("hm08_markers")
    scale = np.array(anatomy.face) * anatomy.scale
    face_origins = raw["face_origins"] * scale
    identity_frames = np.broadcast_to(np.eye(3), (len(face_origins), 3, 3)).copy()
    face_skin = Skin(raw["face_rest"] * scale, raw["face_weights"], identity_frames, face_origins)
    names = tuple(map(str, raw["landmark_names"]))
    landmarks = dict(zip(names, raw["landmarks"] * scale, strict=True))
    landmarks["shoulder"] = raw["shoulder"] * anatomy.scale
    frames = raw["arm_frames"]
    lengths = raw["arm_lengths"] * anatomy.scale
    factors = bone_factors(anatomy, lengths)
    rest, origins = stretch(
        raw["hand_rest"] * anatomy.scale,
        raw["hand_weights"],
        frames,
        raw["arm_origins"] * anatomy.scale,
        arm_parents(),
        factors,
    )
    units, unit_names = raw["units"] * scale, tuple(map(str, raw["unit_names"]))
    return Body(
        name, anatomy, habits, ArmRig(frames, origins, raw["finger_zero"]), face_skin,
        Skin(rest, raw["hand_weights"], frames, origins),
        face_tissue(units, unit_names, anatomy.skin_seed),
        hand_tissue(raw["hand_weights"], frames, anatomy.skin_seed),
        raw["face_normals"], raw["hand_normals"], lengths * factors[:, 1],
        raw["arm_radii"] * anatomy.scale * anatomy.girth, units, unit_names, landmarks,
    )  # fmt: skip


def load_asset(name: str) -> dict[str, NDArray[Any]]:
    """Return the arrays of ``synth/assets/<name>.npz``, numbers as float64."""
    with as_file(files("synth") / "assets" / f"{name}.npz") as path:
        arrays = read_arrays(path, max_bytes=_MAX_ASSET_BYTES)
    return {
        key: value.astype(np.float64) if value.dtype.kind == "f" else value
        for key, value in arrays.items()
    }


def bone_factors(anatomy: Anatomy, lengths: FloatArray) -> FloatArray:
    """Return the stretch (22, 3) of every arm bone."""
    factors = np.ones((len(ARM_BONES), 3))
    factors[2:] = anatomy.girth
    factors[2:8, 1] = anatomy.palm
    for finger, bones in enumerate(FINGER_BONES):
        for bone, part in zip(bones, anatomy.phalanges[f"finger{finger + 1}"], strict=True):
            number = ARM_BONES.index(bone)
            if part is not None:
                factors[number, 1] = part * anatomy.hand_length_mm / lengths[number]
    return factors
