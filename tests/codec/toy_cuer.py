"""A small articulated cuer of known make, for tests of the models alone."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.training.fit import TrainingSet

THROAT_SHARES = np.linspace(0.2, 0.8, len(layout.THROAT))
PHALANGES_MM = (40.0, 25.0, 20.0, 8.0)


def _wander(rng: np.random.Generator, frames: int, n: int, every: int) -> NDArray[np.float64]:
    """Smooth steps between random values of unit variance."""
    knots = rng.normal(size=(frames // every + 2, n))
    place = np.arange(frames) / every
    left = place.astype(int)
    mix = (place - left)[:, None]
    mix = mix * mix * (3 - 2 * mix)
    return np.asarray(knots[left] * (1 - mix) + knots[left + 1] * mix)


def hand_markers(rng: np.random.Generator, frames: int) -> NDArray[np.float64]:
    """Five digits of three bending joints on a wrist, forearm at rest."""
    points = np.zeros((frames, layout.N_HAND, 3))

    def put(name: str, value: ArrayLike) -> None:
        points[:, layout.HAND_MARKERS.index(name)] = np.asarray(value)

    for ring in range(3):
        for k in range(4):
            turn = k * np.pi / 2 + 0.4 * ring
            put(f"A{ring}{k}", [30 * np.cos(turn), 60 * ring - 200, 30 * np.sin(turn)])
    for k in range(4):
        put(f"W{k + 1}", [20 * np.cos(1.6 * k), 2 * k - 15, 12 * np.sin(1.6 * k)])
    wrist = 0.25 * _wander(rng, frames, 3, 12)
    palm: NDArray[np.float64] = rigid.rotation_matrices(wrist * [1, 0, 1])
    place: NDArray[np.float64]
    for digit in range(1, 6):
        bend = np.clip(np.abs(_wander(rng, frames, 1, 12)), 0, 1.4)
        side = 0.1 * _wander(rng, frames, 1, 12) + 0.1 * (3 - digit)
        turn_digit = palm @ rigid.rotation_matrices(side * [0.0, 0.0, 1.0])
        if digit > 1:
            put(f"P{digit}", turn_digit @ np.array([-18.0 * (3 - digit), 40.0, 8.0]))
        place = turn_digit @ np.array([-18.0 * (3 - digit), 80.0, 8.0])
        put(f"K{digit}", place)
        for phalange, share in enumerate((0.3, 1.0, 1.8, 2.2)):
            bent = turn_digit @ rigid.rotation_matrices(bend * [share, 0.0, 0.0])
            if phalange == 1:
                put(f"S{digit}", place + bent @ [7.0, 8.0, -3.0])
            place = place + bent @ np.array([0.0, PHALANGES_MM[phalange], 0.0])
            put(f"F{digit}{'123T'[phalange]}", place)
    return points


def face_markers(rng: np.random.Generator, frames: int, extent: float = 1.0) -> NDArray[np.float64]:
    """A linear face of six modes whose throat follows the head in known shares."""
    make = np.random.default_rng(99)
    rest = 50 * make.normal(size=(layout.N_FACE, 3))
    modes = (
        make.normal(size=(6, layout.N_FACE, 3)) * np.array([3, 2, 1, 1, 0.6, 0.6])[:, None, None]
    )
    modes[:, [layout.FACE_MARKERS.index(name) for name in layout.RIGID_FACE]] = 0
    shares = np.ones((layout.N_FACE, 1))
    shares[[layout.FACE_MARKERS.index(name) for name in layout.THROAT], 0] = THROAT_SHARES
    shape = rest + np.einsum("tp,pkc->tkc", _wander(rng, frames, 6, 8), modes)
    size = extent * np.array([0.05, 0.05, 0.03, 3, 3, 3])
    motion = _wander(rng, frames, 6, 30) * size
    return rigid.weighted_rigid_motion(shape, motion[:, None] * shares)


def cuer_markers(seed: int, frames: int, noise_mm: float = 0.1) -> NDArray[np.float32]:
    """All 113 markers: hand on a moving forearm, face on a moving head, white noise."""
    rng = np.random.default_rng(seed)
    carried = _wander(rng, frames, 6, 20) * [0.2, 0.2, 0.2, 40, 40, 40]
    hand = rigid.rigid_motion(hand_markers(rng, frames), carried) + np.array([-100, -100, 100])
    both = np.concatenate([face_markers(rng, frames), hand], axis=1)
    return (both + rng.normal(0, noise_mm, both.shape)).astype(np.float32)


def training_set(seed: int, frames: int) -> TrainingSet:
    """Frames with labels that cover every target; the targets mean nothing."""
    t = np.arange(frames)
    return TrainingSet(cuer_markers(seed, frames), t % 9, (t // 9) % 6, t % 38)
