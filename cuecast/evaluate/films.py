"""What an image tracker sees of the virtual cuer: landmarks of face and hand in a simulated film.

The camera stands far away before her. Landmarks of the hand are her true joints, with noise and a
constant error each; those of the face lie among her markers, likewise. Depth is a guess: four
fifths of the truth, and noisy. This is kinder than a real film, whose tracker reads folded fingers
half open.
"""

import csv
import io

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import N_FACE
from codec.cues.score import Score
from synth.capture.sources.landmark_maps import FACE_LANDMARKS, face_map, joints_of
from synth.motion.measured.cuer import Performer

FloatArray = NDArray[np.float64]

WIDTH_MM = 1000.0
"""Width of the scene from side to side."""

ASPECT = 16 / 9
"""Width of the picture over its height."""

_FACE_PART = 1 / 6
"""Noise of the face's landmarks, of that of the hand's."""

_FACE_BESIDE_MM = 2.0
"""Standard deviation in mm of the constant displacement of each landmark of the face."""

_DEPTH_SD_MM = 8.0
"""Standard deviation in mm of the guessed depth."""

_DEPTH_GAIN = 0.8
"""Factor of the guess on a true difference of depth."""


def film(
    cuer: Performer, score: Score, *, seconds: float, noise_mm: float, seed: int = 0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the landmarks of a film of `cuer`, and the truth.

    Parameters
    ----------
    cuer : Performer
        Her rate is the film's.
    score : Score
    seconds : float
    noise_mm : float
        Standard deviation of the hand's landmarks; the face's is a sixth.
    seed : int
        Of all errors.

    Returns
    -------
    face, hand : ndarray of float64, shapes (T, L, 3) and (T, 21, 3)
        In parts of the picture's width and height, y down.
    markers : ndarray of float64, shape (T, 113, 3)
        The truth, mm.
    """
    pose = cuer.pose(score, 0.0, round(seconds * cuer.rate_hz))
    markers = cuer.body.markers(pose)
    rng = np.random.default_rng([seed, 5])
    face = np.einsum("lk,tkc->tlc", face_map().weights, markers[:, :N_FACE])
    hand = joints_of(pose.angles, pose.forearm, cuer.body.name)
    face = face + rng.normal(scale=[_FACE_BESIDE_MM, _FACE_BESIDE_MM, 0.0], size=face.shape[1:])
    hand = hand + rng.normal(scale=0.5 * noise_mm, size=hand.shape[1:])
    face = face + rng.normal(scale=_FACE_PART * noise_mm, size=face.shape)
    hand = hand + rng.normal(scale=noise_mm, size=hand.shape)
    return _in_picture(face, rng), _in_picture(hand, rng), markers


def _in_picture(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    out = np.empty_like(points)
    out[..., 0] = 0.5 + points[..., 0] / WIDTH_MM
    out[..., 1] = 0.35 - points[..., 1] * ASPECT / WIDTH_MM
    depth = _DEPTH_GAIN * (points[..., 2:] - points[:, :1, 2:])
    depth += rng.normal(scale=_DEPTH_SD_MM, size=depth.shape)
    out[..., 2:] = -depth / WIDTH_MM
    return out


def as_rows(face: FloatArray, hand: FloatArray, rate_hz: float) -> str:
    """Return landmarks as a table with a row per point; unseen points are left out."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", "part", "index", "x", "y", "z"])
    for k, (of_face, of_hand) in enumerate(zip(face, hand, strict=True)):
        for part, numbers, points in (
            ("face", FACE_LANDMARKS, of_face),
            ("right_hand", range(len(of_hand)), of_hand),
        ):
            for number, point in zip(numbers, points, strict=True):
                if np.isfinite(point).all():
                    place = (f"{v:.7f}" for v in point)
                    writer.writerow([f"{k / rate_hz:.6f}", part, number, *place])
    return text.getvalue()
