"""The camera that looks at the cuer: millimetres to the picture plane.

One camera per voice frames head, throat and the space of the hand; the film of ``render`` and the
page see the same picture. Conventions: x to the viewer's right, y up, z towards the viewer.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import EARS, NOSE, marker_indices
from codec.errors import CueError

ASPECT = 0.86
"""Width of the cuer's frame over its height."""

_FACE_WIDTHS = 3.3
"""Height of the picture in widths of the face: head, throat and the space of the hand at the
side."""

_BELOW_NOSE = 0.55
"""How far below the nose the picture's middle lies, in widths of the face."""

_DISTANCE_HEIGHTS = 2.6
"""Distance of the camera in heights of the picture: a portrait's lens, without a large nose."""


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole in front of the cuer, looking along -z.

    Attributes
    ----------
    centre : tuple of float
        Point that falls into the middle of the picture, millimetres.
    height_mm : float
        What fills the height of the picture in the plane of `centre`.
    distance_mm : float
        From the pinhole to `centre`.
    """

    centre: tuple[float, float, float]
    height_mm: float
    distance_mm: float

    def __post_init__(self) -> None:
        if not (self.height_mm > 0 and self.distance_mm > 0):
            raise CueError(f"camera sees {self.height_mm} mm from {self.distance_mm} mm away")

    def project(self, markers: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return (..., 3): x and y in heights of the picture from its middle (y down), scale.

        Parameters
        ----------
        markers : ndarray, shape (..., 3)
            Millimetres, in front of the pinhole.

        Examples
        --------
        >>> camera = Camera((0.0, 700.0, 100.0), 500.0, 1500.0)
        >>> camera.project(np.array([[50.0, 650.0, 100.0]])).tolist()
        [[0.1, 0.1, 1.0]]
        """
        offset = np.asarray(markers, dtype=np.float64) - self.centre
        scale = self.distance_mm / (self.distance_mm - offset[..., 2])
        plane = offset[..., :2] * (scale / self.height_mm)[..., None]
        return np.stack([plane[..., 0], -plane[..., 1], scale], axis=-1)


def frame_cuer(markers: NDArray[np.floating]) -> Camera:
    """Return the camera for a cuer whose neutral posture is `markers`, shape (113, 3).

    The head stands in the upper third; the sides leave room for the hand beside the cheek.
    """
    ears = np.asarray(markers, dtype=np.float64)[marker_indices(EARS)]
    nose = np.asarray(markers, dtype=np.float64)[marker_indices(NOSE)].mean(axis=0)
    width = float(np.linalg.norm(ears[0] - ears[1]))
    height = _FACE_WIDTHS * width
    x, y, z = ears[:, 0].mean() - 0.25 * width, nose[1] - _BELOW_NOSE * width, nose[2]
    return Camera((float(x), float(y), float(z)), height, _DISTANCE_HEIGHTS * height)
