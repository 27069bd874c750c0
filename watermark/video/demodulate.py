"""From a window's mean amplitudes to one log-likelihood ratio per coded bit.

A value lies near a point of its bit's lattice: the fine one, or in a textured cell the coarse one
(`watermark.video.lattices`). Values that moved during the window are trusted less; the amount of
noise is estimated from the pilots, whose bits are known. Specification: spec/video-carrier.md,
section 6.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.video.lattices import PILOT_TEXTURES, lattice_shares, likelihood, pilot_waves
from watermark.video.modes import Mode
from watermark.video.profile import PILOT_SPREADS, PILOTS, TEMPLATES, TEXTURE

FloatArray = NDArray[np.float64]

MOTION_WEIGHT, MOTION_LIMIT = 0.05, 1.0
"""Growth of a value's noise with its variance over the window in squared steps, and where it ends.
Motion predicts errors only weakly. Of ten films, each left out, the nine others choose this value,
as they do for the limit and `ALL_PILOTS` (`tests/bench/picture_weights.py`)."""

NOISES = tuple(0.06 * 1.25**n for n in range(13))
"""Standard deviations in steps among which the pilots choose; at the last one the fine lattice
shows nothing any more."""

FLAT = 0.5
"""Texture in luma of 8 bits up to which a cell's noise is estimated apart from that of others:
there coders copy most, and cleaners leave least. With it 55 instead of 51 of 57 superframes were
read through MPEG-2 at 360 lines, 105 instead of 102 of 134 whole through AV1."""

ALL_PILOTS = 4
"""Pilots of the whole picture that count beside those of cells of the same kind, in case that there
are few of these."""

LAGS = 0.45, 0.9
"""Lags that are tried: parts of a window that a flat cell's mean is behind, as its share of the
difference between the window's end and the frames before it. `hqdn3d` leaves .8 to 1 of a film
with noise and .4 to .6 of a still one."""

LAG_TEXTURE = 0.45
"""Texture in luma of 8 bits of a cell with half the lag of a flat one: cleaners of noise mix less
where more changes. Fitted to known marks in one film."""

LAG_MOTION = 3.0
"""Factor of `MOTION_WEIGHT` where a lag is taken back: an error of it grows with the motion."""


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


def soft_bits(
    mean: FloatArray,
    variance: FloatArray,
    mode: Mode,
    texture: FloatArray,
    parity: int | None = None,
) -> Soft:
    """Demodulate a window.

    Parameters
    ----------
    mean, variance : ndarray of float64, shape (POSITIONS,)
        Mean of each amplitude over the window in luma of 8 bits, and variance of the frames
        around it.
    mode : Mode
        The mode in question.
    texture : ndarray of float64, shape (ROWS * COLUMNS,)
        Textures of the cells in luma of 8 bits.
    parity : int, optional
        0 or 1 if it is known; otherwise the pilots show it.
    """
    layout = mode.layout
    dither, pilots, data = layout.dither, layout.pilots, layout.data
    moving = np.minimum(variance / mode.step**2, MOTION_LIMIT)
    noise = mode.step * np.sqrt(1 + MOTION_WEIGHT * moving)
    textures = np.tile(texture, TEMPLATES)
    place = mean[pilots] / mode.pilot_step - dither[pilots]
    metric = float(np.mean((1 - 2 * layout.pilot_bits) * pilot_waves(place, textures[pilots])))
    if parity is None:
        parity = int(metric < 0)
    known = layout.pilot_bits ^ parity
    shares = lattice_shares(textures[pilots], PILOT_TEXTURES)
    spread = noise[pilots] / mode.pilot_step
    scores = np.stack(
        [likelihood(place, known, sigma * spread, shares, PILOT_SPREADS) for sigma in NOISES]
    )
    together = scores.sum(axis=1)
    shares = lattice_shares(textures, [TEXTURE])
    kinds = (shares[1] >= 0.5).astype(int) + (textures >= FLAT)
    for kind in range(3):
        # Coders and cleaners spare texture, and cleaners leave little of the mark elsewhere.
        alike = kinds == kind
        best = scores[:, alike[pilots]].sum(axis=1) + together * (ALL_PILOTS / PILOTS)
        noise[alike] *= NOISES[int(best.argmax())]
    place, sigma = mean[data] / mode.step - dither[data], noise[data] / mode.step
    ratios = [likelihood(place, bit, sigma, shares[:, data]) for bit in (0, 1)]
    return Soft(ratios[0] - ratios[1], parity, abs(metric))


def without_lag(mean: FloatArray, rise: FloatArray, texture: FloatArray, lag: float) -> FloatArray:
    """Mean amplitudes of a window whose pictures had not been mixed with the ones before.

    A recursive filter in time, as in cleaners of noise, gives `y[t] = a y[t-1] + (1-a) x[t]`, so
    that the mean of `x` is that of `y` and `a / (1-a)` times the rise of `y` over the window,
    divided by its frames.

    Parameters
    ----------
    mean, rise : ndarray of float64
        Mean of each amplitude over a window, and how far its end is above the frames before.
    texture : ndarray of float64
        Textures of the cells in luma of 8 bits.
    lag : float
        Share of the rise in a flat cell.

    Examples
    --------
    >>> without_lag(np.zeros(2), np.ones(2), np.array([0.0, 0.45]), 0.9).round(2).tolist()
    [0.9, 0.45]
    """
    return np.asarray(mean + lag / (1 + texture / LAG_TEXTURE) * rise)
