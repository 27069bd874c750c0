"""A cleaner of noise as in many playout chains: the recursive filter in space and time `hqdn3d`.

Each pixel is drawn towards its left neighbour, then towards the pixel above, then towards the same
pixel of the frame before, all filtered already (the first frame has itself before it); the smaller
the difference, the further. Facts of
the filter: FFmpeg's manual (strengths 4 in space and 6 in time for luma) and its
behaviour, with which `tests/cuecast/test_denoiser.py` compares it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

SPATIAL, TEMPORAL = 4.0, 6.0
"""Strengths for luma in levels of 8 bits: a quarter of such a difference remains as filtering."""

_FINE = 16
"""Entries of the table of weights per level."""

Luma = NDArray[Any]
Table = NDArray[np.float32]


def weights(strength: float) -> Table:
    """Part of a difference that moves a pixel, for differences of 0 to 255 levels.

    Examples
    --------
    >>> weights(4.0)[[0, 4 * 16, 255 * 16]].round(2).tolist()
    [1.0, 0.25, 0.0]
    """
    exponent = np.log(0.25) / np.log(1 - strength / 255)
    away = np.arange(255 * _FINE + 1) / (255 * _FINE)
    return np.asarray((1 - away) ** exponent, dtype=np.float32)


class Denoiser:
    """Clean luma, frame by frame.

    Parameters
    ----------
    depth : int
        Bits per sample of what comes in; 8 go out.
    """

    def __init__(self, depth: int = 8) -> None:
        self._shift = depth - 8
        self._spatial, self._temporal = weights(SPATIAL), weights(TEMPORAL)
        self._before: NDArray[np.float32] | None = None

    def process(self, luma: Luma) -> list[Luma]:
        """Take a frame; return it cleaned, uint8."""
        now = (luma >> self._shift).astype(np.float32)
        if self._before is None:
            self._before = now.copy()
        _clean(now, self._before, self._spatial, self._temporal)
        return [np.asarray(np.round(self._before), dtype=np.uint8)]

    def flush(self) -> list[Luma]:
        """Return nothing: no frame is held back."""
        return []


@njit(cache=True, nogil=True)
def _clean(
    luma: NDArray[np.float32], before: NDArray[np.float32], spatial: Table, temporal: Table
) -> None:
    """Filter a frame; `before` is the last result and becomes this one's."""
    above = luma[0].copy()
    for y in range(luma.shape[0]):
        left = luma[y, 0]
        for x in range(luma.shape[1]):
            value = luma[y, x]
            left = value + spatial[int(abs(left - value) * 16 + 0.5)] * (left - value)
            drawn = left
            if y > 0:
                drawn += spatial[int(abs(above[x] - left) * 16 + 0.5)] * (above[x] - left)
            above[x] = drawn
            old = before[y, x]
            before[y, x] = drawn + temporal[int(abs(old - drawn) * 16 + 0.5)] * (old - drawn)
