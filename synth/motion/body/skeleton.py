"""Forward kinematics of the right arm and of head and neck: angles in, bone frames out.

Every bone has a frame whose columns are *ulnar* (towards the little finger), *along* (towards
the tip) and *dorsal* (out of the back of the hand), right-handed. Angles are absolute: zero is a
flat hand with straight, parallel fingers, flexion closes the hand, spread turns towards the thumb.

The forearm is the free carrier of the hand, as in Gibert, Bailly, Elisei 2004, section 3.2. The
31 angles are more than the twelve parameters of their model: metacarpal arch, finger twist and
forearm twist are there on purpose.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

FINGER_BONES = tuple(tuple(f"finger{f}-{p}" for p in (1, 2, 3)) for f in range(1, 6))
METACARPALS = tuple(f"metacarpal{m}" for m in range(1, 5))
ARM_BONES = (
    "lowerarm01",
    "lowerarm02",
    "wrist",
    *METACARPALS,
    *(b for f in FINGER_BONES for b in f),
)
NECK_BONES = ("spine01", "neck01", "neck02", "neck03", "head")
NECK_SHARE = (0.0, 0.22, 0.22, 0.22, 0.34)
"""Part of the head's turn that happens at the lower end of each bone."""

HAND_ANGLES = (
    "wrist_flex", "wrist_deviation", "forearm_twist",
    "thumb_abduction", "thumb_flex", "thumb_opposition",
    "thumb_mcp", "thumb_mcp_spread", "thumb_ip",
    *(
        f"{finger}_{angle}"
        for finger in ("index", "middle", "ring", "little")
        for angle in ("mcp", "spread", "twist", "pip", "dip")
    ),
    "arch_ring", "arch_little",
)  # fmt: skip
"""Names of the angles, in degrees, of a hand pose."""

ANGLE_NUMBER = {name: number for number, name in enumerate(HAND_ANGLES)}

_FINGER_NAMES = ("index", "middle", "ring", "little")


def rotation(axis: int, degrees: FloatArray) -> FloatArray:
    """Return rotations about a coordinate axis, shape (..., 3, 3), right-handed.

    Examples
    --------
    >>> rotation(2, np.array(90.0)).round(6)[:, 0].tolist()
    [0.0, 1.0, 0.0]
    """
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    out = np.zeros((*np.shape(degrees), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[..., axis, axis] = 1.0
    out[..., i, i] = out[..., j, j] = c
    out[..., i, j], out[..., j, i] = -s, s
    return out


def frame(along: FloatArray, ulnar: FloatArray) -> FloatArray:
    """Return the right-handed frame (3, 3) with columns ulnar, along, dorsal."""
    y = along / np.linalg.norm(along)
    x = ulnar - y * (ulnar @ y)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, y, np.cross(x, y)])


@dataclass(frozen=True, slots=True)
class ArmRig:
    """Rest state of the right arm.

    Attributes
    ----------
    frames : ndarray, shape (22, 3, 3)
        Rest frame of each bone of `ARM_BONES`, columns ulnar, along, dorsal.
    origins : ndarray, shape (22, 3)
        Rest position of each bone's base joint, mm.
    zero : ndarray, shape (5, 3, 3)
        Frame of each finger's first bone at zero angles, relative to the hand's frame.
    """

    frames: FloatArray
    origins: FloatArray
    zero: FloatArray

    def pose(
        self, angles: FloatArray, carrier: FloatArray, wrist: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Place all bones.

        Parameters
        ----------
        angles : ndarray, shape (T, 31)
            Degrees, columns as `HAND_ANGLES`.
        carrier : ndarray, shape (T, 3, 3)
            Frame of the forearm (near the wrist).
        wrist : ndarray, shape (T, 3)
            Position of the wrist joint, mm.

        Returns
        -------
        turns : ndarray, shape (T, 22, 3, 3)
            Frame of each bone.
        places : ndarray, shape (T, 22, 3)
            Position of each bone's base joint, mm.
        """
        a = {name: angles[:, number] for name, number in ANGLE_NUMBER.items()}
        n = len(angles)
        turns = np.empty((n, len(ARM_BONES), 3, 3))
        places = np.empty((n, len(ARM_BONES), 3))
        local = self._offsets()
        turns[:, 1] = carrier
        turns[:, 0] = carrier @ rotation(1, -a["forearm_twist"])
        length = self.origins[2] - self.origins[:2]
        back = np.linalg.norm(length, axis=1)
        places[:, 0] = wrist - back[0] * carrier[:, :, 1]
        places[:, 1] = wrist - back[1] * carrier[:, :, 1]
        places[:, 2] = wrist
        # Chain: R(child) = R(parent) R_axis(angle), p(child) = p(parent) + R(parent) offset;
        # forearm, hand, arches of the palm, thumb, and fingers from base to tip.
        turns[:, 2] = carrier @ rotation(2, a["wrist_deviation"]) @ rotation(0, -a["wrist_flex"])
        hand = turns[:, 2]
        relative = self.frames[2].T @ self.frames[3:7]
        for i, arch in enumerate((None, None, a["arch_ring"], a["arch_little"])):
            turn = hand if arch is None else hand @ rotation(0, -arch)
            turns[:, 3 + i] = turn @ relative[i]
            places[:, 3 + i] = wrist + hand @ local[3 + i]
        self._thumb(a, turns, places, local)
        for i, name in enumerate(_FINGER_NAMES):
            meta, first = 3 + i, 10 + 3 * i
            base = turns[:, meta] @ relative[i].T @ self.zero[i + 1]
            turns[:, first] = (
                base
                @ rotation(2, a[f"{name}_spread"])
                @ rotation(0, -a[f"{name}_mcp"])
                @ rotation(1, a[f"{name}_twist"])
            )
            turns[:, first + 1] = turns[:, first] @ rotation(0, -a[f"{name}_pip"])
            turns[:, first + 2] = turns[:, first + 1] @ rotation(0, -a[f"{name}_dip"])
            places[:, first] = places[:, meta] + turns[:, meta] @ local[first]
            self._chain(first, turns, places, local)
        return turns, places

    def _thumb(
        self, a: dict[str, FloatArray], turns: FloatArray, places: FloatArray, local: FloatArray
    ) -> None:
        turns[:, 7] = (
            turns[:, 2]
            @ self.zero[0]
            @ rotation(2, a["thumb_abduction"])
            @ rotation(0, -a["thumb_flex"])
            @ rotation(1, a["thumb_opposition"])
        )
        turns[:, 8] = (
            turns[:, 7] @ rotation(2, a["thumb_mcp_spread"]) @ rotation(0, -a["thumb_mcp"])
        )
        turns[:, 9] = turns[:, 8] @ rotation(0, -a["thumb_ip"])
        places[:, 7] = places[:, 2] + turns[:, 2] @ local[7]
        self._chain(7, turns, places, local)

    @staticmethod
    def _chain(first: int, turns: FloatArray, places: FloatArray, local: FloatArray) -> None:
        for bone in (first + 1, first + 2):
            places[:, bone] = places[:, bone - 1] + turns[:, bone - 1] @ local[bone]

    def _offsets(self) -> FloatArray:
        """Return each bone's base joint in its parent's frame, shape (22, 3)."""
        parents = arm_parents()
        out = np.zeros((len(ARM_BONES), 3))
        for bone, parent in enumerate(parents):
            if parent >= 0:
                out[bone] = self.frames[parent].T @ (self.origins[bone] - self.origins[parent])
        return out


def arm_parents() -> list[int]:
    """Return the parent's number of each bone of `ARM_BONES`; -1 for the root.

    Examples
    --------
    >>> [ARM_BONES[p] for p in arm_parents()[7:11]]
    ['wrist', 'finger1-1', 'finger1-2', 'metacarpal1']
    """
    number = {name: i for i, name in enumerate(ARM_BONES)}
    parents = {
        "lowerarm02": "lowerarm01",
        "wrist": "lowerarm02",
        **dict.fromkeys(METACARPALS, "wrist"),
    }
    for finger, (first, second, third) in enumerate(FINGER_BONES):
        parents[first] = METACARPALS[finger - 1] if finger else "wrist"
        parents |= {second: first, third: second}
    return [number[parents[name]] if name in parents else -1 for name in ARM_BONES]
