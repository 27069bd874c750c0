"""The avatar's right hand and wrist out of the base mesh, with nails; the sleeve is the bust's."""

import numpy as np

from codec.cuer.layout import FINGERS, HAND_MARKERS
from lab.avatar.head import SLEEVE_MM, hollowness
from lab.avatar.looks import Look
from lab.avatar.paint import blend
from lab.avatar.parts import FloatArray, IntArray, Part, cut, plain, triangulate

_UNDER_MM = 8.0
"""How far the skin goes on below the sleeve, mm."""


def hand_part(
    quads: IntArray, points: FloatArray, markers: FloatArray, wrist: FloatArray, look: Look
) -> Part:
    """Return the hand down to below the sleeve.

    Parameters
    ----------
    quads : ndarray of int, shape (F, 4)
        Of the arm.
    points : ndarray, shape (M, 3)
        All vertices of the mesh at rest.
    markers : ndarray, shape (50, 3)
        The hand markers on the mesh.
    wrist : ndarray, shape (2, 3)
        Wrist and elbow joint at rest.
    look : Look
    """
    colours = plain(look.skin, 60, len(points))
    for finger in FINGERS:
        joint, nail = (markers[HAND_MARKERS.index(finger[k])] for k in (2, 3))
        middle = nail + 0.15 * (nail - joint)
        distance = np.linalg.norm(points - middle, axis=1)
        share = np.clip((7.0 - distance) / 2.5, 0, 1)
        blend(colours, look.nail, 0.8 * share)
        colours[:, 3] += 90 * share
    triangles = triangulate(quads)
    hollow = hollowness(points, triangles)
    along = (wrist[1] - wrist[0]) / np.linalg.norm(wrist[1] - wrist[0])

    def up(places: FloatArray) -> FloatArray:
        return np.asarray((places - wrist[0]) @ along)

    sources, shares, small = cut(triangles, points, lambda p: SLEEVE_MM + _UNDER_MM - up(p))
    own = (colours[sources] * shares[..., None]).sum(axis=1)
    own[:, :3] *= (1 - (hollow[sources] * shares).sum(axis=1))[:, None]
    still = np.zeros((len(sources), 3))
    return Part(sources, shares, still, small, np.clip(own, 0, 255).astype(np.uint8))
