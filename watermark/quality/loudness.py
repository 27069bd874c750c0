"""Programme loudness after ITU-R BS.1770-4 and EBU R 128.

In: full-scale samples; out: the gated loudness in LUFS. The filters are those of the
Recommendation's annex 1, moved to the sound's rate by the bilinear transform of their analogue
forms (Brecht De Man, "Evaluation of implementations of the EBU R128 loudness measurement", AES 145,
2018).
"""

import numpy as np
import scipy.signal
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError

BLOCK_S, STEP_S = 0.4, 0.1
"""Gating blocks overlap by three quarters."""

ABSOLUTE_GATE, RELATIVE_GATE = -70.0, -10.0
"""Blocks below -70 LUFS, and those 10 LU below the mean of the others, do not count."""

WEIGHTS = (1.0, 1.0, 1.0, 0.0, 1.41, 1.41)
"""Weights of L R C LFE Ls Rs (ITU-R BS.1770)."""


def _shelf(fs: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stage 1: the head's high shelf of 4 dB."""
    k = np.tan(np.pi * 1681.974450955533 / fs)
    gain, q = 10 ** (3.999843853973347 / 20), 0.7071752369554196
    middle = gain**0.4996667741545416
    b = [gain + middle * k / q + k * k, 2 * (k * k - gain), gain - middle * k / q + k * k]
    a = [1 + k / q + k * k, 2 * (k * k - 1), 1 - k / q + k * k]
    return np.array(b) / a[0], np.array(a) / a[0]


def _high_pass(fs: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stage 2: the revised low-frequency curve."""
    k = np.tan(np.pi * 38.13547087602444 / fs)
    q = 0.5003270373238773
    a = np.array([1 + k / q + k * k, 2 * (k * k - 1), 1 - k / q + k * k])
    return np.array([1.0, -2.0, 1.0]), a / a[0]


def loudness_lufs(sound: ArrayLike, fs: int) -> float:
    """Integrated loudness.

    Parameters
    ----------
    sound : array_like of float, shape (n, channels)
        Full scale 1; up to six channels in the order L R C LFE Ls Rs.
    fs : int
        Sampling rate in Hz.

    Returns
    -------
    float
        In LUFS.

    Raises
    ------
    CueError
        If nothing is louder than the gate, or there are more than six channels.

    Examples
    --------
    >>> t = np.arange(48000 * 2) / 48000
    >>> round(loudness_lufs(np.sin(2 * np.pi * 997 * t)[:, None], 48000), 2)
    -3.01
    """
    x = np.asarray(sound, dtype=np.float64)
    if x.ndim != 2 or not 1 <= x.shape[1] <= len(WEIGHTS):
        raise CueError(f"loudness of shape {x.shape}: expected (n, 1 to {len(WEIGHTS)})")
    for b, a in (_shelf(fs), _high_pass(fs)):
        x = scipy.signal.lfilter(b, a, x, axis=0)
    total = np.concatenate([[0.0], np.cumsum((x**2) @ np.array(WEIGHTS[: x.shape[1]]))])
    size, step = round(BLOCK_S * fs), round(STEP_S * fs)
    power = (total[size::step] - total[:-size:step][: len(total[size::step])]) / size
    loud = power[_lufs(power) > ABSOLUTE_GATE]
    if not loud.size:
        raise CueError("loudness: nothing is louder than -70 LUFS")
    gate = _lufs(loud.mean()) + RELATIVE_GATE
    return float(_lufs(loud[_lufs(loud) > gate].mean()))


def _lufs(power: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(-0.691 + 10 * np.log10(np.maximum(power, 1e-20)))
