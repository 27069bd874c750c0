"""Fundamental frequency of recorded or synthetic speech, frame by frame.

Autocorrelation of Hann-windowed frames divided by that of the window, parabolic peaks, best path
through the candidates (Boersma 1993, "Accurate short-term analysis of the fundamental frequency
and the harmonics-to-noise ratio of a sampled sound").
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError

_CANDIDATES = 8
"""Periods per frame that are considered."""

_OCTAVE_COST = 0.01
"""Strength that a candidate loses per octave of its period (Boersma 1993, section 3.4)."""

_OCTAVE_JUMP_COST = 0.35
"""Strength that a jump by an octave costs (Boersma 1993)."""

_VOICING_COST = 0.14
"""Strength that a change between voiced and unvoiced costs (Boersma 1993)."""

_SILENCE = 0.03
"""Loudness, of the sound's maximum, below which a frame tends to be unvoiced (Boersma 1993)."""

_VOICING_THRESHOLD = 0.45
"""Least strength of a voiced frame (Boersma 1993)."""

_BLOCK = 512
"""Frames that are analysed at once, for constant memory."""


@dataclass(frozen=True, slots=True)
class PitchTrack:
    """Fundamental frequency on a regular grid.

    Attributes
    ----------
    f0 : ndarray of float64, shape (T,)
        Hertz; 0 where the frame has no pitch. Frame t stands at ``t * hop_s`` seconds.
    hop_s : float
        Distance of the frames in seconds.
    """

    f0: NDArray[np.float64]
    hop_s: float


def track_pitch(
    x: ArrayLike, fs: float, *, f0_min: float = 70.0, f0_max: float = 450.0, hop_s: float = 0.005
) -> PitchTrack:
    """Track the fundamental frequency of speech.

    Parameters
    ----------
    x : array_like of float, shape (n,)
        One channel.
    fs : float
        Sample rate in Hz.
    f0_min, f0_max : float
        Range searched, in Hz; ``f0_max`` must stay below a quarter of `fs`.
    hop_s : float
        Distance between frames in seconds.

    Returns
    -------
    PitchTrack

    Raises
    ------
    CueError
        If the range is empty or does not fit the sample rate.

    Examples
    --------
    >>> t = np.arange(16000) / 16000
    >>> track = track_pitch(np.sin(2 * np.pi * 200 * t) + np.sin(2 * np.pi * 400 * t), 16000)
    >>> float(np.median(track.f0).round(1))
    200.0
    """
    from synth.units.speech import _kernels

    if not 0 < f0_min < f0_max < fs / 4:
        raise CueError(f"pitch range {f0_min}..{f0_max} Hz does not fit a rate of {fs} Hz")
    signal = np.asarray(x, dtype=np.float64)
    window = round(3 * fs / f0_min)
    hop = hop_s * fs
    frames = 1 + int(len(signal) / hop)
    padded = np.pad(signal, (window // 2, window))
    peak = np.abs(signal).max(initial=0.0)
    lag = np.zeros((frames, _CANDIDATES))
    strength = np.zeros((frames, _CANDIDATES))
    unvoiced = np.zeros(frames)
    for first in range(0, frames, _BLOCK):
        rows = np.arange(first, min(first + _BLOCK, frames))
        start = np.round(rows * hop).astype(np.int64)
        block = padded[start[:, None] + np.arange(window)]
        lag[rows], strength[rows] = _candidates(block, fs, f0_min, f0_max)
        loudness = np.abs(block - block.mean(axis=1, keepdims=True)).max(axis=1) / (peak + 1e-30)
        # A frame without a pitch is as strong as the threshold, and stronger the quieter it is.
        unvoiced[rows] = _VOICING_THRESHOLD + np.maximum(
            0.0, 2.0 - loudness / _SILENCE * (1 + _VOICING_THRESHOLD)
        )
    path = np.zeros(frames, dtype=np.int64)
    jump = 0.01 / hop_s
    _kernels.voicing_path(
        lag, strength, unvoiced, _OCTAVE_JUMP_COST * jump, _VOICING_COST * jump, path
    )
    chosen = np.take_along_axis(lag, np.minimum(path, _CANDIDATES - 1)[:, None], axis=1)[:, 0]
    voiced = path < _CANDIDATES
    f0 = np.where(voiced, fs / np.where(voiced, chosen, 1.0), 0.0)
    return PitchTrack(f0, hop_s)


def _candidates(
    block: NDArray[np.float64], fs: float, f0_min: float, f0_max: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return lags (samples, 0 for none) and strengths of the best peaks, each (rows, C)."""
    _rows, width = block.shape
    window = np.hanning(width)
    size = 1 << int(np.ceil(np.log2(1.5 * width)))
    centred = (block - block.mean(axis=1, keepdims=True)) * window
    spectrum = np.fft.rfft(centred, size, axis=1)
    r = np.fft.irfft(np.abs(spectrum) ** 2, size, axis=1)[:, : width // 2]
    own = np.fft.irfft(np.abs(np.fft.rfft(window, size)) ** 2, size)[: width // 2]
    # Autocorrelation of the windowed signal over that of the window itself (Boersma 1993).
    r = r / np.maximum(r[:, :1], 1e-12) / (own / own[0])
    low, high = int(fs / f0_max), min(int(np.ceil(fs / f0_min)), width // 2 - 2)
    middle = r[:, low : high + 1]
    left, right = r[:, low - 1 : high], r[:, low + 1 : high + 2]
    curve = left - 2 * middle + right
    is_peak = (middle > left) & (middle >= right) & (curve < 0)
    is_peak &= middle > 0.5 * _VOICING_THRESHOLD
    # Vertex and height of the parabola through a peak and its neighbours.
    shift = np.where(is_peak, 0.5 * (left - right) / np.where(is_peak, curve, 1.0), 0.0)
    height = np.minimum(middle - 0.25 * (left - right) * shift, 1.0)
    lags = np.arange(low, high + 1) + np.clip(shift, -0.5, 0.5)
    # Of two peaks of one height the shorter lag, an octave higher, is preferred.
    value = np.where(is_peak, height - _OCTAVE_COST * np.log2(f0_min * lags / fs), -np.inf)
    best = np.argsort(-value, axis=1)[:, :_CANDIDATES]
    strength = np.take_along_axis(value, best, axis=1)
    lag = np.where(np.isfinite(strength), np.take_along_axis(lags, best, axis=1), 0.0)
    return lag, np.where(np.isfinite(strength), strength, 0.0)
