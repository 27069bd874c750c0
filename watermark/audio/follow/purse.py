"""What a receiver may spend: one allowance for searching, hunting, reading and decoding.

In: the sound that arrives, which earns an allowance; out: whether an attempt is paid for. Costs are
counted, not measured: the same sound gives the same attempts on every machine. An unpaid attempt
is left untried and counted. Unit: a thousandth of a second of a core of the machine on which the
costs were counted; an AAC encode of a second of sound takes some 26. No second of sound is given
more than `EARNED` + `SAVED` after the first ones, whatever comes in.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

EARNED = 50.0
"""Units that a second of sound earns; listening takes some 3 besides, whatever comes in."""

SAVED = 120.0
"""Units that may be saved, and owed: with those of a second, less than a fifth of a core."""

YOUNG_S, AT_FIRST = 8.0, 1.6
"""Sound after switching on that pays for more, and how many times as much: all hypotheses wait."""

SEARCH, FOLLOWED, LOCKED_IN, READ_BACK = 4.5, 2.2, 6.0, 1.5
"""Costs of the usual search of a second of sound, of the corrections from a superframe that was
read, the same where place and clock are sought widely, and of a superframe of the past."""

VIEW, CLUES_COST, LOOK, BELIEFS, RATIOS, FIT = 1.3, 0.8, 0.5, 0.7, 0.4, 0.6
"""A superframe's spectra and masks; clues on its cells; the sound that covers it at one level; its
beliefs; ratios from clues; a search for its delay and drift."""

PIECES, PIECES_VIEW = 14.0, 6.5
"""All places of a superframe's frames in sound that lies in pieces, at all likely levels; reading
along one path."""

PIECES_READ, PIECES_LOCK = PIECES + PIECES_VIEW + 2.0, 40.0
"""Units that must be left for such a superframe, and units that are waited for: further paths and
longer lists."""

PATHS_COST = ((8, 0.2), (32, 0.4), (512, 4.5))
"""Decodings of a class that fail with lists of these lengths, in a mother code of `USUAL_MOTHER`
bits."""

USUAL_MOTHER = 1024
"""Bits of the mother code of the first class of `standard`."""

ELSEWHERE, BESIDE = 6.0, 0.125
"""Least cost of reading beside the likeliest place, and part of the savings that is kept then for
the likeliest one."""

DUE, PAST, PAST_FAILED = 0.125, 0.5, 0.3
"""Part of the savings that candidates leave for superframes which are due, where any are, part
that superframes of the past leave for them, the next ones show level and gain, and part that those
which fail leave."""

HUNTED, LOST = 0.2, 0.3
"""Part of the savings that hunting leaves for attempts at its finds, and part that is left for
hunting by candidates of the usual search, and for both by superframes after one that failed: what
came between may have moved the mark's clock."""

FAILED_BEFORE_GUESSING = 3
"""Superframes in a row that fail at a known place before guesses are tried."""

VENTURED, VENTURES = 1.8, 32.0
"""The same for attempts at candidates: units earned in a second of sound, and units saved."""

LEAST_VENTURED, ON_CREDIT = 4.8, 5.8
"""Least significance of a candidate that is tried where all of that is saved, and of one that the
purse pays for: of a hundred candidates in unmarked sound, one or two reach it."""

UNSURE_COST, SURE_COST, CERTAIN_COST, CERTAIN = 10.0, 32.0, 56.0, 7.0
"""Highest cost of all attempts at a candidate beyond their first decodings: by whether its pilots
confirm it, and the deviations that leave no doubt."""


CONFIRMED = 12.0
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
    heard_s : float
        Sound that has earned an allowance.
    reserve : float
        Units kept for attempts that are likelier than the present ones.
    """

    balance: float = SAVED
    untried: int = 0
    spent: float = 0.0
    heard_s: float = 0.0
    reserve: float = 0.0

    def earn(self, sound_s: float) -> None:
        """Add what so much sound pays for."""
        earned = EARNED * sound_s * (AT_FIRST if self.heard_s < YOUNG_S else 1.0)
        self.heard_s += sound_s
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
    _paid: bool = False
    _used: float = 0.0
    _credit: float = CERTAIN_COST

    def earn(self, sound_s: float) -> None:
        """Add what so much sound pays for."""
        self._left = min(self._left + VENTURED * sound_s, VENTURES)
        self._credit = min(self._credit + CONFIRMED * sound_s, CERTAIN_COST)

    def allows(self, significance: float) -> bool:
        """Whether a candidate is tried: the less is saved, the more significant it must be."""
        self._paid, self._used = significance >= ON_CREDIT, 0.0
        if self._paid:
            return self.purse.affords(UNSURE_COST)
        doubt = (ON_CREDIT - significance) / (ON_CREDIT - LEAST_VENTURED)
        if self._left < VENTURES * min(doubt, 1.0):
            self.purse.untried += 1
            return False
        return True

    @contextmanager
    def attempt(self, score: float, sure: float) -> Iterator[None]:
        """Bound a candidate's cost by the score of its pilots, and pay for this attempt."""
        purse = self.purse
        most = CERTAIN_COST if score >= CERTAIN else SURE_COST if score >= sure else UNSURE_COST
        if self._paid:
            most = min(most, self._used + max(self._credit, UNSURE_COST))
        reserve, spent = purse.reserve, purse.spent
        purse.reserve = max(purse.balance - max(most - self._used, 0.0), reserve)
        try:
            yield
        finally:
            purse.reserve = reserve
            self._used += purse.spent - spent
            if self._paid:
                self._credit -= purse.spent - spent
            else:
                self._left -= purse.spent - spent


def decoding_cost(list_size: int, mother: int) -> float:
    """Return the cost of a decoding."""
    cost = next(cost for paths, cost in PATHS_COST if list_size <= paths)
    return cost * mother / USUAL_MOTHER
