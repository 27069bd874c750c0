"""Alignment: a superframe's soft values at a hypothesised place, and how well a place fits.

In: spectra of the frames at a roughly known start; out: soft values after a small delay per frame,
found by turning phases instead of transforming again, and the delay and drift under which known
bits fit best. Specification: section 7.2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.dither import Cells
from watermark.masking import Masker
from watermark.mdct import analyse, frames_of
from watermark.profile import FRAMES_PER_SUPERFRAME, HOP, SUPERFRAME
from watermark.tape import Tape

FRAME = np.arange(FRAMES_PER_SUPERFRAME) - (FRAMES_PER_SUPERFRAME - 1) / 2
"""Frame numbers from the middle of a superframe."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Delay in the middle of a superframe (48 kHz samples), drift in ppm, and their score."""

    delay: float
    drift_ppm: float
    score: float


def delays(delay: float, drift_ppm: float) -> NDArray[np.float64]:
    """Delay of each frame in samples, shape (64,)."""
    return np.asarray(delay + drift_ppm * 1e-6 * HOP * FRAME)


@dataclass(frozen=True, slots=True)
class View:
    """A superframe as read from a hypothesised place.

    Attributes
    ----------
    cells : Cells
        Demodulator.
    spectra : ndarray of complex128, shape (64, HOP)
        See `watermark.mdct.analyse`.
    amplitudes : ndarray of float64, shape (64, bins)
        The mark's unit, see `Masker.amplitudes`.
    """

    cells: Cells
    spectra: NDArray[np.complex128]
    amplitudes: NDArray[np.float64]

    def soft(
        self, delay: NDArray[np.float64] | None = None, groups: int | None = None
    ) -> NDArray[np.float64]:
        """Soft values, shape (64, groups), of a superframe that comes `delay` samples later.

        Only the lowest `groups` cell positions when that is given.
        """
        profile = self.cells.profile
        count = profile.groups if groups is None else groups
        bins = profile.first_bin + count * profile.cell_bins
        spectra = self.spectra[:, :bins]
        if delay is not None:
            frequency = np.pi / HOP * (np.arange(bins) + 0.5)
            spectra = spectra * np.exp(1j * np.outer(delay, frequency))
        amplitudes = self.amplitudes[:, :bins]
        projections, alive = self.cells.project(spectra.real, amplitudes, count)
        return np.asarray(self.cells.soft(projections) * alive)

    def score(self, expected: NDArray[np.float64], delay: float, drift_ppm: float) -> float:
        """Correlation with expected soft values, shape (64, lowest groups)."""
        soft = self.soft(delays(delay, drift_ppm), expected.shape[1])
        return float((soft * expected).sum())


def read_view(tape: Tape, position: float, ratio: float, cells: Cells, masker: Masker) -> View:
    """Read the superframe at `position` of the tape; `ratio` is tape samples per 48 kHz sample."""
    sound = tape.read(position - HOP * ratio, ratio, SUPERFRAME + 2 * HOP)
    spectra = analyse(frames_of(sound, HOP), HOP)
    threshold = masker.thresholds(np.abs(spectra) ** 2 / 2)
    return View(cells, spectra[1:], masker.amplitudes(threshold[1:], threshold[:-1]))


def search_fit(
    view: View,
    expected: NDArray[np.float64],
    delay_grid: NDArray[np.float64],
    drift_grid: NDArray[np.float64],
) -> Fit:
    """Best fit on a grid, refined by a parabola in each direction."""
    scores = np.array([[view.score(expected, d, r) for r in drift_grid] for d in delay_grid])
    i, j = np.unravel_index(int(scores.argmax()), scores.shape)
    delay = _peak(delay_grid, scores[:, j], int(i))
    drift = _peak(drift_grid, scores[i], int(j))
    return Fit(delay, drift, float(scores[i, j]))


def _peak(grid: NDArray[np.float64], values: NDArray[np.float64], i: int) -> float:
    """Abscissa of the parabola through a maximum and its neighbours on an even grid."""
    if not 0 < i < grid.size - 1:
        return float(grid[i])
    below, top, above = values[i - 1 : i + 2]
    curvature = below - 2 * top + above
    shift = 0.0 if curvature >= 0 else 0.5 * (below - above) / curvature
    return float(grid[i] + shift * (grid[i + 1] - grid[i]))
