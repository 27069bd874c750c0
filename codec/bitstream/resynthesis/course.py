"""Where hand, head, forearm and face are under way: parameters frame by frame (P4 to P9)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.bitstream.joining import Joined
from codec.bitstream.resynthesis import _kernels
from codec.bitstream.resynthesis.movements import PARTS, Movements, movements
from codec.bitstream.resynthesis.targets import N_KEYS, Targets
from codec.cues.phonology import PHONES
from codec.cues.timeline import Sounding

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

COURSES = (1.0, 0.75, 0.55, 0.42)
"""Powers to which the elapsed part of a movement is raised: below 1 its speed peaks early."""

SHIFTS = (0, 3, -3, 6, -6)
"""Ticks by which the hand can be earlier than the rule says."""

_FINGERS_EARLIER = 150.0
_NATURAL = 1250
_UNDERSHOOT = 0.13

_REACH_TICKS = 22.5
_RISE_TICKS = 2.5
_SHARE_OF_LENGTH = 0.6
_SILENT_DOMINANCE = 0.05


def minimum_jerk(phase: Array) -> Array:
    """Return the minimum-jerk course from 0 to 1 over phases 0..1, constant outside.

    Examples
    --------
    >>> minimum_jerk(np.array([-1.0, 0.5, 2.0])).tolist()
    [0.0, 0.5, 1.0]
    """
    u = np.minimum(np.maximum(phase, 0.0), 1.0)
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


@dataclass(frozen=True, slots=True)
class KeyWeights:
    """How far the hand is at each key, frame by frame: the linear part of the prediction.

    Attributes
    ----------
    fingers, carrier : ndarray of float64, shape (T, 54)
        Shares of the keys' targets in hand shape, and in forearm and head; rows sum to 1.
    bend : ndarray of float64, shape (T,)
        0 at the ends of a movement, 1 in its middle.
    ends : ndarray of int64, shape (T, 2)
        Keys between which the hand moves.
    """

    fingers: Array
    carrier: Array
    bend: Array
    ends: Ints


def key_weights(moves: Movements, first_tick: int, n_frames: int) -> KeyWeights:
    """Return the weights of the keys' targets in frames at `first_tick` and after (P5, P6)."""
    held = _held(moves)
    goal, progress = _progress(moves, PARTS * first_tick, n_frames, COURSES[0])
    start = np.maximum(goal - 1, 0)
    fingers, part = progress.T
    return KeyWeights(
        held[start] + fingers[:, None] * (held[goal] - held[start]),
        held[start] + part[:, None] * (held[goal] - held[start]),
        4.0 * part * (1.0 - part),
        np.stack([moves.key[start], moves.key[goal]], axis=1),
    )


def _held(moves: Movements) -> Array:
    """Return what is held at the end of each movement, as shares of the keys' targets (P6)."""
    held = np.zeros((len(moves.key), N_KEYS))
    held[np.arange(len(moves.key)), moves.key] = 1.0
    until = np.append(moves.leave[1:], 1 << 40)
    hurry = np.minimum((_NATURAL - (until - moves.leave)) / (0.5 * _NATURAL), 1.5)
    for g in np.flatnonzero(hurry > 0):
        held[g] += _UNDERSHOOT * hurry[g] * (held[g - 1] - held[g])
    return held


def _progress(moves: Movements, first: int, n_frames: int, power: float) -> tuple[Ints, Array]:
    """Return the movement under way in each frame, and how far fingers and carrier are (P5).

    `first` is the time of the first frame in hundredths of a tick.
    """
    number, progress = np.empty(n_frames, dtype=np.int64), np.empty((n_frames, 2))
    _kernels.progress_into(
        moves.leave, moves.reach, first, PARTS, _FINGERS_EARLIER, power, number, progress
    )
    return number, progress


def phone_weights(line: Sequence[Sounding], first_tick: int, n_frames: int) -> Array:
    """Return the shares of the phones' targets in the face (P7), shape (T, 38)."""
    weights = np.zeros((n_frames, len(PHONES)))
    weights[:, 0] = _SILENT_DOMINANCE
    sounds = np.array([(s.number, s.start, s.end) for s in line], dtype=np.int64).reshape(-1, 3)
    _kernels.pull_into(sounds, first_tick, _REACH_TICKS, _RISE_TICKS, _SHARE_OF_LENGTH, weights)
    return weights


class Resynthesis:
    """The movements that a line implies in some frames, in any form that a superframe can name.

    Parameters
    ----------
    joined : Joined
        The scores around the wanted frames.
    targets : Targets
        Of the voice.
    first_tick, n_frames : int
        Frame i lies at tick ``first_tick + i``.
    """

    def __init__(self, joined: Joined, targets: Targets, first_tick: int, n_frames: int) -> None:
        self._moves = movements(joined)
        face = phone_weights(joined.line, first_tick, n_frames) @ targets.face
        self._width = face.shape[1]
        moving = targets.hand.shape[1] + targets.carried.shape[1]
        self._still = np.empty((n_frames, self._width + moving))
        self._still[:, : self._width] = face
        held = _held(self._moves)
        self._hand, self._carried = held @ targets.hand, held @ targets.carried
        # The arc of a movement is that between its exact targets.
        exact = targets.forearm[self._moves.key]
        self._distance = np.zeros(len(exact))
        self._distance[1:] = np.sqrt(np.square(exact[1:] - exact[:-1]).sum(axis=1))
        self._arc = targets.carried_arc
        self._first = PARTS * first_tick

    def params(self, *, course: int = 0, shift: int = 0) -> Array:
        """Return face, hand, head and forearm (P4, P8, P9), shape (n_frames, P).

        Parameters
        ----------
        course, shift : int
            Form of the hand's movements, index in `COURSES`, and their time, index in `SHIFTS`.
        """
        first = self._first + PARTS * SHIFTS[shift]
        number, progress = _progress(self._moves, first, len(self._still), COURSES[course])
        out = self._still.copy()
        _kernels.course_into(
            number, progress, self._hand, self._carried, self._distance, self._arc,
            out[:, self._width :],
        )  # fmt: skip
        return out
