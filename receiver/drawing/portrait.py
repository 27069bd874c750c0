"""Portraits of the avatar in software: the page's picture without a browser.

Vertices and a camera come in, a picture goes out. The light is that of ``page/avatar.js``. The
hand throws a soft shadow on face and clothes: four silhouettes of it, one beside the other. It
separates the hand from a face of the same colour, and shows how near they are.
"""

import numpy as np
from numpy.typing import NDArray

from receiver.drawing._kernels import cover_triangles, draw_triangles
from receiver.drawing.avatar import Avatar, FloatArray, vertex_normals
from receiver.drawing.camera import Camera

SUPERSAMPLING = 2
"""Samples along each side of a pixel: edges are as smooth as the page's."""

_VIEWER = np.array([0.0, 0.0, 1.0])
"""Direction of the viewer."""

_KEY = np.array([-0.45, 0.55, 0.70]) / np.linalg.norm([-0.45, 0.55, 0.70])
"""Direction of the key light: from the upper left, which shades the hand on the right of the
face."""

_HALF = (_KEY + _VIEWER) / np.linalg.norm(_KEY + _VIEWER)
LIGHT = np.array([_KEY, _HALF, [0.50, 0.32, 0.25], [0.95, 0.912, 0.855]])
"""Direction of the key light, half way to the viewer, wrap and strength per colour."""

SHADOWS_MM = ((2.0, -3.0), (5.0, -6.5), (8.0, -10.0), (11.0, -13.5))
"""Where the shadows lie beside the hand: to the right and down."""

SHADE = 0.1
"""What each of them takes from the picture's brightness."""


def draw_avatar(
    picture: NDArray[np.uint8], avatar: Avatar, vertices: FloatArray, camera: Camera,
    *, mirror: bool = False,
) -> None:  # fmt: skip
    """Draw the avatar into a picture, in place.

    Parameters
    ----------
    picture : ndarray of uint8, shape (height, width, 3)
    avatar : Avatar
    vertices : ndarray, shape (V, 3)
        From `Avatar.place`.
    camera : Camera
    mirror : bool
        Swap left and right, for a left-handed cuer.
    """
    height, width = (SUPERSAMPLING * side for side in picture.shape[:2])
    turned = slice(None, None, -1) if mirror else slice(None)

    def seen(places: FloatArray) -> FloatArray:
        view = camera.project(places)
        x = -view[:, 0] if mirror else view[:, 0]
        return np.stack(
            [width / 2 + x * height, height / 2 + view[:, 1] * height, places[:, 2]], axis=1
        )

    depth = np.full((height, width), -np.inf)
    drawn = np.zeros((height, width, 4))
    start = len(avatar.head.sources)
    for surface, places in ((avatar.head, vertices[:start]), (avatar.hand, vertices[start:])):
        triangles = np.ascontiguousarray(surface.triangles[:, turned])
        colours = surface.colours / 255.0
        if surface is avatar.hand:
            for right_mm, up_mm in SHADOWS_MM:
                offset = np.array([-right_mm if mirror else right_mm, up_mm, 0.0])
                moved = seen(places + offset)
                mask = np.zeros((height, width))
                opacity = np.ascontiguousarray(colours[:, 4])
                cover_triangles(moved, triangles, opacity, depth, mask)
                drawn[..., :3] *= ((1 - SHADE * mask) ** 2.2)[..., None]
        normals = vertex_normals(places, surface.triangles)
        if mirror:
            normals = normals * [-1, 1, 1]
        values = np.concatenate([normals, colours[:, :3] ** 2.2, colours[:, 3:]], axis=1)
        draw_triangles(seen(places), triangles, values, LIGHT, depth, drawn)
    n = SUPERSAMPLING
    drawn = drawn.reshape(height // n, n, width // n, n, 4).mean(axis=(1, 3))
    alpha = drawn[..., 3:]
    colour = np.clip(drawn[..., :3] / np.maximum(alpha, 1e-6), 0, 1) ** (1 / 2.2)
    picture[:] = np.rint(255 * colour * alpha + picture * (1 - alpha)).astype(np.uint8)
