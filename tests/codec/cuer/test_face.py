from types import ModuleType

import numpy as np
import pytest

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.models.face import THROAT_COLUMNS, FaceModel
from codec.cuer.models.inversion import RIGID_FACE_COLUMNS, invert_face
from codec.cuer.voice import Voice
from codec.errors import CueError
from codec.training.fit_face import fit_face


def test_reconstruction_is_the_papers_algorithm(toy_voice: Voice) -> None:
    """P3DF marker by marker, as printed in section 3.1."""
    model = toy_voice.face
    rng = np.random.default_rng(2)
    pa, pm = rng.normal(size=(4, 7)), rng.normal(size=(4, model.n_motion))
    found = model.reconstruct(np.concatenate([pa, pm], axis=1))
    for t in range(4):
        mvt = model.motion_mean + pm[t] @ model.motion_directions
        p3d = model.mean + np.einsum("p,pkc->kc", pa[t], model.directions)
        for i in range(layout.N_FACE):
            shared = mvt * model.weights[i]
            turned = rigid.rotation_matrices(shared[:3]) @ (p3d[i] - model.pivot)
            np.testing.assert_allclose(found[t, i], turned + shared[3:] + model.pivot, atol=1e-4)


def test_slopes_are_derivatives_of_the_residual(toy_voice: Voice) -> None:
    model, step = toy_voice.face, 1e-4
    rng = np.random.default_rng(3)
    at = rng.normal(size=(2, model.n_parameters))
    markers = model.reconstruct(at)
    np.testing.assert_allclose(model.residual(at, markers), 0, atol=1e-6)
    slopes = model.slopes(at)
    for p in range(model.n_parameters):
        nudge = step * np.eye(model.n_parameters)[p]
        ahead, behind = (model.residual(at + sign * nudge, markers) for sign in (1, -1))
        np.testing.assert_allclose(slopes[:, p], (behind - ahead) / (2 * step), atol=2e-3)


def test_shares_of_the_throat_are_found(toy: ModuleType, toy_voice: Voice) -> None:
    found = toy_voice.face.weights[THROAT_COLUMNS].mean(1)
    np.testing.assert_allclose(found, toy.THROAT_SHARES, atol=0.05)
    assert (toy_voice.face.weights[THROAT_COLUMNS] < 1).all()


def test_seven_parameters_explain_a_face_of_six_modes(toy: ModuleType) -> None:
    clean = toy.face_markers(np.random.default_rng(5), 600)
    model = fit_face(clean, clean[:, RIGID_FACE_COLUMNS])
    seen = np.ones(clean.shape[:2], dtype=bool)
    error = np.abs(model.reconstruct(invert_face(model, clean, seen)) - clean)
    assert error.mean() < 0.1  # measured 0.03: guided components are not quite the six modes


def test_head_weights_other_than_one_are_refused(toy_voice: Voice) -> None:
    model = toy_voice.face
    weights = model.weights.copy()
    weights[0] = 0.5
    with pytest.raises(CueError, match="a marker of the head does not follow"):
        FaceModel(
            model.mean,
            model.directions,
            model.pivot,
            model.motion_mean,
            model.motion_directions,
            weights,
        )


def test_wrong_shape_is_named(toy_voice: Voice) -> None:
    model = toy_voice.face
    with pytest.raises(CueError, match=r"face model: mean has shape \(62, 3\), expected \(63, 3\)"):
        FaceModel(
            model.mean[1:],
            model.directions,
            model.pivot,
            model.motion_mean,
            model.motion_directions,
            model.weights,
        )
