"""Bringing recordings of other laboratories into the coordinates of the models.

Models and figures take x to the viewer's right, y up, z to the viewer, and a right hand.
Laboratories put their axes otherwise, and some people cue with the left hand: the head gives the
axes, the way the fingers bend gives the hand. A left-handed cuer is mirrored, names and all.
"""

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.voice import load_voice
from codec.errors import CueError

FloatArray = NDArray[np.float64]
F = TypeVar("F", bound=np.floating[Any])

_SKULL = layout.marker_indices(layout.RIGID_FACE)
_EARS = layout.marker_indices(layout.EARS)
_KNUCKLES = layout.marker_indices(layout.KNUCKLES[1:])
_TIPS = layout.marker_indices([finger[2] for finger in layout.FINGERS[1:]])
_PALM = layout.marker_indices(layout.PALM)

_EAR_DISTANCE_MM = (80.0, 250.0)
"""Distances in mm between the ears that heads can have, with room to distinguish units."""

_SAME_AXES_RAD = 0.6
"""Angle in radians below which axes count as ours: less than half a quarter turn."""


def _other_side(name: str) -> str:
    swapped = {"R": "L", "L": "R"}
    return name[:-1] + swapped[name[-1]] if name[-2:] in ("_R", "_L") else name


_MIRROR = layout.marker_indices([_other_side(name) for name in layout.MARKERS])


@dataclass(frozen=True, slots=True)
class Framing:
    """How the recordings of one session are brought into our coordinates.

    Attributes
    ----------
    left_handed : bool
        Mirror first.
    motion : ndarray of float64, shape (6,)
        Rotation vector (radians) about the origin, then translation (mm).
    """

    left_handed: bool
    motion: FloatArray

    def apply(self, markers: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return markers (T, 113, 3) in our coordinates; NaN stays NaN."""
        seen = mirrored(markers) if self.left_handed else markers
        if not self.motion.any():
            return seen
        return rigid.rigid_motion(seen, self.motion).astype(np.float32)


def find_framing(markers: NDArray[np.float32]) -> Framing:
    """Return the framing of a session from some of its frames.

    Parameters
    ----------
    markers : ndarray of float32, shape (T, 113, 3)
        Millimetres, NaN where hidden; sentences, so that head and hand are seen.

    Raises
    ------
    CueError
        If no frame shows the head, or the head has not the size of a head: wrong units.
    """
    skull = markers[:, _SKULL].astype(np.float64)
    whole = np.asarray(np.isfinite(skull).all((1, 2)))
    if not whole.any():
        raise CueError("no frame shows all markers of ears, nose and forehead")
    ears = np.linalg.norm(markers[whole][:, _EARS[0]] - markers[whole][:, _EARS[1]], axis=-1)
    apart = float(np.median(ears))
    if not _EAR_DISTANCE_MM[0] <= apart <= _EAR_DISTANCE_MM[1]:
        low, high = _EAR_DISTANCE_MM
        raise CueError(f"the ears are {apart:.3g} mm apart, not {low:.0f}..{high:.0f}: wrong unit?")
    left_handed = shows_left_hand(markers)
    if left_handed:
        skull = mirrored(markers)[:, _SKULL].astype(np.float64)
    own = skull[whole]
    _, motions = rigid.mean_body(own)
    reference = load_voice().face.mean[_SKULL].astype(np.float64)
    # Heads differ in size: directions count, so both are brought to one.
    centred = own[len(own) // 2] - own[len(own) // 2].mean(0)
    target = reference - reference.mean(0)
    scale = np.linalg.norm(target) / np.linalg.norm(centred)
    turn, _ = rigid.estimate_motion(scale * centred, target[None], outlier_mm=30.0)
    if np.linalg.norm(turn[0, :3]) < _SAME_AXES_RAD:
        return Framing(left_handed, np.zeros(6))
    rotation = rigid.rotation_matrices(turn[0, :3])
    shift = reference.mean(0) - rotation @ motions[:, 3:].mean(0)
    return Framing(left_handed, np.concatenate([turn[0, :3], shift]))


def mirrored(markers: NDArray[F]) -> NDArray[F]:
    """Return the mirror image: right is left, in space and in the markers' names."""
    out = markers[:, _MIRROR].copy()
    out[..., 0] *= -1.0
    return out


def shows_left_hand(markers: NDArray[np.float32]) -> bool:
    """Return whether the fingers bend as those of a left hand do.

    From index to little finger, times along the hand, points out of the back of a right hand;
    fingers bend to the other side.
    """
    x = markers.astype(np.float64)
    along = x[:, _KNUCKLES].mean(1) - x[:, _PALM].mean(1)
    out = np.cross(x[:, _KNUCKLES[3]] - x[:, _KNUCKLES[0]], along)
    height = ((x[:, _TIPS] - x[:, _KNUCKLES]) * out[:, None]).sum(-1)
    height = height[np.isfinite(height)]
    return bool(len(height) > 0 and height.mean() > 0)
