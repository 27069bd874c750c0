"""What may be spent on decoding where superframes fail.

In: the sound that arrives, which earns an allowance; out: whether an attempt is paid for. Costs are
counted, not measured: the same sound gives the same attempts on every machine. An unpaid attempt
is left untried and counted. Unit: a thousandth of a second of a core of the machine on which the
costs were counted; a second of sound earns a quarter of it.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

EARNED = 240.0
"""What a second of sound pays for."""

SAVED_S = 4.0
"""Sound whose allowance is saved for superframes that fail after others that did not."""

VIEW, CLUES_COST, LOOK, BELIEFS, RATIOS, FIT = 2.1, 1.9, 1.3, 0.8, 0.8, 1.5
"""A superframe's spectra and masks; what tells of its cells; what covers it at one level; its
beliefs; ratios from clues; a search for its delay and drift."""

PATHS_COST = ((8, 0.35), (32, 1.0), (512, 16.5))
"""Decodings of a class with lists of so many paths, in a mother code of `USUAL_MOTHER` bits."""

USUAL_MOTHER = 1024
"""Bits of the mother code of the first class of `standard`."""


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

    balance: float = EARNED * SAVED_S
    untried: int = 0
    spent: float = 0.0
    reserve: float = 0.0

    def earn(self, sound_s: float) -> None:
        """Add what so much sound pays for."""
        self.balance = min(self.balance + EARNED * sound_s, EARNED * SAVED_S)

    @contextmanager
    def sparing(self) -> Iterator[None]:
        """Keep half of the savings, for attempts beside the likeliest place."""
        before, self.reserve = self.reserve, EARNED * SAVED_S / 2
        try:
            yield
        finally:
            self.reserve = before

    def charge(self, cost: float) -> None:
        """Pay for work that is done in any case, on credit if need be."""
        self.balance -= cost
        self.spent += cost

    def pays(self, cost: float) -> bool:
        """Pay for an attempt, or note that it was left out."""
        if cost > self.balance - self.reserve:
            self.untried += 1
            return False
        self.charge(cost)
        return True


def decoding_cost(list_size: int, mother: int) -> float:
    """Return the cost of a decoding."""
    cost = next(cost for paths, cost in PATHS_COST if list_size <= paths)
    return cost * mother / USUAL_MOTHER
