"""The lapped transform of the mark: modulated complex lapped transform and its inverse.

In: samples; out: complex spectra whose real part is the MDCT (hop N, sine window, orthonormal) and
whose squared magnitude is a power that hardly depends on the phase of the sound. One real FFT gives
both. Sources: Malvar, "A modulated complex lapped transform and its applications to audio
processing", ICASSP 1999, and "Fast algorithm for the modulated complex lapped transform", IEEE
Signal Processing Letters 10(1), 2003. Specification: spec/audio-carrier.md, W8 and W9.
"""

from functools import lru_cache
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

AT_ONCE = 80
"""Frames that are transformed at once: their spectra stay near the processor. A superframe's and
the one before, 65, are not parted."""


@lru_cache(maxsize=8)
def lapping(hop: int, kind: str = "complex128") -> tuple[NDArray[Any], NDArray[Any]]:
    """Return factors of two neighbouring bins of a plain transform, each of shape (hop,).

    Their sum is a bin of the lapped one: its sine window is the difference of two turns.
    """
    k = np.arange(hop)
    after = np.sqrt(2.0 / hop) * np.exp(-1j * np.pi * (0.5 + hop / 2) * (k + 0.5) / hop) / 2j
    half = np.exp(0.5j * np.pi / (2 * hop))
    return (after * half).astype(kind), (-after / half).astype(kind)


def frames_of(x: NDArray[np.float64], hop: int) -> NDArray[np.float64]:
    """View of the overlapping frames of `x`: frame t is ``x[t * hop : (t + 2) * hop]``."""
    x = np.ascontiguousarray(x)
    # As `sliding_window_view`, whose checks cost as much as a third of a superframe's transform.
    frames: NDArray[np.float64] = np.ndarray(
        (x.size // hop - 1, 2 * hop), x.dtype, x, 0, (hop * x.itemsize, x.itemsize)
    )
    return frames


def analyse(frames: NDArray[Any], hop: int, bins: int | None = None) -> NDArray[Any]:
    """Transform frames.

    Parameters
    ----------
    frames : ndarray of float64 or float32, shape (T, 2 * hop)
        Overlapping frames, see `frames_of`.
    hop : int
        Half the frame length.
    bins : int, optional
        Number of lowest bins to compute; default: all.

    Returns
    -------
    ndarray of complex128 or complex64, shape (T, bins)
        Real part: MDCT coefficients. Half the squared magnitude: their expected power.

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal(480 * 6)
    >>> y = synthesise(analyse(frames_of(x, 480), 480).real, 480)
    >>> bool(np.allclose(y[480:-480], x[480:-480]))
    True
    """
    count = bins or hop
    kind = "complex64" if frames.dtype == np.float32 else "complex128"
    own, following = (table[:count] for table in lapping(hop, kind))
    lapped = np.empty((len(frames), count), dtype=own.dtype)
    for first in range(0, len(frames), AT_ONCE):
        spectrum = scipy.fft.rfft(frames[first : first + AT_ONCE], axis=1)
        part = lapped[first : first + AT_ONCE]
        np.multiply(spectrum[:, :count], own, out=part)
        part += spectrum[:, 1 : count + 1] * following
    return lapped


def sliding_tables(
    hop: int, bins: int, advance: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Tables for sliding the lapped transform on by frames `advance` samples apart.

    The plain transform of a frame is that of the frame before, plus the waves that came in and
    less those that left, turned on. Source: Jacobsen and Lyons, "The sliding DFT", IEEE Signal
    Processing Magazine 20(2), 2003.

    Returns
    -------
    wave : ndarray of float32, shape (2, 2 * hop, bins + 1)
        Waves of the plain transform's bins at each sample of a frame, real and imaginary parts.
    turn : ndarray of float32, shape (6, bins + 1)
        Real and imaginary parts of the factor from frame to frame, and of those of two neighbouring
        bins whose sum is the lapped one.
    """
    k, tables = np.arange(bins + 1), lapping(hop)
    angle = np.pi / hop * (np.arange(2 * hop)[:, np.newaxis] * k % (2 * hop))
    wave = np.stack([np.cos(angle), -np.sin(angle)])
    factors = np.exp(1j * angle[advance]), tables[0][: bins + 1], tables[1][: bins + 1]
    turn = np.concatenate([[factor.real, factor.imag] for factor in factors])
    return wave.astype(np.float32), turn.astype(np.float32)


def synthesise(coefficients: NDArray[Any], hop: int) -> NDArray[Any]:
    """Overlap-add the inverse MDCT of coefficients.

    Parameters
    ----------
    coefficients : ndarray of float64 or float32, shape (T, bins)
        MDCT coefficients of the lowest bins, at most `hop`; the others are zero.
    hop : int
        Half the frame length.

    Returns
    -------
    ndarray of float64 or float32, shape ((T + 1) * hop,)
        Samples; the first and the last `hop` of them still lack their neighbour frame.
    """
    count, bins = coefficients.shape
    kind = np.result_type(coefficients.dtype, np.complex64).name
    own, following = (table[:bins].conj() for table in lapping(hop, kind))
    spectrum = np.zeros((count, hop + 1), dtype=kind)
    np.multiply(coefficients, own, out=spectrum[:, :bins])
    spectrum[:, 1 : bins + 1] += coefficients * following
    # A real inverse transform counts all bins but the first and the last twice.
    spectrum[:, ::hop] *= 2
    y = scipy.fft.irfft(spectrum, axis=1)
    y *= hop
    out = np.zeros((count + 1, hop), dtype=y.dtype)
    out[:count] = y[:, :hop]
    out[1:] += y[:, hop:]
    return out.reshape(-1)
