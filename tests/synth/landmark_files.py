"""Tables of landmarks as image trackers give them, of takes of the virtual cuer."""

import csv
import io

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import Score
from cuecast.evaluate.films import as_rows, film
from synth.capture.sources.landmark_maps import FACE_LANDMARKS
from synth.motion.rules.gesture import GestureSynthesiser

FloatArray = NDArray[np.float64]
RATE_HZ = 30.0


def project(
    identity: str,
    score: Score,
    *,
    seconds: float,
    noise_mm: float = 0.0,
    seed: int = 0,
    rate_hz: float = RATE_HZ,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return face (T, L, 3) and hand (T, 21, 3) in parts of the picture, and the true markers."""
    cuer = GestureSynthesiser(identity, rate_hz=rate_hz, seed=seed)
    return film(cuer, score, seconds=seconds, noise_mm=noise_mm, seed=seed)


def wide(face: FloatArray, hand: FloatArray, numbers: tuple[int, ...] = FACE_LANDMARKS) -> str:
    """Return a table with a column per coordinate; unseen points are empty."""
    text = io.StringIO()
    writer = csv.writer(text)
    slots = [FACE_LANDMARKS.index(n) for n in numbers]
    lips = set(numbers) & {0, 17, 37, 39, 40, 61, 84, 91, 146, 181, 185, 267, 269, 270, 291, 314,
                           321, 375, 405, 409}  # fmt: skip
    writer.writerow(
        [
            "fn_video",
            "frame_number",
            *(f"hand_{a}{i}" for i in range(21) for a in "xyz"),
            *(f"{'lip' if n in lips else 'face'}_{a}{n}" for n in numbers for a in "xyz"),
        ]
    )
    for k, (f, h) in enumerate(zip(face[:, slots], hand, strict=True), start=1):
        values = np.concatenate([h.ravel(), f.ravel()])
        writer.writerow(["a.mp4", k, *("" if np.isnan(v) else f"{v:.7f}" for v in values)])
    return text.getvalue()


def long(face: FloatArray, hand: FloatArray) -> str:
    """Return a table with a row per point, and times."""
    return as_rows(face, hand, RATE_HZ)
