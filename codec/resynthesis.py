"""Resynthesis: the movements that a score implies, as parameters.

A joined line of phones and the voice's gesture table go in; face, hand, head and forearm come
out at 50 Hz, one frame per tick. Every gesture is a step from target to target along a
minimum-jerk course (Flash and Hogan 1985); steps that overlap add up. The hand leaves before the
sound of its key and arrives shortly after its onset, by the proportions that Attina (2005, chapter
VI) measured; the face moves around the boundaries of phones. The result is a pure function of the
line: sender and receiver compute the same prediction. Specification: spec/bitstream.md, section 5.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cueing import DEFAULT_OPTIONS
from codec.gestures import GestureTable
from codec.joining import Sounding, gaps, keys_of
from codec.score import PLACEMENT_NUMBER
from codec.score_coding import ScorePart
from codec.timeline import TICK_S

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Timing:
    """When gestures move, relative to the sounds; ticks unless said otherwise.

    Attributes
    ----------
    lead, lag : float
        Departure before and arrival after the onset of a key, in lengths of the key.
    vowel_lead, vowel_lag : float
        The same for keys without a consonant.
    shortest, longest : float
        Limits of the length by which lead and lag are scaled.
    shape_share : float
        Part of the movement's duration after which the fingers have their shape.
    rest_delay, rest_duration : float
        When the hand leaves for its rest after the last key's end, and for how long it moves.
    lips : float
        Half the duration of a movement of the face, at most.
    lips_lead : float
        How far the middle of that movement precedes the boundary of phones.
    """

    lead: float = 0.62
    lag: float = 0.10
    vowel_lead: float = 0.46
    vowel_lag: float = 0.21
    shortest: float = 10.0
    longest: float = 22.0
    shape_share: float = 0.9
    rest_delay: float = 5.0
    rest_duration: float = 20.0
    lips: float = 4.0
    lips_lead: float = 1.0


TIMING = Timing()


@dataclass(frozen=True, slots=True)
class Step:
    """A movement of the hand: from `leave` to `arrive` (ticks) towards a shape and placement."""

    leave: float
    arrive: float
    shape: int
    placement: int


def hand_steps(
    line: Sequence[Sounding], parts: Mapping[int, ScorePart], timing: Timing = TIMING
) -> list[Step]:
    """Return the movements of the hand that a line implies, by time of arrival.

    Parameters
    ----------
    line : sequence of Sounding
        From `codec.joining.join`.
    parts : mapping of int to ScorePart
        The parts that were joined.
    timing : Timing

    Returns
    -------
    list of Step
        The first one stands for the state before everything else.
    """
    if not line:
        return [Step(0.0, 1.0, 0, PLACEMENT_NUMBER["rest"])]
    options = next(iter(parts.values())).options if parts else DEFAULT_OPTIONS
    steps = []
    for key in keys_of(list(line), parts, unsure=True):
        start, end = key.start / TICK_S, key.end / TICK_S
        length = min(max(end - start, timing.shortest), timing.longest)
        alone = len(key.phones) == 1 and key.shape == 5
        lead, lag = (timing.vowel_lead, timing.vowel_lag) if alone else (timing.lead, timing.lag)
        placement = PLACEMENT_NUMBER[key.placement]
        steps.append(Step(start - lead * length, start + lag * length, key.shape, placement))
    rest = PLACEMENT_NUMBER["rest"]
    for start, end in gaps(list(line)):
        if (end - start) * TICK_S >= options.rest_gap_s or start == line[0].start:
            leave = start + timing.rest_delay
            steps.append(Step(leave, leave + timing.rest_duration, 0, rest))
    steps.sort(key=lambda step: step.leave)
    return steps or [Step(line[0].start, line[0].start + 1.0, 0, rest)]


def minimum_jerk(phase: Array) -> Array:
    """Return the minimum-jerk course from 0 to 1 over phases 0..1, constant outside.

    Examples
    --------
    >>> minimum_jerk(np.array([-1.0, 0.5, 2.0])).tolist()
    [0.0, 0.5, 1.0]
    """
    u = np.clip(phase, 0.0, 1.0)
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


def follow(times: Array, leave: Array, arrive: Array, targets: Array) -> Array:
    """Return the course through `targets`, shape (T, D).

    Parameters
    ----------
    times : ndarray of float64, shape (T,)
        Ticks.
    leave, arrive : ndarray of float64, shape (N,)
        Times of the steps; those of the first one are not used.
    targets : ndarray of float64, shape (N, D)
        Where each step leads; the course begins at the first one.
    """
    changes = np.diff(targets, axis=0, prepend=0.0)
    duration = np.maximum(arrive - leave, 1.0)
    course = minimum_jerk((times[:, None] - leave) / duration)
    course[:, 0] = 1.0
    return course @ changes


def _hand(
    times: Array, steps: Sequence[Step], table: GestureTable, timing: Timing
) -> tuple[Array, Array]:
    leave = np.array([step.leave for step in steps])
    arrive = np.array([step.arrive for step in steps])
    shapes = [step.shape for step in steps]
    places = [step.placement for step in steps]
    formed = leave + timing.shape_share * (arrive - leave)
    place = table.placement_targets.astype(np.float64)[shapes, places]
    shape = table.shape_targets.astype(np.float64)[shapes]
    return follow(times, leave, formed, shape), follow(times, leave, arrive, place)


def _face(times: Array, line: Sequence[Sounding], table: GestureTable, timing: Timing) -> Array:
    sounds = [s for s in line if s.end > s.start] or [Sounding(0, 0, 1)]
    numbers = [s.number for s in sounds]
    starts = np.array([s.start for s in sounds], dtype=np.float64)
    lengths = np.array([s.end - s.start for s in sounds], dtype=np.float64)
    half = np.minimum(timing.lips, np.minimum(lengths, np.roll(lengths, 1)))
    middle = starts - timing.lips_lead
    targets = table.viseme_targets.astype(np.float64)[numbers]
    return follow(times, middle - half, middle + half, targets)


def resynthesise(
    line: Sequence[Sounding],
    parts: Mapping[int, ScorePart],
    table: GestureTable,
    first_tick: int,
    n_frames: int,
    *,
    timing: Timing = TIMING,
) -> Array:
    """Return the parameters that a line implies.

    Parameters
    ----------
    line : sequence of Sounding
        Joined phones around the wanted frames.
    parts : mapping of int to ScorePart
        The parts that were joined.
    table : GestureTable
        Targets of the voice.
    first_tick, n_frames : int
        Frame i lies at tick ``first_tick + i``.
    timing : Timing

    Returns
    -------
    ndarray of float64, shape (n_frames, P)
        Face, hand, head (neutral) and forearm.
    """
    times = first_tick + np.arange(n_frames, dtype=np.float64)
    shape, place = _hand(times, hand_steps(line, parts, timing), table, timing)
    face = _face(times, line, table, timing)
    neutral = table.neutral_head.astype(np.float64)
    head = np.broadcast_to(neutral, (n_frames, len(neutral)))
    return np.concatenate([face, shape, head, place], axis=1)
