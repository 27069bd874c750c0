"""Which hypothesis is tried next, and how much is spent on them.

In: the time, second by second of sound; out: the hypothesis whose pause has run out longest, as
long as the allowance pays for it. The spend of a second of sound is the same in the first minute
and after hours; hypotheses that were right before on this set come first, and more often.
Cost: that of the hypotheses tried, `SPEND` of every second of sound.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from watermark.audio.search.evidence import Evidence
from watermark.audio.search.hypotheses import (
    RARELY_S,
    STRETCH_S,
    ChannelHypothesis,
    make_hypotheses,
)

SPEND = 9.0
"""Costs of tries that a second of sound pays for, see `hypotheses.COST_SIGHT`."""

SAVED_S = 4.0
"""Sound whose allowance may be saved: the rest of an unspent allowance expires."""

FIRST = 70.0
"""Allowance at the start: a first round of the likelier hypotheses; the others but rare ones follow
within 8 s. A whole round at once, of 110, was the dearest second of all."""

UNSOUGHT = 0.5
"""Part of the pause that follows where there is nothing to search."""

REPEATED = 3.0
"""Factor on the rate of hypotheses that were read on this set before, and of those that seem
near."""

PROMISING = 6.0
"""Significance of a hypothesis that is tried more often for it: one stretch of a thousand without a
mark gives as much."""


@dataclass(slots=True)
class _Entry:
    """A hypothesis, whether it was read, whether it seems near, and its evidence."""

    hypothesis: ChannelHypothesis
    evidence: Evidence = field(default_factory=Evidence)
    read: bool = False
    promising: bool = False

    @property
    def pause_s(self) -> float:
        """Pause after which it is tried again."""
        pause_s = self.hypothesis.pause_s
        for reason in (self.read, self.promising):
            pause_s /= REPEATED if reason else 1.0
        return pause_s


@dataclass(slots=True)
class HypothesisScheduler:
    """Chooses what to try.

    Parameters
    ----------
    channels : int
        Of the sound.
    """

    channels: int
    _entries: list[_Entry] = field(init=False)
    _tried_s: NDArray[np.float64] = field(init=False)
    _pauses_s: NDArray[np.float64] = field(init=False)
    _allowance: float = field(default=FIRST, init=False)
    _cheapest: float = field(init=False)
    _awaited: float = field(init=False)
    _idle_until_s: float = field(default=-math.inf, init=False)

    def __post_init__(self) -> None:
        # One pause has run out for each at the start: they are tried in their order. What is tried
        # rarely comes later, one after another.
        listed = make_hypotheses(self.channels)
        self._entries = [_Entry(one) for one in listed]
        self._cheapest = self._awaited = min(one.cost for one in listed)
        self._pauses_s = pauses = np.array([one.pause_s for one in listed])
        rare = pauses == RARELY_S
        late = np.cumsum(np.where(rare, pauses / max(rare.sum(), 1), 0.0))
        self._tried_s = STRETCH_S - pauses + np.where(rare, late, 0.0)

    def earn(self, sound_s: float) -> None:
        """Add the allowance of so much sound."""
        most = max(self._allowance, SPEND * SAVED_S)
        self._allowance = min(self._allowance + SPEND * sound_s, most)

    def next(self, now_s: float, most: float = math.inf) -> ChannelHypothesis | None:
        """Return what to try at a time of the sound, at `most` at some cost.

        None where nothing is due or paid for.
        """
        if min(self._allowance, most) < self._awaited or now_s < self._idle_until_s:
            return None
        self._awaited, self._idle_until_s = self._cheapest, -math.inf
        waited = (now_s - self._tried_s) / self._pauses_s
        n = int(waited.argmax())
        best = self._entries[n].hypothesis
        if waited[n] < 1.0:
            # Pauses only grow with time.
            self._idle_until_s = float((self._tried_s + self._pauses_s).min())
            return None
        if min(self._allowance, most) < best.cost:
            self._awaited = best.cost
            return None
        self._allowance -= best.cost
        self._tried_s[n] = now_s
        return best

    def give_back(self, hypothesis: ChannelHypothesis) -> float:
        """Note that a hypothesis needed no search: its mix is silent, or one tried before.

        Its mix is looked for again after part of its pause. Returned is what looking cost less.
        """
        n, rest = self._number(hypothesis), hypothesis.cost - hypothesis.mixing
        self._allowance += rest
        self._tried_s[n] -= (1 - UNSOUGHT) * self._pauses_s[n]
        self._idle_until_s = -math.inf
        return rest

    def evidence(self, hypothesis: ChannelHypothesis) -> Evidence:
        """Return what stretches said so far, if a hypothesis is true."""
        return self._entries[self._number(hypothesis)].evidence

    def note(self, hypothesis: ChannelHypothesis, significance: float) -> None:
        """Note how likely the likeliest place of the last try is."""
        n = self._number(hypothesis)
        self._entries[n].promising = significance >= PROMISING
        self._changed(n)

    def remember(self, hypothesis: ChannelHypothesis) -> None:
        """Note that a mark was read under a hypothesis."""
        n = self._number(hypothesis)
        self._entries[n].read = True
        self._changed(n)

    def _changed(self, n: int) -> None:
        """Note how often a hypothesis is tried from now on."""
        self._pauses_s[n] = self._entries[n].pause_s
        self._idle_until_s = -math.inf

    def _number(self, hypothesis: ChannelHypothesis) -> int:
        return next(n for n, one in enumerate(self._entries) if one.hypothesis is hypothesis)
