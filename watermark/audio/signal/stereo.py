"""Two channels as mid, left and right: their values and their masks.

In: quantities of mid and side; out: the same of mid, left and right, in this order, which is
that of `watermark.audio.signal.channel_choice`. Specification: spec/audio-carrier.md, W43 and W44.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.audio.signal.masking import Masker


def channels_of(mid: NDArray[Any], side: NDArray[Any]) -> NDArray[Any]:
    """Mid, left and right, shape (3, *shape)."""
    return np.stack([mid, mid + side, mid - side])


def stereo_units(
    mid: NDArray[np.complex128], side: NDArray[np.complex128], masker: Masker, bins: int
) -> NDArray[np.float64]:
    """Mask's units of mid, left and right, shape (3, T - 1, bins), by spectra of T frames."""
    # |M +- S|^2 = |M|^2 + |S|^2 +- 2 Re(M S*)
    middle = (mid.real**2 + mid.imag**2) / 2
    both = middle + (side.real**2 + side.imag**2) / 2
    cross = mid.real * side.real + mid.imag * side.imag
    powers = middle, np.maximum(both + cross, 0.0), np.maximum(both - cross, 0.0)
    thresholds = (masker.thresholds(power) for power in powers)
    return np.stack([masker.amplitudes(one[1:], one[:-1], bins) for one in thresholds])
