"""The cell grid of a picture and its two templates.

In: luma; out: the amplitude of each template in each cell.
The grid is 80 x 45 whatever the size of the picture, so scaling keeps it. Specification:
spec/video-carrier.md, section 3.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.video import _kernels
from watermark.video.profile import COLUMNS, MIN_HEIGHT, MIN_WIDTH, ROWS, TEMPLATES

FloatArray = NDArray[np.float64]

_MOST = 0.7  # of a template's energy has to be inside the picture


@dataclass(frozen=True, slots=True)
class Region:
    """Where the marked picture lies in the picture at hand, in parts of the latter's size.

    Attributes
    ----------
    left, top : float
        Its corner; negative where it was cropped.
    width, height : float
        Its size; above 1 where it was cropped.
    """

    left: float = 0.0
    top: float = 0.0
    width: float = 1.0
    height: float = 1.0


WHOLE = Region()


class Grid:
    """Projection for one size of picture.

    Parameters
    ----------
    width, height : int
        Pixels.
    depth : int
        Bits per sample, 8 to 16; amplitudes are in steps of 8 bits.
    region : Region
        Where the marked picture lies.
    reduced : int
        Each pixel is the mean of a square of so many by so many pixels of the picture.
    frames : int
        Each pixel is the sum of those of so many frames.

    Attributes
    ----------
    seen : ndarray of bool, shape (2, 45, 80)
        Cells mostly inside the picture; the others' amplitudes mean nothing.

    Raises
    ------
    CueError
        If the picture is too small for the cells or the depth out of range.

    Examples
    --------
    >>> ramp = np.tile(np.arange(640, dtype=np.float32), (360, 1))  # brighter to the right
    >>> Grid(640, 360).project(ramp)[:, 3, 5].round(1).tolist()
    [-3.5, 0.0]
    """

    def __init__(
        self,
        width: int,
        height: int,
        depth: int = 8,
        *,
        region: Region = WHOLE,
        reduced: int = 1,
        frames: int = 1,
    ) -> None:
        if width < MIN_WIDTH or height < MIN_HEIGHT:
            raise CueError(f"picture {width}x{height}: the cells need {MIN_WIDTH}x{MIN_HEIGHT}")
        if not 8 <= depth <= 16:
            raise CueError(f"luma of {depth} bits: must be 8..16")
        self.shape = (height, width)
        self.largest = float(2**depth - 1)
        self._unit = 2.0 ** (depth - 8) * frames
        self._columns, across, across_norm = axis_factors(width, COLUMNS, region.left, region.width)
        self._rows, down, down_norm = axis_factors(height, ROWS, region.top, region.height)
        self._quarter_columns = _borders(width, 4 * COLUMNS, region.left, region.width)
        self._quarter_rows = _borders(height, 4 * ROWS, region.top, region.height)
        nominal = (across_norm.max(axis=1), down_norm.max(axis=1))
        whole = [
            n > _MOST * m[:, None] for n, m in zip((across_norm, down_norm), nominal, strict=True)
        ]
        self.seen = whole[1][::-1, :, None] & whole[0][:, None, :]
        # Template 0 is a dipole across and a hump down; template 1 the other way round.
        self._across = np.ascontiguousarray(across, dtype=np.float32)
        self._down = np.ascontiguousarray(down[::-1], dtype=np.float32)
        norm = down_norm[::-1, :, None] * across_norm[:, None, :]
        cell = width * region.width / COLUMNS, height * region.height / ROWS
        kept = [_kept(size, reduced) for size in cell]
        for template in range(TEMPLATES):
            norm[template] *= kept[template] * (2 + kept[1 - template]) / 3
        self._norm = np.where(self.seen, norm, np.inf)

    def project(self, luma: NDArray[Any]) -> FloatArray:
        """Amplitude of each template in each cell, shape (2, 45, 80)."""
        out = np.empty((TEMPLATES, ROWS, COLUMNS))
        _kernels.project_into(luma, self._across, self._down, self._columns, self._rows, out)
        out /= self._norm * self._unit
        return out

    def texture(self, luma: NDArray[Any]) -> FloatArray:
        """Texture of each cell in luma of 8 bits, shape (45, 80).

        A sixteenth of a cell has a mean, a quarter the standard deviation of four of them. The
        least of the four quarters counts, so that a lone edge in a flat cell does not.
        """
        out = np.empty((ROWS, COLUMNS))
        _kernels.texture_into(luma, self._quarter_columns, self._quarter_rows, out)
        out /= self._unit
        return out


def _kept(pixels: float, reduced: int) -> float:
    """Part of a sine over a cell of so many pixels that is left after reduction to them."""
    angle = np.pi / pixels
    return float(np.sin(angle) / (reduced * np.sin(angle / reduced)))


def axis_factors(
    size: int, cells: int, start: float = 0.0, length: float = 1.0
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Cell borders, the factors dipole and hump per pixel, their squared norms per cell."""
    place = _places(size, cells, start, length)
    border = _borders(size, cells, start, length)
    inside = place - np.floor(place)
    factors = np.stack([np.sin(2 * np.pi * inside), np.sin(np.pi * inside) ** 2])
    norm = np.zeros((2, cells))
    for c in range(cells):
        pixels = slice(border[c], border[c + 1])
        if border[c] < border[c + 1]:
            # Uneven cells leave the dipole a mean, which would let brightness through.
            factors[0, pixels] -= factors[0, pixels].mean()
            norm[:, c] = np.sum(factors[:, pixels] ** 2, axis=1)
    return border, factors, norm


def _places(size: int, cells: int, start: float, length: float) -> FloatArray:
    """Place of each pixel in units of cells."""
    return np.asarray(((np.arange(size) + 0.5) / size - start) / length * cells)


def _borders(size: int, cells: int, start: float, length: float) -> NDArray[np.int64]:
    """First pixel of each cell, and the end of the last one."""
    cell = np.floor(_places(size, cells, start, length)).astype(np.int64)
    return np.searchsorted(cell, np.arange(cells + 1)).astype(np.int64)
