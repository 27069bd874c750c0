"""Measures of a marked picture: peak signal-to-noise ratio, structural similarity, flicker.

SSIM after Wang, Bovik, Sheikh and Simoncelli, "Image quality assessment: from error visibility to
structural similarity", 2004 (Gaussian window of 11 pixels, standard deviation 1.5).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from codec.errors import CueError

_SIGMA, _RADIUS = 1.5, 5
"""Standard deviation and reach in pixels of the window of structural similarity (Wang et al. 2004:
11 by 11)."""

_BLOCK = 16
"""Side in pixels of the blocks of flicker."""


@dataclass(frozen=True, slots=True)
class PictureQuality:
    """How alike two pictures are.

    Attributes
    ----------
    psnr_db : float
        Of luma, over all frames.
    ssim : float
        Mean over the frames that were looked at.
    flicker : float
        Root mean square of the mark's change from frame to frame, in luma of 8 bits.
    own_noise : float
        The same of the source itself, in the quietest quarter of its blocks of 16 x 16.
    """

    psnr_db: float
    ssim: float
    flicker: float
    own_noise: float


class PictureMeter:
    """Compare two streams of luma in constant memory.

    Parameters
    ----------
    depth : int
        Bits per sample.
    ssim_every : int
        Structural similarity is measured on every n-th frame.

    Examples
    --------
    >>> meter = PictureMeter()
    >>> frame = np.arange(32 * 48, dtype=np.uint8).reshape(32, 48)
    >>> meter.process(frame, frame)
    >>> meter.result().ssim
    1.0
    """

    def __init__(self, depth: int = 8, *, ssim_every: int = 10) -> None:
        self._unit = 2.0 ** (depth - 8)
        self._every = ssim_every
        self._squares = self._pixels = 0.0
        self._ssim: list[float] = []
        self._frames = 0
        self._before: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
        self._changes = np.zeros(2)

    def process(self, reference: NDArray[Any], test: NDArray[Any]) -> None:
        """Take the next frame of both, shape (height, width).

        Raises
        ------
        CueError
            If the two differ in shape.
        """
        if reference.shape != test.shape:
            raise CueError(f"test has shape {test.shape}, reference {reference.shape}")
        ref = reference.astype(np.float32) / np.float32(self._unit)
        mark = test.astype(np.float32) / np.float32(self._unit) - ref
        self._squares += float(np.vdot(mark, mark))
        self._pixels += mark.size
        if self._frames % self._every == 0:
            self._ssim.append(ssim(ref, ref + mark))
        if self._before is not None:
            change = mark - self._before[1]
            self._changes += [float(np.mean(change**2)), _quiet_change(ref, self._before[0])]
        self._before = ref, mark
        self._frames += 1

    def result(self) -> PictureQuality:
        """Sum up.

        Raises
        ------
        CueError
            If no frame was given.
        """
        if not self._frames:
            raise CueError("nothing to compare: no frames")
        mean = self._squares / self._pixels
        flicker, own = np.sqrt(self._changes / max(1, self._frames - 1))
        return PictureQuality(
            float("inf") if mean == 0 else float(10 * np.log10(255**2 / mean)),
            round(float(np.mean(self._ssim)), 9),
            float(flicker),
            float(own),
        )


def ssim(a: NDArray[np.float32], b: NDArray[np.float32]) -> float:
    """Structural similarity of two pictures of 8-bit range, 1 for identical ones."""

    def smooth(x: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.asarray(gaussian_filter(x, _SIGMA, radius=_RADIUS), dtype=np.float32)

    mean_a, mean_b = smooth(a), smooth(b)
    var_a, var_b = smooth(a * a) - mean_a**2, smooth(b * b) - mean_b**2
    cov = smooth(a * b) - mean_a * mean_b
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    value = (2 * mean_a * mean_b + c1) * (2 * cov + c2)
    value /= (mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2)
    return float(value.mean(dtype=np.float64))


def _quiet_change(now: NDArray[np.float32], before: NDArray[np.float32]) -> float:
    """Mean square change in the quietest quarter of the blocks."""
    rows, columns = (n // _BLOCK for n in now.shape)
    change = (now - before)[: rows * _BLOCK, : columns * _BLOCK] ** 2
    blocks = change.reshape(rows, _BLOCK, columns, _BLOCK).mean(axis=(1, 3))
    return float(np.mean(np.sort(blocks, axis=None)[: max(1, blocks.size // 4)]))
