"""Markers under wrong names: swapped neighbours, ghosts, identities that were lost.

The models say where each marker should be. Markers that are far from there, and points without a
name, are given anew to the markers that are missing, each to the nearest (Kuhn 1955, through
`scipy.optimize.linear_sum_assignment`); the rest is left out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from codec.cuer import layout

FloatArray = NDArray[np.float64]

SUSPECT_MM = np.array([6.0] * layout.N_FACE + [9.0] * layout.N_HAND)
"""A marker farther from where it should be is doubted, shape (113,)."""

_FAR_MM = 1e6
"""Distance in mm that stands for never."""


@dataclass(slots=True)
class Repairs:
    """Repairs, counted in marker frames.

    Attributes
    ----------
    renamed : int
        Markers that stood under another marker's name.
    recovered : int
        Markers that stood under no name.
    dropped : int
        Markers that were left out: jumps and ghosts.
    """

    renamed: int = 0
    recovered: int = 0
    dropped: int = 0


def relabel(
    markers: FloatArray,
    expected: FloatArray,
    unnamed: FloatArray,
    possible: NDArray[np.bool_],
    repairs: Repairs,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the markers under the names that they seem to have.

    Parameters
    ----------
    markers : ndarray of float64, shape (T, 113, 3)
        NaN where hidden.
    expected : ndarray of float64, shape (T, 113, 3)
        Where the models say they are; NaN where nothing is known.
    unnamed : ndarray of float64, shape (T, G, 3)
        Points without a name; NaN where there are none.
    possible : ndarray of bool, shape (113,)
        Markers that the cuer wears.
    repairs : Repairs
        Counts on.

    Returns
    -------
    markers : ndarray of float64, shape (T, 113, 3)
    changed : ndarray of bool, shape (T,)
    """
    away = np.linalg.norm(markers - expected, axis=-1)
    doubted = np.nan_to_num(away) > SUSPECT_MM
    stray = np.asarray(np.isfinite(unnamed).all(-1))
    out = markers.copy()
    hidden = ~np.isfinite(markers).all(-1) & possible & np.isfinite(expected).all(-1)
    work = doubted.any(1) | (stray.any(1) & hidden.any(1))
    changed = np.zeros(len(markers), dtype=bool)
    for t in np.flatnonzero(work).tolist():
        wanted = np.flatnonzero(doubted[t] | hidden[t])
        own = np.flatnonzero(doubted[t])
        offered = np.concatenate([markers[t, own], unnamed[t, stray[t]]])
        out[t, own] = np.nan
        gap = np.linalg.norm(expected[t, wanted][:, None] - offered, axis=-1)
        cost = np.where(gap <= SUSPECT_MM[wanted][:, None], gap, _FAR_MM)
        # Pairs of least total distance (Hungarian method); those beyond the limit are given up.
        rows, columns = linear_sum_assignment(cost)
        fitting = cost[rows, columns] < _FAR_MM
        rows, columns = rows[fitting], columns[fitting]
        out[t, wanted[rows]] = offered[columns]
        renamed = int((columns < len(own)).sum())
        repairs.renamed += renamed
        repairs.recovered += len(columns) - renamed
        repairs.dropped += len(own) - renamed
        changed[t] = len(own) > 0 or len(columns) > 0
    return out, changed
