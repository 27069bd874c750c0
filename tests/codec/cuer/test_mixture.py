import numpy as np
import pytest

from codec.cuer.models import _kernels
from codec.cuer.models.mixture import Mixture, fit_mixture
from codec.errors import CueError


def curve(rows: int, seed: int) -> np.ndarray:
    """Points of a bent line in five dimensions: no single normal distribution fits it."""
    rng = np.random.default_rng(seed)
    t = rng.uniform(0.0, 3.0, size=rows)
    x = np.stack([10 * np.cos(t), 10 * np.sin(t), 5 * t, 10 * np.sin(2 * t), 4 * t**2], axis=1)
    return np.asarray(x + rng.normal(scale=0.2, size=x.shape))


def test_a_mixture_follows_what_one_component_cannot() -> None:
    known = np.ones((900, 5), dtype=bool)
    rng = np.random.default_rng(5)
    known[rng.random(known.shape) < 0.2] = False
    test = curve(400, 2)
    shown = np.tile([True, True, True, False, False], (400, 1))
    errors = []
    for components in (1, 6):
        model = fit_mixture(curve(900, 1), known, components=components)
        share = model.responsibilities(test, shown)
        completed, _ = model.complete(np.where(shown, test, 0.0), shown, share)
        np.testing.assert_allclose(completed[:, :3], test[:, :3])
        errors.append(np.abs(completed - test)[:, 3:].mean())
    assert errors[1] < 0.35 * errors[0]  # measured 0.2
    assert errors[1] < 0.6


def test_the_expectation_of_a_normal_distribution_is_its_regression() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(4, 4))
    covariance, mean = root @ root.T + np.eye(4), rng.normal(size=4)
    model = Mixture(np.ones(1), mean[None], covariance[None])
    values, known = rng.normal(size=(6, 4)), np.tile([True, False, True, False], (6, 1))
    completed, surprise = model.complete(values, known, np.ones((6, 1)))
    seen, left = [0, 2], [1, 3]
    slope = covariance[np.ix_(left, seen)] @ np.linalg.inv(covariance[np.ix_(seen, seen)])
    expected = mean[left] + (values[:, seen] - mean[seen]) @ slope.T
    np.testing.assert_allclose(completed[:, left], expected)
    alone = covariance[0, 2] / covariance[2, 2] * (values[:, 2] - mean[2]) + mean[0]
    np.testing.assert_allclose(surprise[:, 0], values[:, 0] - alone)


def test_few_rows_make_few_components() -> None:
    model = fit_mixture(curve(200, 3), np.ones((200, 5), dtype=bool), components=20)
    assert len(model.shares) == 1


def test_what_was_never_known_cannot_be_learnt() -> None:
    known = np.ones((50, 5), dtype=bool)
    known[:, 2] = False
    with pytest.raises(CueError, match="1 values are never known"):
        fit_mixture(curve(50, 0), known, components=1)


def test_learning_is_deterministic() -> None:
    known = np.random.default_rng(1).random((900, 5)) > 0.1
    first, second = (fit_mixture(curve(900, 4), known, components=6) for _ in range(2))
    np.testing.assert_array_equal(first.means, second.means)
    np.testing.assert_array_equal(first.covariances, second.covariances)


def gaps() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return rows, what is known of them, responsibilities, means and precisions."""
    rng = np.random.default_rng(6)
    root = rng.normal(size=(2, 4, 4))
    known = np.repeat(rng.random((4, 4)) < 0.6, 2, axis=0)
    known[4:6] = False
    share = rng.dirichlet([1.0, 1.0], size=8)
    share[2] = [0.0, 1.0]
    precisions = root @ np.swapaxes(root, 1, 2) + np.eye(4)
    return rng.normal(size=(8, 4)), known, share, rng.normal(size=(2, 4)), precisions


def test_compiled_sums_are_those_of_python() -> None:
    values, known, share, means, precisions = gaps()
    for kernel, head, shapes in (
        (_kernels.densities_into, (values, known, means, precisions), [(8, 2)]),
        (_kernels.expect_into, (values, known, share, means, precisions), [(8, 4)] * 2),
        (_kernels.gather_into, (values, known, share, means, precisions), [2, (2, 4), (2, 4, 4)]),
    ):
        found, plain = [np.zeros(n) for n in shapes], [np.zeros(n) for n in shapes]
        kernel(*head, *found)
        kernel.py_func(*head, *plain)
        for one, other in zip(found, plain, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-12)


def test_densities_and_moments_are_those_of_the_known_values() -> None:
    values, known, share, means, precisions = gaps()
    distance, total = np.zeros((8, 2)), np.zeros(2)
    first, second = np.zeros((2, 4)), np.zeros((2, 4, 4))
    _kernels.densities_into(values, known, means, precisions, distance)
    _kernels.gather_into(values, known, share, means, precisions, total, first, second)
    moments = np.zeros((2, 4, 4))
    for k in range(2):
        covariance = np.linalg.inv(precisions[k])
        whole = np.linalg.slogdet(covariance)[1]
        for t in range(8):
            s, h = np.flatnonzero(known[t]), np.flatnonzero(~known[t])
            a, inner = (values[t] - means[k])[s], covariance[np.ix_(s, s)]
            expected = a @ np.linalg.solve(inner, a) + np.linalg.slogdet(inner)[1] - whole
            assert distance[t, k] == pytest.approx(expected)
            slope = np.linalg.solve(inner, covariance[np.ix_(s, h)])
            away = np.zeros(4)
            away[s], away[h] = a, a @ slope
            moment = np.outer(away, away)
            moment[np.ix_(h, h)] += covariance[np.ix_(h, h)] - covariance[np.ix_(h, s)] @ slope
            moments[k] += share[t, k] * moment
    np.testing.assert_allclose(total, share.sum(0))
    np.testing.assert_allclose(np.tril(second), np.tril(moments), atol=1e-12)
