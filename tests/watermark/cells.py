"""Projection of cells by its formula, beside the compiled loops of embedder and receiver."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.audio.signal.layout import Cells


def _cut(values: NDArray[Any], cells: Cells) -> NDArray[Any]:
    """Bins of the cells, shape (T, groups, bins)."""
    return values[:, cells.first_bin : cells.last_bin].reshape(-1, cells.dither.size, cells.bins)


def project(
    coefficients: NDArray[Any], amplitudes: NDArray[Any], cells: Cells
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Projection of each cell in units of the mask, and whether the cell can carry.

    Parameters
    ----------
    coefficients, amplitudes : ndarray of float64 or float32, shape (T, bins)
        MDCT coefficients and the amplitude of the mark's unit.
    cells : Cells
        Cells and signs of the projection.

    Returns
    -------
    projections : ndarray of float64, shape (T, groups)
    alive : ndarray of bool, shape (T, groups)
        False where a bin of the cell is silent; the projection is zero there.
    """
    unit = _cut(amplitudes, cells)
    dead = unit <= 0
    signs = cells.signs.reshape(-1, cells.bins).astype(coefficients.dtype)
    u = _cut(coefficients, cells) * signs / np.where(dead, unit.dtype.type(1), unit)
    alive = np.asarray(~dead.any(axis=2))
    return np.where(alive, u.sum(axis=2), u.dtype.type(0)) / math.sqrt(cells.bins), alive
