import numpy as np

from codec.cuer.models import _kernels
from codec.cuer.models.completion import MEMORY_S, blend

RATE_HZ = 120.0


def steps_and_seen() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    return rng.normal(size=(11, 3, 2)), rng.random((12, 3)) < [0.5, 0.0, 1.0]


def test_blending_solves_its_least_squares() -> None:
    steps, seen = steps_and_seen()
    found = blend(steps, seen, rate_hz=RATE_HZ)
    assert (found[seen] == 0).all()
    for k in range(3):
        free = np.flatnonzero(~seen[:, k])
        rows = np.concatenate([np.diff(np.eye(12), axis=0), np.eye(12) / (MEMORY_S * RATE_HZ)])
        right = np.concatenate([-steps[:, k], np.zeros((12, 2))])
        expected, *_ = np.linalg.lstsq(rows[:, free], right, rcond=None)
        np.testing.assert_allclose(found[free, k], expected, atol=1e-9)


def test_compiled_blending_is_that_of_python() -> None:
    steps, seen = steps_and_seen()
    found, plain = np.zeros((2, 12, 3, 2))
    _kernels.blend_into(steps, seen, 0.2, np.empty(12), found)
    _kernels.blend_into.py_func(steps, seen, 0.2, np.empty(12), plain)
    np.testing.assert_allclose(found, plain, atol=1e-12)


def test_a_long_gap_forgets_its_ends() -> None:
    seen = np.zeros((400, 1), dtype=bool)
    seen[[0, -1]] = True
    steps = np.zeros((399, 1, 1))
    steps[0] = -5.0
    found = blend(steps, seen, rate_hz=RATE_HZ)[:, 0, 0]
    assert found[1] > 3.0
    assert (np.diff(found[1:200]) <= 1e-12).all()
    assert abs(found[200]) < 1e-6


def test_one_frame_alone() -> None:
    assert blend(np.zeros((0, 2, 3)), np.zeros((1, 2), dtype=bool), rate_hz=RATE_HZ).shape == (
        1,
        2,
        3,
    )
