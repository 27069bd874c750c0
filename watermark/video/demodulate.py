"""From a window's mean amplitudes to one log-likelihood ratio per coded bit.

A value lies near a point of its bit's lattice: the fine one, or in a textured cell the coarse one.
The receiver's view of the texture is not exactly the embedder's, so both count, each with its
probability. Values that moved during the window are trusted less; the amount of noise is estimated
from the pilots, whose bits are known. Specification: spec/video-carrier.md, section 6.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.video.layout import VideoLayout
from watermark.video.profile import COARSE, PILOTS, TEXTURE

FloatArray = NDArray[np.float64]

MOTION_WEIGHT, MOTION_LIMIT = 0.15, 4.0
"""Growth of a value's noise with its variance over the window in squared steps, and where it ends.

Measured through H.264: motion predicts errors only weakly, so the weight is small.
"""

NOISES = tuple(0.06 * 1.25**n for n in range(13))
"""Standard deviations in steps among which the pilots choose; at the last one the fine lattice
tells nothing any more."""

ALL_PILOTS = 48
"""Pilots of the whole picture that count beside those of cells of the same kind, in case that there
are few of these."""

BLUR = 0.15
"""Uncertainty of a cell's texture, as a part of it; coding also lowers it a little."""

CENTRE = TEXTURE * 0.93
"""Texture in luma levels at which the mark is as strong as it is taken to be."""


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


def coarse_share(texture: FloatArray) -> FloatArray:
    """Probability that cells of this texture, in luma of 8 bits, have the coarse step.

    Examples
    --------
    >>> coarse_share(np.array([0.0, 1.9, 9.0])).round(1).tolist()
    [0.0, 0.5, 1.0]
    """
    place = np.log(np.maximum(texture, 1e-3) / CENTRE) / BLUR
    return np.asarray(1 / (1 + np.exp(-np.clip(place, -30, 30))))


def pilot_waves(place: FloatArray, coarse: FloatArray) -> FloatArray:
    """How far pilots speak for bit 0, from 1 down to -1 for bit 1; 0 on average for noise.

    Parameters
    ----------
    place : ndarray of float64, shape (..., PILOTS)
        Mean amplitudes less the dither, in steps.
    coarse : ndarray of float64, shape (..., PILOTS)
        Probability of the coarse step, 0 in profiles that have none.

    Examples
    --------
    >>> pilot_waves(np.array([0.0, 0.5, 1.25]), np.zeros(3)).round(6).tolist()
    [1.0, -1.0, 0.0]
    """
    turn = 2 * np.pi * place
    return np.asarray((1 - coarse) * np.cos(turn) + coarse * np.cos(turn / COARSE))


def soft_bits(
    mean: FloatArray, variance: FloatArray, layout: VideoLayout, coarse: FloatArray
) -> Soft:
    """Demodulate a window.

    Parameters
    ----------
    mean, variance : ndarray of float64, shape (POSITIONS,)
        Mean of each amplitude over the window and variance of the frames around it, in steps.
    layout : VideoLayout
        The layout of the profile in question.
    coarse : ndarray of float64, shape (POSITIONS,)
        Probability of the coarse step.
    """
    place = mean - layout.dither
    spread = np.sqrt(1 + MOTION_WEIGHT * np.minimum(variance, MOTION_LIMIT))
    pilots, data = layout.pilots, layout.data
    waves = pilot_waves(place[pilots], coarse[pilots])
    metric = float(np.mean((1 - 2 * layout.pilot_bits) * waves))
    parity = int(metric < 0)
    known = layout.pilot_bits ^ parity
    scores = np.stack([
        likelihood(place[pilots], known, sigma * spread[pilots], coarse[pilots])
        for sigma in NOISES
    ])  # fmt: skip
    together = scores.sum(axis=1)
    noise = np.empty(place.shape)
    for textured in (False, True):
        # Coders and cleaners spare texture, and cleaners leave little of the mark elsewhere.
        alike = (coarse >= 0.5) == textured
        best = scores[:, alike[pilots]].sum(axis=1) + together * (ALL_PILOTS / PILOTS)
        noise[alike] = NOISES[int(best.argmax())] * spread[alike]
    ratios = [likelihood(place[data], bit, noise[data], coarse[data]) for bit in (0, 1)]
    return Soft(ratios[0] - ratios[1], parity, abs(metric))


def likelihood(
    place: FloatArray, bit: NDArray[np.int64] | int, sigma: FloatArray, coarse: FloatArray
) -> FloatArray:
    """Logarithm of the density of amplitudes, less the dither, around the lattice of a bit."""
    total = np.full(place.shape, 1e-4)
    for period, share in ((1, 1 - coarse), (COARSE, coarse)):
        away = place - period * np.asarray(bit) / 2
        away -= period * np.round(away / period)
        density = np.zeros(place.shape)
        for neighbour in (-1, 0, 1):
            density += np.exp(-0.5 * ((away + neighbour * period) / sigma) ** 2)
        # All points of a lattice together weigh the same, however few they are.
        total += share * period * density / sigma
    return np.asarray(np.log(total))
