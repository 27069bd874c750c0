"""When the hand moves: the movements that a line of keys implies (P1 to P3)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.bitstream.joining import Joined
from codec.cues.cueing import DEFAULT_OPTIONS
from codec.cues.score import PLACEMENT_NUMBER, PLACEMENTS
from codec.cues.timeline import TICK_S, Sounding

Ints = NDArray[np.int64]

_REST_KEY = PLACEMENT_NUMBER["rest"]

PARTS = 100
"""Movements are timed in whole hundredths of a tick: both ends compute the same numbers."""

_LEAD_PERCENT = 62
_LEAST_LEAD, _MOST_LEAD, _LEAD_FROM_REST = 700, 1200, 2250
_LAG_PERCENT = 16
_SHORTEST_MOVE = 300
_REST_DELAY, _REST_MOVE = 400, 2750


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


def movements(joined: Joined) -> Movements:
    """Return the movements of the hand that a line implies (P1 to P3).

    Parameters
    ----------
    joined : Joined
        From `codec.bitstream.joining.join`.
    """
    line = joined.line
    options = next((part.options for part in joined.parts.values()), DEFAULT_OPTIONS)
    gap = round(options.rest_gap_s / TICK_S) * PARTS
    length = {s.start: s.end - s.start for s in line}
    rows = [(_REST_KEY, -(1 << 40), -(1 << 40))]
    before: tuple[int, int] | None = None
    for key in joined.every:
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
