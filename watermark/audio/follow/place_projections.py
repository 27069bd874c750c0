"""Cells of frames that begin at any of many places, from transforms of a few of them.

In: spectra at places a few samples apart; out: what a table says of the cells' errors at those
places and between them. Between two transforms lies the mean of both, their phases turned; what
turning errs by, which grows with the distance from the middle of a cell and of a wave, cancels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow import _path_kernels
from watermark.audio.signal.layout import Cells
from watermark.audio.signal.profile import HOP

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class PlaceProjections:
    """Projections of cells on places, and what lies between each and a second place.

    Attributes
    ----------
    planes : ndarray of float32, shape (2, rows + step, groups)
        Real and imaginary parts at each place.
    step : int
        Rows from a place to the one `distance` later.
    alive : ndarray of bool, shape (units, groups)
        Which cells carry, under each mask.
    nearest : ndarray of int64, shape (rows,)
        Mask of each row.
    distance : float
        Samples between the two places.
    cells : Cells
        Of which they are.
    """

    planes: Floats
    step: int
    alive: NDArray[np.bool_]
    nearest: NDArray[np.int64]
    distance: float
    cells: Cells

    @classmethod
    def of(
        cls, spectra: NDArray[np.complex64], units: Array, nearest: NDArray[np.int64],
        distance: float, cells: Cells, *, step: int = 1,
    ) -> "PlaceProjections":  # fmt: skip
        """Project spectra, shape (rows + step, bins), in units of masks, shape (units, bins).

        The second place of a row is that of the spectrum `step` later.
        """
        used = units[:, cells.first_bin : cells.last_bin].reshape(len(units), -1, cells.bins)
        alive = np.asarray((used > 0).all(axis=2), dtype=np.bool_)
        weights = np.where(alive[..., np.newaxis], 1 / np.where(used > 0, used, 1.0), 0.0)
        weights = weights.reshape(len(units), -1) * (cells.signs / np.sqrt(cells.bins))
        planes = np.empty((2, len(spectra), cells.dither.size), dtype=np.float32)
        _path_kernels.project_rows(
            spectra, weights.astype(np.float32), nearest, cells.first_bin, *planes
        )
        return cls(planes, step, alive, nearest, distance, cells)

    def look_up(
        self, step: float, table: Array, delays: Array, *, shifts: tuple[float, ...] = (0.0,)
    ) -> Floats:
        """Return values of a table by cells' errors.

        Parameters
        ----------
        step : float
            Of the lattice.
        table : ndarray of float64, shape (groups, points)
            Over one step; a power of two of points.
        delays : ndarray of float64, shape (delays,)
            Samples after a row's place, up to `distance`.
        shifts : tuple of float
            By which lattices are shifted, in steps.

        Returns
        -------
        ndarray of float32, shape (shifts, rows * delays, groups)
            0 for cells that do not carry.
        """
        shape = len(shifts), self._count(delays), self.cells.dither.size
        values, sums = np.empty(shape, dtype=np.float32), np.empty((0, 0), dtype=np.float32)
        self._look_up((step,) * len(shifts), shifts, table, delays, values, sums)
        return values

    def sums(self, steps: list[float], table: Array, delays: Array) -> Floats:
        """Return sums of such values over all cells, shape (steps, rows * delays)."""
        values = np.empty((0, 0, 0), dtype=np.float32)
        sums = np.empty((len(steps), self._count(delays)), dtype=np.float32)
        self._look_up(tuple(steps), (0.0,) * len(steps), table, delays, values, sums)
        return sums

    def _count(self, delays: Array) -> int:
        return int((self.planes.shape[1] - self.step) * delays.size)

    def _look_up(
        self,
        steps: tuple[float, ...],
        shifts: tuple[float, ...],
        table: Array,
        delays: Array,
        values: Floats,
        sums: Floats,
    ) -> None:
        cells, part = self.cells, (delays / self.distance)[:, np.newaxis]
        groups, points = table.shape
        middle = np.pi / HOP * (cells.first_bin + cells.bins * (np.arange(groups) + 0.5))
        on, back = (np.exp(1j * np.outer(far, middle)) for far in (delays, delays - self.distance))
        on, back = (1 - part) * on, part * back
        turns = np.stack([on.real, on.imag, back.real, back.imag]).astype(np.float32)
        zeros = points * (np.add.outer(np.array(shifts), cells.dither)) - 0.5
        rows = points * np.where(self.alive, np.arange(groups), groups)
        _path_kernels.look_up(
            self.planes, self.step, rows.astype(np.uint32), self.nearest,
            turns, zeros.astype(np.float32),
            (points / np.array(steps)).astype(np.float32),
            np.concatenate([table, np.zeros((1, points))]).astype(np.float32), values, sums,
        )  # fmt: skip
