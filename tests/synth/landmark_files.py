"""Tables of landmarks as image trackers give them, of takes of the virtual cuer."""

import csv
import io

import numpy as np
from numpy.typing import NDArray

from codec.layout import N_FACE
from codec.score import Score
from synth.capture.landmark_maps import FACE_LANDMARKS, face_map, joints_of
from synth.gesture import GestureSynthesiser

FloatArray = NDArray[np.float64]
RATE_HZ = 30.0
WIDTH_MM = 1000.0


def project(
    identity: str, score: Score, *, seconds: float, aspect: float = 16 / 9, noise_mm: float = 0.0,
    seed: int = 0, rate_hz: float = RATE_HZ, law: str = "minimum-jerk",
) -> tuple[FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """Return face (T, L, 3) and hand (T, 21, 3) in parts of the picture, and the true markers.

    Depth is a guess: wrong by a fifth, and noisy. Noise of the face is a sixth of the hand's.
    """
    cuer = GestureSynthesiser(identity, rate_hz=rate_hz, seed=seed, law=law)
    pose = cuer.pose(score, 0.0, round(seconds * rate_hz))
    markers = cuer.body.markers(pose)
    rng = np.random.default_rng([seed, 5])
    face = np.einsum("lk,tkc->tlc", face_map().weights, markers[:, :N_FACE])
    hand = joints_of(pose.angles, pose.forearm, identity)
    # Trackers put each point a little beside where another one would, always the same way.
    face = face + rng.normal(scale=[2.0, 2.0, 0.0], size=face.shape[1:])
    hand = hand + rng.normal(scale=0.5 * noise_mm, size=hand.shape[1:])
    face = face + rng.normal(scale=noise_mm / 6, size=face.shape)
    hand = hand + rng.normal(scale=noise_mm, size=hand.shape)
    return _in_picture(face, aspect, rng), _in_picture(hand, aspect, rng), markers


def _in_picture(points: FloatArray, aspect: float, rng: np.random.Generator) -> FloatArray:
    middle = points[:, :1, 2:]
    out = np.empty_like(points)
    out[..., 0] = 0.5 + points[..., 0] / WIDTH_MM
    out[..., 1] = (0.35 * WIDTH_MM / aspect - points[..., 1]) * aspect / WIDTH_MM
    depth = 0.8 * (points[..., 2:] - middle)
    out[..., 2:] = -(depth + rng.normal(scale=8.0, size=depth.shape)) / WIDTH_MM
    return out


def wide(face: FloatArray, hand: FloatArray, numbers: tuple[int, ...] = FACE_LANDMARKS) -> str:
    """Return a table with a column per coordinate; unseen points are empty."""
    text = io.StringIO()
    writer = csv.writer(text)
    slots = [FACE_LANDMARKS.index(n) for n in numbers]
    lips = set(numbers) & {0, 17, 37, 39, 40, 61, 84, 91, 146, 181, 185, 267, 269, 270, 291, 314,
                           321, 375, 405, 409}  # fmt: skip
    writer.writerow(
        ["fn_video", "frame_number",
         *(f"hand_{a}{i}" for i in range(21) for a in "xyz"),
         *(f"{'lip' if n in lips else 'face'}_{a}{n}" for n in numbers for a in "xyz")]
    )  # fmt: skip
    for k, (f, h) in enumerate(zip(face[:, slots], hand, strict=True), start=1):
        values = np.concatenate([h.ravel(), f.ravel()])
        writer.writerow(["a.mp4", k, *("" if np.isnan(v) else f"{v:.7f}" for v in values)])
    return text.getvalue()


def long(face: FloatArray, hand: FloatArray, *, part: str = "right_hand") -> str:
    """Return a table with a row per point, and times."""
    rows = ["time,part,index,x,y,z"]
    for k, (f, h) in enumerate(zip(face, hand, strict=True)):
        for name, numbers, points in (("face", FACE_LANDMARKS, f), (part, range(21), h)):
            for number, point in zip(numbers, points, strict=True):
                if np.isfinite(point).all():
                    x, y, z = (f"{v:.7f}" for v in point)
                    rows.append(f"{k / RATE_HZ:.6f},{name},{number},{x},{y},{z}")
    return "\n".join(rows) + "\n"
