"""How hard a coder will be pressed: the level that each superframe needs to come through alike.

In: the programme's spectra before marking; out: per superframe a level, in steps of 1.5 dB. A
transform coder of constant rate raises its noise over the masking threshold until the bits
suffice; a mark of constant loudness drowns where the programme is loud and dense, and has strength
to spare in pauses. Sources: perceptual entropy, Johnston, IEEE J. Sel. Areas Commun. 6(2), 1988;
spread-transform dither modulation, Chen and Wornell, IEEE Trans. IT 47(4), 2001. Specification:
spec/audio-carrier.md, W20 leaves the choice of levels to the embedder.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.audio.signal import _kernels
from watermark.audio.signal.layout import Cells
from watermark.audio.signal.masking import COMPRESSION, REFERENCE, Masker
from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, LEVELS, AudioProfile

CODED_BINS = 300
"""A coder spends its bits below 15 kHz."""

BLOCK_FRAMES = 4
"""Frames of 10 ms for which a coder's bits must suffice: its reservoir."""

QUIETEST = 10 ** (-12.0)
"""Power below which nothing is coded."""

NOISE_SCALE = 30.0
"""Noise in units of the squared step at which soft values shrink by half, about: fitted to AAC,
MP3 and Opus at 64 kbit/s on eleven clips, and uncritical (10 to 100 do as well)."""

SURPLUS = 3.0
"""Sum of squared soft values that a message needs per bit."""

NEED_LIMITS = (-12.0, 24.0)
"""Levels, real or thought, among which the needed one is sought."""

NOISE_LIMITS = (-8.0, 12.0)
"""Natural logarithms of the noise over the shaped threshold among which a coder's is sought."""

ROUNDS = 14
"""Halvings of the interval around the noise."""


def coder_noise(powers: list[NDArray[Any]], masker: Masker, bits: float) -> NDArray[np.float64]:
    """Power per bin of the noise that a coder of constant rate would leave in the first signal.

    Parameters
    ----------
    powers : list of ndarray of float64 or float32, shape (64, HOP)
        Expected powers of the mid, and of the side where there is one: they share the bits.
    masker : Masker
        Bands and spreading.
    bits : float
        Bits per frame of 10 ms.

    Returns
    -------
    ndarray of float64, shape (64, bands)
        One multiple of the shaped threshold per block of `BLOCK_FRAMES`.
    """
    starts, widths = masker.edges[:-1], np.diff(masker.edges)
    energies = [np.add.reduceat(power, starts, axis=1) / widths for power in powers]
    return band_noise(powers, energies, masker, bits)


def band_noise(
    powers: list[NDArray[Any]], energies: list[NDArray[Any]], masker: Masker, bits: float
) -> NDArray[np.float64]:
    """Return the same where the mean powers of the bands, shape (64, bands), are known."""
    shaped = [
        # A coder's noise follows the spread power as masking does.
        REFERENCE * (np.maximum(energy @ masker.matrix, QUIETEST) / REFERENCE) ** COMPRESSION
        for energy in energies
    ]
    ratio = np.empty((FRAMES_PER_SUPERFRAME, CODED_BINS * len(powers)))
    for n, (power, shape) in enumerate(zip(powers, shaped, strict=True)):
        least = power.dtype.type(1e-14)
        _kernels.noise_ratios(power, least, shape, masker.edges, ratio, n * CODED_BINS, CODED_BINS)
    blocks = ratio.reshape(FRAMES_PER_SUPERFRAME // BLOCK_FRAMES, BLOCK_FRAMES, -1)
    high = np.empty(len(blocks))
    _kernels.affordable_noise(blocks, bits * BLOCK_FRAMES, ROUNDS, *NOISE_LIMITS, high)
    return np.asarray(shaped[0] * np.repeat(np.exp(high), BLOCK_FRAMES)[:, np.newaxis])


def needed_level(
    noise: NDArray[np.float64],
    unit: NDArray[np.float64],
    masker: Masker,
    cells: Cells,
    profile: AudioProfile,
) -> float:
    """Level, not whole and perhaps beyond `LEVELS`, at which a superframe bears its message.

    Parameters
    ----------
    noise : ndarray of float64, shape (64, bands)
        See `coder_noise`.
    unit : ndarray of float64, shape (64, bins)
        The mark's unit.
    masker : Masker
        Bands of `noise`.
    cells : Cells
        The profile's cells.
    profile : AudioProfile
        Its message is what must come through.
    """
    bins = np.arange(cells.first_bin, cells.last_bin)
    band = np.searchsorted(masker.edges, bins, side="right") - 1
    shape = (FRAMES_PER_SUPERFRAME, -1, cells.bins)
    own = noise[:, band].reshape(shape).mean(axis=2)
    power = unit[:, bins].reshape(shape).mean(axis=2) ** 2
    ratio = NOISE_SCALE * own[power > 0] / power[power > 0]
    low, high = NEED_LIMITS
    for _ in range(ROUNDS):
        middle = (low + high) / 2
        resultant = 1 / (1 + ratio / (profile.strength * LEVELS[0] * 2 ** (middle / 4)) ** 2)
        if (resultant**2).sum() < SURPLUS * profile.message_bits:
            low = middle
        else:
            high = middle
    return (low + high) / 2
