"""Unit selection: the cheapest sequence of candidates by dynamic programming.

Hunt and Black 1996 (section 2): the sum of target costs and join costs is minimal.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

JoinCost = Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.float64]]
"""(m,) units before a join and (n,) units after it -> (m, n) costs."""


def select_units(
    candidates: Sequence[NDArray[np.int64]],
    target_costs: Sequence[NDArray[np.float64]],
    join_cost: JoinCost,
) -> NDArray[np.int64]:
    """Choose one candidate per place.

    Parameters
    ----------
    candidates : sequence of ndarray of int64, shape (n_k,)
        Numbers of the units that may stand at place k; none may be empty.
    target_costs : sequence of ndarray of float64, shape (n_k,)
        How badly each of them suits its place.
    join_cost : callable
        How badly units follow each other.

    Returns
    -------
    ndarray of int64, shape (K,)

    Raises
    ------
    CueError
        If a place has no candidate.

    Examples
    --------
    >>> places = [np.array([0, 1]), np.array([2, 3])]
    >>> costs = [np.array([0.0, 0.1]), np.array([0.0, 0.0])]
    >>> select_units(places, costs, lambda a, b: np.abs(a[:, None] + 2 - b) * 1.0)
    array([0, 2])
    """
    if not candidates:
        return np.zeros(0, dtype=np.int64)
    for place, units in enumerate(candidates):
        if len(units) == 0:
            raise CueError(f"no unit for place {place}")
    score = target_costs[0]
    back: list[NDArray[np.int64]] = []
    for before, units, cost in zip(candidates, candidates[1:], target_costs[1:], strict=False):
        total = score[:, None] + join_cost(before, units)
        best = total.argmin(axis=0)
        back.append(best)
        score = total[best, np.arange(len(units))] + cost
    state = int(score.argmin())
    chosen = [int(candidates[-1][state])]
    for units, best in zip(candidates[-2::-1], back[::-1], strict=True):
        state = int(best[state])
        chosen.append(int(units[state]))
    return np.array(chosen[::-1], dtype=np.int64)
