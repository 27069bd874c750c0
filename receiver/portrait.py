"""Portraits of the avatar in software: the page's picture without a browser.

Vertices and a camera come in, a picture goes out. The light is that of ``page/avatar.js``.
"""

import numpy as np
from numpy.typing import NDArray

from receiver._kernels import draw_triangles
from receiver.avatar import Avatar, FloatArray, vertex_normals
from receiver.camera import Camera

SUPERSAMPLING = 2

_VIEWER = np.array([0.0, 0.0, 1.0])
_KEY = np.array([-0.45, 0.55, 0.70]) / np.linalg.norm([-0.45, 0.55, 0.70])
_HALF = (_KEY + _VIEWER) / np.linalg.norm(_KEY + _VIEWER)
LIGHT = np.array([_KEY, _HALF, [0.50, 0.32, 0.25], [0.95, 0.912, 0.855]])
"""Direction of the key light, half way to the viewer, wrap and strength per colour."""


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
    triangles = avatar.triangles
    normals = vertex_normals(vertices, triangles)
    view = camera.project(vertices)
    x, nearness = view[:, 0] * height, vertices[:, 2]
    if mirror:
        x, triangles = -x, triangles[:, ::-1]
        normals = normals * [-1, 1, 1]
    points = np.stack([width / 2 + x, height / 2 + view[:, 1] * height, nearness], axis=1)
    colours = avatar.colours / 255.0
    values = np.concatenate([normals, colours[:, :3] ** 2.2, colours[:, 3:]], axis=1)
    depth = np.full((height, width), -np.inf)
    drawn = np.zeros((height, width, 4))
    draw_triangles(
        np.ascontiguousarray(points), np.ascontiguousarray(triangles), values, LIGHT, depth, drawn
    )
    n = SUPERSAMPLING
    drawn = drawn.reshape(height // n, n, width // n, n, 4).mean(axis=(1, 3))
    alpha = drawn[..., 3:]
    colour = np.clip(drawn[..., :3] / np.maximum(alpha, 1e-6), 0, 1) ** (1 / 2.2)
    picture[:] = np.rint(255 * colour * alpha + picture * (1 - alpha)).astype(np.uint8)
