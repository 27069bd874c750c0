"""Whether a cuer can be read: one meter for all that moves, sent or received.

`VisibilityMeter` measures the motion itself, part by part in constant memory: synthesised,
joined, read from a file or received. `cuecast evaluate readability` and the reports of ``dub``,
``keys`` and ``synth`` state its figures.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.analysis.readability import (
    HELD_S,
    Classes,
    Shown,
    classes_of,
    keys_shown_at,
    peak_speed_of,
)
from codec.cuer import layout
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import Key, Score
from cuecast.dubbing.motions import MotionSource
from synth.planning.prosody.simulation import CLAIRE, RATE_HZ, PerformerChoice, mirror_of

FloatArray = NDArray[np.float64]

PICTURES_S = 0.12
"""Three pictures at 25 a second, whenever the first one is taken."""

_AT_ONCE_S = 30.0
"""Motion that is looked at together."""

_AROUND_S = 1.2
"""Motion that is looked at with a key, before and after it."""

_WINDOW = 256
"""Frames that a source is asked for at once."""

_PHRASE_S = 0.3
"""A gap between keys that does not end a phrase."""

_SAME_S = 1e-6
"""Seconds within which times count as the same."""


class VisibilityMeter:
    """Looks at a moving cuer.

    Parameters
    ----------
    classes : Classes
        Of the cuer.
    rate_hz : float
        Frames per second of her motion.
    options : CueingOptions
        Which gaps between keys return to rest.
    """

    def __init__(
        self, classes: Classes, rate_hz: float, options: CueingOptions = DEFAULT_OPTIONS
    ) -> None:
        self._classes, self._rate_hz, self._options = classes, rate_hz, options
        self._parts: list[tuple[FloatArray, ...]] = []  # hand, distances from shapes, places
        self._start_s = self._end_s = 0.0
        self._waiting: list[Key] = []
        self._looked_s = 0.0
        self._peak = 0.0
        self.shown: list[Shown] = []
        """Every key so far, and how long it is shown."""

    def add(self, markers: NDArray[np.floating], start_s: float, keys: Iterable[Key] = ()) -> None:
        """Look at further motion.

        Parameters
        ----------
        markers : ndarray, shape (T, 113, 3)
            Millimetres; follows the markers added before.
        start_s : float
            Time of the first frame, seconds.
        keys : iterable of Key
            Further keys, in order of time; none began more than a second before this motion.
        """
        self.add_hand(self._classes.seen_from_head(markers), start_s, keys)

    def add_hand(self, hand: FloatArray, start_s: float, keys: Iterable[Key] = ()) -> None:
        """Look at further motion of a hand (T, 50, 3) as seen from the head, otherwise as `add`."""
        if not self._parts:
            self._start_s = self._looked_s = start_s
        if len(hand):
            self._parts.append((hand, *self._classes.distances_of(hand)))
            self._end_s = start_s + len(hand) / self._rate_hz
        self._waiting += keys
        if self._end_s - self._looked_s > _AT_ONCE_S:
            self._look(self._end_s - _AROUND_S)

    def figures(self) -> dict[str, Any]:
        """Return the figures of all that was seen.

        They are ``keys``, ``keys_per_s``, ``most_keys_per_s``, ``held_share``,
        ``three_pictures_share``, ``hold_p10_s`` and ``peak_m_s``. Keys per second are those inside
        phrases, and the most in any 3 s; the shares are those of keys that are held for
        `codec.analysis.readability.HELD_S` or more, and that three of 25 pictures a second show
        whenever they are taken; then the 10th percentile of that time, then the greatest speed of
        a knuckle.
        """
        self._look(np.inf)
        held = np.array([item.held_s for item in self.shown])
        return {
            "keys": len(held),
            "keys_per_s": round(keys_per_s([item.key for item in self.shown]), 2),
            "most_keys_per_s": round(most_keys_per_s([item.key for item in self.shown]), 2),
            "held_share": round(share_held(held, HELD_S), 4),
            "three_pictures_share": round(share_held(held, PICTURES_S), 4),
            "hold_p10_s": round(float(np.percentile(held, 10)), 3) if len(held) else 0.0,
            "peak_m_s": round(self._peak, 2),
        }

    def _look(self, until_s: float) -> None:
        """Measure all keys that end before a time, and drop frames that the next do not need."""
        if not self._parts:
            return
        hand, shapes, placements = map(np.concatenate, zip(*self._parts, strict=True))
        ready = [key for key in self._waiting if key.end <= until_s]
        self._waiting = self._waiting[len(ready) :]
        if ready:
            self.shown += keys_shown_at(
                shapes,
                placements,
                Score((), tuple(ready)),
                rate_hz=self._rate_hz,
                start_s=self._start_s,
                options=self._options,
            )
        self._peak = max(self._peak, peak_speed_of(hand, self._rate_hz))
        needed_s = self._end_s - 2 * _AROUND_S
        if self._waiting:
            needed_s = min(needed_s, self._waiting[0].start - _AROUND_S)
        first = int(np.clip((needed_s - self._start_s) * self._rate_hz, 0, len(hand) - 1))
        self._parts = [(hand[first:], shapes[first:], placements[first:])]
        self._start_s += first / self._rate_hz
        self._looked_s = self._end_s


def keys_per_s(keys: Sequence[Key]) -> float:
    """Return keys per second inside phrases, 0 if there are none."""
    apart = [
        other.start - one.start
        for one, other in itertools.pairwise(keys)
        if other.start - one.end < _PHRASE_S
    ]
    return len(apart) / sum(apart) if apart else 0.0


def most_keys_per_s(keys: Sequence[Key], span_s: float = 3.0) -> float:
    """Return the most keys per second that begin within any `span_s`."""
    starts = np.array([key.start for key in keys])
    until = np.searchsorted(starts, starts + span_s - _SAME_S)
    return float((until - np.arange(len(starts))).max() / span_s) if len(keys) else 0.0


def share_held(held: NDArray[np.floating], least_s: float) -> float:
    """Return the share of keys that are held so long; 1 if there are none."""
    return float(np.mean(held >= least_s - _SAME_S)) if len(held) else 1.0


def watched_plan(
    score: Score, performing: PerformerChoice = CLAIRE, options: CueingOptions = DEFAULT_OPTIONS
) -> VisibilityMeter:
    """Return the visibility of a score in a rule-based performance.

    The hand is the cuer's own: no model of it is fitted.
    """
    mirror = mirror_of(performing, options)
    seen = VisibilityMeter(mirror.classes, RATE_HZ, options)
    for start_s, frames in _windows(seen, score, RATE_HZ):
        seen.add_hand(mirror.performer.hand(score, start_s, frames), start_s)
    return seen


def watched(
    source: MotionSource, voice: Voice, options: CueingOptions = DEFAULT_OPTIONS
) -> VisibilityMeter:
    """Return the visibility of a score in its motion."""
    seen = VisibilityMeter(classes_of(voice), source.rate_hz, options)
    for start_s, frames in _windows(seen, source.score, source.rate_hz):
        seen.add(voice.reconstruct(source.window(start_s, frames).params), start_s)
    return seen


def _windows(seen: VisibilityMeter, score: Score, rate_hz: float) -> Iterator[tuple[float, int]]:
    """Announce the keys of a score to a meter, and yield start and frames of parts around them."""
    if not score.keys:
        return
    seen.add_hand(np.zeros((0, layout.N_HAND, 3)), 0.0, score.keys)
    first = int(max(0.0, score.keys[0].start - _AROUND_S) * rate_hz)
    last = int((score.keys[-1].end + _AROUND_S) * rate_hz)
    for at in range(first, last, _WINDOW):
        yield at / rate_hz, min(_WINDOW, last - at)


def in_words(figures: dict[str, Any]) -> str:
    """Return the figures of `VisibilityMeter` in one line."""
    return (
        f"readable: {figures['keys_per_s']} keys/s, at most {figures['most_keys_per_s']} in 3 s, "
        f"{100 * figures['held_share']:.1f} % held for "
        f"{1000 * HELD_S:.0f} ms, {100 * figures['three_pictures_share']:.1f} % in three pictures, "
        f"a tenth for less than {1000 * figures['hold_p10_s']:.0f} ms, "
        f"peak {figures['peak_m_s']} m/s"
    )
