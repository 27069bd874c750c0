"""A voice of plain geometry and random directions: exercises the receiver without real data."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cuer.gestures import GestureTable
from codec.cuer.layout import EARS, FACE_MARKERS, HAND_MARKERS, THROAT
from codec.cuer.models.face import FaceModel
from codec.cuer.models.hand import HandModel
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Key, Score

N_HEAD, N_FOREARM, N_ANGLES = 5, 6, 21


def _f32(values: ArrayLike) -> NDArray[np.float32]:
    return np.asarray(values, dtype=np.float32)


def _face_points() -> NDArray[np.float64]:
    turn = np.linspace(0, 6 * np.pi, len(FACE_MARKERS))
    height = np.linspace(60, -60, len(FACE_MARKERS))
    points = np.stack([60 * np.sin(turn), 700 + height, 120 + 30 * np.cos(turn)], axis=1)
    for name, side in zip(EARS, (-1, 1), strict=True):
        points[FACE_MARKERS.index(name)] = (80 * side, 720, 50)
    return points


def make_voice(seed: int = 0) -> Voice:
    rng = np.random.default_rng(seed)
    weights = np.ones((len(FACE_MARKERS), 6))
    weights[[FACE_MARKERS.index(name) for name in THROAT]] = 0.4
    face = FaceModel(
        _f32(_face_points()),
        _f32(rng.normal(0, 2, (7, len(FACE_MARKERS), 3))),
        _f32([3, 690, 100]),
        _f32(np.zeros(6)),
        _f32(rng.normal(0, 1, (N_HEAD, 6)) * [0.03, 0.03, 0.03, 3, 3, 3]),
        _f32(weights),
    )
    regression = rng.normal(0, 4, (1 + 2 * N_ANGLES, len(HAND_MARKERS), 3))
    regression[0, :, 1] += np.linspace(80, -120, len(HAND_MARKERS))
    hand = HandModel(
        _f32(rng.normal(0, 0.3, N_ANGLES)),
        _f32(rng.normal(0, 0.3, (12, N_ANGLES))),
        _f32(regression),
        _f32([-110, 560, 190]),
        _f32([0.1, -0.2, 0.3, 1, 2, 3]),
        _f32(rng.normal(0, 1, (N_FOREARM, 6)) * [0.1, 0.1, 0.1, 20, 20, 20]),
        _f32(np.zeros((0, len(HAND_MARKERS), 3))),
    )
    gestures = GestureTable(
        _f32(rng.normal(size=(9, 12))),
        _f32(rng.normal(size=(9, 6, N_FOREARM))),
        _f32(rng.normal(size=(38, 7))),
        _f32(np.zeros(N_HEAD)),
    )
    return Voice("stand-in", face, hand, gestures)


def make_motion(voice: Voice, duration_s: float = 8.0, start_s: float = 0.0) -> Motion:
    """Slow sinusoids: cubic interpolation between 50 Hz frames is then exact to some microns."""
    times = start_s + np.arange(round(50 * duration_s)) / 50
    rates = np.linspace(0.2, 1.0, len(voice.layout))
    params = 0.7 * np.sin(2 * np.pi * np.outer(times, rates) + rates * 9)
    placements = ("side", "mouth", "chin", "cheek", "throat")
    starts = np.arange(start_s, start_s + duration_s - 0.3, 0.3)
    keys = tuple(
        Key(s, s + 0.3, ("b", "ɔ̃"), 1 + i % 8, placements[i % 5])
        for i, s in enumerate(map(float, starts))
    )
    return Motion(
        params.astype(np.float32), 50.0, start_s, voice.layout, voice.identity, Score((), keys)
    )
