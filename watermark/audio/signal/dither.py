"""Distortion-compensated dither modulation of spread cells.

In: MDCT coefficients, the mask's amplitudes and bits; out: marked coefficients; and back to one
soft value per cell. A cell is a few neighbouring coefficients of one frame; each is divided by the
mask's amplitude, and their projection on a sign sequence is moved towards the nearest point of a
lattice that the bit shifts by half a step. Sources: Chen and Wornell, IEEE Trans. IT 47(4), 2001;
Costa, IEEE Trans. IT 29(3), 1983. Specification: spec/audio-carrier.md, W18, W19 and W22.
"""

import numpy as np
from numpy.typing import NDArray

from watermark.audio.signal import _kernels
from watermark.audio.signal.layout import Cells


def soft_values(
    projections: NDArray[np.float64], alive: NDArray[np.bool_], cells: Cells, step: float
) -> NDArray[np.float64]:
    """Soft value of each cell: +1 on a point of bit 0, -1 on a point of bit 1, 0 if silent."""
    out = np.empty(projections.shape)
    _kernels.soft_cells(projections, alive, cells.dither, 1.0 / step, out)
    return out


def mark_change(
    coefficients: NDArray[np.float32],
    amplitudes: NDArray[np.float32],
    cells: Cells,
    wanted: NDArray[np.float32],
    *,
    step: float,
    alpha: NDArray[np.float32],
) -> tuple[NDArray[np.float32], float]:
    """Change of the coefficients that brings cells towards wanted soft values.

    Parameters
    ----------
    coefficients, amplitudes : ndarray of float32, shape (T, bins)
        MDCT coefficients and the amplitude of the mark's unit.
    cells : Cells
        Where to write.
    wanted : ndarray of float32, shape (T, groups)
        +1 for bit 0, -1 for bit 1, 0 where the cell must stay as it is.
    step : float
        Quantiser step in units of the mask's amplitude.
    alpha : ndarray of float32, shape (groups,)
        Part of the quantisation error to remove.

    Returns
    -------
    change : ndarray of float32, shape (T, bins)
    living : float
        Share of the cells that can carry.
    """
    change = np.zeros_like(coefficients)
    living = _kernels.change_cells(
        coefficients, amplitudes, cells.signs, cells.first_bin, cells.dither, wanted, step, alpha,
        change,
    )  # fmt: skip
    return change, living / wanted.size
