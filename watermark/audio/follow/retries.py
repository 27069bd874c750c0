"""Further attempts at a superframe that failed: other weights, longer lists, interference masks.

In: a superframe's view and its likely levels; out: ratios of the cells and sizes of the decoder's
list, one attempt after another. Kinds of attempts come in the order of their success so far per
unit of cost, each as far as the purse pays for it. Specification: spec/audio-carrier.md, W38.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow.align import SuperframeView
from watermark.audio.follow.interference import InterferenceMask
from watermark.audio.follow.purse import CELLS
from watermark.audio.follow.reliability import NOISY
from watermark.audio.follow.standing import LEAST_STANDING

if TYPE_CHECKING:
    from watermark.audio.follow.demodulate import Demodulator

LONG_LIST_SIZE, LONGEST_LIST_SIZE = 32, 512
"""Paths that the decoder follows at a candidate, and where a superframe is due."""

COVERED_LEVELS, COVERED_ROUNDS = 3, 3
"""Levels at which a superframe is read as one that another sound covers in part, the most
promising, and rounds of decoding and estimation in turns at each."""

LONG_LEVELS, DUE_LEVELS = 2, 4
"""Levels at which a longer list is tried at a candidate, and where a superframe is due: half of
them the likeliest, half the most promising."""

PRIOR_TRIES, MEMORY = 20.0, 0.98
"""Attempts for which the prior rate of a kind counts, and weight of the past when one is noted."""

Array = NDArray[np.float64]

Attempt = tuple[float, Array, int]
"""Level, ratios of the cells, and size of the decoder's list."""


@dataclass(slots=True)
class _Kind:
    """How often a kind of attempt succeeded.

    Attributes
    ----------
    prior : float
        Part of attempts expected to succeed. Where a superframe is due in film and pop through
        three coders, 4 of 58 with long lists did at first, 1 of 170 with interference masks, which
        serve under voices.
    """

    prior: float
    tries: float = 0.0
    successes: float = 0.0

    @property
    def rate(self) -> float:
        return (self.successes + PRIOR_TRIES * self.prior) / (self.tries + PRIOR_TRIES)

    def note(self, success: bool) -> None:
        self.tries = MEMORY * self.tries + 1
        self.successes = MEMORY * self.successes + success


def _priors() -> dict[str, _Kind]:
    rates = {
        "likely": 0.06,
        "covered": 0.02,
        "promising": 0.03,
        "plain": 0.01,
        "even": 0.01,
        "noisy": 0.005,
        "lone": 0.005,
    }
    return {name: _Kind(rate) for name, rate in rates.items()}


@dataclass(slots=True)
class Retries:
    """Proposes further attempts of a demodulator and remembers which kinds of them succeeded."""

    demodulator: "Demodulator"
    _kinds: dict[str, _Kind] = field(default_factory=_priors)
    _kind: str = ""

    def note(self, success: bool) -> None:
        """Note the result of the last attempt."""
        self._kinds[self._kind].note(success)

    def attempts(
        self, view: SuperframeView, clues: Array, levels: list[float], offset: float, *, due: bool
    ) -> Iterator[Attempt]:
        """Yield attempts as far as the purse pays for them: kinds in the order of their worth."""
        one, size = self.demodulator, LONGEST_LIST_SIZE if due else LONG_LIST_SIZE
        count = (DUE_LEVELS if due else LONG_LEVELS) // 2
        masks: dict[float, InterferenceMask] = {}

        def looked() -> list[float]:
            """Return the levels, the most promising first."""
            if not masks and one.purse.pays(CELLS * len(levels)):
                looks = [(level, one.look(view, level, offset)) for level in levels]
                masks.update(sorted(looks, key=lambda look: -look[1].promise))
            return list(masks)

        def weighted(tried: list[float], weights: Array, paths: int) -> Iterator[Attempt]:
            for level in tried:
                if one.purse.pays(one.cost(paths)):
                    yield level, one.weighted(view, level, weights), paths

        def covered() -> Iterator[Attempt]:
            for level in looked()[:COVERED_LEVELS]:
                yield from self._covered(masks[level], level)

        def promising() -> Iterator[Attempt]:
            others = [level for level in looked()[:count] if level not in levels[:count]]
            yield from weighted(others, learnt, size)

        def lone() -> Iterator[Attempt]:
            for kind, level in one.standing.lone_levels(view, levels):
                yield from weighted([level], np.maximum(kind, LEAST_STANDING), size)

        learnt, few = one.reliability.cautious(clues), levels[: LONG_LEVELS if due else 1]
        ways: dict[str, Callable[[], Iterator[Attempt]]] = {
            "likely": lambda: weighted(levels[:count], learnt, size),
            "covered": covered,
            "promising": promising,
            "plain": lambda: weighted(few, one.reliability.plain(clues), size),
            "even": lambda: weighted(few, np.ones((1, 1)), size),
            "noisy": lambda: weighted(
                few, one.reliability.weights(clues, exponents=NOISY), LONG_LIST_SIZE
            ),
            "lone": lone,
        }
        costs = dict.fromkeys(ways, one.cost(size))
        costs |= {"noisy": one.cost(LONG_LIST_SIZE)}
        costs |= {"covered": 3 * CELLS + one.cost(LONG_LIST_SIZE)}
        # Order by expected finds per cost: success rates are learnt from this programme.
        for name in sorted(ways, key=lambda name: -self._kinds[name].rate / costs[name]):
            self._kind = name
            yield from ways[name]()

    def _covered(self, mask: InterferenceMask, level: float) -> Iterator[Attempt]:
        """Yield attempts at a superframe that another sound covers, decoding and masking in turns.

        Each round begins with the decoder's beliefs from the ratios of the one before.
        """
        one = self.demodulator
        cost = CELLS + one.cost(LONG_LIST_SIZE)
        if not one.purse.pays(cost):
            return
        ratios = mask.ratios()
        yield level, ratios, LONG_LIST_SIZE
        for _ in range(COVERED_ROUNDS):
            if not one.purse.pays(CELLS + cost):
                return
            believed = one.link.beliefs(one.layout.gather(ratios))
            ratios = mask.ratios(one.layout.spread(believed))
            yield level, ratios, LONG_LIST_SIZE
