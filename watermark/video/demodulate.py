"""From a window's mean amplitudes to one log-likelihood ratio per coded bit.

Values that moved during the window are trusted less; how much is scaled by the pilots, whose bits
are known. Specification: spec/video-carrier.md, section 6.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.video.layout import VideoLayout

FloatArray = NDArray[np.float64]

MOTION_WEIGHT, MOTION_LIMIT = 0.15, 4.0
"""Growth of a value's noise with its variance over the window in squared steps, and where it ends.

Measured through H.264: motion predicts errors only weakly, so the weight is small.
"""

FLOOR = 0.004
"""Least variance of a value in squared steps: a lattice is never trusted blindly."""


@dataclass(frozen=True, slots=True)
class Soft:
    """Soft values of one window.

    Attributes
    ----------
    ratios : ndarray of float64, shape (DATA,)
        Log-likelihood ratios in the order of the coded bits, positive for 0.
    parity : int
        0 for an even superframe, 1 for an odd one.
    agreement : float
        Mean agreement of the pilots, 0 (noise) to 1.
    """

    ratios: FloatArray
    parity: int
    agreement: float


def pilot_metric(values: FloatArray, layout: VideoLayout) -> float:
    """Agreement of the pilots with an even superframe, -1 (odd) to 1; 0 for noise.

    Parameters
    ----------
    values : ndarray of float64, shape (PILOTS,)
        Mean amplitudes at the pilots' positions in steps.
    layout : VideoLayout
        Where the pilots are and what they hold.
    """
    place = values - layout.dither[layout.pilots] - layout.pilot_bits / 2
    return float(np.cos(2 * np.pi * place).mean())


def soft_bits(mean: FloatArray, variance: FloatArray, layout: VideoLayout) -> Soft:
    """Demodulate a window.

    Parameters
    ----------
    mean, variance : ndarray of float64, shape (POSITIONS,)
        Mean of each amplitude over the window and variance of the frames around it, in steps.
    layout : VideoLayout
        The layout of the profile in question.
    """
    metric = pilot_metric(mean[layout.pilots], layout)
    parity = int(metric < 0)
    noise = 1 + MOTION_WEIGHT * np.minimum(variance, MOTION_LIMIT)
    error = mean[layout.pilots] - layout.dither[layout.pilots] - (layout.pilot_bits ^ parity) / 2
    error -= np.round(error)
    noise *= max(FLOOR, float(np.mean(error**2 / noise[layout.pilots])))
    place = mean[layout.data] - layout.dither[layout.data]
    to_zero = place - np.round(place)
    to_one = place - 0.5 - np.round(place - 0.5)
    ratios = (to_one**2 - to_zero**2) / (2 * noise[layout.data])
    return Soft(ratios, parity, abs(metric))
