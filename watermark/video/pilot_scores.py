"""How well the pilots of a mark agree with a mean picture, at any place of it and in every mode.

In: a mean over a window of small frames and a place; out: a score in standard deviations of that of
a picture without a mark. Specification: spec/video-carrier.md, section 6.
"""

import numpy as np
from numpy.typing import NDArray

from watermark.video import _kernels
from watermark.video._place_kernels import fine_texture_into
from watermark.video.grid import Region
from watermark.video.lattices import BLUR, PILOT_TEXTURES, SEEN_TEXTURE
from watermark.video.layout import common_pilots
from watermark.video.modes import PilotWatch
from watermark.video.profile import COLUMNS, ROWS

FloatArray = NDArray[np.float64]

CELL = 8
"""Pixels of a cell, about, for its texture."""

_SINE = np.sin(2 * np.pi * (np.arange(512) + 0.5) / 512).astype(np.float32)
_COSINE = np.cos(2 * np.pi * (np.arange(512) + 0.5) / 512).astype(np.float32)


class PilotScores:
    """How well pilots agree with every mode at a place of a mean picture.

    Parameters
    ----------
    watch : PilotWatch
        The pilots.
    shape : tuple of int
        Rows and columns of the mean picture.
    """

    def __init__(self, watch: PilotWatch, shape: tuple[int, int]) -> None:
        self.step = watch.modes[0].pilot_step
        cells = watch.positions % (ROWS * COLUMNS)
        order = np.argsort(cells, kind="stable")
        template = watch.positions // (ROWS * COLUMNS)
        pilots = np.stack([template, cells // COLUMNS, cells % COLUMNS], axis=1)
        self.pilots = np.ascontiguousarray(pilots[order])
        self.common = common_pilots()[order]
        signs = [1.0 - 2.0 * mode.layout.pilot_bits[order] for mode in watch.modes]
        self.signs = np.array(signs, dtype=np.float32)
        self.dither = watch.modes[0].layout.dither[watch.positions[order]]
        self._limits = np.log(np.multiply(PILOT_TEXTURES, SEEN_TEXTURE))
        self._values = np.empty(len(order))
        self._waves = np.empty(len(order))
        self._mean = np.zeros(shape, dtype=np.float32)
        self._texture = np.zeros((shape[0] // 2 - 3, shape[1] // 2 - 3), dtype=np.float32)

    def look_at(self, mean: NDArray[np.float32]) -> None:
        """Take the mean picture that the next scores are of."""
        self._mean = mean

    def take_texture(self, half: NDArray[np.float32]) -> None:
        """Compute the texture of a picture at half its size, for the shares."""
        fine_texture_into(half, self._texture)

    def best(self, region: Region, shares: FloatArray) -> tuple[float, int]:
        """Return score, in standard deviations of noise, and number of the best mode."""
        scores = np.abs(self.signs @ self._votes(region, shares))
        mode = int(scores.argmax())
        return float(scores[mode]), mode

    def one(self, region: Region, mode: int, shares: FloatArray) -> float:
        """Score of a mode in standard deviations of noise."""
        return float(abs(self.signs[mode] @ self._votes(region, shares)))

    def shares(self, region: Region) -> FloatArray:
        """Probabilities of the pilots' steps if the picture is at this place, shape (3, PILOTS)."""
        rows, columns = self._mean.shape
        shares = np.empty((len(PILOT_TEXTURES) + 1, len(self.pilots)))
        _kernels.shares_into(
            self._texture, region.left * columns, region.top * rows,
            region.width * columns / COLUMNS, region.height * rows / ROWS, self.pilots, CELL,
            self._limits, BLUR, shares,
        )  # fmt: skip
        return shares

    def _votes(self, region: Region, shares: FloatArray) -> FloatArray:
        """Votes of the pilots at a place, in standard deviations of their sum."""
        rows, columns = self._mean.shape
        _kernels.pilot_values_into(
            self._mean, region.left * columns, region.top * rows, region.width * columns,
            region.height * rows, self.pilots, ROWS, COLUMNS, _SINE, self._values,
        )  # fmt: skip
        deviation = _kernels.waves_into(
            self._values, shares, self.dither, self.step, _COSINE, self._waves
        )
        return np.asarray(self._waves / deviation)
