"""The picture that landmarks stand in: its shape, its scale, where the face is, which hand cues."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.errors import CueError
from synth.capture.sources.landmark_maps import (
    FACE_LANDMARKS,
    WIDTH_LANDMARKS,
    LandmarkMap,
    face_map,
)
from synth.capture.sources.landmark_table import LandmarkTable

FloatArray = NDArray[np.float64]

_LEAST_FRAMES = 5
"""Least number of frames with a known landmark."""

_LEAST_LANDMARKS = 4
"""Landmarks of the face that give its place and turn."""

_FRONTAL = 0.75
"""Quantile of the face's width over time: turned heads look narrow."""

_SLOT = {number: slot for slot, number in enumerate(FACE_LANDMARKS)}

_MIRROR_PAIRS = (
    (234, 454), (127, 356), (109, 338), (67, 297), (103, 332), (54, 284), (33, 263), (133, 362),
    (49, 279), (48, 278), (64, 294), (37, 267), (39, 269), (40, 270), (185, 409), (61, 291),
    (84, 314), (181, 405), (91, 321), (146, 375), (214, 434), (172, 397), (136, 365), (150, 379),
    (149, 378), (50, 280), (205, 425), (187, 411), (105, 334), (66, 296), (92, 322),
)  # fmt: skip
"""Landmarks of the right half of the face, and those of the left."""


def _mirror_order() -> NDArray[np.intp]:
    order = np.arange(len(FACE_LANDMARKS))
    for right, left in _MIRROR_PAIRS:
        order[_SLOT[right]], order[_SLOT[left]] = _SLOT[left], _SLOT[right]
    return order


_MIRROR = _mirror_order()


@dataclass(frozen=True, slots=True)
class Picture:
    """How landmarks come to the voice's coordinates.

    Attributes
    ----------
    aspect : float
        Width over height of the picture; 1 if coordinates are pixels.
    mm_per_width : float
        Millimetres of the voice per unit of x.
    centre : ndarray of float64, shape (2,)
        Offset added to x and y, mm.
    mirrored : bool
        The left hand cues, or the picture is a mirror image.
    hand_name : str or None
        Which of the table's hands cues.
    map : LandmarkMap
        Of the face.
    offsets : ndarray of float64, shape (L, 3)
        Of the face's landmarks from their markers, mm.
    notes : tuple of str
    """

    aspect: float
    mm_per_width: float
    centre: FloatArray
    mirrored: bool
    hand_name: str | None
    map: LandmarkMap
    offsets: FloatArray
    notes: tuple[str, ...]

    def face(self, table: LandmarkTable) -> FloatArray:
        """Return the landmarks of the face, shape (T, L, 3), mm."""
        points = self._placed(table.face)
        return np.asarray(points[:, _MIRROR]) if self.mirrored else points

    def hand(self, table: LandmarkTable) -> FloatArray | None:
        """Return the landmarks of the cueing hand, shape (T, 21, 3), mm; None if there is none."""
        return None if self.hand_name is None else self._placed(table.hands[self.hand_name])

    def _placed(self, points: FloatArray) -> FloatArray:
        out = _square(points, self.aspect) * self.mm_per_width
        if self.mirrored:
            out[..., 0] *= -1.0
        out[..., :2] += self.centre
        return out


def _square(points: FloatArray, aspect: float) -> FloatArray:
    """Return points with y up and z to the viewer, all in units of x."""
    return np.asarray(points * np.array([1.0, -1.0 / aspect, -1.0]))


def find_picture(table: LandmarkTable, voice: Voice, *, aspect: float) -> Picture:
    """Return how a table's landmarks come to the coordinates of `voice`.

    Parameters
    ----------
    table : LandmarkTable
    voice : Voice
    aspect : float
        Width of the picture over its height; 1 if coordinates are pixels.

    Raises
    ------
    CueError
        If too little of a face is seen.
    """
    often, rest = _given(table), _resting(voice)
    mapped = face_map()
    notes = []
    name = _cueing_hand(table)
    mirrored = name is not None and _is_right_of_face(table, name)
    if mirrored:
        notes.append("the left hand cues: mirrored")
    face = _square(table.face, aspect)
    if mirrored:
        face = (face * np.array([-1.0, 1.0, 1.0]))[:, _MIRROR]
        often = often[_MIRROR]
    scale = _scale(face, often, rest)
    middle = _middle_face(face, often) * scale
    centre = np.nanmedian((rest - middle)[_reliable(often)], axis=0)[:2]
    offsets = np.zeros_like(rest)
    offsets[often, :2] = middle[often, :2] + centre - rest[often, :2]
    return Picture(aspect, scale, centre, mirrored, name, mapped, offsets, tuple(notes))


def _given(table: LandmarkTable) -> NDArray[np.bool_]:
    """Return the landmarks of the face that are given often."""
    given = np.isfinite(table.face[..., 0])
    often = given.sum(0) >= min(_LEAST_FRAMES, len(given))
    if often.sum() < _LEAST_LANDMARKS:
        raise CueError(
            f"{int(often.sum())} landmarks of the face are known, {_LEAST_LANDMARKS} needed to "
            "know size and place"
        )
    return np.asarray(often)


def _resting(voice: Voice) -> FloatArray:
    """Return the voice's landmarks at rest, shape (L, 3), mm."""
    markers = voice.face.reconstruct(np.zeros((1, voice.face.n_parameters)))[0]
    return np.asarray(face_map().weights @ markers)


def _reliable(often: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the landmarks that give the place of the face: firm ones, else all."""
    firm = often & face_map().firm
    return firm if firm.sum() >= 2 else often


def _scale(face: FloatArray, often: NDArray[np.bool_], rest: FloatArray) -> float:
    """Return millimetres per unit by the best pair of landmarks across the face."""
    for right, left in WIDTH_LANDMARKS:
        a, b = _SLOT[right], _SLOT[left]
        if often[a] and often[b]:
            apart = np.linalg.norm((face[:, b] - face[:, a])[:, :2], axis=1)
            width = float(np.nanquantile(apart, _FRONTAL))
            if width > 0:
                return float(np.linalg.norm((rest[b] - rest[a])[:2])) / width
    shown = np.isfinite(face[:, often, 0]).any(1)
    spread = np.median(np.nanstd(face[shown][:, often, 0], axis=1))
    if not spread > 0:
        raise CueError("all landmarks of the face lie on one spot")
    return float(rest[often, 0].std() / spread)


def _middle_face(face: FloatArray, often: NDArray[np.bool_]) -> FloatArray:
    """Return the median place of each landmark, shape (L, 3); NaN if it is never given."""
    firm = _reliable(often)
    face = face[np.isfinite(face[:, firm, 0]).any(1)]
    centre = np.nanmean(face[:, firm], axis=1, keepdims=True)
    out = np.full(face.shape[1:], np.nan)
    out[often] = np.nanmedian((face - centre)[:, often], axis=0)
    return np.asarray(out + np.median(centre[:, 0], axis=0))


def unlike_face(table: LandmarkTable, voice: Voice, aspect: float) -> float:
    """Return how much the face differs from the voice's in width against height, logarithm.

    Raises
    ------
    CueError
        If too little of a face is seen.
    """
    often, rest = _given(table), _resting(voice)
    face = _middle_face(_square(table.face, aspect), often)[often, :2]
    spread, expected = face.std(0), rest[often, :2].std(0)
    return abs(float(np.log(spread[0] / spread[1]) - np.log(expected[0] / expected[1])))


def _cueing_hand(table: LandmarkTable) -> str | None:
    """Return the hand that is seen highest, and often: the other one hangs."""
    best, name = -np.inf, None
    low = max(float(np.nanmax(table.face[..., 1])), 1e-9)
    for candidate, points in table.hands.items():
        shown = np.isfinite(points[..., 0]).any(1)
        if shown.sum() < 2:
            continue
        depth = float(np.nanmedian(points[shown][..., 1])) / low
        value = float(np.log(shown.sum())) - depth
        if value > best:
            best, name = value, candidate
    return name


def _is_right_of_face(table: LandmarkTable, name: str) -> bool:
    """Return whether the wrist is mostly on the picture's right side of the face."""
    wrist = table.hands[name][:, 0, 0]
    middle = np.nanmedian(table.face[..., 0])
    return bool(np.isfinite(wrist).any() and np.nanmedian(wrist) > middle)
