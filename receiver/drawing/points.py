"""Point lights: one anti-aliased disc per marker, the paradigm of the paper's evaluation.

Markers and a camera go in, a picture's coverage comes out; `receiver.drawing.render` makes films of
it.
"""

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import N_FACE
from receiver.drawing.camera import Camera

FACE_COLOUR = (238, 240, 246)
"""Red, green, blue of the face's points."""

HAND_COLOUR = (255, 217, 160)
"""Red, green, blue of the hand's points: warm, so that it stands out before the face."""


def _stamp(coverage: NDArray[np.float32], x: float, y: float, radius: float) -> None:
    """Raise the coverage by one disc; parts outside the picture are cut off."""
    height, width = coverage.shape
    left, right = max(0, int(x - radius - 1)), min(width, int(x + radius + 2))
    top, bottom = max(0, int(y - radius - 1)), min(height, int(y + radius + 2))
    if left >= right or top >= bottom:
        return
    dx = np.arange(left, right) + 0.5 - x
    dy = np.arange(top, bottom) + 0.5 - y
    disc = np.clip(radius + 0.5 - np.hypot(dx[None, :], dy[:, None]), 0, 1)
    part = coverage[top:bottom, left:right]
    np.maximum(part, disc, out=part, casting="same_kind")


def draw_points(
    picture: NDArray[np.uint8],
    markers: NDArray[np.floating],
    camera: Camera,
    *,
    dot: float = 0.62,
    mirror: bool = False,
) -> None:
    """Draw the cuer's markers into a picture, in place.

    Parameters
    ----------
    picture : ndarray of uint8, shape (height, width, 3)
    markers : ndarray, shape (113, 3)
        Millimetres.
    camera : Camera
    dot : float
        Radius of a disc in the plane of the camera's centre, percent of the picture's height.
    mirror : bool
        Swap left and right, for a left-handed cuer.

    Examples
    --------
    >>> picture = np.zeros((200, 160, 3), np.uint8)
    >>> draw_points(picture, np.zeros((113, 3)), Camera((0, 0, 0), 500, 1500), dot=2)
    >>> int((picture.max(axis=2) > 0).sum()) in range(45, 75)
    True
    """
    height, width = picture.shape[:2]
    view = camera.project(markers)
    x = width / 2 + (-1 if mirror else 1) * view[:, 0] * height
    y = height / 2 + view[:, 1] * height
    radius = dot / 100 * height * view[:, 2]
    groups = ((slice(0, N_FACE), FACE_COLOUR), (slice(N_FACE, None), HAND_COLOUR))
    for members, colour in groups:
        coverage = np.zeros((height, width), dtype=np.float32)
        for disc in zip(x[members], y[members], radius[members], strict=True):
            _stamp(coverage, *map(float, disc))
        rows, columns = np.nonzero(coverage)
        share = coverage[rows, columns, None]
        mixed = picture[rows, columns] * (1 - share) + np.array(colour) * share
        picture[rows, columns] = np.rint(mixed).astype(np.uint8)
