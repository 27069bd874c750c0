"""When the hand moves: the movements that a line of keys implies (P1 to P3)."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codec.cuer.movement import FLOWING, Movement
from codec.cues.timeline import TICK_S, Sounding
from codec.superframe.merging import MergedScore, options_at
from codec.superframe.resynthesis.targets import PARTS, PARTS_PER_S

Ints = NDArray[np.int64]
Places = NDArray[np.float64]

_REST_KEY = 0
"""Number of the key at rest, which no phone has."""


@dataclass(frozen=True, slots=True)
class Movements:
    """The movements of the hand, the rest before everything first.

    Attributes
    ----------
    key : ndarray of int64, shape (G,)
        Number of the key that each one leads to.
    leave, reach : ndarray of int64, shape (G,)
        Hundredths of a tick; `reach` ascends. Strokes overlap as far as the voice's movement says.
    """

    key: Ints
    leave: Ints
    reach: Ints


def movements(
    joined: MergedScore, movement: Movement = FLOWING, places: Places | None = None, *, at: int = 0
) -> Movements:
    """Return the movements of the hand that a line implies (P1 to P3).

    Parameters
    ----------
    joined : MergedScore
        From `codec.superframe.merging.join`.
    movement : Movement
        Of the voice.
    places : ndarray, shape (keys, 3), optional
        Where the hand is for each key, mm; without them no way is long.
    at : int
        The predicted superframe: its options say after which silence the hand rests.
    """
    line, language = joined.line, joined.language
    gap = round(options_at(joined.parts, at).rest_gap_s / TICK_S) * PARTS
    length = {
        one.start: one.end - one.start
        for one, two in itertools.pairwise(s for s in line if s.number)
        if one.end == two.start
        and language.is_consonant(one.number)
        and language.is_vowel(two.number)
    }
    lost = [s for s in line if s.open_start and s.open_end]
    rule = _Rule.of(movement)
    rows = [_Row(_REST_KEY, -(1 << 40), -(1 << 40))]
    before: tuple[int, int] | None = None
    for key in joined.every:
        tick = round(key.start / TICK_S)
        start, end = tick * PARTS, round(key.end / TICK_S) * PARTS
        number = language.key_number(key.shape, key.placement)
        begun = language.beginning_of(number)
        rested = before is None or (
            start - before[1] >= gap and not _untold(before[1], start, lost)
        )
        if rested and before is not None:
            lead = min(rule.first_lead, (start - before[1]) // 2)
            rows.append(_to_rest(before[1], start - lead, rule))
        way = _apart(places, begun, rows[-1].key)
        if before is None:
            lead = rule.first_lead
        elif not rested:
            lead = rule.lead((start - before[0]) // PARTS, way)
        lag = rule.lag_percent * length.get(tick, 0) if len(key.phones) == 2 else 0
        rows.append(_stroke(rows[-1], begun, (start - lead, start + lag), way, rule))
        if begun != number:
            vowel = start + (PARTS * length.get(tick, 0) if len(key.phones) == 2 else 0)
            rows.append(_moved_on(rows[-1], number, vowel, _apart(places, begun, number), rule))
        before = start, end
    if before is not None:
        rows.append(_to_rest(before[1], 1 << 40, rule))
    keys, leaves, reaches = (np.array(column, dtype=np.int64) for column in zip(*rows, strict=True))
    # A movement to rest may be due before the last key was reached.
    for g in range(1, len(rows)):
        leaves[g] = max(leaves[g], rule.free(int(leaves[g - 1]), int(reaches[g - 1])))
        reaches[g] = max(reaches[g], leaves[g] + 1, reaches[g - 1] + 1)
    return Movements(keys, leaves, reaches)


def _apart(places: Places | None, one: int, other: int) -> float:
    """Return the way between two keys in mm, 0 without places."""
    return 0.0 if places is None else float(np.linalg.norm(places[one] - places[other]))


class _Row(NamedTuple):
    key: int
    leave: int
    reach: int


@dataclass(frozen=True, slots=True)
class _Rule:
    """The constants of a `Movement` in hundredths of a tick and hundredths."""

    movement: Movement
    lead_percent: int
    calm_percent: int
    lag_percent: int
    hurried_ticks: int
    least_lead: int
    first_lead: int
    shortest: int
    late: int
    rest_delay: int
    rest_move: int

    @classmethod
    def of(cls, m: Movement) -> "_Rule":
        def parts(seconds: float) -> int:
            return round(PARTS_PER_S * seconds)

        return cls(
            m, round(PARTS * m.lead_share), round(PARTS * m.calm_share), round(PARTS * m.lag_share),
            round(m.hurried_s / TICK_S), parts(m.least_lead_s), parts(m.first_lead_s),
            parts(m.shortest_s), parts(m.late_s), parts(m.rest_delay_s), parts(m.rest_move_s),
        )  # fmt: skip

    def lead(self, apart: int, way_mm: float) -> int:
        """Return how early a stroke begins that ends `apart` ticks after the key before (P1)."""
        m, quick = self.movement, min(apart, self.hurried_ticks)
        most = round(PARTS_PER_S * (m.most_lead_s + m.lead_s_per_mm * way_mm))
        lead = self.lead_percent * quick + self.calm_percent * (apart - quick)
        return max(min(lead, most), self.least_lead)

    def free(self, leave: int, reach: int) -> int:
        """Return when the stroke after one may begin."""
        return reach - round(self.movement.overlap * (reach - leave))


def _stroke(last: _Row, number: int, wanted: tuple[int, int], way_mm: float, rule: _Rule) -> _Row:
    """Return the stroke to a key that should leave and arrive at the times wanted."""
    least = round(PARTS_PER_S * rule.movement.peak_s_per_mm * way_mm)
    leave = max(min(wanted[0], wanted[1] - least), rule.free(last.leave, last.reach))
    late = min(leave + least, wanted[1] + rule.late)
    return _Row(number, leave, max(wanted[1], late, leave + rule.shortest))


def _moved_on(last: _Row, number: int, vowel: int, way_mm: float, rule: _Rule) -> _Row:
    """Return the second stroke of a key whose placement moves (P12)."""
    leave = max(last.reach, vowel)
    least = round(PARTS_PER_S * rule.movement.peak_s_per_mm * way_mm)
    return _Row(number, leave, leave + max(rule.shortest, least))


def _untold(begin: int, end: int, lost: Sequence[Sounding]) -> bool:
    """Return whether a superframe was lost between two times, so that silence is not known."""
    return any(begin <= PARTS * s.start and PARTS * s.end <= end for s in lost)


def _to_rest(end: int, before: int, rule: _Rule) -> _Row:
    leave = end + rule.rest_delay
    return _Row(_REST_KEY, leave, max(min(leave + rule.rest_move, before), leave + rule.shortest))
