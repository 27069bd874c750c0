"""Sound to the features of the aligner: mel cepstra and their slopes, mean and spread removed.

S. Davis, P. Mermelstein 1980; the mean over the programme takes away the microphone and most of
a steady background.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, signal

from codec.errors import CueError

FS = 16_000
"""Rate in Hz at which sound is looked at."""

HOP = 160
"""Samples between frames: 10 ms."""

FRAME_RATE = FS / HOP

_WINDOW, _FFT = 400, 512
"""Samples of a window, 25 ms, and of its transform."""

_BANDS, _COEFFICIENTS = 28, 13
"""Mel bands, and the cepstral coefficients that are kept of them (Davis and Mermelstein 1980)."""

_LOW_HZ, _HIGH_HZ = 100.0, 7000.0
"""Ends of the bands in Hz."""

_FLOOR = 10**-3.0
"""What lies 30 dB under the loud frames of a band counts as silence: breath, room, soft music."""

_SLOPE_REACH = 2
"""Frames on either side over which slopes are taken."""

_SLOPE_WEIGHT = 0.7
"""Weight of slopes against the cepstra themselves."""


def mono(samples: ArrayLike, fs: int) -> NDArray[np.float64]:
    """Return sound of shape (n,) or (n, channels) as one channel at `FS`.

    Raises
    ------
    CueError
        If the sampling rate is not within 8 to 192 kHz.
    """
    if not 8_000 <= fs <= 192_000:
        raise CueError(f"sampling rate {fs} Hz is not within 8000..192000")
    x = np.asarray(samples, dtype=np.float64)
    x = x.mean(axis=1) if x.ndim > 1 else x
    common = np.gcd(fs, FS)
    return x if fs == FS else np.asarray(signal.resample_poly(x, FS // common, fs // common))


def cepstra(x: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return normalised cepstra and slopes.

    Parameters
    ----------
    x : ndarray of float64, shape (n,)
        Sound at `FS`.

    Returns
    -------
    ndarray of float32, shape (n // HOP + 1, 26)
        Frame t stands for the 25 ms around sample t * HOP.

    Examples
    --------
    >>> cepstra(np.zeros(1600)).shape
    (11, 26)
    """
    if not len(x):
        return np.zeros((1, 2 * _COEFFICIENTS), np.float32)
    emphasised = np.append(x[:1], x[1:] - 0.97 * x[:-1])
    padded = np.pad(emphasised, _WINDOW // 2)
    frames = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW)[::HOP]
    power = np.abs(np.fft.rfft(frames * np.hamming(_WINDOW), _FFT)) ** 2
    energy = power @ _mel_bank().T
    floor = _FLOOR * np.percentile(energy, 95, axis=0) + 1e-12
    cepstrum = fft.dct(np.log(energy + floor), norm="ortho")[:, :_COEFFICIENTS]
    return np.hstack([_standard(cepstrum), _SLOPE_WEIGHT * _standard(_slopes(cepstrum))]).astype(
        np.float32
    )


def _mel_bank() -> NDArray[np.float64]:
    """Return triangular bands, shape (bands, bins), equally spaced on the mel scale."""
    low, high = (2595 * np.log10(1 + f / 700) for f in (_LOW_HZ, _HIGH_HZ))
    edges = 700 * (10 ** (np.linspace(low, high, _BANDS + 2) / 2595) - 1)
    bins = np.fft.rfftfreq(_FFT, 1 / FS)
    rising = (bins - edges[:-2, None]) / np.diff(edges)[:-1, None]
    falling = (edges[2:, None] - bins) / np.diff(edges)[1:, None]
    return np.asarray(np.maximum(0, np.minimum(rising, falling)))


def _slopes(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the regression slope over 2 * reach + 1 frames."""
    reach = np.arange(-_SLOPE_REACH, _SLOPE_REACH + 1)
    padded = np.pad(x, ((_SLOPE_REACH, _SLOPE_REACH), (0, 0)), mode="edge")
    return np.asarray(
        sum(r * padded[_SLOPE_REACH + r : len(padded) - _SLOPE_REACH + r] for r in reach)
    ) / float((reach**2).sum())


def _standard(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((x - x.mean(axis=0)) / (x.std(axis=0) + 1e-9))
