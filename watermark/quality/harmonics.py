"""Harmonic structure of the error: a peak in the spectrum of the log spectra's autocorrelation.

ITU-R BS.1387-1, Annex 2, section 4.8.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LAGS = 256
SILENT = 8000 / 32768**2  # energy of the newer half of a frame below which nothing is measured
_FLOOR = 1e-12  # of a power spectrum; keeps digital silence finite
_WINDOW = np.sqrt(8 / 3) / LAGS * 0.5 * (1 - np.cos(2 * np.pi * np.arange(LAGS) / (LAGS - 1)))


def harmonic_structure(power: FloatArray, energy: FloatArray) -> FloatArray:
    """Measure how harmonic the difference of two spectra is.

    Parameters
    ----------
    power : ndarray of float64, shape (2, T, bins)
        Power spectra of reference and test, at least 511 bins.
    energy : ndarray of float64, shape (2, T)
        Energy of the newer half of each frame.

    Returns
    -------
    ndarray of float64, shape (T,)
        Largest value of the spectrum of the normalised autocorrelation, -1 where both are silent.
    """
    ratio = np.log(np.maximum(power[1, :, : 2 * LAGS - 1], _FLOOR))
    ratio -= np.log(np.maximum(power[0, :, : 2 * LAGS - 1], _FLOOR))
    head = np.fft.rfft(ratio[:, :LAGS], 2 * LAGS)
    whole = np.fft.rfft(ratio, 2 * LAGS)
    product = np.fft.irfft(np.conj(head) * whole, 2 * LAGS)[:, :LAGS]
    squares = np.cumsum(np.pad(ratio**2, ((0, 0), (1, 0))), axis=1)
    lag = np.arange(LAGS)
    moving = squares[:, lag + LAGS] - squares[:, lag]
    norm = np.sqrt(np.maximum(moving * moving[:, :1], 0.0))
    correlation = np.ones_like(product)
    np.divide(product, norm, out=correlation, where=norm > 1e-20)
    correlation -= correlation.mean(axis=1, keepdims=True)
    spectrum = np.abs(np.fft.rfft(correlation * _WINDOW, axis=1)) ** 2
    peak = np.where(spectrum[:, 1:] > spectrum[:, :1], spectrum[:, 1:], 0.0).max(axis=1)
    return np.where((energy < SILENT).all(axis=0), -1.0, peak)
