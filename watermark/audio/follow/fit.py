"""Where known bits of a superframe fit best: delay and drift.

In: a superframe's view at a roughly known start, and soft values that cells should have; out: delay
and drift, found by turning phases instead of transforming again. Specification:
spec/audio-carrier.md, W36.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow import _kernels
from watermark.audio.follow.align import SuperframeView
from watermark.audio.signal.layout import Cells
from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, HOP

FARTHEST = 5
"""Steps to either side at which a delay is sought: more than a young lock's clock is wrong by."""


@dataclass(frozen=True, slots=True)
class AlignmentFit:
    """Where known bits fit best.

    Attributes
    ----------
    delay : float
        Samples at 48 kHz by which frame `pivot` comes later than it was read.
    drift_ppm : float
        Growth of the delay with time.
    pivot : float
        Mean number of the frames that were seen: delay and drift are independent there.
    score : float
        Correlation there.
    """

    delay: float
    drift_ppm: float
    pivot: float
    score: float = 0.0

    def delays(self) -> NDArray[np.float64]:
        """Delay of each frame in samples, shape (64,)."""
        frame = np.arange(FRAMES_PER_SUPERFRAME)
        return np.asarray(self.delay + self.drift_ppm * 1e-6 * HOP * (frame - self.pivot))

    @property
    def start_delay(self) -> float:
        """Delay of the superframe's start."""
        return self.delay - self.drift_ppm * 1e-6 * HOP * self.pivot


Grid = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Delays in samples and drifts in ppm to try."""


def search_fit(
    view: SuperframeView,
    cells: Cells,
    step: float,
    expected: NDArray[np.float64],
    grid: Grid,
    *,
    harmonic: int = 1,
) -> AlignmentFit:
    """Delay and drift under which `expected` soft values, shape (64, groups), fit best.

    Found on a grid and refined by a parabola in each direction. Second harmonics suit both bits.
    """
    score = _Score(view, cells, step, expected, harmonic)
    delay_grid, drift_grid = grid
    scores = score(delay_grid, *drift_grid)
    i, j = np.unravel_index(int(scores.argmax()), scores.shape)
    delay = _peak(delay_grid, scores[:, j], int(i))
    return AlignmentFit(
        delay, _peak(drift_grid, scores[i], int(j)), score.pivot, float(scores[i, j])
    )


def find_delay(
    view: SuperframeView, cells: Cells, step: float, expected: NDArray[np.float64], reach: float
) -> float:
    """Delay of a place that is nearly right: by a parabola.

    Tried are delays `reach` samples apart, on from the place as long as they fit better, but not
    beyond `FARTHEST` of them.
    """
    score = _Score(view, cells, step, expected)
    grid = np.array([-reach, 0.0, reach])
    scores = score(grid, 0.0)[:, 0]
    at = int(scores.argmax())
    while at in (0, grid.size - 1) and grid.size < 2 * FARTHEST + 1:
        beyond = np.array([grid[0] - reach, grid[-1] + reach])
        below, above = score(beyond, 0.0)[:, 0]
        grid = np.array([beyond[0], *grid, beyond[1]])
        scores = np.array([below, *scores, above])
        at = int(scores.argmax())
    return _peak(grid, scores, at)


class _Score:
    """Correlation of a view with expected soft values, as a function of delay and drift."""

    def __init__(
        self,
        view: SuperframeView,
        cells: Cells,
        step: float,
        expected: NDArray[np.float64],
        harmonic: int = 1,
    ) -> None:
        seen = np.abs(expected * view.soft(cells, step)).sum(axis=1)
        self.pivot = float((np.arange(seen.size) * seen).sum() / max(seen.sum(), 1e-9))
        self._view, self._cells, self._dither = view, cells, harmonic * cells.dither
        self._scale = harmonic / (step * np.sqrt(cells.bins))
        self._expected = expected

    def __call__(self, delays: NDArray[np.float64], *drifts_ppm: float) -> NDArray[np.float64]:
        """Scores of some delays at some drifts, shape (delays, drifts)."""
        cells = self._cells
        frequency = np.pi / HOP * (np.arange(cells.first_bin, cells.last_bin) + 0.5)
        turn = np.exp(1j * np.outer(frequency, delays))
        scores = np.zeros((len(drifts_ppm), delays.size))
        bins = slice(cells.first_bin, cells.last_bin)
        spectra, amplitudes = self._view.spectra[:, bins], self._view.amplitudes[:, bins]
        for score, drift_ppm in zip(scores, drifts_ppm, strict=True):
            frames = AlignmentFit(0.0, drift_ppm, self.pivot).delays()
            _kernels.fit_scores(
                spectra, amplitudes, cells.signs, self._expected, self._dither,
                frames * frequency[0], frames * (np.pi / HOP), turn, self._scale, score,
            )  # fmt: skip
        return scores.T


def _peak(grid: NDArray[np.float64], values: NDArray[np.float64], i: int) -> float:
    """Abscissa of the parabola through a maximum and its neighbours on an even grid."""
    if not 0 < i < grid.size - 1:
        return float(grid[i])
    below, top, above = values[i - 1 : i + 2]
    curvature = below - 2 * top + above
    shift = 0.0 if curvature >= 0 else 0.5 * (below - above) / curvature
    return float(grid[i] + shift * (grid[i + 1] - grid[i]))
