"""The avatar's right hand and forearm out of the base mesh, with nails and a sleeve."""

import numpy as np

from codec.layout import FINGERS, HAND_MARKERS
from synth.avatar.head import blend, hollowness
from synth.avatar.parts import CLOTH, SKIN, FloatArray, IntArray, Part, plain, take, triangulate

NAIL = (236, 186, 172)

_SLEEVE_MM = (52.0, 60.0)
_FADE_MM = (120.0, 175.0)


def hand_part(quads: IntArray, points: FloatArray, markers: FloatArray, wrist: FloatArray) -> Part:
    """Return hand and forearm.

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
    """
    colours = plain(SKIN, 60, len(points))
    for finger in FINGERS:
        joint, nail = (markers[HAND_MARKERS.index(finger[k])] for k in (2, 3))
        middle = nail + 0.15 * (nail - joint)
        distance = np.linalg.norm(points - middle, axis=1)
        share = np.clip((7.0 - distance) / 2.5, 0, 1)
        blend(colours, NAIL, 0.8 * share)
        colours[:, 3] += 90 * share
    colours[:, :3] *= (1 - hollowness(points, triangulate(quads)))[:, None]
    along = (wrist[1] - wrist[0]) / np.linalg.norm(wrist[1] - wrist[0])
    up = (points - wrist[0]) @ along
    sleeve = np.clip((up - _SLEEVE_MM[0]) / (_SLEEVE_MM[1] - _SLEEVE_MM[0]), 0, 1)
    blend(colours, CLOTH, sleeve)
    colours[:, 3] *= 1 - 0.85 * sleeve
    colours[:, 4] = 255 * np.clip((_FADE_MM[1] - up) / (_FADE_MM[1] - _FADE_MM[0]), 0, 1)
    return take(quads, np.clip(colours, 0, 255))
