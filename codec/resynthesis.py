"""Resynthesis: the movements that a score implies, as parameters.

A joined line of phones and the targets of a voice go in; face, hand, head and forearm come out
at 50 Hz, one frame per tick. The hand moves from key to key along a minimum-jerk course (Flash
and Hogan 1985): it leaves before the sound of its key, by the share of the distance between keys
that Attina (2005, chapter VI) measured, and arrives in the first part of the consonant; targets
that are left early are not quite reached. The face is the mean of the targets of nearby phones,
weighted by dominances that fall off with time (Cohen and Massaro 1993). The result is a pure
function of the line: sender and receiver compute the same prediction.
Specification: spec/bitstream.md, section 5.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from codec.cueing import DEFAULT_OPTIONS
from codec.errors import VoiceError
from codec.gestures import GestureTable
from codec.joining import Parts, keys_of
from codec.phonology import PHONES
from codec.score import PLACEMENT_NUMBER, PLACEMENTS, SHAPES
from codec.timeline import TICK_S, Sounding

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

N_KEYS = len(SHAPES) * len(PLACEMENTS)
_REST_KEY = PLACEMENT_NUMBER["rest"]

PARTS = 100
"""Movements are timed in whole hundredths of a tick: both ends compute the same numbers."""

_LEAD_PERCENT = 62
_LEAST_LEAD, _MOST_LEAD, _LEAD_FROM_REST = 700, 1200, 2250
_LAG_PERCENT = 16
_SHORTEST_MOVE = 300
_REST_DELAY, _REST_MOVE = 400, 2750
_FINGERS_EARLIER = 150
_NATURAL = 1250
_UNDERSHOOT = 0.13

COURSES = (1.0, 0.75, 0.55, 0.42)
"""Powers to which the elapsed part of a movement is raised: below 1 its speed peaks early."""

SHIFTS = (0, 3, -3, 6, -6)
"""Ticks by which the hand can be earlier than the rule says."""

_REACH_TICKS = 22.5
_RISE_TICKS = 2.5
_SHARE_OF_LENGTH = 0.6
_SILENT_DOMINANCE = 0.05


@dataclass(frozen=True, slots=True)
class Targets:
    """Where the parameters of a voice go for each key and phone.

    Attributes
    ----------
    hand, head, forearm : ndarray of float64, shape (54, 12), (54, nmF), (54, nmH)
        Parameters when a key is held; key number = 6 shape + placement.
    arc : ndarray of float64, shape (nmH,)
        Forearm parameters by which the middle of a movement leaves the straight line, per unit
        of distance between its ends.
    face : ndarray of float64, shape (38, 7)
        Parameters of each phone.
    """

    hand: Array
    head: Array
    forearm: Array
    arc: Array
    face: Array

    def __post_init__(self) -> None:
        for item in fields(self):
            array = np.ascontiguousarray(getattr(self, item.name), dtype=np.float64)
            rows = {"face": len(PHONES), "arc": self.forearm.shape[-1]}.get(item.name, N_KEYS)
            if len(array) != rows or not np.isfinite(array).all():
                raise VoiceError(f"targets: {item.name} has shape {array.shape}, not {rows} rows")
            object.__setattr__(self, item.name, array)

    @classmethod
    def of(cls, table: GestureTable) -> "Targets":
        """Return the exact targets of a gesture table, reached on straight lines."""
        n_forearm = table.placement_targets.shape[-1]
        return cls(
            np.repeat(table.shape_targets, len(PLACEMENTS), axis=0).astype(np.float64),
            np.tile(table.neutral_head, (N_KEYS, 1)).astype(np.float64),
            table.placement_targets.reshape(N_KEYS, n_forearm).astype(np.float64),
            np.zeros(n_forearm),
            table.viseme_targets.astype(np.float64),
        )


@dataclass(frozen=True, slots=True)
class Movements:
    """The movements of the hand, the rest before everything first.

    Attributes
    ----------
    key : ndarray of int64, shape (G,)
        Number of the key that each one leads to.
    leave, reach : ndarray of int64, shape (G,)
        Hundredths of a tick; ascending, ``leave[g] >= reach[g - 1]``.
    """

    key: Ints
    leave: Ints
    reach: Ints


def movements(line: Sequence[Sounding], parts: Parts) -> Movements:
    """Return the movements of the hand that a line implies (P1 to P3).

    Parameters
    ----------
    line : sequence of Sounding
        From `codec.joining.join`.
    parts : mapping of int to ScorePart or Window
        The parts that were joined.
    """
    options = next(iter(parts.values())).options if parts else DEFAULT_OPTIONS
    gap = round(options.rest_gap_s / TICK_S) * PARTS
    length = {s.start: s.end - s.start for s in line}
    rows = [(_REST_KEY, -(1 << 40), -(1 << 40))]
    before: tuple[int, int] | None = None
    for key in keys_of(list(line), parts, unsure=True):
        tick = round(key.start / TICK_S)
        start, end = tick * PARTS, round(key.end / TICK_S) * PARTS
        rested = before is None or (
            start - before[1] >= gap and not _untold(before[1], start, line)
        )
        if rested:
            lead = _LEAD_FROM_REST
            if before is not None:
                lead = min(lead, (start - before[1]) // 2)
                rows.append(_to_rest(before[1], start - lead))
        else:
            assert before is not None
            away = _LEAD_PERCENT * ((start - before[0]) // PARTS)
            lead = min(max(away, _LEAST_LEAD), _MOST_LEAD)
        lag = _LAG_PERCENT * length.get(tick, 0) if len(key.phones) == 2 else 0
        leave = max(start - lead, rows[-1][2])
        number = len(PLACEMENTS) * key.shape + PLACEMENT_NUMBER[key.placement]
        rows.append((number, leave, max(start + lag, leave + _SHORTEST_MOVE)))
        before = start, end
    if before is not None:
        rows.append(_to_rest(before[1], 1 << 40))
    keys, leaves, reaches = (np.array(column, dtype=np.int64) for column in zip(*rows, strict=True))
    # A movement to rest may be due before the last key was reached.
    for g in range(1, len(rows)):
        leaves[g] = max(leaves[g], reaches[g - 1])
        reaches[g] = max(reaches[g], leaves[g] + 1)
    return Movements(keys, leaves, reaches)


def _untold(begin: int, end: int, line: Sequence[Sounding]) -> bool:
    """Return whether a superframe was lost between two times, so that silence is not known."""
    return any(
        s.open_start and s.open_end and begin <= PARTS * s.start and PARTS * s.end <= end
        for s in line
    )


def _to_rest(end: int, before: int) -> tuple[int, int, int]:
    leave = end + _REST_DELAY
    return _REST_KEY, leave, max(min(leave + _REST_MOVE, before), leave + _SHORTEST_MOVE)


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
    at = _Place.of(moves, PARTS * (first_tick + np.arange(n_frames, dtype=np.int64)))
    fingers, part = at.progress(0)
    start, goal = held[at.before], held[at.number]
    return KeyWeights(
        start + fingers[:, None] * (goal - start),
        start + part[:, None] * (goal - start),
        4.0 * part * (1.0 - part),
        np.stack([moves.key[at.before], moves.key[at.number]], axis=1),
    )


def _held(moves: Movements) -> Array:
    """Return what is held at the end of each movement, as shares of the keys' targets (P6)."""
    held = np.zeros((len(moves.key), N_KEYS))
    held[np.arange(len(moves.key)), moves.key] = 1.0
    until = np.append(moves.leave[1:], 1 << 40)
    hurry = np.clip((_NATURAL - (until - moves.leave)) / (0.5 * _NATURAL), 0.0, 1.5)
    for g in np.flatnonzero(hurry > 0):
        held[g] += _UNDERSHOOT * hurry[g] * (held[g - 1] - held[g])
    return held


@dataclass(frozen=True, slots=True)
class _Place:
    """Where some frames lie among movements: under way from one's end to the next one's."""

    number: Ints
    before: Ints
    carried: Array
    fingered: Array

    @classmethod
    def of(cls, moves: Movements, times: Ints) -> "_Place":
        number = np.searchsorted(moves.leave, times, side="right") - 1
        elapsed, duration = times - moves.leave[number], (moves.reach - moves.leave)[number]
        sooner = np.maximum(duration - _FINGERS_EARLIER, duration / 2)
        arrived = number == 0
        carried = np.where(arrived, 1.0, np.minimum(elapsed / np.maximum(duration, 1), 1.0))
        fingered = np.where(arrived, 1.0, np.minimum(elapsed / np.maximum(sooner, 1), 1.0))
        return cls(number, np.maximum(number - 1, 0), carried, fingered)

    def progress(self, course: int) -> tuple[Array, Array]:
        """Return the progress of fingers and carrier (P5)."""
        phase = np.concatenate([self.fingered, self.carried])
        done = minimum_jerk(phase ** COURSES[course] if course else phase)
        return done[: len(done) // 2], done[len(done) // 2 :]


def phone_weights(line: Sequence[Sounding], first_tick: int, n_frames: int) -> Array:
    """Return the shares of the phones' targets in the face (P7), shape (T, 38)."""
    times = first_tick + np.arange(n_frames, dtype=np.float64)[:, None]
    last = first_tick + n_frames - 1
    near = [
        s for s in line
        if s.number and s.end > first_tick - _REACH_TICKS and s.start < last + _REACH_TICKS
    ]  # fmt: skip
    weights = np.zeros((n_frames, len(PHONES)))
    weights[:, 0] = _SILENT_DOMINANCE
    if near:
        start = np.array([s.start for s in near], dtype=np.float64)
        end = np.array([s.end for s in near], dtype=np.float64)
        half = 0.5 * (end - start)
        away = np.abs(times - 0.5 * (start + end))
        fade = np.clip((away - half) / np.maximum(_REACH_TICKS - half, _RISE_TICKS), 0.0, 1.0)
        scale = _SHARE_OF_LENGTH * half + _RISE_TICKS
        pull = np.exp(-((away / scale) ** 1.5)) * (1.0 - fade) ** 2
        for column, sound in enumerate(near):
            weights[:, sound.number] += pull[:, column]
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


class Resynthesis:
    """The movements that a line implies in some frames, in any form that a superframe can name.

    Parameters
    ----------
    line : sequence of Sounding
        Joined phones around the wanted frames.
    parts : mapping of int to ScorePart or Window
        The parts that were joined.
    targets : Targets
        Of the voice.
    first_tick, n_frames : int
        Frame i lies at tick ``first_tick + i``.
    """

    def __init__(
        self,
        line: Sequence[Sounding],
        parts: Parts,
        targets: Targets,
        first_tick: int,
        n_frames: int,
    ) -> None:
        self._moves = movements(line, parts)
        self._face = phone_weights(line, first_tick, n_frames) @ targets.face
        carried = np.concatenate([targets.head, targets.forearm], axis=1)
        held = _held(self._moves)
        self._hand, self._carried = held @ targets.hand, held @ carried
        # The arc of a movement is that between its exact targets.
        exact = targets.forearm[self._moves.key]
        self._distance = np.sqrt(np.square(np.diff(exact, axis=0, prepend=exact[:1])).sum(axis=1))
        self._arc = np.concatenate([np.zeros(targets.head.shape[1]), targets.arc])
        self._times = PARTS * (first_tick + np.arange(n_frames, dtype=np.int64))
        self._places: dict[int, _Place] = {}

    def params(self, *, course: int = 0, shift: int = 0) -> Array:
        """Return face, hand, head and forearm (P4, P8, P9), shape (n_frames, P).

        Parameters
        ----------
        course, shift : int
            Form of the hand's movements, index in `COURSES`, and their time, index in `SHIFTS`.
        """
        if shift not in self._places:
            self._places[shift] = _Place.of(self._moves, self._times + PARTS * SHIFTS[shift])
        at = self._places[shift]
        fingers, part = at.progress(course)
        start, goal = self._hand[at.before], self._hand[at.number]
        hand = start + fingers[:, None] * (goal - start)
        start, goal = self._carried[at.before], self._carried[at.number]
        bend = 4.0 * part * (1.0 - part) * self._distance[at.number]
        carried = start + part[:, None] * (goal - start) + bend[:, None] * self._arc
        return np.concatenate([self._face, hand, carried], axis=1)
