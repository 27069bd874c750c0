"""Which key the cuer holds in each frame, and which phone: labels of a motion made by rule."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.movement import Movement
from codec.cues.phonology import PAUSE, PHONE_NUMBER
from synth.motion.rules.coarticulation import PhoneLine
from synth.motion.rules.movement import Gestures

FloatArray = NDArray[np.float64]

_HELD_PART = 0.3
"""Middle part of a key whose frames are labelled as held."""

_NEAR_PART = 0.15
"""Part of a stroke's time at each end that covers 3 % of its way."""

_SILENT_S = 0.3
"""Least silence in seconds whose frames are labelled as a pause."""


@dataclass(frozen=True, slots=True)
class Labels:
    """The held key of each frame; -1 during movements.

    Attributes
    ----------
    shape, placement, phone : ndarray of int8, shape (T,)
        Hand shape, index into `codec.cues.score.PLACEMENTS`, phone number.
    """

    shape: NDArray[np.int8]
    placement: NDArray[np.int8]
    phone: NDArray[np.int8]


def labels_at(times: FloatArray, g: Gestures, line: PhoneLine, rule: Movement) -> Labels:
    """Return the labels of frames at some times, s.

    Parameters
    ----------
    times : ndarray of float64, shape (T,)
    g : Gestures
    line : PhoneLine
    rule : Movement
        How the fingers move beside the hand.

    Returns
    -------
    Labels
    """
    shape = _held(times, g.leave + rule.fingers_begin_s, g.reach + rule.fingers_end_s, g.shape)
    placement = _held(times, g.leave, g.reach, g.placement)
    phone = np.where(line.silent(times, _SILENT_S), PHONE_NUMBER[PAUSE], -1).astype(np.int8)
    middle, half = 0.5 * (line.start + line.end), 0.5 * _HELD_PART * (line.end - line.start)
    first, last = np.searchsorted(times, middle - half), np.searchsorted(times, middle + half)
    for number in np.flatnonzero(last > first):
        phone[first[number] : last[number]] = line.number[number]
    return Labels(shape, placement, phone)


def _held(
    times: FloatArray, leave: FloatArray, reach: FloatArray, target: NDArray[np.int64]
) -> NDArray[np.int8]:
    """Return the target held at each time, -1 on the way to one.

    A target is held from near the end of its own stroke until the next one has begun in earnest:
    strokes overlap.
    """
    length = reach - leave
    begins = reach - _NEAR_PART * length
    ends = np.append(leave[1:] + _NEAR_PART * length[1:], np.inf)
    current = np.searchsorted(begins, times, side="right") - 1
    there = times < ends[np.maximum(current, 0)]
    return np.where(there & (current >= 0), target[current], -1).astype(np.int8)
