"""From a window's mean amplitudes to one log-likelihood ratio per coded bit.

A value lies near a point of its bit's lattice: the fine one, or in a textured cell the coarse one
(`watermark.video.lattices`). How much noise it has is told by the pilots, whose bits are known, in
cells with like texture and motion; once L0 is decoded, its values tell it better, and L1 is read
again. Specification: spec/video-carrier.md, section 6.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.video.lattices import PILOT_TEXTURES, densities, lattice_shares, pilot_waves
from watermark.video.modes import Mode
from watermark.video.noise import NOISES, noise_shares, surroundings
from watermark.video.profile import PILOT_SPREADS, TEMPLATES, TEXTURE

FloatArray = NDArray[np.float64]

LAGS = 0.45, 0.9
"""Lags that are tried: parts of a window that a flat cell's mean is behind, as its share of the
difference between the window's end and the frames before it. `hqdn3d` leaves .8 to 1 of a film
with noise and .4 to .6 of a still one."""

LAG_TEXTURE = 0.45
"""Texture in luma of 8 bits of a cell with half the lag of a flat one: cleaners of noise mix less
where more changes. Fitted to known marks in one film."""


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
    *,
    first: NDArray[np.int64] | None = None,
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
    first : ndarray of int64, shape (values of L0,), optional
        Coded bits of L0 if they are known: they show the noise as pilots do.
    """
    layout = mode.layout
    pilots, data = layout.pilots, layout.data
    textures = np.tile(texture, TEMPLATES)
    place = mean[pilots] / mode.pilot_step - layout.dither[pilots]
    metric = float(np.mean((1 - 2 * layout.pilot_bits) * pilot_waves(place, textures[pilots])))
    if parity is None:
        parity = int(metric < 0)
    known = layout.pilot_bits ^ parity
    shares = lattice_shares(textures[pilots], PILOT_TEXTURES)
    noises = tuple(sigma * mode.step / mode.pilot_step for sigma in NOISES)
    shown = np.log(densities(place, known, shares, noises, PILOT_SPREADS))
    place = mean[data] / mode.step - layout.dither[data]
    shares = lattice_shares(textures[data], [TEXTURE])
    both = [densities(place, bit, shares, NOISES) for bit in (0, 1)]
    where, positions = surroundings(textures, variance), pilots
    if first is not None:
        size = first.size
        right = np.where(first == 0, both[0][:, :size], both[1][:, :size])
        shown = np.hstack([shown, np.log(right)])
        positions = np.concatenate([pilots, data[:size]])
    likely = noise_shares(shown, where[positions], where[data])
    ratios = [np.log(np.sum(likely * each, axis=0)) for each in both]
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
