"""Portraits of the avatar in software: the page's picture without a browser.

Vertices and a camera come in, a picture goes out. The page (``page/avatar.js``) takes the same
light and shadow from the avatar's document. The hand casts one soft shadow on face and clothes: it
separates the hand from a face of the same colour, and shows how near they are.
"""

import numpy as np
from numpy.typing import NDArray

from receiver.drawing._kernels import draw_triangles
from receiver.drawing._light_kernels import add_normals
from receiver.drawing._shadow_kernels import blur_shadow, cast
from receiver.drawing._visibility_kernels import BLENDED, CASTS
from receiver.drawing.avatar import Avatar, FloatArray
from receiver.drawing.camera import Camera

_KEY = np.array([-0.45, 0.55, 0.70]) / np.linalg.norm([-0.45, 0.55, 0.70])
"""Direction of the key light: from the upper left, which shades the hand on the right of the
face."""

# Direction of the viewer, and the one between light and viewer.
_VIEWER = np.array([0.0, 0.0, 1.0])
_HALF = (_KEY + _VIEWER) / np.linalg.norm(_KEY + _VIEWER)

LIGHT = np.array(
    [
        _KEY,
        _HALF,
        [0.50, 0.32, 0.25],  # wrap: how far the key light reaches round
        [0.95, 0.912, 0.855],  # strength of the key light
        [0.170, 0.195, 0.220],  # light from everywhere
        [0.187, 0.2145, 0.242],  # light from above
        [0.170, 0.190, 0.210],  # light on rims
        [0.5, 0.5, 0.5],  # highlights of gloss 1
        [1.0, 6.0, 40.0],  # shadow: share taken from the key; depth in mm that begins, halves it
    ],
    dtype=np.float32,
)
"""Directions and linear red, green, blue of the lights, and the shadow's strength."""

SHADOW_SIDE = 256
"""Pixels along a side of the shadow's map."""

SHADOW_TEXEL_MM = 2.5
"""Width of one of them."""

_SHADOW_UNITS = np.array([SHADOW_TEXEL_MM, -SHADOW_TEXEL_MM, 1], np.float32)
_SHADOW_BLUR_MM = 4.0
"""Standard deviation of its blur: fingers melt into one shadow."""

_taps = np.arange(-6, 7) * (SHADOW_TEXEL_MM / _SHADOW_BLUR_MM)
SHADOW_WEIGHTS = (np.exp(-(_taps**2) / 2) / np.exp(-(_taps**2) / 2).sum()).astype(np.float32)
"""Weights of the blur along a row or a column."""

_RIGHT = np.cross([0, 1, 0], _KEY) / np.linalg.norm(np.cross([0, 1, 0], _KEY))
FROM_LIGHT = np.array([_RIGHT, np.cross(_KEY, _RIGHT), _KEY], dtype=np.float32)
"""Right, up and forward of the key light: axes of the shadow's map."""

_GRID = 256
"""Corners of triangles lie on whole parts of a pixel."""


class Portrait:
    """Pictures of an avatar through a camera.

    Parameters
    ----------
    avatar : Avatar
    camera : Camera
    mirror : bool
        Swap left and right, for a left-handed cuer.
    """

    def __init__(self, avatar: Avatar, camera: Camera, *, mirror: bool = False) -> None:
        self._camera = camera
        self._sides = np.array([-1 if mirror else 1, 1, 1], np.float32)
        triangles = avatar.triangles.astype(np.int32)
        self._triangles = np.ascontiguousarray(triangles[:, ::-1] if mirror else triangles)
        colours = avatar.colours / np.float32(255)
        self._values = np.zeros((len(colours), 8), np.float32)
        self._values[:, 3:] = np.concatenate([colours[:, :3] ** 2.2, colours[:, 3:]], axis=1)
        casts = avatar.casts
        casting = np.ascontiguousarray(self._triangles[casts])
        self._first = int(casting.min(initial=len(colours)))  # of the vertices that cast
        self._casting = casting - self._first
        clear = (avatar.colours[:, 4] < 255)[triangles].any(axis=1)
        self._kinds = (BLENDED * clear + CASTS * casts).astype(np.uint8)

    def draw(self, picture: NDArray[np.uint8], vertices: FloatArray) -> None:
        """Draw the avatar into a picture, in place.

        Parameters
        ----------
        picture : ndarray of uint8, shape (height, width, 3)
        vertices : ndarray, shape (V, 3)
            From `Avatar.place`.
        """
        height, width = picture.shape[:2]
        camera, values = self._camera, self._values
        places = (vertices - camera.centre).astype(np.float32) * self._sides
        add_normals(places, self._triangles, values)
        shadow = _cast_shadow(places[self._first :], self._casting, values[self._first :])
        near = camera.distance_mm / (camera.distance_mm - places[:, 2])
        scale = near * (height / camera.height_mm)
        points = np.empty_like(places)
        points[:, 0] = np.rint((width / 2 + places[:, 0] * scale) * _GRID) / _GRID
        points[:, 1] = np.rint((height / 2 - places[:, 1] * scale) * _GRID) / _GRID
        points[:, 2] = near
        draw_triangles(
            points, self._triangles, values, self._kinds, LIGHT, shadow,
            _to_light(camera, width, height), picture,
        )  # fmt: skip


def _cast_shadow(
    places: NDArray[np.float32], casting: NDArray[np.int32], values: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the blurred map of the casting triangles, places being from the camera's centre."""
    seen = places @ FROM_LIGHT.T / _SHADOW_UNITS
    seen[:, :2] = np.rint((seen[:, :2] + SHADOW_SIDE / 2) * _GRID) / _GRID
    cover = np.zeros((SHADOW_SIDE, SHADOW_SIDE, 2), np.float32)
    cast(np.ascontiguousarray(seen), casting, np.ascontiguousarray(values[:, 7]), cover)
    return np.asarray(blur_shadow(cover, SHADOW_WEIGHTS))


def _to_light(camera: Camera, width: int, height: int) -> NDArray[np.float32]:
    """Return the matrix from a place of the picture to texels and depth of the shadow's map."""
    unit, far = camera.height_mm / height, camera.distance_mm
    back = np.array(
        [[unit, 0, -unit * width / 2, 0], [0, -unit, unit * height / 2, 0], [0, 0, -far, far]]
    )
    matrix = FROM_LIGHT @ back / _SHADOW_UNITS[:, None]
    matrix[:2, 3] += SHADOW_SIDE / 2 - 0.5
    return np.asarray(matrix, dtype=np.float32)
