"""The avatar's right hand and forearm out of the base mesh, with nails and a sleeve."""

import numpy as np

from codec.cuer.layout import FINGERS, HAND_MARKERS
from lab.avatar.head import hollowness, vertex_normals
from lab.avatar.looks import Look
from lab.avatar.paint import blend
from lab.avatar.parts import (
    FloatArray,
    IntArray,
    Part,
    cut,
    join,
    plain,
    triangulate,
)

_SLEEVE_MM, _HEM_MM = 54.0, 5.0
"""Distance in mm from the wrist to the sleeve's edge, and its hem's width."""

_FADE_MM = (185.0, 222.0)
"""Distances in mm from the wrist between which the forearm fades out, below the picture's usual
edge."""


def hand_part(
    quads: IntArray, points: FloatArray, markers: FloatArray, wrist: FloatArray, look: Look
) -> Part:
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
    normals = vertex_normals(points, triangles)
    along = (wrist[1] - wrist[0]) / np.linalg.norm(wrist[1] - wrist[0])

    def up(places: FloatArray) -> FloatArray:
        return np.asarray((places - wrist[0]) @ along)

    parts = []
    for level, lift_mm, colour in (
        (lambda p: _SLEEVE_MM + 8 - up(p), 0.0, None),
        (lambda p: up(p) - _SLEEVE_MM, 2.6, look.hem),
        (lambda p: up(p) - _SLEEVE_MM - _HEM_MM, 3.2, look.cloth),
    ):  # fmt: skip
        sources, shares, small = cut(triangles, points, level, division=2)
        at = (points[sources] * shares[..., None]).sum(axis=1)
        own = (colours[sources] * shares[..., None]).sum(axis=1)
        if colour is not None:
            own = plain(colour, 10, len(at))
        own[:, :3] *= (1 - (hollow[sources] * shares).sum(axis=1))[:, None]
        own[:, 4] = 255 * np.clip((_FADE_MM[1] - up(at)) / (_FADE_MM[1] - _FADE_MM[0]), 0, 1)
        offsets = lift_mm * (normals[sources] * shares[..., None]).sum(axis=1)
        painted = np.clip(own, 0, 255).astype(np.uint8)
        parts.append(Part(sources, shares, offsets, small, painted))
    return join(parts)
