"""A cuer's own hand and mouth: where her landmarks lie among the voice's markers.

People differ in more than their size: in the lengths of their fingers, in how far a corner of the
mouth goes with its middle, and trackers put their points elsewhere than our markers are. Each
landmark stays a weighted mean of markers near it; the weights are learnt from the take, as far as
it shows them (ridge regression towards anybody's weights). Along a digit that is its proportions,
across it an offset.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from synth.capture.sources.landmark_maps import (
    FACE_LANDMARKS,
    SOFT_LANDMARKS,
    LandmarkMap,
    near_markers,
)
from synth.capture.tracker.landmark_model import LandmarkModel

FloatArray = NDArray[np.float64]
Near = Callable[[int], NDArray[np.intp]]

HAND_RIDGE_MM2 = 30.0
"""Price of weights against anybody's, in squared error: a landmark 10 mm elsewhere costs 1 mm²."""

FACE_RIDGE_MM2 = 0.05
"""The same for lips, which move by millimetres."""

_SUM_WEIGHT = 1e4
"""Weight of the equation that keeps the sum of a landmark's weights: in effect infinite."""

_OUTLIER_MM = 25.0
"""Least distance in mm of a landmark that counts as a mistake of the tracker."""

_LEAST_FRAMES = 30
"""Frames that must show a landmark for its weights to be learnt."""

_MOVING = (
    *layout.UPPER_LIP,
    *layout.LOWER_LIP,
    *layout.LIP_CORNERS,
    *layout.CHIN,
    *layout.JAW,
    *layout.CHEEKS,
    *layout.NASOLABIAL,
)
_SOFT = np.array([layout.FACE_MARKERS.index(name) for name in _MOVING])


def near_hand(number: int) -> NDArray[np.intp]:
    """Return the markers among which a landmark of the hand may lie."""
    return near_markers(number)


def near_face(number: int) -> NDArray[np.intp]:
    """Return the markers among which a landmark of the face may lie; none if it is firm."""
    return _SOFT if FACE_LANDMARKS[number] in SOFT_LANDMARKS else _SOFT[:0]


def own_map(
    model: LandmarkModel, x: FloatArray, parameters: FloatArray, near: Near, ridge_mm2: float
) -> LandmarkModel:
    """Return the model with the weights of the cuer of a take.

    Parameters
    ----------
    model : LandmarkModel
    x : ndarray of float64, shape (T, L, 3)
        Landmarks, mm; NaN where not seen. Only the picture's plane counts.
    parameters : ndarray of float64, shape (T, P)
        What `model` finds in them.
    near : callable
        `near_hand` or `near_face`.
    ridge_mm2 : float
    """
    markers = model.model.reconstruct(parameters)[..., :2].astype(np.float64)
    meant = np.einsum("lk,tkc->tlc", model.map.weights, markers)
    beside = model.landmarks(parameters)[..., :2] - meant
    weights = model.map.weights.copy()
    for number, row in enumerate(weights):
        own = near(number)
        target = x[:, number, :2] - beside[:, number]
        use = np.flatnonzero(np.linalg.norm(target - meant[:, number], axis=1) < _OUTLIER_MM)
        if not len(own) or len(use) < _LEAST_FRAMES:
            continue
        weights[number, own] = _solved(markers[use][:, own], target[use], row[own], ridge_mm2)
    return replace(model, map=LandmarkMap(weights, model.map.firm))


def _solved(
    markers: FloatArray, target: FloatArray, before: FloatArray, ridge_mm2: float
) -> FloatArray:
    """Return weights of markers (T, n, 2) that give the target (T, 2); their sum stays."""
    scale = 1.0 / np.sqrt(len(markers))
    system = scale * markers.transpose(0, 2, 1).reshape(-1, len(before))
    ridge = np.sqrt(ridge_mm2)
    rows = [system, ridge * np.eye(len(before)), _SUM_WEIGHT * np.ones((1, len(before)))]
    right = [scale * target.reshape(-1), ridge * before, np.array([_SUM_WEIGHT * before.sum()])]
    return np.asarray(np.linalg.lstsq(np.vstack(rows), np.concatenate(right))[0])
