"""The rate-distortion bound of a motion: reverse water-filling over its spectra.

A motion goes in; the rate comes out that a Gaussian process of the same spectra needs at least
for a given error (Cover and Thomas 2006, section 10.3.3, over frequency and channels). The metric
is that of the markers, so that errors are millimetres. A process that is not Gaussian, as speech
is not, may be coded at less: codecs that know the score are not held by this bound.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import MARKERS
from codec.cuer.voice import Voice
from codec.superframe.transform import marker_metric

Array = NDArray[np.float64]

WINDOW = 128
"""Frames of a Welch segment: 2.56 s at 50 Hz, half overlapping."""

_EVERY = 97
"""Stride in frames of the metric; a prime, so that it falls on all phases of speech."""


@dataclass(frozen=True, slots=True)
class Bound:
    """Eigenvalues of the spectral density in the markers' metric.

    Attributes
    ----------
    spectrum : ndarray of float64, shape (F, P)
        Per frequency of the two-sided transform, mm**2.
    rate_hz : float
        Frames per second.
    """

    spectrum: Array
    rate_hz: float

    def rate_bps(self, error_mm: float) -> float:
        """Return the least rate at which the markers' RMS error is `error_mm`, bit/s."""
        wanted = error_mm**2 * len(MARKERS)
        low, high = 1e-12, float(self.spectrum.max()) + 1e-9
        if np.minimum(self.spectrum, high).sum(axis=1).mean() <= wanted:
            return 0.0
        for _ in range(80):
            level = np.sqrt(low * high)
            if np.minimum(self.spectrum, level).sum(axis=1).mean() > wanted:
                high = level
            else:
                low = level
        bits = 0.5 * np.log2(np.maximum(self.spectrum / low, 1.0))
        return float(bits.sum(axis=1).mean() * self.rate_hz)


def bound_of(params: Array, voice: Voice, *, rate_hz: float = 50.0) -> Bound:
    """Return the bound of a motion.

    Parameters
    ----------
    params : ndarray of float64, shape (T, P)
        Parameters of the voice, T at least 128.
    voice : Voice
    rate_hz : float
    """
    metric = marker_metric(voice, params[::_EVERY])
    root = np.linalg.cholesky(metric + 1e-9 * np.trace(metric) * np.eye(len(metric)))
    channels = (params - params.mean(axis=0)) @ root
    window = np.hanning(WINDOW)
    window *= np.sqrt(1.0 / np.square(window).sum())
    starts = range(0, len(channels) - WINDOW + 1, WINDOW // 2)
    density = np.zeros((WINDOW, channels.shape[1], channels.shape[1]), dtype=np.complex128)
    for start in starts:
        spectrum = np.fft.fft(channels[start : start + WINDOW] * window[:, None], axis=0)
        density += spectrum[:, :, None] * spectrum[:, None, :].conj()
    values = np.linalg.eigvalsh(density / len(starts))
    return Bound(np.maximum(values, 1e-15), rate_hz)
