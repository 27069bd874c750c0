"""Pieces of motion in any order to one motion on a constant grid, gaps concealed.

Events go in; `Assembler.motion` gives a `Motion` with its score. Where nothing arrived at all
(before the lock, after a loss) the last frame is held and both ends are joined by a minimum-jerk
blend, so that the cuer never jumps.
"""

from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Key, Phone, Score
from codec.errors import CueError
from receiver.reception.events import Event, KeysFound, MotionPiece

_Timed = TypeVar("_Timed", Phone, Key)

BLEND_S = 0.3
"""Length of the movement back to known motion after a gap."""


class Assembler:
    """Collects a receiver's events into a motion.

    Parameters
    ----------
    voice : Voice
        That of the receiver.
    """

    def __init__(self, voice: Voice) -> None:
        self._voice = voice
        self._pieces: dict[tuple[int, int], MotionPiece] = {}
        self._keys: dict[int, Key] = {}

    def add(self, event: Event) -> None:
        """Take an event; all but motion and certain keys are passed over."""
        if isinstance(event, MotionPiece):
            name = (event.epoch, round(event.start_s * event.rate_hz))
            known = self._pieces.get(name)
            if known is None or len(event.layers) >= len(known.layers):
                self._pieces[name] = event
        elif isinstance(event, KeysFound) and event.final:
            self._keys |= {round(key.start * 100): key for key in event.keys}

    def motion(self) -> Motion:
        """Return all that was received, from the first frame to the last.

        Raises
        ------
        CueError
            If no motion was received.
        """
        if not self._pieces:
            raise CueError("no motion was received")
        pieces = sorted(self._pieces.values(), key=lambda piece: (piece.epoch, piece.start_s))
        rate_hz = pieces[0].rate_hz
        start_s = min(piece.start_s for piece in pieces)
        n_frames = max(round((p.end_s - start_s) * rate_hz) for p in pieces)
        params = np.zeros((n_frames, len(self._voice.layout)), dtype=np.float32)
        known = np.zeros(n_frames, dtype=bool)
        for piece in pieces:
            at = round((piece.start_s - start_s) * rate_hz)
            params[at : at + len(piece.params)] = piece.params[: n_frames - at]
            known[at : at + len(piece.params)] = True
        bridge(params, known, rate_hz)
        return Motion(
            params, rate_hz, start_s, self._voice.layout, self._voice.identity, self._score()
        )

    def _score(self) -> Score:
        phones = {
            round(phone.start * 100): phone
            for piece in self._pieces.values()
            for phone in piece.phones
        }
        return Score(_sorted(phones.values()), _sorted(self._keys.values()))


def _sorted(line: Iterable[_Timed]) -> tuple[_Timed, ...]:
    return tuple(sorted(line, key=lambda item: item.start))


def bridge(params: NDArray[np.float32], known: NDArray[np.bool_], rate_hz: float) -> None:
    """Fill unknown frames in place: hold, then move to the next known frame.

    Parameters
    ----------
    params : ndarray, shape (T, P)
    known : ndarray of bool, shape (T,)
    rate_hz : float

    Examples
    --------
    >>> params = np.array([[1.0], [0], [0], [0], [3.0]], np.float32)
    >>> bridge(params, np.array([True, False, False, False, True]), rate_hz=10)
    >>> [round(float(x), 2) for x in params.ravel()]
    [1.0, 1.0, 1.42, 2.58, 3.0]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[True], known, [True]]).astype(np.int8)))
    for first, end in edges.reshape(-1, 2):
        before = params[first - 1] if first > 0 else params[end]
        after = params[end] if end < len(params) else before
        length = min(end - first + 1, max(2, round(BLEND_S * rate_hz)))
        phase = np.clip((np.arange(first, end) - (end - length)) / length, 0, 1)
        share = (10 * phase**3 - 15 * phase**4 + 6 * phase**5)[:, None]
        params[first:end] = before + share * (after - before)
