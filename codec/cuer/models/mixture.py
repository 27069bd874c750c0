"""A mixture of normal distributions that learns from, and completes, rows with unknown values.

Expectation and maximisation with unknown values after Ghahramani and Jordan 1994. The
covariance of each component is drawn towards the mean of all, so that a component of few rows
stays a distribution.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from codec.cuer.models.threads import one_thread
from codec.errors import CueError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_LEAST_SHARE = 0.02
"""Share of a row below which a component does not complete it."""

_SHRINK_ROWS = 6.0
"""Rows that the covariance common to all components counts for in each."""

_FLOOR = 0.01
"""Variance, in the units of the rows squared, that every direction has at least."""

_GLOBAL_ROUNDS = 4
"""Rounds with one component, which fill in unknown values before clusters are looked for."""

_ROWS_PER_COMPONENT = 150
"""Rows that a component needs."""


@dataclass(frozen=True, slots=True)
class Mixture:
    """Components of the distribution.

    Attributes
    ----------
    shares : ndarray of float64, shape (K,)
        Sum to one.
    means : ndarray of float64, shape (K, D)
    covariances : ndarray of float64, shape (K, D, D)
    precisions : ndarray of float64, shape (K, D, D)
        Their inverses.
    log_volumes : ndarray of float64, shape (K,)
        Logarithms of their determinants.
    """

    shares: FloatArray
    means: FloatArray
    covariances: FloatArray
    precisions: FloatArray = field(init=False, repr=False)
    log_volumes: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "precisions", np.linalg.inv(self.covariances))
        object.__setattr__(self, "log_volumes", np.linalg.slogdet(self.covariances)[1])

    def responsibilities(self, values: FloatArray, known: BoolArray) -> FloatArray:
        """Return how likely each component is, given the known values.

        Parameters
        ----------
        values : ndarray of float64, shape (T, D)
            Unknown values may be anything finite.
        known : ndarray of bool, shape (T, D)

        Returns
        -------
        ndarray of float64, shape (T, K)
            Rows sum to one; the unlikely components are set to zero.
        """
        from codec.cuer.models import _kernels

        distance = np.empty((len(values), len(self.shares)))
        _kernels.densities_into(*_rows(values, known), self.means, self.precisions, distance)
        log_share = np.log(self.shares) - 0.5 * (distance + self.log_volumes)
        share = np.exp(log_share - log_share.max(1, keepdims=True))
        share /= share.sum(1, keepdims=True)
        share[share < _LEAST_SHARE] = 0.0
        return np.asarray(share / share.sum(1, keepdims=True))

    def complete(
        self, values: FloatArray, known: BoolArray, share: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the rows with their unknown values expected from the known ones.

        Parameters
        ----------
        values, known : as for `responsibilities`
        share : ndarray of float64, shape (T, K)
            Responsibilities.

        Returns
        -------
        completed : ndarray of float64, shape (T, D)
            Known values as they were.
        surprise : ndarray of float64, shape (T, D)
            Distance of each known value from its expectation given the others; 0 if unknown.
        """
        from codec.cuer.models import _kernels

        completed, surprise = np.where(known, values, 0.0), np.zeros(values.shape)
        _kernels.expect_into(
            *_rows(values, known),
            np.ascontiguousarray(share),
            self.means,
            self.precisions,
            completed,
            surprise,
        )
        return completed, surprise


def _rows(values: FloatArray, known: BoolArray) -> tuple[FloatArray, BoolArray]:
    return np.ascontiguousarray(values, dtype=np.float64), np.ascontiguousarray(known)


@one_thread
def fit_mixture(
    values: FloatArray, known: BoolArray, *, components: int, rounds: int = 5
) -> Mixture:
    """Learn a mixture.

    Parameters
    ----------
    values : ndarray of float64, shape (T, D)
    known : ndarray of bool, shape (T, D)
        Every column has to be known somewhere.
    components : int
        At most; fewer for few rows.
    rounds : int
        Of expectation and maximisation.

    Raises
    ------
    CueError
        If a column is never known.

    Examples
    --------
    >>> x = np.array([[0.0, 0.0], [1.0, 2.0], [2.0, 4.0], [3.0, 0.0]])
    >>> seen = np.array([[True, True]] * 3 + [[True, False]])
    >>> found = fit_mixture(x, seen, components=1)
    >>> completed, _ = found.complete(x, seen, np.ones((4, 1)))
    >>> bool(abs(completed[3, 1] - 6.0) < 0.5)
    True
    """
    model = _single(values, known)
    share = np.ones((len(values), 1))
    for _ in range(_GLOBAL_ROUNDS):
        model = _maximised(model, values, known, share)
    completed, _ = model.complete(values, known, share)
    share = _clusters(completed, min(components, max(1, len(values) // _ROWS_PER_COMPONENT)))
    first = np.tile(model.means, (share.shape[1], 1))
    model = Mixture(share.mean(0), first, np.tile(model.covariances, (share.shape[1], 1, 1)))
    # What is unknown was completed without clusters: one more round tells the clusters' own.
    model = _maximised(model, completed, np.ones_like(known), share)
    for _ in range(rounds):
        model = _maximised(model, values, known, model.responsibilities(values, known))
    return model


def _single(values: FloatArray, known: BoolArray) -> Mixture:
    """Return one component: each covariance from the rows that know both values.

    If enough rows know all values, these alone count: their covariances agree, and expectation
    and maximisation would take very long to make those of all rows agree.
    """
    whole = known.all(1)
    if whole.sum() > 3 * known.shape[1]:
        values, known = values[whole], known[whole]
    count = known.sum(0)
    if not count.all():
        raise CueError(f"{int((count == 0).sum())} values are never known: nothing to learn from")
    mean = np.where(known, values, 0.0).sum(0) / count
    away = np.where(known, values - mean, 0.0)
    seen = known.astype(np.float64)
    variance, axes = np.linalg.eigh(away.T @ away / np.maximum(seen.T @ seen, 1.0))
    # Pairs that different rows tell need not agree: what would be negative is nothing.
    covariance = (axes * np.maximum(variance, _FLOOR)) @ axes.T
    return Mixture(np.ones(1), mean[None], covariance[None])


def _clusters(rows: FloatArray, count: int) -> FloatArray:
    """Return the membership (T, K) of clusters that start from evenly spaced rows."""
    start = rows[np.linspace(0, len(rows) - 1, count).astype(int)]
    _, number = kmeans2(rows, start, minit="matrix", missing="warn")
    used = np.flatnonzero(np.bincount(number, minlength=count) > 1)
    return np.asarray(number[:, None] == used, dtype=np.float64)


def _maximised(model: Mixture, values: FloatArray, known: BoolArray, share: FloatArray) -> Mixture:
    """Return the mixture of greatest expected likelihood under the responsibilities `share`."""
    from codec.cuer.models import _kernels

    k, d = model.means.shape
    total, first, second = np.full(k, 1e-9), np.zeros((k, d)), np.zeros((k, d, d))
    _kernels.gather_into(
        *_rows(values, known), share, model.means, model.precisions, total, first, second
    )
    second += np.swapaxes(np.tril(second, -1), 1, 2)
    shift = first / total[:, None]
    scatter = second - total[:, None, None] * shift[:, :, None] * shift[:, None]
    common = scatter.sum(0) / total.sum()
    covariances = scatter + _SHRINK_ROWS * common
    covariances /= (total + _SHRINK_ROWS)[:, None, None]
    return Mixture(
        np.maximum(total / total.sum(), 1e-6), model.means + shift, covariances + _FLOOR * np.eye(d)
    )
