"""Distortion-compensated dither modulation of spread cells.

In: MDCT coefficients, the mask's amplitudes and bits; out: marked coefficients; and back to one
soft value per cell. A cell is a few neighbouring coefficients of one frame; each is divided by the
mask's amplitude, and their projection on a sign sequence is moved towards the nearest point of a
lattice that the bit shifts by half a step. Sources: Chen and Wornell, IEEE Trans. IT 47(4), 2001;
Costa, IEEE Trans. IT 29(3), 1983. Specification: spec/audio-carrier.md, W18, W19 and W22.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    signs = cells.signs.reshape(-1, cells.bins)
    u = _cut(coefficients, cells) * signs / np.where(dead, 1.0, unit)
    alive = np.asarray(~dead.any(axis=2))
    return np.where(alive, u.sum(axis=2), 0.0) / np.sqrt(cells.bins), alive


def soft_values(
    projections: NDArray[np.float64], alive: NDArray[np.bool_], cells: Cells, step: float
) -> NDArray[np.float64]:
    """Soft value of each cell: +1 on a point of bit 0, -1 on a point of bit 1, 0 if silent."""
    from watermark.audio.signal import _kernels

    out = np.empty(projections.shape)
    _kernels.soft_cells(projections, alive, cells.dither, 1.0 / step, out)
    return out


def mark_change(
    coefficients: NDArray[np.float64],
    amplitudes: NDArray[np.float64],
    cells: Cells,
    wanted: NDArray[np.float64],
    *,
    step: float,
    alpha: ArrayLike,
) -> NDArray[np.float64]:
    """Change of the coefficients that brings cells towards wanted soft values.

    Parameters
    ----------
    coefficients, amplitudes : ndarray of float64, shape (T, bins)
        MDCT coefficients and the amplitude of the mark's unit.
    cells : Cells
        Where to write.
    wanted : ndarray of float64, shape (T, groups)
        +1 for bit 0, -1 for bit 1, 0 where the cell must stay as it is.
    step : float
        Quantiser step in units of the mask's amplitude.
    alpha : array_like of float, shape () or (groups,)
        Part of the quantisation error to remove.

    Returns
    -------
    ndarray of float64, shape (T, bins)
    """
    projections, alive = project(coefficients, amplitudes, cells)
    error = (cells.dither + (1 - wanted) / 4) * step - projections
    error -= step * np.round(error / step)
    move = np.where(alive & (wanted != 0), np.asarray(alpha) * error, 0.0) / np.sqrt(cells.bins)
    change = np.zeros_like(coefficients)
    spread = cells.signs.reshape(-1, cells.bins) * move[:, :, np.newaxis]
    _cut(change, cells)[:] = spread * _cut(amplitudes, cells)
    return change
