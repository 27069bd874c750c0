"""Passages that were made one by one, joined to one performance without gaps or jumps.

In: frames and samples of passages in order of time, each a little longer than its share.  Out:
the same in a row. Where two passages meet, the first one's continuation fades into the second;
between passages the cuer is still.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

_FADE_S = 0.4
"""Seconds over which passages of motion fade into each other."""

_SOUND_FADE_S = 0.01
"""Seconds over which their sounds do: a period of a low voice."""

_STILL_S = 10.0
"""Seconds of a gap that are made at once, for constant memory."""


class Flow:
    """Joins the passages of one performance.

    Parameters
    ----------
    rate_hz : float
        Frames per second.
    fs : int
        Samples per second.
    start : int, optional
        Number of the first frame wanted; by default the first that there is.
    """

    def __init__(self, rate_hz: float, fs: int, start: int | None = None) -> None:
        self.rate_hz = rate_hz
        self.fs = fs
        self.fade_frames = round(_FADE_S * rate_hz)
        self._sound_fade = round(_SOUND_FADE_S * fs)
        self._at = start
        self._tail: tuple[NDArray[np.float64], NDArray[np.float32]] | None = None

    def sample(self, frame: int) -> int:
        """Return the number of the sample at which a frame begins."""
        return round(frame / self.rate_hz * self.fs)

    def join(
        self, first: int, last: int, params: NDArray[np.float64], sound: NDArray[np.float32]
    ) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.float32]]]:
        """Yield (number of the first frame, frames, samples) of the next pieces.

        Parameters
        ----------
        first, last : int
            The frames of the passage: ``first`` not before the last passage's end.
        params : ndarray, shape (last - first + fade_frames, P)
        sound : ndarray of float32
            From ``sample(first)`` to ``sample(last + fade_frames)``.
        """
        held = params[:1] if self._tail is None else self._tail[0][:1]
        at = first if self._at is None else self._at
        while at < first:
            end = min(first, at + max(1, round(_STILL_S * self.rate_hz)))
            silence = np.zeros(self.sample(end) - self.sample(at), dtype=np.float32)
            yield at, np.repeat(held, end - at, axis=0), silence
            at = end
            self._tail = np.repeat(held, self.fade_frames, axis=0), silence[:0]
        if self._tail is not None:
            params = _faded(self._tail[0], params)
            sound = _faded(self._tail[1][: self._sound_fade], sound)
        n, cut = last - first, self.sample(last) - self.sample(first)
        if at < last:
            yield at, params[at - first : n], sound[self.sample(at) - self.sample(first) : cut]
            at = last
        self._tail = params[n:], sound[cut:]
        self._at = at


def _faded(before: NDArray[Any], after: NDArray[Any]) -> NDArray[Any]:
    """Return `after`, its beginning faded in over `before`."""
    n = min(len(before), len(after))
    weight = np.sin(np.linspace(0.0, np.pi / 2, n + 2)[1:-1]) ** 2
    if before.ndim > 1:
        weight = weight[:, None]
    result = after.copy()
    result[:n] = weight * after[:n] + (1 - weight) * before[:n]
    return result
