"""Which points are which markers, when all that is known is where both are.

A body's points are laid on a template of its markers by a similarity and an assignment in turn
(iterated closest points after Besl and McKay 1992, each point to one marker after Kuhn 1955), from
many rotations; mirror images are excluded. A pair's certainty is the extra cost of the best
assignment without it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

_CAPS_MM = (90.0, 60.0, 40.0, 30.0, 20.0, 15.0)
"""Distances in mm beyond which points count as strangers, round by round."""

_ROUNDS_PER_CAP = 3
"""Rounds of assignment and fit with each of them."""

_SMALLEST = 1e-30
"""Spread that points have at least, in their unit's square, so that nothing is divided by 0."""

_NEVER = 1e9
"""Cost in mm2 that stands for never."""


@dataclass(frozen=True, slots=True)
class TemplateFit:
    """Points laid on a template.

    Attributes
    ----------
    error_mm2 : float
        Mean squared distance, that of strangers and of markers without a point bounded.
    template : int
        Number of the template.
    scale : float
        Template's length over the points'.
    turn : ndarray of float64, shape (3, 3)
    shift : ndarray of float64, shape (3,)
    """

    error_mm2: float
    template: int
    scale: float
    turn: FloatArray
    shift: FloatArray

    def apply(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) where the template is."""
        return np.asarray(self.scale * points @ self.turn.T + self.shift)


def spread_turns(count: int) -> FloatArray:
    """Return rotations spread over all there are, shape (count, 3, 3).

    Alexa 2022, "Super-Fibonacci spirals": quaternions at even steps along a spiral.
    """
    s = np.arange(count) + 0.5
    # The two irrational steps of the paper.
    alpha, beta = 2 * np.pi * s / np.sqrt(2.0), 2 * np.pi * s / 1.533751168755204288118041
    inner, outer = np.sqrt(s / count), np.sqrt(1 - s / count)
    x, y, z, w = (
        inner * np.sin(alpha),
        inner * np.cos(alpha),
        outer * np.sin(beta),
        outer * np.cos(beta),
    )
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
        ],
        axis=1,
    )


def lay(
    points: FloatArray,
    templates: Sequence[FloatArray],
    turns: FloatArray,
    *,
    free_scale: bool,
    kept: int = 4,
) -> list[TemplateFit]:
    """Return how points lie on the best of some templates, the best first.

    Parameters
    ----------
    points : ndarray of float64, shape (N, 3)
        In any unit if the scale is free.
    templates : sequence of ndarray of float64, shape (K, 3)
        Millimetres.
    turns : ndarray of float64, shape (R, 3, 3)
        Rotations to start from.
    free_scale : bool
        Whether the size is looked for too.
    kept : int
        Starts that are followed after the first rounds.
    """
    caps = [cap for cap in _CAPS_MM for _ in range(_ROUNDS_PER_CAP)]
    first, rest = caps[:_ROUNDS_PER_CAP], caps[_ROUNDS_PER_CAP:]
    begun = []
    for number, template in enumerate(templates):
        centre, middle, scale = points.mean(0), template.mean(0), 1.0
        if free_scale:
            spread = max(float(points.var(0).sum()), _SMALLEST)
            scale = float(np.sqrt(template.var(0).sum() / spread))
        for turn in turns:
            start = TemplateFit(np.inf, number, scale, turn, middle - scale * turn @ centre)
            begun.append(_followed(start, points, template, first, free_scale))
    begun.sort(key=lambda fit: fit.error_mm2)
    done = [
        _followed(fit, points, templates[fit.template], rest, free_scale) for fit in begun[:kept]
    ]
    return sorted(done, key=lambda fit: fit.error_mm2)


def _followed(
    fit: TemplateFit,
    points: FloatArray,
    template: FloatArray,
    caps: Sequence[float],
    free_scale: bool,
) -> TemplateFit:
    """Return a fit after one round of assignment and fit per cap."""
    error = np.inf
    for cap in caps:
        cost = np.minimum(cdist(fit.apply(points), template, "sqeuclidean"), cap**2)
        rows, columns = linear_sum_assignment(cost)
        paid = cost[rows, columns]
        most = max(cost.shape)
        error = float((paid.sum() + cap**2 * (most - len(rows))) / most)
        near = paid < cap**2
        if near.sum() < 4:
            break
        scale, turn, shift = similarity(
            points[rows[near]], template[columns[near]], free_scale=free_scale
        )
        fit = replace(fit, scale=scale, turn=turn, shift=shift)
    return replace(fit, error_mm2=error)


def similarity(
    a: FloatArray, b: FloatArray, *, free_scale: bool
) -> tuple[float, FloatArray, FloatArray]:
    """Return scale, rotation and shift that carry points `a` onto `b`, both (N, 3).

    Umeyama 1991 (IEEE PAMI 13:376): least squares, no mirror image.
    """
    of_a, of_b = a - a.mean(0), b - b.mean(0)
    u, s, vt = np.linalg.svd(of_b.T @ of_a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    turn = (u * sign) @ vt
    scale = float((s * sign).sum() / max(float((of_a**2).sum()), _SMALLEST)) if free_scale else 1.0
    return scale, turn, b.mean(0) - scale * turn @ a.mean(0)


def mean_costs(points: FloatArray, expected: FloatArray, *, cap_mm: float) -> FloatArray:
    """Return the mean squared distance of each point from each marker over time, bounded, mm2.

    Parameters
    ----------
    points : ndarray of float64, shape (T, N, 3)
        NaN where hidden.
    expected : ndarray of float64, shape (T, K, 3)
        NaN where nothing is known.
    cap_mm : float
        Distance beyond which it does not matter how far.

    Returns
    -------
    ndarray of float64, shape (N, K)
        The bound for pairs that are never seen.
    """
    total = np.zeros((points.shape[1], expected.shape[1]))
    count = np.zeros_like(total)
    for at, wanted in zip(points, expected, strict=True):
        away = cdist(at, wanted, "sqeuclidean")
        known = np.isfinite(away)
        total += np.where(known, np.minimum(np.where(known, away, 0.0), cap_mm**2), 0.0)
        count += known
    return np.where(count > 0, total / np.maximum(count, 1), cap_mm**2)


def assigned(cost: FloatArray, *, none: float) -> tuple[IntArray, IntArray, float]:
    """Return points and markers of the best assignment, and its cost.

    Parameters
    ----------
    cost : ndarray of float64, shape (N, K)
    none : float
        Cost of a point without a marker.
    """
    count, markers = cost.shape
    whole = np.full((count, markers + count), _NEVER)
    whole[:, :markers] = cost
    whole[np.arange(count), markers + np.arange(count)] = none
    rows, columns = linear_sum_assignment(whole)
    real = columns < markers
    return rows[real], columns[real], float(whole[rows, columns].sum())


def margins(cost: FloatArray, rows: IntArray, columns: IntArray, *, none: float) -> FloatArray:
    """Return how much more the best assignment without each pair costs, shape (pairs,)."""
    best = assigned(cost, none=none)[2]
    out = np.empty(len(rows))
    without = cost.copy()
    for number, (row, column) in enumerate(zip(rows, columns, strict=True)):
        without[row, column] = _NEVER
        out[number] = assigned(without, none=none)[2] - best
        without[row, column] = cost[row, column]
    return out
