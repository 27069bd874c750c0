from types import ModuleType

import numpy as np

from codec.cuer import layout
from codec.cuer.models import _kernels, rigid
from codec.cuer.models.angles import N_ANGLES, SEGMENTS, angle_frames, measure_angles
from codec.cuer.models.hand import HandModel
from codec.cuer.models.inversion import FOREARM_COLUMNS, invert_hand
from codec.cuer.voice import Voice
from codec.training.fit_hand import fit_hand
from codec.training.pruning import prune


def mean_error(model: HandModel, markers: np.ndarray) -> float:
    seen = np.ones(markers.shape[:2], dtype=bool)
    found = model.reconstruct(invert_hand(model, markers, seen))
    return float(np.linalg.norm(found - markers, axis=-1).mean())


def test_reconstruction_is_the_papers_algorithm(toy_voice: Voice) -> None:
    """P3DH as printed in section 3.2."""
    model = toy_voice.hand
    rng = np.random.default_rng(2)
    pa, pm = rng.normal(size=(4, 12)), rng.normal(size=(4, model.n_motion))
    found = model.reconstruct(np.concatenate([pa, pm], axis=1))
    for t in range(4):
        mvt = model.motion_mean + pm[t] @ model.motion_directions
        ang = model.angle_mean + pa[t] @ model.angle_directions
        p = np.concatenate([[1.0], np.cos(ang), np.sin(ang)])
        points = np.einsum("a,akc->kc", p, model.regression)
        expected = points @ rigid.rotation_matrices(mvt[:3]).T + mvt[3:] + model.pivot
        np.testing.assert_allclose(found[t], expected, atol=1e-3)


def test_slopes_are_derivatives_of_the_residual(toy_voice: Voice) -> None:
    model, step = toy_voice.hand, 1e-4
    rng = np.random.default_rng(3)
    at = rng.normal(size=(2, model.n_parameters))
    markers = model.reconstruct(at)
    np.testing.assert_allclose(model.residual(at, markers), 0, atol=1e-6)
    slopes = model.slopes(at)
    for p in range(model.n_parameters):
        nudge = step * np.eye(model.n_parameters)[p]
        ahead, behind = (model.residual(at + sign * nudge, markers) for sign in (1, -1))
        np.testing.assert_allclose(slopes[:, p], (behind - ahead) / (2 * step), atol=2e-3)


def test_angles_follow_a_bending_finger(toy: ModuleType) -> None:
    points = toy.hand_markers(np.random.default_rng(1), 400)
    angles = measure_angles(points, angle_frames(points))
    assert angles.shape == (400, N_ANGLES)
    assert np.isfinite(angles).all()
    chord = {pair: k for k, pair in enumerate(SEGMENTS)}
    tip = angles[:, chord[("F33", "F3T")]] - angles[:, chord[("F32", "F33")]]
    # The toy's last joint bends by 0.4 of what its middle joints bend together, 0.8 + 1.0.
    middle = angles[:, chord[("F32", "F33")]] - angles[:, chord[("K3", "F31")]]
    np.testing.assert_allclose(
        np.abs(tip - tip.mean()), np.abs(middle - middle.mean()) * 0.4 / 1.5, atol=0.12
    )


def test_rotation_of_all_markers_leaves_successive_angles(toy: ModuleType) -> None:
    points = toy.hand_markers(np.random.default_rng(1), 50)
    turned = rigid.rigid_motion(points, [0.3, 0.2, -0.1, 5, 6, 7])
    own = measure_angles(points, angle_frames(points))
    moved = measure_angles(turned, angle_frames(turned))
    inner = slice(2 * len(SEGMENTS), N_ANGLES - 6)
    # The sense of a hinge is a convention.
    np.testing.assert_allclose(np.abs(own[:, inner]), np.abs(moved[:, inner]), atol=1e-6)


def test_cosines_and_sines_beat_a_linear_model_and_six_parameters_fail(toy: ModuleType) -> None:
    markers = toy.cuer_markers(1, 1500)[:, layout.N_FACE :].astype(float)
    unseen = toy.cuer_markers(2, 300)[:, layout.N_FACE :].astype(float)
    elliptic = mean_error(fit_hand(markers, markers[:, FOREARM_COLUMNS]), unseen)
    linear = mean_error(fit_hand(markers, markers[:, FOREARM_COLUMNS], regress_on="linear"), unseen)
    few = mean_error(fit_hand(markers, markers[:, FOREARM_COLUMNS], n_parameters=6), unseen)
    assert elliptic < 1.3  # measured 1.0
    assert linear > 1.3 * elliptic
    assert few > 3 * elliptic


def test_hidden_markers_are_recovered(toy: ModuleType, toy_voice: Voice) -> None:
    truth = toy.cuer_markers(3, 300, noise_mm=0.0)[:, layout.N_FACE :].astype(float)
    seen = np.random.default_rng(0).random(truth.shape[:2]) > 0.2
    found = toy_voice.hand.reconstruct(
        invert_hand(toy_voice.hand, np.where(seen[..., None], truth, 1e4), seen)
    )
    error = np.linalg.norm(found - truth, axis=-1)
    assert error[~seen].mean() < 1.5 * error[seen].mean()


def test_a_swapped_pair_and_a_ghost_do_not_pull(toy: ModuleType, toy_voice: Voice) -> None:
    truth = toy.cuer_markers(4, 100, noise_mm=0.0)[:, layout.N_FACE :].astype(float)
    seen = np.ones(truth.shape[:2], dtype=bool)
    broken = truth.copy()
    broken[:, [3, 15]] = truth[:, [15, 3]]
    broken[:, 25] += 60.0
    clean = np.linalg.norm(
        toy_voice.hand.reconstruct(invert_hand(toy_voice.hand, truth, seen)) - truth, axis=-1
    )
    found = toy_voice.hand.reconstruct(invert_hand(toy_voice.hand, broken, seen))
    error = np.linalg.norm(found - truth, axis=-1)
    assert np.median(error) < 2 * np.median(clean)


def test_pruning_keeps_a_least_distance() -> None:
    frames = np.cumsum(np.random.default_rng(0).normal(0, 0.4, (400, 5, 3)), axis=0)
    kept = prune(frames)
    chosen = frames[kept].astype(np.float32)
    gaps = np.linalg.norm(chosen[:, None] - chosen[None], axis=-1).max(-1)
    assert gaps[~np.eye(len(kept), dtype=bool)].min() >= 2.0 - 1e-3
    nearest = np.linalg.norm(frames[:, None] - frames[kept][None], axis=-1).max(-1).min(1)
    assert nearest.max() <= 2.0 + 1e-3


def test_pruning_kernel_equals_python() -> None:
    frames = np.random.default_rng(0).normal(size=(60, 4, 3)).astype(np.float32)
    kept, expected = np.empty(60, np.int64), np.empty(60, np.int64)
    count = _kernels.prune_into(frames, 4.0, kept)
    assert count == _kernels.prune_into.py_func(frames, 4.0, expected)
    assert kept[:count].tolist() == expected[:count].tolist()
    assert 1 < count < 60
