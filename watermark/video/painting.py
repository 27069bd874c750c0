"""Amplitudes in, a pattern that has exactly these out, without a grid in flat parts.

Receivers measure no more of a pattern than its projections onto the templates, so an embedder may
add anything else that they do not see. Templates alone leave all borders of cells unmarked: a
lattice, where nothing hides it. In smooth cells the pattern is therefore a sum of blurred
templates, which overlap, with the amplitudes that have the projections asked for: interpolation by
a smooth kernel (Wahba, "Spline models for observational data", 1990) instead of the least energy.
In other cells templates are left as they are: there the blur costs more quality than the lattice.
Specification: spec/video-carrier.md, sections 3 and 4.
"""

import numpy as np
from numpy.typing import NDArray

from watermark.video import _kernels
from watermark.video.grid import axis_factors
from watermark.video.profile import COLUMNS, ROWS, TEMPLATES

FloatArray = NDArray[np.float64]

BLUR = 0.22
"""Standard deviation of the blur in cells. A flat part's change, by its size, agrees with itself a
cell further by .42 without, .17 at .18, .09 at .22, .04 at .265; its mean square grows by .6, 1.1
and 1.7 dB, of which the trial on coders takes back about half, since smooth patterns last."""

ROUNDS, STRIDE = 12, 0.75
"""Steps of the iteration for the amplitudes, and their length: the error falls below .001."""


class Painter:
    """Patterns for one size of picture.

    Parameters
    ----------
    width, height : int
        Pixels.
    depth : int
        Bits per sample; amplitudes are in steps of 8 bits.

    Attributes
    ----------
    shape : tuple of int
        Height and width.

    Examples
    --------
    >>> from watermark.video.grid import Grid
    >>> amplitude = np.random.default_rng(1).uniform(-1, 1, (2, 45, 80))
    >>> pattern = Painter(640, 360).paint(amplitude, np.ones((45, 80), dtype=bool))
    >>> bool(abs(Grid(640, 360).project(pattern) - amplitude).max() < 0.001)
    True
    """

    def __init__(self, width: int, height: int, depth: int = 8) -> None:
        self.shape = height, width
        self._unit = 2.0 ** (depth - 8)
        self._columns, across, across_norm = axis_factors(width, COLUMNS)
        self._rows, down, down_norm = axis_factors(height, ROWS)
        # Template 0 is a dipole across and a hump down; template 1 the other way round.
        wide_across = _blurred(across, self._columns)
        wide_down = _blurred(down, self._rows)[::-1]
        down, down_norm = down[::-1], down_norm[::-1]
        self._across, self._down, self._wide_across, self._wide_down = (
            np.ascontiguousarray(factors, dtype=np.float32)
            for factors in (across, down, wide_across, wide_down)
        )
        # Response of the projections to blurred templates of a cell and its neighbours.
        self._gain_across = _gains(across, wide_across, across_norm, self._columns)
        self._gain_down = _gains(down, wide_down, down_norm, self._rows)
        own = np.einsum("kkr,kkc->krc", self._gain_down[:, :, 1], self._gain_across[:, :, 1])
        self._length = STRIDE / own

    def paint(self, amplitude: FloatArray, smooth: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Paint a pattern.

        Parameters
        ----------
        amplitude : ndarray of float64, shape (TEMPLATES, ROWS, COLUMNS)
            Its projections onto the templates.
        smooth : ndarray of bool, shape (ROWS, COLUMNS)
            Cells without texture that could hide a lattice.

        Returns
        -------
        ndarray of float32, shape (height, width)
        """
        scaled = amplitude * self._unit
        wide = np.zeros((TEMPLATES, ROWS + 2, COLUMNS + 2))  # no cells around the picture
        inner = wide[:, 1:-1, 1:-1]
        near = np.lib.stride_tricks.sliding_window_view(wide, (3, 3), axis=(1, 2))
        length = np.where(smooth, self._length, 0.0)
        left = scaled
        for _ in range(ROUNDS):
            inner += length * left
            left = scaled - np.einsum(
                "klir,lrcij,kljc->krc", self._gain_down, near, self._gain_across
            )
        out = np.empty(self.shape, dtype=np.float32)
        # Other cells also take back what blurred templates beside them bring in.
        _kernels.paint_into(
            np.where(smooth, 0.0, left), wide, self._across, self._down, self._wide_across,
            self._wide_down, self._columns, self._rows, out,
        )  # fmt: skip
        return out


def _blurred(factors: FloatArray, border: NDArray[np.int64]) -> FloatArray:
    """Blur each cell's factors, shape (2, size), into itself and both neighbours.

    Returns shape (2, 3, size): at each pixel the factors of the cell before, its own, the next.
    """
    cells = border.size - 1
    out = np.zeros((2, 3, factors.shape[1]))
    place = np.empty(factors.shape[1])
    for c in range(cells):
        count = border[c + 1] - border[c]
        place[border[c] : border[c + 1]] = c + (np.arange(count) + 0.5) / count
    for c in range(cells):
        source = slice(border[c], border[c + 1])
        for side in range(3):
            target = c + 1 - side  # the cell to which c is the one before, itself, the next
            if 0 <= target < cells:
                pixels = slice(border[target], border[target + 1])
                away = (place[pixels, None] - place[source]) / BLUR
                weights = np.exp(-0.5 * away**2) / (source.stop - source.start)
                out[:, side, pixels] = factors[:, source] @ weights.T
    return out


def _gains(
    factors: FloatArray, wide: FloatArray, norm: FloatArray, border: NDArray[np.int64]
) -> FloatArray:
    """Projections onto templates k of blurred ones l of three cells, shape (2, 2, 3, cells)."""
    product = factors[:, None, None] * wide[None]
    return np.asarray(np.add.reduceat(product, border[:-1], axis=3) / norm[:, None, None])
