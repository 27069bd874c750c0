"""Bringing samples over time to the steady rate of a motion.

A sinc under a Kaiser window, cut at the lower of the two rates (Smith and Gossett 1984): nothing
faster than the new rate can bear is folded back. Ends are mirrored.
"""

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

FloatArray = NDArray[np.float64]

_ZEROS = 8
"""Zeros of the sinc on either side."""

_BETA = 8.0
"""Shape of its Kaiser window, without unit."""

_PASS = 0.9
"""Share of the band that passes."""

_AT_ONCE = 4096
"""Samples that are made at once, for constant memory."""

MOST_FRAMES = 20_000_000
"""More frames are no take: two days at 100 Hz."""


def resample(values: FloatArray, rate_hz: float, times: FloatArray) -> FloatArray:
    """Return values at other times.

    Parameters
    ----------
    values : ndarray, shape (T, P)
        At 0, 1 / rate_hz, ... seconds.
    rate_hz : float
    times : ndarray, shape (N,)
        Seconds from the first value on, evenly spaced.

    Returns
    -------
    ndarray of float64, shape (N, P)

    Examples
    --------
    >>> slow = np.sin(np.arange(100) / 10)[:, None]
    >>> out = resample(slow, 100.0, np.arange(20, 30) / 40)
    >>> bool(np.abs(out[:, 0] - np.sin(np.arange(20, 30) * 0.25)).max() < 1e-3)
    True
    """
    if len(values) == 1 or not len(times):
        return np.repeat(values[:1].astype(np.float64), len(times), axis=0)
    step = float(times[1] - times[0]) if len(times) > 1 else 1.0 / rate_hz
    if np.allclose(times * rate_hz, np.arange(len(times)) + times[0] * rate_hz, atol=1e-6) and (
        abs(times[0] * rate_hz - round(times[0] * rate_hz)) < 1e-6
    ):
        at = np.clip(np.round(times * rate_hz).astype(int), 0, len(values) - 1)
        return np.asarray(values[at], dtype=np.float64)
    # Windowed sinc (Kaiser): it passes up to a part of the lower one of both Nyquist frequencies.
    cut = min(1.0, 1.0 / (step * rate_hz)) * _PASS
    reach = int(np.ceil(_ZEROS / cut))
    taps = np.arange(-reach, reach + 1)
    out = np.empty((len(times), values.shape[1]))
    for begin in range(0, len(times), _AT_ONCE):
        place = times[begin : begin + _AT_ONCE] * rate_hz
        centre = np.round(place).astype(int)
        at = centre[:, None] + taps
        away = at - place[:, None]
        inside = np.clip(1.0 - (away / (reach + 1)) ** 2, 0.0, None)
        weights = np.sinc(cut * away) * np.i0(_BETA * np.sqrt(inside))
        weights /= weights.sum(1, keepdims=True)
        at = np.abs(at)
        last = len(values) - 1
        at = np.clip(last - np.abs(last - at), 0, last)
        out[begin : begin + _AT_ONCE] = np.einsum("nk,nkp->np", weights, values[at])
    return out


def even_times(start_s: float, duration_s: float, rate_hz: float) -> FloatArray:
    """Return the times of a motion's frames within an interval, whole multiples of its step.

    Raises
    ------
    CueError
        If that is more than anybody can have recorded.

    Examples
    --------
    >>> even_times(0.95, 0.1, 50.0).tolist()
    [0.96, 0.98, 1.0, 1.02, 1.04]
    """
    if not 0 <= duration_s * rate_hz <= MOST_FRAMES or abs(start_s) > 1e7:
        raise CueError(f"{duration_s:.4g} s from {start_s:.4g} s on are no take")
    first = int(np.ceil(start_s * rate_hz - 1e-6))
    last = int(np.floor((start_s + duration_s) * rate_hz - 1e-6))
    return np.arange(first, max(last, first) + 1) / rate_hz


def evenly(times: FloatArray, values: FloatArray, *, name: str) -> tuple[FloatArray, float]:
    """Return samples at uneven times at their usual rate, interpolated linearly.

    Parameters
    ----------
    times : ndarray, shape (T,)
        Seconds; times that do not rise are left out.
    values : ndarray, shape (T, P)
    name : str
        Of the file, for errors.

    Returns
    -------
    values : ndarray of float64, shape (N, P)
        From the first time on.
    rate_hz : float

    Raises
    ------
    CueError
        If the times do not rise.
    """
    rising = np.concatenate([[True], times[1:] > np.maximum.accumulate(times)[:-1]])
    times, values = times[rising], values[rising]
    if len(times) < 2:
        raise CueError(f"{name}: the times do not rise")
    rate_hz = 1.0 / float(np.median(np.diff(times)))
    count = round((times[-1] - times[0]) * rate_hz) + 1
    if not 1 <= rate_hz <= 1000 or count > MOST_FRAMES:
        raise CueError(f"{name}: {rate_hz:.4g} frames/s over {times[-1] - times[0]:.4g} s")
    grid = times[0] + np.arange(count) / rate_hz
    even = np.stack([np.interp(grid, times, column) for column in values.T], axis=1)
    return even, rate_hz
