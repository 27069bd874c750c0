"""Shapes of a moving hand, against the same fits one at a time."""

import numpy as np

from codec.analysis.readability import Classes
from codec.cuer import layout
from codec.cuer.models import rigid

_SKULL = layout.marker_indices(layout.RIGID_FACE)
_BACK = layout.marker_indices((*layout.PALM, *layout.KNUCKLES[1:], *layout.WRIST))
_FINGERS = layout.marker_indices([n for f in layout.FINGERS for n in f])


def test_shapes_are_compared_hand_upon_hand() -> None:
    rng = np.random.default_rng(4)
    targets = np.repeat(rng.normal(0, 40, (1, 1, 113, 3)), 54, axis=1).reshape(9, 6, 113, 3)
    targets[:, :, _FINGERS] += rng.normal(0, 15, (9, 1, len(_FINGERS), 3))
    moved = rigid.rigid_motion(targets[:, 2], [0.4, -0.9, 0.2, 15.0, -30.0, 8.0])
    moved[:, _SKULL] = targets[0, 0, _SKULL]
    exact, _ = Classes(targets).distances(moved)
    assert exact.argmin(axis=1).tolist() == list(range(9))
    assert np.abs(np.diag(exact)).max() < 1e-5
    noisy = moved + rng.normal(0, 1.0, moved.shape)
    noisy[:, _SKULL] = targets[0, 0, _SKULL]
    noisy[4, _BACK[3]] += 80.0
    found, _ = Classes(targets).distances(noisy)
    for shape in range(9):
        still = targets[shape, 1]
        motion, _ = rigid.estimate_motion(still[_BACK], noisy[:, _BACK])
        fingers = rigid.inverse_rigid_motion(noisy[:, _FINGERS], motion)
        apart = np.square(fingers - still[_FINGERS]).sum(axis=2).mean(axis=1)
        np.testing.assert_allclose(found[:, shape], np.sqrt(apart), atol=1e-9)
