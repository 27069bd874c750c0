"""What a receiver may spend: one allowance for searching, hunting, reading and decoding.

In: the sound that arrives, which earns an allowance; out: whether an attempt is paid for. Costs are
counted, not measured: the same sound gives the same attempts on every machine. An unpaid attempt
is left untried and counted. Unit: a thousandth of a second of a core of the machine on which the
costs were counted; an AAC encode of a second of music takes some 15 there. No second of sound is
given more than `EARNED` + `SAVED`, and hunting no more than `HUNTING` in the long run.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

EARNED, HUNTING = 36.0, 14.0
"""Units that a second of sound earns where a mark was read within the last `RECENT_S`, and where
none was; listening takes some 2 besides, whatever comes in."""

SAVED = 80.0
"""Units that may be saved, and owed."""

RECENT_S = 10.0
"""Sound after which a mark was read long ago; as long after switching on all hypotheses wait."""

SEARCH, FOLLOWED, LOCKED_IN = 3.0, 1.0, 3.0
"""Costs of the usual search of a second of sound, of the corrections from a superframe that was
read, and of the same where place and clock are sought widely."""

VIEW, CELLS, PHASES = 0.7, 0.4, 4.0
"""A superframe's spectra and masks; a pass over its cells: clues on them, what covers them at one
level, ratios, beliefs, a search for delay and drift; phases of all bands at the levels of a
tier."""

PIECES, PIECES_VIEW = 13.0, 10.0
"""All places of a superframe's frames in sound that lies in pieces; reading along one path."""

PIECES_READ, PIECES_LOCK = PIECES + PIECES_VIEW, 40.0
"""Units that must be left for such a superframe, and units that are waited for: further paths and
longer lists."""

PATHS_COST = ((8, 0.2), (32, 0.3), (512, 2.5))
"""Decodings of a class that fail with lists of these lengths, in a mother code of `USUAL_MOTHER`
bits."""

USUAL_MOTHER = 1024
"""Bits of the mother code of the first class of `standard`."""

ELSEWHERE = 4.0
"""Least cost of reading beside the likeliest place."""

DUE, LOST, PAST = 0.125, 0.25, 0.5
"""Parts of the savings that are kept: for superframes which are due, by candidates where any are
and by what is read beside the likeliest place, and for finds by the hypotheses that are tried; for
likelier attempts, by unlikely candidates, by superframes of the past that fail and by those after
one that failed: what came between may have moved the mark's clock; for the next superframes, which
show level and gain, by those of the past."""

FAILED_BEFORE_GUESSING = 3
"""Superframes in a row that fail at a known place before guesses are tried."""

VENTURED, VENTURES = 1.0, 20.0
"""What the search may spend on unlikely candidates, and as much hypotheses: units earned in a
second of sound, and units saved."""

ON_CREDIT = 5.8
"""Least significance of a candidate that the whole purse pays for: of a hundred candidates in
unmarked sound, one or two reach it. One less likely by 1 is tried where all of that is saved."""

UNSURE_COST, SURE_COST, CERTAIN_COST, CERTAIN = 6.0, 20.0, 36.0, 7.0
"""Highest cost of all attempts at a candidate beyond their first decodings: by whether its pilots
confirm it, and the deviations that leave no doubt."""

CONFIRMED = 8.0
"""Units a second for candidates that the purse pays for: one that stands out in every
superframe and is not read was altered, and is left to hunting."""


@dataclass(slots=True)
class DecodingPurse:
    """An allowance.

    Attributes
    ----------
    balance : float
        What may be spent.
    untried : int
        Attempts that were left out.
    spent : float
        All that was paid.
    reserve : float
        Units kept for attempts that are likelier than the present ones.
    """

    balance: float = SAVED
    untried: int = 0
    spent: float = 0.0
    reserve: float = 0.0

    def earn(self, sound_s: float, quiet_s: float = 0.0) -> None:
        """Add what so much sound pays for, so long after a mark was read."""
        earned = sound_s * (EARNED if quiet_s < RECENT_S else HUNTING)
        self.balance = min(self.balance + earned, SAVED)

    @contextmanager
    def keeping(self, part: float) -> Iterator[None]:
        """Keep a part of the savings for attempts that are likelier."""
        before, self.reserve = self.reserve, max(SAVED * part, self.reserve)
        try:
            yield
        finally:
            self.reserve = before

    def charge(self, cost: float) -> None:
        """Pay for work that is done in any case, on credit if need be."""
        self.balance = max(self.balance - cost, -SAVED)
        self.spent += cost

    @property
    def left(self) -> float:
        """What may be spent on the present attempts."""
        return self.balance - self.reserve

    def has(self, cost: float) -> bool:
        """Whether so much is left."""
        return cost <= self.left

    def affords(self, cost: float) -> bool:
        """Whether an attempt could be paid; note that it is left out if not."""
        if not self.has(cost):
            self.untried += 1
            return False
        return True

    def pays(self, cost: float) -> bool:
        """Pay for an attempt, or note that it was left out."""
        if not self.affords(cost):
            return False
        self.charge(cost)
        return True


@dataclass(slots=True)
class Ventures:
    """What attempts at candidates may cost: nothing but pilots speaks for these.

    Parameters
    ----------
    purse : DecodingPurse
        That counts what they cost.
    """

    purse: DecodingPurse
    _left: float = VENTURES
    _credit: float = CERTAIN_COST
    _doubtful: bool = False
    _used: float = 0.0

    def earn(self, sound_s: float) -> None:
        """Add what so much sound pays for."""
        self._left = min(self._left + VENTURED * sound_s, VENTURES)
        self._credit = min(self._credit + CONFIRMED * sound_s, CERTAIN_COST)

    def allows(self, significance: float) -> bool:
        """Whether a candidate is tried: the less is saved, the more significant it must be."""
        self._doubtful, self._used = significance < ON_CREDIT, 0.0
        if not self._doubtful:
            return self.purse.affords(UNSURE_COST)
        if self._left < VENTURES * min(ON_CREDIT - significance, 1.0):
            self.purse.untried += 1
            return False
        return True

    @contextmanager
    def attempt(self, score: float, sure: float) -> Iterator[None]:
        """Bound a candidate's cost by the score of its pilots, and pay for this attempt."""
        purse = self.purse
        most = CERTAIN_COST if score >= CERTAIN else SURE_COST if score >= sure else UNSURE_COST
        if not self._doubtful:
            most = min(most, self._used + max(self._credit, UNSURE_COST))
        reserve, spent = purse.reserve, purse.spent
        purse.reserve = max(purse.balance - max(most - self._used, 0.0), reserve)
        try:
            yield
        finally:
            purse.reserve = reserve
            self._used += purse.spent - spent
            if self._doubtful:
                self._left -= purse.spent - spent
            else:
                self._credit -= purse.spent - spent


def decoding_cost(list_size: int, mother: int) -> float:
    """Return the cost of a decoding."""
    cost = next(cost for paths, cost in PATHS_COST if list_size <= paths)
    return cost * mother / USUAL_MOTHER
