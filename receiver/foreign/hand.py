"""A foreign hand under the cuer's markers.

The hand's bones in the file's pose and the cuer's own joints come in; for each pose of the fingers
the affine map of every bone goes out. Palm and phalanges take the lengths of the cuer's: a finger
that points then ends where hers ends, and what a shape shows stays readable.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.errors import CueError
from codec.files.npz import read_arrays
from receiver.drawing.avatar import ASSETS
from receiver.drawing.maps import MarkerMap
from receiver.foreign.names import FINGER_BONES, FINGERS
from receiver.foreign.scene import Scene

FloatArray = NDArray[np.float64]

ELBOW, WRIST, FIRST = 0, 1, 2
"""Columns of the joints: elbow, wrist, then four of each finger, the thumb's first."""

_POSES = 48
"""Poses between and around the shapes of the hand that a map is learnt from, beside all pairs."""

_MAX_BYTES = 1 << 20
"""Bytes of our own asset, unpacked, at most."""


def joint_map(voice: Voice) -> MarkerMap:
    """Return the map from the hand's markers to its 22 joints.

    Raises
    ------
    CueError
        If there is none of this voice's cuer.
    """
    path = ASSETS / f"joints_{voice.name}.npz"
    if not path.is_file():
        raise CueError(f"voice {voice.name} has no joints of the hand: others' avatars need them")
    a = read_arrays(path, max_bytes=_MAX_BYTES)
    return MarkerMap(
        *(a[k].astype(np.float64) for k in ("markers", "rest", "coefficients", "basis"))
    )


def lesson(voice: Voice, rng: np.random.Generator) -> FloatArray:
    """Return parameters (T, P) of hands: every shape, half ways between, and some about them."""
    shapes = voice.gestures.shape_targets.astype(np.float64)
    half = [0.5 * (a + b) for i, a in enumerate(shapes) for b in shapes[:i]]
    about = shapes[rng.integers(len(shapes), size=_POSES)]
    about = about + 0.15 * shapes.std(axis=0) * rng.standard_normal(about.shape)
    return np.concatenate([shapes, half, about])


@dataclass(frozen=True, slots=True)
class ForeignHand:
    """The right hand in the scene's pose, in millimetres.

    Attributes
    ----------
    wrist : ndarray, shape (3,)
    joints : ndarray, shape (5, 4, 3)
        Of each finger: its three joints and its tip.
    """

    wrist: FloatArray
    joints: FloatArray

    @staticmethod
    def of(scene: Scene, points: FloatArray, place: Mapping[str, FloatArray]) -> "ForeignHand":
        """Find the joints; a tip is the farthest vertex of the last bone.

        Parameters
        ----------
        scene : Scene
        points : ndarray, shape (V, 3)
            Its vertices, mm.
        place : mapping of str to ndarray, shape (3,)
            Joint of every bone, mm.
        """
        joints = np.zeros((5, 4, 3))
        for f, finger in enumerate(FINGERS):
            names = [f"right{finger}{part}" for part in FINGER_BONES[finger]]
            joints[f, :3] = [place[name] for name in names]
            along = joints[f, 2] - joints[f, 1]
            length = np.linalg.norm(along)
            own = scene.share(names[2]) > 0.4
            if not (length > 0 and own.any()):
                raise CueError(f"{scene.name}: the bone {names[2]} moves no vertex")
            way = along / length
            joints[f, 3] = joints[f, 2] + way * max(((points[own] - joints[f, 2]) @ way).max(), 2)
        return ForeignHand(place["rightHand"], joints)

    def bones(self, joints: FloatArray) -> dict[str, FloatArray]:
        """Return the maps (T, 3, 4) of palm and phalanges under joints (T, 22, 3)."""
        wrist, fingers = joints[:, WRIST], joints[:, FIRST:].reshape(len(joints), 5, 4, 3)
        before = self.joints[1:, 0] - self.wrist
        after = fingers[:, 1:, 0] - wrist[:, None]
        ratio = np.linalg.norm(after, axis=2).mean(axis=1) / np.linalg.norm(before, axis=1).mean()
        scale = float(ratio.mean())
        # Palm: the linear map that brings wrist-to-knuckle vectors, and their normal, to the
        # markers'.
        before = np.vstack([before, _normal(before[None])])
        after = np.concatenate([after, scale * _normal(after)[:, None]], axis=1)
        palm = np.linalg.pinv(before) @ after
        linear = palm.transpose(0, 2, 1)
        maps = {"rightHand": _map(linear, self.wrist, wrist)}
        u, _, v = np.linalg.svd(linear)
        turn = u @ v
        for f, finger in enumerate(FINGERS):
            # Fingers: each phalanx swings from where the one before it has carried it, and
            # stretches along its axis.
            carried = turn
            for k, part in enumerate(FINGER_BONES[finger]):
                axis = self.joints[f, k + 1] - self.joints[f, k]
                length = np.linalg.norm(axis)
                axis = axis / length
                way = fingers[:, f, k + 1] - fingers[:, f, k]
                reach = np.linalg.norm(way, axis=1)
                carried = swing(carried @ axis, way / reach[:, None]) @ carried
                stretch = (reach / length - scale)[:, None, None] * np.outer(axis, axis)
                maps[f"right{finger}{part}"] = _map(
                    carried @ (scale * np.eye(3) + stretch), self.joints[f, k], fingers[:, f, k]
                )
        return maps


def _normal(spokes: FloatArray) -> FloatArray:
    """Return a vector (T, 3) across a palm, as long as its spokes (T, 4, 3) on average."""
    across = np.cross(spokes[:, 0], spokes[:, 3])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(across * np.linalg.norm(spokes, axis=2).mean(axis=1)[:, None])


def _map(linear: FloatArray, start: FloatArray, goal: FloatArray) -> FloatArray:
    return np.concatenate([linear, (goal - linear @ start)[..., None]], axis=2)


def swing(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return rotations (T, 3, 3) that turn unit vectors (T, 3) the short way to others."""
    x, y, z = np.cross(before, after).T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    cosine = (before * after).sum(axis=1)[:, None, None]
    return np.asarray(np.eye(3) + cross + cross @ cross / np.maximum(1 + cosine, 1e-6))
