"""Colours of the skin: flush, lids, lips, stubble, and the small unevenness that skin has."""

import numpy as np

from codec.cuer.layout import FACE_MARKERS, LIP_CORNERS, LOWER_LIP, UPPER_LIP
from lab.avatar.hair import covered
from lab.avatar.looks import Look
from lab.avatar.parts import MOUTH, FloatArray, plain

_EYE = np.array([31.0, 728.0, 130.0])
"""Middle of the left eye's opening, mm."""

_LINES = (
    (((15, 697), (22, 690), (29, 678), (33, 666)), 3.2, 1.0),
    (((31, 652), (34, 641), (33, 632)), 3.0, 0.6),
    (((16, 719), (26, 712), (38, 713), (45, 719)), 3.0, 0.6),
    (((0, 772), (22, 774), (44, 770)), 2.6, 0.5),
    (((0, 784), (20, 786), (40, 782)), 2.6, 0.4),
    (((50, 729), (60, 731)), 3.0, 0.5),
)
"""Course in mm (x outwards, y), width in mm and depth of the lines of age; drawn by eye."""

_WAVES = np.array([
    (0.41, 0.23, 0.19), (-0.27, 0.38, 0.31), (0.19, -0.45, 0.37), (0.66, 0.59, -0.41),
    (-0.83, 0.31, 0.57), (0.23, 0.14, -0.09), (0.11, -0.17, 0.13),
])  # fmt: skip
"""Wave numbers, 1/mm, of the unevenness."""


def skin_colours(
    points: FloatArray, face: FloatArray, hollow: FloatArray, look: Look
) -> FloatArray:
    """Return red, green, blue, gloss, opacity of points of the skin, shape (N, 5).

    Parameters
    ----------
    points : ndarray, shape (N, 3)
    face : ndarray, shape (63, 3)
        The face markers.
    hollow : ndarray, shape (N,)
        Shade of hollows.
    look : Look
    """
    x, y, z = points.T
    aside = points * [1, 1, 1]
    aside[:, 0] = np.abs(x)
    colours = plain(look.skin, 64, len(points))
    uneven = np.sin(points @ _WAVES.T + np.arange(len(_WAVES))).mean(axis=1)
    colours[:, :3] *= 1 + uneven[:, None] * [0.045, 0.065, 0.07]
    cheek = face[FACE_MARKERS.index("CK1_L")] * [1, 1, 1]
    cheek[0] = abs(cheek[0])
    for middle, size, share in (
        (cheek, 21, 0.42),
        (np.array([0, 703, 168]), 11, 0.34),
        (np.array([0, 634, 150]), 13, 0.2),
        (np.array([80, 715, 50]), 22, 0.4),
        (np.array([20, 540, 90]), 55, 0.16),
    ):
        near = np.exp(-((np.linalg.norm(aside - middle, axis=1) / size) ** 2))
        blend(colours, look.blush, share * near)
    shade = np.array(look.skin) * [0.74, 0.66, 0.68]
    ahead = z > 100
    lid = np.exp(-(((aside[:, 0] - _EYE[0]) / 15) ** 2) - (((y - _EYE[1] - 7) / 6.0) ** 2))
    below = np.exp(-(((aside[:, 0] - 26) / 11) ** 2) - (((y - 716) / 4.5) ** 2))
    blend(colours, shade, ahead * (0.4 * lid + 0.28 * below))
    colours[:, 3] += 40 * np.exp(-((x / 9) ** 2) - (((y - 715) / 30) ** 2)) * ahead
    if look.stubble:
        line = np.interp(aside[:, 0], [0, 22, 45, 75], [690, 684, 676, 706])
        bearded = np.clip((line - y) / 9, 0, 1) * np.clip((y - 600) / 26, 0, 1)
        bearded *= np.clip((z - 28) / 20, 0, 1)
        blend(colours, look.hair, look.stubble * bearded * (0.85 + 0.5 * uneven))
        colours[:, 3] *= 1 - 0.7 * bearded
    colours[:, 3] *= np.clip((y - 560) / 90, 0.3, 1)
    if look.lines:
        blend(colours, shade, look.lines * _lines(aside))
    red = inside_lips(points, face)
    blend(colours, look.lips, red)
    colours[:, 3] += 70 * red
    seam = np.exp(-(((y - 660.6) / 1.5) ** 2)) * (aside[:, 0] < 25) * (z > 130)
    colours[:, :3] *= (1 - 0.34 * seam)[:, None]
    cavity = (aside[:, 0] < 34) & (y > 634) & (y < 684) & (z < 141 - 0.012 * x**2) & (z > 50)
    blend(colours, MOUTH, cavity.astype(float))
    colours[:, :3] *= (1 - hollow)[:, None]
    under_hair = np.clip(covered(points) / 3 - look.recess_deg / 2, 0, 1) * (y > 690)
    ear = (aside[:, 0] > 71) & (y > 678) & (y < 754) & (z > 20) & (z < 82)
    blend(colours, tuple(0.8 * np.array(look.hair)), 0.92 * under_hair * ~ear)
    return colours


def _lines(aside: FloatArray) -> FloatArray:
    """Return the depth of lines beside nose and mouth, under the eyes and on the forehead, 0..1."""
    deep = np.zeros(len(aside))
    for bend, width, depth in _LINES:
        steps = np.linspace(0, 1, 20)
        knots = np.linspace(0, 1, len(bend))
        along = np.stack([np.interp(steps, knots, np.array(bend)[:, k]) for k in (0, 1)], axis=1)
        near = np.linalg.norm(aside[:, None, :2] - along[None], axis=2).min(axis=1)
        deep = np.maximum(deep, depth * np.exp(-((near / width) ** 2)))
    return deep * (aside[:, 2] > 90)


def blend(colours: FloatArray, colour: object, share: FloatArray) -> None:
    """Move colours (N, 5) towards one colour (3,) by `share` (N,), in place."""
    colours[:, :3] += share[:, None] * (np.asarray(colour) - colours[:, :3])


def inside_lips(points: FloatArray, face: FloatArray) -> FloatArray:
    """Return how far each point belongs to the red of the lips, 0..1."""

    def at(name: str) -> FloatArray:
        corner: FloatArray = face[FACE_MARKERS.index(name), :2]
        return corner

    upper = sorted((at(name) for name in (*UPPER_LIP, *LIP_CORNERS)), key=lambda p: p[0])
    lower = sorted((at(name) for name in (*LOWER_LIP, *LIP_CORNERS)), key=lambda p: p[0])
    top = np.interp(points[:, 0], *np.transpose(upper))
    bottom = np.interp(points[:, 0], *np.transpose(lower))
    margin = np.minimum(top + 0.6 - points[:, 1], points[:, 1] - bottom + 0.6)
    half = abs(at("LC_L")[0]) + 1
    margin = np.minimum(margin, (half - np.abs(points[:, 0])) * 0.5)
    return np.where(points[:, 2] > 130, np.clip(margin / 1.6, 0, 1), 0.0)
