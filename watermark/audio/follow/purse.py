"""What may be spent on decoding where superframes fail.

In: the sound that arrives, which earns an allowance; out: whether an attempt is paid for. Costs are
counted, not measured: the same sound gives the same attempts on every machine. What cannot be paid
is left untried and counted. Unit: a thousandth of a second of a core of the machine on which the
costs were counted; `EARNED` is a fifth of it.
"""

from dataclasses import dataclass

EARNED = 200.0
"""What a second of sound pays for."""

SAVED_S = 2.0
"""Sound whose allowance is saved for superframes that fail after others that did not."""

VIEW, LOOK, BELIEFS, RATIOS, FIT = 5.0, 2.5, 1.5, 1.0, 3.0
"""A superframe's spectra and masks; what covers it at one level; its beliefs; ratios from clues; a
search for its delay and drift."""

PATHS_COST = ((8, 0.3), (32, 1.5), (512, 18.0))
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
    """

    balance: float = EARNED * SAVED_S
    untried: int = 0
    spent: float = 0.0

    def earn(self, sound_s: float) -> None:
        """Add what so much sound pays for."""
        self.balance = min(self.balance + EARNED * sound_s, EARNED * SAVED_S)

    def charge(self, cost: float) -> None:
        """Pay what is done in any case, on credit if need be."""
        self.balance -= cost
        self.spent += cost

    def pays(self, cost: float) -> bool:
        """Pay for an attempt, or note that it was left out."""
        if cost > self.balance:
            self.untried += 1
            return False
        self.charge(cost)
        return True


def decoding_cost(list_size: int, mother: int) -> float:
    """Return what a decoding costs."""
    cost = next(cost for paths, cost in PATHS_COST if list_size <= paths)
    return cost * mother / USUAL_MOTHER
