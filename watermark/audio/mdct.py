"""The lapped transform in which the mark lives: modulated complex lapped transform and its inverse.

In: samples; out: complex spectra whose real part is the MDCT (hop N, sine window, orthonormal) and
whose squared magnitude is a power that hardly depends on the phase of the sound. One FFT gives
both. Source: Malvar, "A modulated complex lapped transform and its applications to audio
processing", ICASSP 1999. Specification: section 3.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class _Tables:
    before: NDArray[np.complex128]
    after: NDArray[np.complex128]
    window: NDArray[np.float64]


@lru_cache(maxsize=4)
def _tables(hop: int) -> _Tables:
    n = np.arange(2 * hop)
    k = np.arange(hop)
    window = np.sin(np.pi * (n + 0.5) / (2 * hop))
    turn = np.exp(-1j * np.pi * n / (2 * hop))
    centre = 0.5 + hop / 2
    after = np.sqrt(2.0 / hop) * np.exp(-1j * np.pi * centre * (k + 0.5) / hop)
    return _Tables(window * turn, after, window)


def frames_of(x: NDArray[np.float64], hop: int) -> NDArray[np.float64]:
    """View of the overlapping frames of `x`: frame t is ``x[t * hop : (t + 2) * hop]``."""
    return np.lib.stride_tricks.sliding_window_view(x, 2 * hop)[::hop]


def analyse(frames: NDArray[Any], hop: int) -> NDArray[Any]:
    """Transform frames.

    Parameters
    ----------
    frames : ndarray of float64 or float32, shape (T, 2 * hop)
        Overlapping frames, see `frames_of`.
    hop : int
        Half the frame length.

    Returns
    -------
    ndarray of complex128 or complex64, shape (T, hop)
        Real part: MDCT coefficients. Half the squared magnitude: their expected power.

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal(480 * 6)
    >>> y = synthesise(analyse(frames_of(x, 480), 480).real, 480)
    >>> bool(np.allclose(y[480:-480], x[480:-480]))
    True
    """
    tables = _tables(hop)
    before, after = tables.before, tables.after
    if frames.dtype == np.float32:
        before, after = before.astype(np.complex64), after.astype(np.complex64)
    spectrum = scipy.fft.fft(frames * before, axis=1)[:, :hop]
    return np.asarray(spectrum * after)


def synthesise(coefficients: NDArray[np.float64], hop: int) -> NDArray[np.float64]:
    """Overlap-add the inverse MDCT of coefficients.

    Parameters
    ----------
    coefficients : ndarray of float64, shape (T, hop)
        MDCT coefficients.
    hop : int
        Half the frame length.

    Returns
    -------
    ndarray of float64, shape ((T + 1) * hop,)
        Samples; the first and the last `hop` of them still lack their neighbour frame.
    """
    tables = _tables(hop)
    count = coefficients.shape[0]
    padded = np.zeros((count, 2 * hop), dtype=np.complex128)
    padded[:, :hop] = coefficients * tables.after
    # The forward FFT of the conjugate phases is the inverse transform without a second table.
    folded = scipy.fft.fft(padded, axis=1)
    n = np.arange(2 * hop)
    turn = np.exp(-1j * np.pi * n / (2 * hop))
    y = np.real(folded * turn) * tables.window
    out = np.zeros((count + 1) * hop)
    out[: count * hop] += y[:, :hop].reshape(-1)
    out[hop:] += y[:, hop:].reshape(-1)
    return out
