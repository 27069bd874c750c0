"""Channels of a programme to the one signal that is marked, and the mark back into the channels.

Specification: spec/audio-carrier.md, W5 to W7. What left takes more of the mark right takes less,
so it stands
unattenuated in the mid of stereo and in a mono downmix. A centre's part comes back there too.
"""

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

RATES = (32_000, 44_100, 48_000)
"""Sampling rates that are marked and received without outside conversion."""

_WEIGHTS = {
    1: (1.0,),
    2: (0.5, 0.5),
    3: (0.5, 0.5, np.sqrt(0.5)),
    4: (0.5, 0.5, np.sqrt(0.125), np.sqrt(0.125)),
    5: (0.5, 0.5, np.sqrt(0.5), np.sqrt(0.125), np.sqrt(0.125)),
    6: (0.5, 0.5, np.sqrt(0.5), 0.0, np.sqrt(0.125), np.sqrt(0.125)),
}
"""Weights of the analysed signal: the mid of the ITU-R BS.775 stereo downmix."""


def check_format(fs: int, channels: int) -> None:
    """Raise CueError unless the carrier serves this rate and number of channels."""
    if fs not in RATES:
        raise CueError(f"sampling rate {fs} Hz, the audio carrier takes {RATES}")
    if channels not in _WEIGHTS:
        raise CueError(f"{channels} channels, the audio carrier takes 1 to {max(_WEIGHTS)}")


def weights_of(channels: int) -> tuple[float, ...]:
    """Weights of a programme's channels in the signal that is analysed."""
    return tuple(float(weight) for weight in _WEIGHTS[channels])


def mid_of(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signal that is analysed, shape (n,), of a programme, shape (n, channels).

    Examples
    --------
    >>> mid_of(np.array([[1.0, 0.0]]))
    array([0.5])
    """
    return np.asarray(x @ np.array(_WEIGHTS[x.shape[1]]))


def side_of(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half the difference of the front channels, shape (n,); silence for mono.

    Examples
    --------
    >>> side_of(np.array([[1.0, 0.0]]))
    array([0.5])
    """
    return np.zeros(len(x)) if x.shape[1] == 1 else (x[:, 0] - x[:, 1]) / 2


def front_of(
    mid: NDArray[np.float64], side: NDArray[np.float64], channels: int
) -> NDArray[np.float64]:
    """Front of a programme, shape (n, channels), from its mid and side; 1 or 2 channels."""
    front = np.empty((mid.size, channels))
    if channels == 1:
        front[:, 0] = mid
    else:
        np.add(mid, side, out=front[:, 0])
        np.subtract(mid, side, out=front[:, 1])
    return front


def has_centre(channels: int) -> bool:
    """Whether the third channel of that many is the centre."""
    return channels in (3, 5, 6)


def add_mark(
    x: NDArray[np.float64],
    mark: NDArray[np.float64],
    across: NDArray[np.float64],
    taken: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Programme with its mark: left has `across` more, right less, the centre its own part."""
    out = x.copy()
    out[:, :2] += (mark - taken)[:, np.newaxis]
    if x.shape[1] > 1:
        out[:, 0] += across
        out[:, 1] -= across
    if has_centre(x.shape[1]):
        out[:, 2] += np.sqrt(2) * taken
    return out
