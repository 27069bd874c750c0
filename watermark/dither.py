"""Distortion-compensated dither modulation of spread cells.

In: MDCT coefficients, the mask's amplitudes and bits; out: marked coefficients; and back to one
soft value per cell. A cell is `cell_bins` neighbouring coefficients of one frame; each is divided
by the mask's amplitude, and their projection on a sign sequence is moved towards the nearest point
of a lattice that the bit shifts by half a step. Sources: Chen and Wornell, IEEE Trans. IT 47(4),
2001; Costa, IEEE Trans. IT 29(3), 1983. Specification: section 4.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.layout import Layout
from watermark.profile import Profile


@dataclass(frozen=True, slots=True)
class Cells:
    """Modulator and demodulator of the cells of whole frames.

    Attributes
    ----------
    profile : Profile
        Geometry and strength.
    layout : Layout
        Signs and dither.
    """

    profile: Profile
    layout: Layout

    def _cut(self, bins: NDArray[np.float64], groups: int) -> NDArray[np.float64]:
        first, width = self.profile.first_bin, self.profile.cell_bins
        return bins[:, first : first + groups * width].reshape(-1, groups, width)

    def project(
        self,
        coefficients: NDArray[np.float64],
        amplitudes: NDArray[np.float64],
        groups: int | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Projection of each cell in units of the mask, and whether the cell can carry.

        Parameters
        ----------
        coefficients, amplitudes : ndarray of float64, shape (T, bins)
            MDCT coefficients and the amplitude of the mark's unit.
        groups : int, optional
            Only the first cell positions; all of them by default.

        Returns
        -------
        projections : ndarray of float64, shape (T, groups)
        alive : ndarray of bool, shape (T, groups)
            False where a bin of the cell is silent; the projection is zero there.
        """
        count = self.profile.groups if groups is None else groups
        x, m = self._cut(coefficients, count), self._cut(amplitudes, count)
        alive = np.asarray((m > 0).all(axis=2))
        u = x / np.where(m > 0, m, 1.0) * self.layout.signs[:count]
        return np.where(alive, u.sum(axis=2), 0.0) / np.sqrt(self.profile.cell_bins), alive

    def soft(self, projections: NDArray[np.float64]) -> NDArray[np.float64]:
        """Soft value of each cell, +1 on a point of bit 0 and -1 on a point of bit 1."""
        dither = self.layout.dither[: projections.shape[1]]
        return np.cos(2 * np.pi * (projections / self.profile.step - dither))

    def mark(
        self,
        coefficients: NDArray[np.float64],
        amplitudes: NDArray[np.float64],
        bits: NDArray[np.int64],
    ) -> NDArray[np.float64]:
        """Change of the coefficients that writes `bits`, shape (T, groups), into the cells."""
        step, width = self.profile.step, self.profile.cell_bins
        projections, alive = self.project(coefficients, amplitudes)
        target = (self.layout.dither + bits / 2) * step
        error = target - projections
        error -= step * np.round(error / step)
        move = np.where(alive, self.profile.alpha * error, 0.0) / np.sqrt(width)
        change = np.zeros_like(coefficients)
        spread = self.layout.signs * move[:, :, np.newaxis]
        self._cut(change, self.profile.groups)[:] = spread * self._cut(
            amplitudes, self.profile.groups
        )
        return change
