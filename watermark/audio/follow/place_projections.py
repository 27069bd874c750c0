"""Cells of frames that begin at any of many places, from transforms of a few of them.

In: spectra at places a few samples apart; out: what a table says of the cells' errors at those
places and between them. Between two transforms lies the mean of both, their phases turned; what
turning errs by, which grows with the distance from the middle of a cell and of a wave, cancels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.signal.layout import Cells
from watermark.audio.signal.profile import HOP

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PlaceProjections:
    """Projections of cells on places, and what lies between each and a second place.

    Attributes
    ----------
    before, after : ndarray of complex64, shape (rows, groups)
        At a place, and at the one `distance` later.
    alive : ndarray of bool, shape (units, groups)
        Which cells carry, under each mask.
    nearest : ndarray of int64, shape (rows,)
        Mask of each row.
    distance : float
        Samples between the two places.
    cells : Cells
        Of which they are.
    """

    before: NDArray[np.complex64]
    after: NDArray[np.complex64]
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
        from watermark.audio.follow import _path_kernels

        cut = slice(cells.first_bin, cells.last_bin)
        used = units[:, cut].reshape(len(units), -1, cells.bins)
        alive = np.asarray((used > 0).all(axis=2), dtype=np.bool_)
        inverse = np.zeros(units.shape, dtype=np.float32)
        part = np.where(alive[..., np.newaxis], 1 / np.where(used > 0, used, 1.0), 0.0)
        inverse[:, cut] = part.reshape(len(units), -1)
        values = np.empty((len(spectra), cells.dither.size), dtype=np.complex64)
        signs = (cells.signs / np.sqrt(cells.bins)).astype(np.float32)
        _path_kernels.project_rows(spectra, inverse, nearest, signs, cells.first_bin, values)
        return cls(values[:-step], values[step:], alive, nearest, distance, cells)

    def look_up(
        self, step: float, table: Array, delays: Array, *, whole: bool = False
    ) -> NDArray[np.float32]:
        """Return values of a table by cells' errors, or their sums.

        Parameters
        ----------
        step : float
            Of the lattice.
        table : ndarray of float64, shape (groups, points)
            Over one step; a power of two of points.
        delays : ndarray of float64, shape (delays,)
            Samples after a row's place, up to `distance`.
        whole : bool
            Whether values of all cells are summed.

        Returns
        -------
        ndarray of float32, shape (rows * delays, groups), or (rows * delays, 1) for sums
            0 for cells that do not carry.
        """
        from watermark.audio.follow import _path_kernels

        cells, part = self.cells, (delays / self.distance)[:, np.newaxis]
        middle = np.pi / HOP * (cells.first_bin + cells.bins * (np.arange(cells.dither.size) + 0.5))
        on, back = (np.exp(1j * np.outer(far, middle)) for far in (delays, delays - self.distance))
        turns = np.stack([(1 - part) * on, part * back]).astype(np.complex64)
        columns = 1 if whole else cells.dither.size
        out = np.empty((len(self.before) * delays.size, columns), dtype=np.float32)
        _path_kernels.look_up(
            self.before, self.after, self.alive, self.nearest, turns,
            cells.dither.astype(np.float32), 1.0 / step, table.astype(np.float32), out,
        )  # fmt: skip
        return out
