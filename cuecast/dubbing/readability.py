"""Whether what a score implies can be read: figures of its movement, for reports.

The movement is the one that a receiver draws from the score alone, with the voice's own targets:
it needs no motion, and is that of every way to make one up to small differences.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.analysis.readability import HELD_S, Classes, Shown, peak_speed, shown_keys
from codec.bitstream.joining import join
from codec.bitstream.resynthesis.course import Resynthesis
from codec.bitstream.resynthesis.targets import Targets
from codec.bitstream.score_coding import part_of
from codec.cuer.movement import FLOWING
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import PLACEMENTS, SHAPES, Key, Score
from codec.cues.timeline import SUPERFRAME_S, TICK_S, TICKS, to_line

_AT_ONCE = 48
"""Superframes drawn at a time: half a minute."""

_AROUND = 4
"""Superframes known beside them: the hand may be on its way for so long."""

_PHRASE_S = 0.3
"""A gap between keys that does not end a phrase."""


class Seen:
    """Sees a score part by part.

    Parameters
    ----------
    voice : Voice
    options : CueingOptions
        Where charts of the code differ.
    """

    def __init__(self, voice: Voice, options: CueingOptions = DEFAULT_OPTIONS) -> None:
        self._voice, self._options = voice, options
        self._held: list[float] = []
        self._peak = 0.0
        self._apart = [0.0, 0.0]
        self._last: Key | None = None

    def add(self, score: Score | None) -> None:
        """Draw what a further part of a score implies, and look at it."""
        if score is None or not score.keys:
            return
        shown, peak = seen_keys(score, self._voice, self._options)
        self._held += [item.held_s for item in shown]
        self._peak = max(self._peak, peak)
        for key in score.keys:
            before, self._last = self._last, key
            if before is not None and key.start - before.end < _PHRASE_S:
                self._apart[0] += key.start - before.start
                self._apart[1] += 1

    def figures(self) -> dict[str, Any]:
        """Return ``keys``, ``keys_per_s``, ``held_share``, ``hold_p10_s`` and ``peak_m_s``.

        Keys per second are those inside phrases; the share is that of keys that are held for
        `codec.analysis.readability.HELD_S` or more, then the 10th percentile of that time, then
        the greatest speed of a knuckle.
        """
        held = np.array(self._held)
        apart_s, count = self._apart
        return {
            "keys": len(held),
            "keys_per_s": round(count / apart_s, 2) if apart_s else 0.0,
            "held_share": round(float(np.mean(held >= HELD_S - 1e-6)), 4) if len(held) else 1.0,
            "hold_p10_s": round(float(np.percentile(held, 10)), 3) if len(held) else 0.0,
            "peak_m_s": round(self._peak, 2),
        }


def readability(
    score: Score, voice: Voice, options: CueingOptions = DEFAULT_OPTIONS
) -> dict[str, Any]:
    """Return how well the keys of a score can be seen, as `Seen.figures` does."""
    seen = Seen(voice, options)
    seen.add(score)
    return seen.figures()


def in_words(figures: dict[str, Any]) -> str:
    """Return the figures of `readability` in one line."""
    return (
        f"readable: {figures['keys_per_s']} keys/s, {100 * figures['held_share']:.1f} % held for "
        f"{1000 * HELD_S:.0f} ms, a tenth for less than {1000 * figures['hold_p10_s']:.0f} ms, "
        f"peak {figures['peak_m_s']} m/s"
    )


def seen_keys(
    score: Score, voice: Voice, options: CueingOptions = DEFAULT_OPTIONS
) -> tuple[list[Shown], float]:
    """Return how long each key of a score is shown, and the hand's greatest speed, m/s."""
    classes = classes_of(voice)
    shown: list[Shown] = []
    peak = 0.0
    for start_s, end_s, markers, first_s in implied(score, voice, options):
        keys = tuple(key for key in score.keys if start_s <= key.start < end_s)
        if keys:
            shown += shown_keys(
                markers, Score((), keys), classes, rate_hz=1 / TICK_S, start_s=first_s,
                options=options,
            )  # fmt: skip
        peak = max(peak, peak_speed(markers, 1 / TICK_S))
    return shown, peak


def classes_of(voice: Voice) -> Classes:
    """Return the keys of a voice's gesture table, to compare its moving hand with."""
    table, n = voice.gestures, len(SHAPES) * len(PLACEMENTS)
    params = np.zeros((n, len(voice.layout)), dtype=np.float32)
    face = len(voice.face_columns) - table.neutral_head.size
    hand = table.shape_targets.shape[1]
    params[:, face : face + hand] = np.repeat(table.shape_targets, len(PLACEMENTS), axis=0)
    params[:, face + hand : face + hand + table.neutral_head.size] = table.neutral_head
    params[:, face + hand + table.neutral_head.size :] = table.placement_targets.reshape(n, -1)
    markers = voice.reconstruct(params).astype(np.float64)
    return Classes(markers.reshape(len(SHAPES), len(PLACEMENTS), *markers.shape[1:]))


def implied(
    score: Score, voice: Voice, options: CueingOptions = DEFAULT_OPTIONS
) -> Iterator[tuple[float, float, NDArray[np.float32], float]]:
    """Yield what a score looks like, piece by piece.

    Yields
    ------
    start_s, end_s : float
        The stretch that a piece is for.
    markers : ndarray of float32, shape (T, 113, 3)
        At 50 Hz, reaching beyond the stretch on both sides.
    first_s : float
        Time of the first frame.
    """
    line, targets = to_line(score, options), Targets.of(voice, FLOWING)
    begin = int(score.keys[0].start // SUPERFRAME_S) - 1
    end = int(score.keys[-1].end // SUPERFRAME_S) + 2
    for k in range(begin, end, _AT_ONCE):
        last = min(k + _AT_ONCE, end)
        known = {i: part_of(line, i) for i in range(k - _AROUND, last + _AROUND)}
        first_tick = (k - 1) * TICKS
        params = Resynthesis(join(known), targets, first_tick, (last - k + 2) * TICKS).params()
        markers = voice.reconstruct(params)
        yield k * SUPERFRAME_S, last * SUPERFRAME_S, markers, first_tick * TICK_S
