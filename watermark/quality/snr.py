"""Plain measures beside the grade: signal-to-noise ratios and wideband PESQ for speech."""

import importlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError
from watermark.quality.resample import Resampler

_PESQ_HZ = 16_000
"""Rate in Hz of wideband PESQ (ITU-T P.862.2)."""


def snr_db(reference: ArrayLike, test: ArrayLike) -> float:
    """Ratio of the reference's energy to that of the difference, in dB.

    Parameters
    ----------
    reference, test : array_like of float
        Signals of the same shape.

    Returns
    -------
    float
        Infinity for identical signals.

    Raises
    ------
    CueError
        If the shapes differ or the reference is silent.

    Examples
    --------
    >>> snr_db([1.0, -1.0], [1.1, -1.1])
    20.0
    """
    ref, noise = _reference_and_noise(reference, test)
    signal, error = float(np.sum(ref**2)), float(np.sum(noise**2))
    if signal == 0:
        raise CueError("no signal-to-noise ratio: the reference is silent")
    return float("inf") if error == 0 else round(10 * float(np.log10(signal / error)), 9)


def segmental_snr_db(
    reference: ArrayLike, test: ArrayLike, fs: int, *, segment_s: float = 0.02
) -> float:
    """Mean over segments of the signal-to-noise ratio, each limited to -10..35 dB.

    Parameters
    ----------
    reference, test : array_like of float, shape (n,) or (n, channels)
        Signals of the same shape.
    fs : int
        Sampling rate in Hz.
    segment_s : float
        Length of a segment; segments below -60 dB of the loudest are left out as silence.

    Returns
    -------
    float
        In dB.

    Raises
    ------
    CueError
        If the shapes differ, the reference is silent or shorter than one segment.

    Examples
    --------
    >>> tone = np.sin(np.arange(16000) / 5)
    >>> round(segmental_snr_db(tone, 1.1 * tone, 16000), 6)
    20.0
    """
    ref, noise = _reference_and_noise(reference, test)
    size = max(1, round(segment_s * fs))
    count = len(ref) // size
    if count == 0 or not ref[: count * size].any():
        raise CueError("no segmental signal-to-noise ratio: the reference is silent or too short")
    signal, error = (
        np.sum(x[: count * size].reshape(count, -1) ** 2, axis=1) for x in (ref, noise)
    )
    keep = signal > signal.max() * 1e-6
    ratio = 10 * np.log10(signal[keep] / np.maximum(error[keep], signal[keep] * 1e-12))
    return float(np.clip(ratio, -10, 35).mean())


def pesq_wb(reference: ArrayLike, test: ArrayLike, fs: int) -> float:
    """Wideband PESQ (ITU-T P.862.2) of speech: 1 bad to 4.64 excellent; mono mix.

    Needs the optional package `pesq`.

    Parameters
    ----------
    reference, test : array_like of float, shape (n,) or (n, channels)
        Speech, full scale 1.
    fs : int
        Sampling rate in Hz.

    Returns
    -------
    float
        Listening quality (MOS-LQO).

    Raises
    ------
    CueError
        If the package is missing, the shapes differ, or no utterance is found.
    """
    try:
        pesq = importlib.import_module("pesq")
    except ImportError:
        raise CueError("PESQ needs the package `pesq`: pip install pesq") from None
    signals = []
    for x in np.broadcast_arrays(*_same_shape(reference, test)):
        resampler = Resampler(fs, _PESQ_HZ, 1)
        mono = x.reshape(len(x), -1).mean(axis=1, keepdims=True)
        signals.append(np.concatenate([resampler.process(mono), resampler.flush()])[:, 0])
    try:
        return float(pesq.pesq(_PESQ_HZ, *signals, "wb"))
    except (pesq.PesqError, ValueError) as error:
        raise CueError(f"PESQ cannot grade this: {error}") from None


def _same_shape(
    reference: ArrayLike, test: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    ref, other = np.asarray(reference, dtype=np.float64), np.asarray(test, dtype=np.float64)
    if ref.shape != other.shape:
        raise CueError(f"test has shape {other.shape}, reference {ref.shape}")
    return ref, other


def _reference_and_noise(
    reference: ArrayLike, test: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    ref, other = _same_shape(reference, test)
    return ref, other - ref
