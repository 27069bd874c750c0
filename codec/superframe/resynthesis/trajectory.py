"""Where hand, head, forearm and face are under way: parameters frame by frame (P4 to P9)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from codec.cuer.movement import Movement
from codec.cues.timeline import TICKS, Sounding
from codec.superframe.merging import MergedScore
from codec.superframe.resynthesis import _kernels
from codec.superframe.resynthesis.movements import Movements, movements
from codec.superframe.resynthesis.targets import PARTS, PARTS_PER_S, Targets

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

COURSES = (1.0, 0.75, 0.55, 0.42)
"""Powers to which the elapsed part of a movement is raised: below 1 its speed peaks early."""

SHIFTS = (0, 3, -3, 6, -6)
"""Shifts of the hand in ticks, earlier than the rule."""

_REACH_TICKS = 22.5
"""Ticks from a phone beyond which it has no say (P7)."""

_RISE_TICKS = 2.5
"""Time constant of the weight's own fall, in ticks (P7)."""

_SHARE_OF_LENGTH = 0.6
"""Share of half its length over which it falls besides (P7)."""

_SILENT_DOMINANCE = 0.05
"""Weight of the pause (P7)."""


def minimum_jerk(phase: Array) -> Array:
    """Return the minimum-jerk course from 0 to 1 over phases 0..1, constant outside.

    Examples
    --------
    >>> minimum_jerk(np.array([-1.0, 0.5, 2.0])).tolist()
    [0.0, 0.5, 1.0]
    """
    u = np.minimum(np.maximum(phase, 0.0), 1.0)
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


class TrajectoryProfile:
    """The hand's course over some frames.

    Parameters
    ----------
    moves : Movements
    movement : Movement
        Of the voice.
    first : int
        Time of the first frame, hundredths of a tick; the others follow tick by tick.
    n_frames : int
    power : float
        Of the superframe's course.
    """

    def __init__(
        self, moves: Movements, movement: Movement, first: int, n_frames: int, power: float = 1.0
    ) -> None:
        self._moves, self._first, self._n_frames = moves, first, n_frames
        self._power = power * movement.power
        self._stroke = PARTS_PER_S * movement.stroke_s

    def moved(
        self,
        held: Array,
        lateness: tuple[Array, Array],
        *,
        distance: Array | None = None,
        arc: Array | None = None,
    ) -> Array:
        """Return where channels are, shape (T, C).

        Parameters
        ----------
        held : ndarray, shape (G, C)
            The held target at the end of each movement.
        lateness : tuple of two ndarray, shape (C,)
            How much later than the movement each channel begins and ends, hundredths of a tick.
        distance, arc : ndarray, shape (G,), (C,), optional
            Length of each stroke, and how far its middle leaves the straight way per unit of it.
        """
        out = np.empty((self._n_frames, held.shape[1]))
        moves = self._moves
        _kernels.moved_into(
            moves.leave, moves.reach, self._first, PARTS, *lateness, self._stroke,
            self._power, held, np.zeros(len(held)) if distance is None else distance,
            np.zeros(held.shape[1]) if arc is None else arc, out,
        )  # fmt: skip
        return out


def held_keys(moves: Movements, movement: Movement, n_keys: int) -> Array:
    """Return the held targets at the end of each movement, as shares of the keys' targets (P6)."""
    held = np.zeros((len(moves.key), n_keys))
    held[np.arange(len(moves.key)), moves.key] = 1.0
    natural = round(PARTS_PER_S * movement.natural_s)
    until = np.append(moves.leave[1:], 1 << 40)
    hurry = np.minimum((natural - (until - moves.leave)) / (0.5 * natural), 1.5)
    undershoot = round(movement.undershoot, 6)
    for g in np.flatnonzero(hurry > 0):
        held[g] += undershoot * hurry[g] * (held[g - 1] - held[g])
    return held


def phone_weights(line: Sequence[Sounding], first_tick: int, n_frames: int, n_phones: int) -> Array:
    """Return the shares of the phones' targets in the face (P7), shape (T, n_phones)."""
    weights = np.zeros((n_frames, n_phones))
    weights[:, 0] = _SILENT_DOMINANCE
    sounds = np.array([(s.number, s.start, s.end) for s in line], dtype=np.int64).reshape(-1, 3)
    _kernels.pull_into(sounds, first_tick, _REACH_TICKS, _RISE_TICKS, _SHARE_OF_LENGTH, weights)
    return weights


class Resynthesis:
    """The movements that a line implies in some frames, in any form that a superframe can name.

    Parameters
    ----------
    joined : MergedScore
        The scores around the wanted frames.
    targets : Targets
        Of the voice.
    first_tick, n_frames : int
        Frame i lies at tick ``first_tick + i``.
    """

    def __init__(
        self, joined: MergedScore, targets: Targets, first_tick: int, n_frames: int
    ) -> None:
        self._rule = targets.movement
        self._moves = movements(joined, self._rule, targets.places, at=first_tick // TICKS)
        weights = phone_weights(joined.line, first_tick, n_frames, len(targets.face))
        face = weights @ targets.face
        self._width = face.shape[1]
        self._still = np.empty((n_frames, self._width + targets.moving.shape[1]))
        self._still[:, : self._width] = face
        self._held = held_keys(self._moves, self._rule, len(targets.hand)) @ targets.moving
        # The arc of a movement is that between its exact targets.
        exact = targets.forearm[self._moves.key]
        self._distance = np.zeros(len(exact))
        self._distance[1:] = np.sqrt(np.square(exact[1:] - exact[:-1]).sum(axis=1))
        self._arc, self._lateness = targets.moving_arc, targets.lateness
        self._first = PARTS * first_tick

    def params(self, *, course: int = 0, shift: int = 0) -> Array:
        """Return face, hand, head and forearm (P4, P8, P9), shape (n_frames, P).

        Parameters
        ----------
        course, shift : int
            Form of the hand's movements, index in `COURSES`, and their time, index in `SHIFTS`.
        """
        first = self._first + PARTS * SHIFTS[shift]
        way = TrajectoryProfile(self._moves, self._rule, first, len(self._still), COURSES[course])
        out = self._still.copy()
        out[:, self._width :] = way.moved(
            self._held, self._lateness, distance=self._distance, arc=self._arc
        )
        return out
