"""Planning: the fields of a superframe beside its coefficients, richest first.

An `Analysis` goes in; `SuperframePlan` values come out, in the order to try them.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from codec.superframe.analysis import Analysis
from codec.superframe.payload import Content, room_bits, score_code
from codec.superframe.preview import AHEAD, CHOICES, Preview, thinned
from codec.superframe.quantise import Setting

_SAYS_LITTLE = 0.5
"""Share of a superframe that score and previews may take for a third preview."""

_FEWEST = 2
"""Starts to which a preview is thinned at most, and a third one always."""


@dataclass(frozen=True, slots=True)
class SuperframePlan:
    """The fields of a superframe beside its coefficients.

    Attributes
    ----------
    analysis : Analysis
    previews : dict of int to Preview
        Those that travel.
    bits : float
        Length of all that precedes the coefficients, with the likeliest basis and level.
    """

    analysis: Analysis
    previews: dict[int, Preview]
    bits: float


def plan_of(analysis: Analysis, previews: dict[int, Preview]) -> SuperframePlan:
    """Return the plan of a superframe with some previews."""
    setting = Setting(0, 0, 0, analysis.course, analysis.shift, analysis.shares)
    nothing = np.zeros(0, dtype=np.int64)
    content = Content(analysis.header, setting, analysis.part, nothing, previews, analysis.slow)
    return SuperframePlan(analysis, previews, score_code(content, even=analysis.even).bits)


def plans(analysis: Analysis, l0_bytes: int, l1_bytes: int) -> Iterator[SuperframePlan]:
    """Yield plans that L0 may have room for, the one with most previews first.

    The farthest is sparse, and for superframes that say little; where too much is said, the
    farther of two becomes sparse, then goes, then the nearer one. The last plan has none.

    Parameters
    ----------
    analysis : Analysis
    l0_bytes, l1_bytes : int
        Sizes of the parts.
    """
    room = float(room_bits(analysis.header, l0_bytes))
    if analysis.header.filmed:
        yield from _labelled(analysis, room)
        return
    for choice in reversed(CHOICES) if analysis.previews else ():
        previews = {distance: analysis.previews[distance] for distance in choice}
        most = room
        if len(choice) == len(AHEAD):
            most = min(room, _SAYS_LITTLE * 8 * (l0_bytes + l1_bytes))
            while len(previews[AHEAD[-1]]) > _FEWEST:
                previews[AHEAD[-1]] = thinned(previews[AHEAD[-1]])
        while (plan := plan_of(analysis, previews)).bits > most:
            farthest = max(previews, default=0)
            if len(choice) != 2 or len(previews[farthest]) <= _FEWEST:
                break
            previews[farthest] = thinned(previews[farthest])
        if previews and plan.bits <= most:
            yield plan
    yield plan_of(analysis, {})


def _labelled(analysis: Analysis, room: float) -> Iterator[SuperframePlan]:
    """Yield plans of a filmed superframe, the one with most labels of others first."""
    for number in range(len(analysis.previews), 0, -1):
        plan = plan_of(analysis, dict(list(analysis.previews.items())[:number]))
        if plan.bits <= room or number == 1:
            yield plan
    if not analysis.previews:
        yield plan_of(analysis, {})
