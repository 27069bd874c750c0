"""Distortion-compensated dither modulation of spread cells.

In: MDCT coefficients, the mask's amplitudes and bits; out: marked coefficients; and back to one
soft value per cell. A cell is a few neighbouring coefficients of one frame; each is divided by the
mask's amplitude, and their projection on a sign sequence is moved towards the nearest point of a
lattice that the bit shifts by half a step. Sources: Chen and Wornell, IEEE Trans. IT 47(4), 2001;
Costa, IEEE Trans. IT 29(3), 1983. Specification: section 4.
"""

import numpy as np
from numpy.typing import NDArray

from watermark.layout import Layout
from watermark.profile import FIRST_BIN, LEVELS, PILOT_STEPS, TIER_LEVELS


def steps_of(layout: Layout, level: int) -> NDArray[np.float64]:
    """Quantiser step of each cell at a level: data cells, and pilots at their tier's step.

    Returns
    -------
    ndarray of float64, shape (64, groups)
    """
    steps = np.full((layout.pilot_group.shape[0], layout.dither.size), LEVELS[level])
    pilot_step = PILOT_STEPS[level // TIER_LEVELS]
    np.put_along_axis(steps, layout.pilot_group, pilot_step, axis=1)
    return steps


def project(
    coefficients: NDArray[np.float64],
    amplitudes: NDArray[np.float64],
    layout: Layout,
    groups: int | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Projection of each cell in units of the mask, and whether the cell can carry.

    Parameters
    ----------
    coefficients, amplitudes : ndarray of float64, shape (T, bins)
        MDCT coefficients and the amplitude of the mark's unit.
    layout : Layout
        Signs and cells.
    groups : int, optional
        Only the first cell positions; all of them by default.

    Returns
    -------
    projections : ndarray of float64, shape (T, groups)
    alive : ndarray of bool, shape (T, groups)
        False where a bin of the cell is silent; the projection is zero there.
    """
    count = layout.dither.size if groups is None else groups
    cut = slice(FIRST_BIN, int(layout.starts[count]))
    first = layout.starts[:count] - FIRST_BIN
    unit = amplitudes[:, cut]
    dead = unit <= 0
    u = coefficients[:, cut] * layout.signs[: unit.shape[1]] / np.where(dead, 1.0, unit)
    alive = ~np.logical_or.reduceat(dead, first, axis=1)
    width = np.diff(layout.starts[: count + 1])
    projections = np.add.reduceat(u, first, axis=1) / np.sqrt(width)
    return np.where(alive, projections, 0.0), alive


def soft_values(
    projections: NDArray[np.float64],
    alive: NDArray[np.bool_],
    steps: NDArray[np.float64] | float,
    layout: Layout,
) -> NDArray[np.float64]:
    """Soft value of each cell: +1 on a point of bit 0, -1 on a point of bit 1, 0 if silent."""
    dither = layout.dither[: projections.shape[1]]
    return np.where(alive, np.cos(2 * np.pi * (projections / steps - dither)), 0.0)


def mark_change(
    coefficients: NDArray[np.float64],
    amplitudes: NDArray[np.float64],
    bits: NDArray[np.int64],
    *,
    level: int,
    alpha: float,
    layout: Layout,
) -> NDArray[np.float64]:
    """Change of the coefficients that writes `bits`, shape (64, groups), into the cells."""
    projections, alive = project(coefficients, amplitudes, layout)
    steps = steps_of(layout, level)
    error = (layout.dither + bits / 2) * steps - projections
    error -= steps * np.round(error / steps)
    width = np.diff(layout.starts)
    move = np.where(alive, alpha * error, 0.0) / np.sqrt(width)
    change = np.zeros_like(coefficients)
    cut = slice(FIRST_BIN, int(layout.starts[-1]))
    change[:, cut] = layout.signs * np.repeat(move, width, axis=1) * amplitudes[:, cut]
    return change
