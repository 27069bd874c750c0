"""Which hypothesis is tried next, and how much is spent on them.

In: the time, second by second of sound; out: the hypothesis whose pause has run out longest, as
long as the allowance pays for it. The spend of a second of sound is the same in the first minute
and after hours; hypotheses that were right before on this set come first, and more often.
Cost: that of the hypotheses tried, `SPEND` of every second of sound.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from watermark.audio.search.evidence import Evidence
from watermark.audio.search.hypotheses import (
    RARELY_S,
    STRETCH_S,
    ChannelHypothesis,
    make_hypotheses,
)

SPEND = 12.0
"""Costs of tries that a second of sound pays for, see `hypotheses.COST_SIGHT`."""

SAVED_S = 4.0
"""Sound whose allowance may be saved: the rest of an unspent allowance expires."""

FIRST = 160.0
"""Allowance at the start: a round of all hypotheses but rare ones."""

NOTHING, UNSOUGHT = 2.0, 0.5
"""Cost of finding that there is nothing to search, and part of the pause that follows."""

REPEATED = 3.0
"""Factor on the rate of hypotheses that were read on this set before, and of those that seem
near."""

YOUNG_S = 8.0
"""Seconds of sound: all hypotheses but rare ones are tried more often by that factor."""

PROMISING = 6.0
"""Significance of a hypothesis that is tried more often for it: one stretch of a thousand without a
mark gives as much."""


@dataclass(slots=True)
class _Entry:
    """A hypothesis, when it was tried last, whether it was read, and its evidence."""

    hypothesis: ChannelHypothesis
    tried_s: float
    evidence: Evidence = field(default_factory=Evidence)
    read: bool = False
    promising: bool = False

    def waited(self, now_s: float) -> float:
        """Pauses since the last try."""
        return (now_s - self.tried_s) / self.pause_s(now_s)

    def pause_s(self, now_s: float) -> float:
        """Return the pause after which it is tried again, seconds."""
        young = now_s < YOUNG_S and self.hypothesis.pause_s < RARELY_S
        pause_s = self.hypothesis.pause_s
        for reason in (self.read, self.promising or young):
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
    _allowance: float = field(default=FIRST, init=False)
    _cheapest: float = field(init=False)
    _awaited: float = field(init=False)
    _idle_until_s: float = field(default=-math.inf, init=False)

    def __post_init__(self) -> None:
        # One pause has run out for each at the start: they are tried in their order. What is tried
        # rarely comes later, one after another.
        listed = make_hypotheses(self.channels)
        rare = sum(one.pause_s == RARELY_S for one in listed)
        self._cheapest = self._awaited = min(one.cost for one in listed)
        late = np.cumsum([one.pause_s / rare if one.pause_s == RARELY_S else 0 for one in listed])
        self._entries = [
            _Entry(one, STRETCH_S - one.pause_s + (wait if one.pause_s == RARELY_S else 0.0))
            for one, wait in zip(listed, late, strict=True)
        ]

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
        best = max(self._entries, key=lambda entry: (entry.waited(now_s), entry.read))
        if best.waited(now_s) < 1.0:
            # Pauses only grow with time.
            self._idle_until_s = min(one.tried_s + one.pause_s(now_s) for one in self._entries)
            return None
        if min(self._allowance, most) < best.hypothesis.cost:
            self._awaited = best.hypothesis.cost
            return None
        self._allowance -= best.hypothesis.cost
        best.tried_s = now_s
        return best.hypothesis

    def give_back(self, hypothesis: ChannelHypothesis) -> None:
        """Note that a hypothesis needed no search: its mix is silent, or one tried before.

        It costs little to look for its mix again, after part of its pause.
        """
        self._allowance += hypothesis.cost - NOTHING
        self._find(hypothesis).tried_s -= (1 - UNSOUGHT) * hypothesis.pause_s
        self._idle_until_s = -math.inf

    def evidence(self, hypothesis: ChannelHypothesis) -> Evidence:
        """Return what stretches said so far, if a hypothesis is true."""
        return self._find(hypothesis).evidence

    def note(self, hypothesis: ChannelHypothesis, significance: float) -> None:
        """Note how likely the likeliest place of the last try is."""
        self._find(hypothesis).promising = significance >= PROMISING
        self._idle_until_s = -math.inf

    def remember(self, hypothesis: ChannelHypothesis) -> None:
        """Note that a mark was read under a hypothesis."""
        self._find(hypothesis).read = True
        self._idle_until_s = -math.inf

    def _find(self, hypothesis: ChannelHypothesis) -> _Entry:
        return next(entry for entry in self._entries if entry.hypothesis is hypothesis)
