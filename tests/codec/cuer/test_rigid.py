import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from codec.cuer.models import _kernels, rigid
from codec.errors import CueError

BODY = np.random.default_rng(0).normal(size=(10, 3)) * 50

motions = hnp.arrays(np.float64, 6, elements=st.floats(-1.7, 1.7)).map(
    lambda m: m * [1, 1, 1, 100, 100, 100]
)
vectors = hnp.arrays(np.float64, 3, elements=st.floats(-1.8, 1.8))


@given(vectors)
def test_rotation_matrices_agree_with_scipy(vector: np.ndarray) -> None:
    expected = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(rigid.rotation_matrices(vector), expected, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 1e-3, 1.0, 3.0, np.pi - 1e-9, np.pi])
def test_rotation_vector_round_trip(angle: float) -> None:
    for axis in np.random.default_rng(1).normal(size=(20, 3)):
        vector = angle * axis / np.linalg.norm(axis)
        matrix = rigid.rotation_matrices(vector)
        back = rigid.rotation_matrices(rigid.rotation_vectors(matrix))
        np.testing.assert_allclose(back, matrix, atol=1e-9)


@given(motions)
def test_estimate_finds_the_motion(motion: np.ndarray) -> None:
    moved = rigid.rigid_motion(BODY, motion[None])
    found, solved = rigid.estimate_motion(BODY, moved)
    assert solved.all()
    np.testing.assert_allclose(rigid.rigid_motion(BODY, found), moved, atol=1e-6)


@given(motions, motions)
def test_compose_inverse_and_pivot(first: np.ndarray, second: np.ndarray) -> None:
    both = rigid.rigid_motion(rigid.rigid_motion(BODY, first), second)
    at_once = rigid.rigid_motion(BODY, rigid.compose(second, first))
    np.testing.assert_allclose(at_once, both, atol=1e-6)
    np.testing.assert_allclose(
        rigid.rigid_motion(both, rigid.inverse(rigid.compose(second, first))), BODY, atol=1e-6
    )
    pivot = np.array([10.0, -20.0, 30.0])
    np.testing.assert_allclose(
        rigid.rigid_motion(BODY, rigid.about(pivot, first)),
        rigid.rigid_motion(BODY - pivot, first) + pivot,
        atol=1e-6,
    )


def test_per_marker_motion_equals_common_motion() -> None:
    motion = np.array([0.3, -0.2, 0.5, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(
        rigid.weighted_rigid_motion(BODY, np.tile(motion, (10, 1))),
        rigid.rigid_motion(BODY, motion),
        atol=1e-9,
    )


def test_motion_slopes_are_derivatives() -> None:
    rng, step = np.random.default_rng(0), 1e-6
    points = rng.normal(size=(3, 10, 3)) * 40
    motion = rng.normal(size=(3, 10, 6)) * [0.8, 0.8, 0.8, 9, 9, 9]
    directions = rng.normal(size=(2, 10, 6))
    slopes = rigid.motion_slopes(points, motion, directions)
    back = np.concatenate([-motion[..., :3], np.zeros_like(motion[..., 3:])], axis=-1)
    for n, direction in enumerate(directions):
        ahead = rigid.weighted_rigid_motion(points, motion + step * direction)
        behind = rigid.weighted_rigid_motion(points, motion - step * direction)
        turned = rigid.weighted_rigid_motion((ahead - behind) / (2 * step), back)
        np.testing.assert_allclose(slopes[:, n], turned, atol=1e-5)


@pytest.mark.parametrize("turns", [1, 4])
def test_compiled_slopes_are_those_of_python(turns: int) -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(3, 4, 3))
    turn, shift = rng.normal(size=(2, 3, turns, 3, 5))
    found, expected = np.zeros((2, 3, 5, 4, 3), dtype=np.float32)
    _kernels.turn_into(points, turn, shift, found)
    _kernels.turn_into.py_func(points, turn, shift, expected)
    np.testing.assert_array_equal(found, expected)
    last = np.cross(turn[2, -1, :, 3], points[2, 3]) + shift[2, -1, :, 3]
    np.testing.assert_allclose(found[2, 3, 3], last, atol=1e-5)


def test_points_move_by_their_shares() -> None:
    rng = np.random.default_rng(2)
    points, motion = rng.normal(size=(5, 4, 3)), rng.normal(size=(5, 6))
    motion[0, :3] = 1e-6
    shares = np.repeat(rng.uniform(size=(2, 6)), 2, axis=0)
    pivot = rng.normal(size=3)
    expected = rigid.weighted_rigid_motion(points, motion[:, None] * shares) + pivot
    found = rigid.shared_motion(points, motion, shares, pivot)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    _kernels.move_into.py_func(points, motion, shares, pivot, found)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_reflection_is_refused() -> None:
    found, _ = rigid.estimate_motion(BODY, (BODY * [-1, 1, 1])[None])
    assert np.linalg.det(rigid.rotation_matrices(found[0, :3])) == pytest.approx(1)


def test_outliers_are_left_out() -> None:
    motion = np.array([[0.2, 0.1, -0.3, 5.0, 6.0, 7.0]])
    moved = rigid.rigid_motion(BODY, motion)
    moved[0, 2] += [25.0, 0.0, 0.0]
    moved[0, 7] += [0.0, -15.0, 10.0]
    found, _ = rigid.estimate_motion(BODY, moved, rounds=6)
    np.testing.assert_allclose(found, motion, atol=1e-6)


def test_hidden_markers_do_not_count_and_too_few_are_not_solved() -> None:
    moved = np.repeat(rigid.rigid_motion(BODY, [[0.1, 0, 0, 1, 2, 3]]), 2, axis=0)
    moved[:, 3:] = np.nan
    weights = np.zeros((2, 10))
    weights[0, :3] = 1
    weights[1, :2] = 1
    found, solved = rigid.estimate_motion(BODY, moved, weights)
    assert solved.tolist() == [True, False]
    np.testing.assert_allclose(found[0], [0.1, 0, 0, 1, 2, 3], atol=1e-6)


def test_markers_on_a_line_are_not_solved() -> None:
    line = np.arange(5.0)[:, None] * [1.0, 2.0, 3.0]
    _, solved = rigid.estimate_motion(line, line[None])
    assert not solved.any()


def test_shape_mismatch_names_both_shapes() -> None:
    with pytest.raises(CueError, match=r"\(1, 4, 3\) do not match a reference of shape \(10, 3\)"):
        rigid.estimate_motion(BODY, np.zeros((1, 4, 3)))


def test_mean_body_recovers_shape_and_motion() -> None:
    rng = np.random.default_rng(3)
    motion = rng.normal(size=(50, 6)) * [0.2, 0.2, 0.2, 20, 20, 20]
    frames = rigid.rigid_motion(BODY, motion)
    body, found = rigid.mean_body(frames)
    np.testing.assert_allclose(rigid.rigid_motion(body, found), frames, atol=1e-6)
    assert np.abs(found[:, :3].mean(0)).max() < 0.02
