"""Pitch marks: one sample position per glottal period, a regular grid where there is no pitch."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synth.units.speech.lsp import linear_prediction
from synth.units.speech.pitch import PitchTrack

_UNVOICED_STEP_S = 0.005
"""Seconds between marks where nothing is periodic: half a period of a low voice."""

_DEVIATION_COST = 12.0
"""Cost of a squared deviation from the period, in heights of peaks: a deviation of a tenth of a
period costs an eighth of a full peak."""

_BREAK_COST = 3.0
"""Cost of a hole in a voiced stretch: a peak of one period may be too low to be a candidate."""

_LOWEST_PEAK = 0.2
"""Height, of 1, below which a peak is no candidate."""

_FRAME_S, _EVERY = 0.03, 5
"""Length in seconds of a frame for the polarity, some periods; one in this many values of pitch has
a frame."""

_MORE_POLES = 2
"""Poles of the prediction beyond one for each kHz: a formant each, and the spectrum's slope."""


@dataclass(frozen=True, slots=True)
class PitchMarks:
    """Positions for pitch-synchronous work.

    Attributes
    ----------
    sample : ndarray of int64, shape (M,)
        Strictly ascending sample positions.
    voiced : ndarray of bool, shape (M,)
        Whether the mark stands at a glottal period.
    fs : float
        Sample rate in Hz.
    """

    sample: NDArray[np.int64]
    voiced: NDArray[np.bool_]
    fs: float


def place_marks(x: ArrayLike, fs: float, track: PitchTrack) -> PitchMarks:
    """Place pitch marks on the main peak of every period.

    Parameters
    ----------
    x : array_like of float, shape (n,)
        One channel of speech.
    fs : float
        Sample rate in Hz.
    track : PitchTrack
        Its pitch, from `synth.units.speech.pitch.track_pitch`.

    Returns
    -------
    PitchMarks

    Notes
    -----
    In each voiced stretch a best path chooses among the local maxima (of the polarity in
    which the glottis closes upwards), trading height against regularity; the paper's synthesiser
    marks its units once, off line (Gibert, Bailly, Elisei 2004, section 5.1: TD-PSOLA).
    """
    signal = np.asarray(x, dtype=np.float64)
    signal = signal * _polarity(signal, fs, track)
    positions: list[NDArray[np.int64]] = []
    for first, last in _voiced_stretches(track, len(signal), fs):
        positions.append(_epochs(signal, first, last, fs, track))
    voiced = np.concatenate(positions) if positions else np.zeros(0, dtype=np.int64)
    return _with_grid_between(voiced, len(signal), fs, track)


def _polarity(x: NDArray[np.float64], fs: float, track: PitchTrack) -> float:
    """Return the sign that turns the closures of the glottis upwards.

    The skewness of the prediction residual has the sign of its pulses, one a period (Drugman 2013);
    every frame counts alike.
    That of the waveform changes with the vowels: two recordings of one speaker would be marked at
    opposite peaks, and half a period apart where they are joined.
    """
    width, order = round(_FRAME_S * fs), round(fs / 1000) + _MORE_POLES
    at = np.rint(np.flatnonzero(track.f0 > 0)[::_EVERY] * track.hop_s * fs).astype(np.int64)
    at -= width // 2
    at = at[(at >= order + 1) & (at + width <= len(x))]
    if not len(at):
        return 1.0
    sharp = np.diff(x, prepend=0.0)
    frames = sharp[at[:, None] + np.arange(-order, width)]
    predictor = linear_prediction(frames[:, order:] * np.hanning(width), order)
    residual = sum(
        predictor[:, k, None] * frames[:, order - k : order - k + width] for k in range(order + 1)
    )
    pulses = np.asarray(residual) - np.mean(residual, axis=1, keepdims=True)
    skewness = np.mean(pulses**3, axis=1) / (np.mean(pulses**2, axis=1) ** 1.5 + 1e-30)
    return 1.0 if float(skewness.mean()) >= 0 else -1.0


def _voiced_stretches(track: PitchTrack, n: int, fs: float) -> list[tuple[int, int]]:
    """Return (first, last) sample of every stretch of voiced frames."""
    voiced = np.concatenate(([False], track.f0 > 0, [False]))
    edges = np.flatnonzero(np.diff(voiced.astype(np.int8)))
    hop = track.hop_s * fs
    bounds = [(round((a - 0.5) * hop), round((b - 0.5) * hop)) for a, b in edges.reshape(-1, 2)]
    return [(max(a, 0), min(b, n)) for a, b in bounds if min(b, n) - max(a, 0) > 2]


def _epochs(
    x: NDArray[np.float64], first: int, last: int, fs: float, track: PitchTrack
) -> NDArray[np.int64]:
    from synth.units.speech import _kernels

    piece = x[first:last]
    peaks = np.flatnonzero((piece[1:-1] > piece[:-2]) & (piece[1:-1] >= piece[2:])) + 1
    if len(peaks) == 0:
        return np.zeros(0, dtype=np.int64)
    frames = np.arange(len(track.f0)) * track.hop_s * fs
    known = track.f0 > 0
    period = fs / np.interp(peaks + first, frames[known], track.f0[known])
    reach = int(period.max())
    padded = np.pad(piece, reach, mode="edge")
    loudest = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)[peaks].max(axis=1)
    height = np.maximum(piece[peaks], 0.0) / np.maximum(loudest, 1e-30)
    keep = height > _LOWEST_PEAK
    chosen = np.zeros(int(keep.sum()), dtype=np.bool_)
    _kernels.epoch_path(
        peaks[keep], height[keep], period[keep], _DEVIATION_COST, _BREAK_COST, chosen
    )
    return np.asarray(peaks[keep][chosen] + first, dtype=np.int64)


def _with_grid_between(
    voiced: NDArray[np.int64], n: int, fs: float, track: PitchTrack
) -> PitchMarks:
    """Fill every gap of more than two longest periods with marks every 5 ms."""
    step = round(_UNVOICED_STEP_S * fs)
    longest = fs / track.f0[track.f0 > 0].min() if (track.f0 > 0).any() else step
    sample: list[int] = []
    is_voiced: list[bool] = []
    before = -step
    for position in [*voiced.tolist(), n + step]:
        gap = position - before
        at_edge = before < 0 or position > n
        if gap > 2 * longest or at_edge:
            parts = max(int(gap // step), 1)
            grid = before + np.round(np.arange(1, parts) * gap / parts).astype(np.int64)
            inside = grid[(grid >= 0) & (grid < n)]
            sample += inside.tolist()
            is_voiced += [False] * len(inside)
        if position < n:
            sample.append(position)
            is_voiced.append(True)
        before = position
    return PitchMarks(np.array(sample, dtype=np.int64), np.array(is_voiced, dtype=np.bool_), fs)
