"""The keys that a hand shows, without a transcript.

A line of keys is laid through the frames; this cuer's shapes and placements are
learnt, and the line laid again. Where the first line is surer, it stays.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import PLACEMENT_NUMBER
from synth.capture.cues.appearance import ANYBODYS, KEYS, NOTHING_SHOWN, KeyAppearance, KeyExamples
from synth.capture.cues.features import READ_HZ, HandFeatures
from synth.capture.cues.line import KeyRun, joined, pieces

FloatArray = NDArray[np.float64]

_ROUNDS = 3
"""Rounds of learning looks from the keys and recognising keys by the looks."""

_SURER = 0.2
"""By how many keys more, right less wrong in expectation, the reading before learning must win a
stretch. Of 190 takes (64 of a real cuer, 126 of constructed ones; 78 served no other choice) 15
lost 17 keys by learning and 172 were won; so 10 lose one each and 165 are won."""

_ARRIVED = 1.0 / 7.0
"""Part of its greatest speed at which a movement has ended; the movement that the analysis of real
cuers counts is faster. The last millimetres of a slow end say nothing more."""

_PASSED_S = 0.07
"""A key next to rest that is held no longer is none: the hand comes up, or goes down. Whoever
begins or ends a phrase stays; on 64 takes of a real cuer 0.05 to 0.2 s did the same."""

_AHEAD_S = 0.1
"""A key at the side that is held no longer before one of its shape elsewhere is none either: the
fingers have formed the next shape before the hand sets out. On 64 takes of a real cuer none of 19
such keys up to 0.04 s was right, 7 of 19 up to 0.12 s; whoever cues both stays longer."""


@dataclass(frozen=True, slots=True)
class HeldKey:
    """A key held by the hand.

    Attributes
    ----------
    shape, placement : int
        Numbers; 0 and 0 for rest.
    reach_s, leave_s : float
        When the hand arrives and sets out again, seconds from the first frame.
    confidence : float
        Probability that the key is right, 0 to 1.
    """

    shape: int
    placement: int
    reach_s: float
    leave_s: float
    confidence: float


@dataclass(frozen=True, slots=True)
class Recognised:
    """The recognised keys.

    Attributes
    ----------
    held : tuple of HeldKey
        In order of time, rests too.
    looks : KeyAppearance
        Of this cuer, as learnt.
    shown : KeyExamples
        What they were learnt from in this take.
    """

    held: tuple[HeldKey, ...]
    looks: KeyAppearance
    shown: KeyExamples


def recognise_keys(
    seen: HandFeatures, *, looks: KeyAppearance = ANYBODYS, known: KeyExamples = NOTHING_SHOWN
) -> Recognised:
    """Return the keys that the hand holds, rests too, in order of time.

    Parameters
    ----------
    seen : HandFeatures
    looks : KeyAppearance
        The prior for cuers.
    known : KeyExamples
        What this cuer has shown in other takes.

    Notes
    -----
    A key that repeats its predecessor without a movement looks like a long one. Of the
    right keys of 64 real utterances 21 of 819 stand for two; they are held longer (0.3 s in the
    median, others 0.1 s), yet of those held for more than 0.5 s only 3 of 9 do. Splitting keys by
    their duration would be wrong more often than right, so none is split: a text can.
    """
    before = looks.learnt(known, looks) if known.fingers else looks
    steady = seen.steady()
    plain = lines = [part.line(before) for part in pieces(steady)]
    now, shown = before, NOTHING_SHOWN
    for _ in range(_ROUNDS):
        shown = joined([line.examples(now) for line in lines])
        now = now.learnt(joined([known, shown]), looks)
        lines = [part.line(now) for part in pieces(steady)]
    # Looks by which the take is less likely than before are not hers.
    if sum(line.value for line in lines) < sum(line.value for line in plain):
        now, lines, shown = before, plain, NOTHING_SHOWN
    runs = _surer(*([run for line in some for run in line.runs()] for some in (plain, lines)))
    return Recognised(tuple(_held(seen, _stayed(runs, READ_HZ))), now, shown)


def _surer(plain: list[KeyRun], learnt: list[KeyRun]) -> list[KeyRun]:
    """Return the keys by learnt looks, stretch by stretch unless those before are surer.

    A stretch lies between two keys that both readings have at the same time.
    """
    runs, first, other = list[KeyRun](), 0, 0
    for number, run in enumerate(learnt):
        same = (k for k, one in enumerate(plain[other:], start=other) if _is_same(one, run))
        if (at := next(same, None)) is not None:
            runs += [*_better(plain[other:at], learnt[first:number]), run]
            first, other = number + 1, at + 1
    return runs + _better(plain[other:], learnt[first:])


def _is_same(one: KeyRun, other: KeyRun) -> bool:
    """Whether two runs overlap and hold one key."""
    return one.state == other.state and max(one.begin, other.begin) < min(one.end, other.end)


def _better(plain: list[KeyRun], learnt: list[KeyRun]) -> list[KeyRun]:
    def balance(runs: list[KeyRun]) -> float:
        return sum(2.0 * run.probability - 1.0 for run in runs if run.state)

    return plain if balance(plain) > balance(learnt) + _SURER else learnt


def _held(seen: HandFeatures, runs: list[KeyRun]) -> Iterator[HeldKey]:
    """Yield the keys of runs of frames at `READ_HZ`, timed by the frames of the recording."""
    before, flow = 0, seen.flow()
    for number, run in enumerate(runs):
        shape, place = KEYS[run.state]
        begin, end = own_frames(run.begin, run.end, seen)
        reach = arrival(flow, before, begin, end) if number else begin
        before = end
        yield HeldKey(shape, place, reach / seen.rate_hz, (end - 1) / seen.rate_hz, run.probability)


def own_frames(begin: int, end: int, seen: HandFeatures) -> tuple[int, int]:
    """Return the frames of a recording for some at `READ_HZ`; `end` is the one behind the last."""
    finer = seen.rate_hz / READ_HZ
    first = min(round(begin * finer), len(seen) - 1)
    return first, min(max(round((end - 1) * finer), first), len(seen) - 1) + 1


def _stayed(runs: list[KeyRun], rate_hz: float) -> list[KeyRun]:
    """Return all keys except those passed: next to rest, or with fingers ahead of the hand."""
    rest = KeyRun(0, 0, 0, 1.0)
    return [
        run
        for before, run, after in zip([rest, *runs], runs, [*runs[1:], rest], strict=False)
        if run.end - run.begin > least_held_s(before.state, run.state, after.state) * rate_hz
    ]


def least_held_s(before: int, state: int, after: int) -> float:
    """Return how long the key of a state is held at least between two others, seconds."""
    shape, place = KEYS[state]
    if shape == 0:
        return 0.0
    least = _PASSED_S if before == 0 or after == 0 else 0.0
    if place == PLACEMENT_NUMBER["side"] and KEYS[after][0] == shape:
        least = max(least, _AHEAD_S)
    return least


def arrival(flow: FloatArray, before: int, begin: int, end: int) -> int:
    """Return when the movement to a held key has ended: it is slow, or as slow as it becomes.

    Parameters
    ----------
    flow : ndarray of float64, shape (T,)
        `HandFeatures.flow`; NaN where the hand is not seen.
    before, begin, end : int
        End of the key before; begin and end of this one, frames.

    Notes
    -----
    A hand that slows down and goes on (the palm turns after the tip, the next stroke overlaps) has
    not arrived where it first slowed down.
    """
    known = np.nan_to_num(flow[:end])
    low = min(before, begin)
    at = low + int(known[low : begin + 1].argmax())
    if at == begin:
        # Fingers that are in shape early let a key begin while the hand still gathers speed.
        begin = at = _summit(known, begin)
    slow = np.flatnonzero(known[at:] <= _ARRIVED * known[at])
    return at + int(slow[0]) if len(slow) else begin + int(known[begin:].argmin())


def _summit(flow: FloatArray, begin: int) -> int:
    """Return the frame where a rising speed turns, `begin` where it rises until the last."""
    falls = np.flatnonzero(np.diff(flow[begin:]) <= 0.0)
    return begin + int(falls[0]) if len(falls) else begin
