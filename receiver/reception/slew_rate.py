"""Limit the speed of the hand to one that a reader can follow.

Coarse strokes of a superframe, and joins of superframes with different trajectories, can move the
hand faster than the sender did. The hand shown takes the same way, at most at `FASTEST_M_S`, and
catches up in the next frames. Frames that are slow enough stay as
they are, to the bit.
"""

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.voice import Voice

FASTEST_M_S = 1.42
"""Metres per second of a knuckle against the head; 1.5 are asked of a cuer."""

_JUMP_MM = 60.0
"""Longest step of a stroke from frame to frame: a longer one is a splice, shown as it is."""

_TRIES = 3
"""Times a step is shortened: a turning hand does not move in proportion to its parameters."""

_KNUCKLES = layout.marker_indices(layout.KNUCKLES[1:])
_OF_HAND = _KNUCKLES - layout.N_FACE
_HEAD = layout.marker_indices(layout.RIGID_FACE)

_HEAD_MM = 5.0
"""Movement of the head from frame to frame that is allowed for without measuring it."""


class SlewRateLimiter:
    """Bounds the speed of the hand.

    Parameters
    ----------
    voice : Voice
    rate_hz : float
        Frames per second.
    """

    def __init__(self, voice: Voice, rate_hz: float) -> None:
        self._voice, self._columns = voice, voice.hand_columns
        self._most_mm = 1000.0 * FASTEST_M_S / rate_hz

    def calmed(
        self, params: NDArray[np.float32], before: NDArray[np.float32] | None = None
    ) -> NDArray[np.float32]:
        """Return parameters whose hand is never too fast.

        Parameters
        ----------
        params : ndarray of float32, shape (T, P)
        before : ndarray of float32, shape (P,), optional
            The frame that was shown before the first one.
        """
        line = params if before is None else np.concatenate([before[None], params])
        hand = line[:, self._columns]
        plain = self._voice.hand.reconstruct(hand.astype(np.float64))[:, _OF_HAND]
        if _ways(plain[:-1], plain[1:]).max(initial=0.0) <= self._most_mm - _HEAD_MM:
            return params
        skull = self._voice.reconstruct(line[:1])[0, _HEAD].astype(np.float64)
        at = self._knuckles(line, skull)
        steps = _ways(at[:-1], at[1:])
        if steps.max(initial=0.0) <= self._most_mm:
            return params
        out = line.copy()
        for t in np.flatnonzero(steps <= _JUMP_MM) + 1:
            share = 1.0
            for _ in range(_TRIES):
                way_mm = float(_ways(at[t - 1], at[t]))
                if way_mm <= self._most_mm:
                    break
                # The way is not linear in the parameters: the share of the step is corrected by the
                # way made.
                share *= self._most_mm / way_mm
                going = out[t - 1, self._columns] + share * (hand[t] - out[t - 1, self._columns])
                out[t, self._columns] = going
                at[t] = self._knuckles(out[[t]], skull)[0]
        return out[len(line) - len(params) :]

    def _knuckles(
        self, params: NDArray[np.float32], skull: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the knuckles as seen from the head, whose markers come to lie on `skull`, mm."""
        markers = self._voice.reconstruct(params).astype(np.float64)
        head, _ = rigid.estimate_motion(skull, markers[:, _HEAD], rounds=1)
        return rigid.inverse_rigid_motion(markers[:, _KNUCKLES], head)


def _ways(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the longest way of a knuckle, shape (T,)."""
    return np.asarray(np.linalg.norm(other - one, axis=-1).max(axis=-1))
