"""Choosing sentences that cover French: greedy weighted multi-cover, then a reverse pass.

Units are diphones, polysounds, key successions, and successions of shapes and placements. Every
unit that the list offers should occur at least twice among the chosen sentences (Gibert, Bailly,
Elisei 2004, section 5.1: "a minimum number of 2 samples of each polysound"); the sentence with
most new units for its length comes next; in the end sentences that became superfluous leave.
"""

import heapq
import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from codec.cues.cueing import cue
from codec.cues.phonology import PAUSE
from codec.cues.score import PLACEMENT_NUMBER, Key, Phone
from codec.errors import CueError

_GLIDES = frozenset("jɥw")
_REST = "rest"

_ROUNDS = 4
"""Passes of exchange at most."""

KINDS = ("diphones", "polysounds", "dikeys", "shapes", "placements")
"""Kinds of units, in the order of reports."""

Units = dict[str, Counter[tuple[str, ...]]]


def units_of(line: Sequence[str]) -> Units:
    """Return the units of a line of phones, pauses as `codec.cues.phonology.PAUSE`.

    The line is taken to stand between pauses. A polysound reaches from one stable phone to the
    next; glides are not stable, so ``a j i`` is one.

    Examples
    --------
    >>> units = units_of(["p", "j", "a"])
    >>> sorted(units["polysounds"])
    [('_', 'p'), ('a', '_'), ('p', 'j', 'a')]
    >>> sorted(units["placements"])
    [('rest', 'side'), ('side', 'rest'), ('side', 'side')]
    """
    symbols = [PAUSE, *_without_doubled_pauses(line), PAUSE]
    stable = [i for i, s in enumerate(symbols) if s not in _GLIDES]
    keys = [None, *_keys(symbols), None]
    names = [
        "00" if key is None else f"{PLACEMENT_NUMBER[key.placement]}{key.shape}" for key in keys
    ]
    return {
        "diphones": Counter(itertools.pairwise(symbols)),
        "polysounds": Counter(tuple(symbols[a : b + 1]) for a, b in itertools.pairwise(stable)),
        "dikeys": Counter(itertools.pairwise(names)),
        "shapes": Counter(itertools.pairwise(name[1] for name in names)),
        "placements": Counter(
            itertools.pairwise(_REST if key is None else key.placement for key in keys)
        ),
    }


def _without_doubled_pauses(line: Sequence[str]) -> list[str]:
    out: list[str] = []
    for symbol in line:
        if symbol != PAUSE or (out and out[-1] != PAUSE):
            out.append(symbol)
    return out[:-1] if out and out[-1] == PAUSE else out


def _keys(symbols: Sequence[str]) -> list[Key]:
    phones = [Phone(s, float(i), i + 1.0) for i, s in enumerate(symbols) if s != PAUSE]
    return list(cue(phones))


@dataclass(frozen=True, slots=True)
class SentenceCoverage:
    """How well chosen sentences cover the units of a list.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    offered : int
        Different units in the list.
    covered, twice : int
        Those that the choice holds at least once, at least twice.
    short : int
        Units with two or more examples in the list and fewer in the choice.
    running : float
        Part of the list's running units whose type the choice holds.
    """

    kind: str
    offered: int
    covered: int
    twice: int
    short: int
    running: float


def choose(
    lines: Sequence[Sequence[str]],
    count: int,
    *,
    wanted: int = 2,
    advance: Callable[[], object] = lambda: None,
) -> list[int]:
    """Return the numbers of at most `count` lines that cover what all lines offer.

    Parameters
    ----------
    lines : sequence of sequence of str
        Phones of each sentence.
    count : int
    wanted : int
        How often every unit should occur, where the list offers as many.
    advance : callable
        Called once per chosen sentence, for a progress bar.

    Raises
    ------
    CueError
        If `count` is below 1.

    Examples
    --------
    >>> choose([["p", "a"], ["p", "a", "p", "a"], ["p", "a"]], 2, wanted=1)
    [1]
    """
    if count < 1:
        raise CueError(f"{count} sentences cannot be chosen, at least 1")
    units = [_flat(units_of(line)) for line in lines]
    offered: Counter[tuple[str, ...]] = sum(units, Counter())
    need = Counter({unit: min(wanted, n) for unit, n in offered.items()})
    rarity = {unit: 1.0 / n for unit, n in offered.items()}
    chosen: list[int] = []
    for _ in range(_ROUNDS):
        before = len(chosen)
        _add(chosen, count, units, need, rarity, [len(line) for line in lines], advance)
        kept = _without_superfluous(chosen, units, offered, wanted)
        if len(kept) == len(chosen) or len(chosen) == before:
            return kept
        chosen = kept
    return chosen


def _add(
    chosen: list[int],
    count: int,
    units: Sequence[Mapping[tuple[str, ...], int]],
    need: Counter[tuple[str, ...]],
    rarity: Mapping[tuple[str, ...], float],
    lengths: Sequence[int],
    advance: Callable[[], object],
) -> None:
    """Add the most useful sentences to `chosen`, up to `count`, and lower `need`.

    A sentence only ever loses usefulness as others join, so an old value is a bound and the
    queue need not be kept up to date (lazy greedy).
    """
    left = sorted(set(range(len(units))) - set(chosen))
    queue = [(-_gain(units[i], need, rarity, lengths[i]), i) for i in left]
    heapq.heapify(queue)
    while queue and len(chosen) < count:
        _, number = heapq.heappop(queue)
        gain = _gain(units[number], need, rarity, lengths[number])
        if queue and gain < -queue[0][0]:
            heapq.heappush(queue, (-gain, number))
        elif gain <= 0:
            return
        else:
            chosen.append(number)
            advance()
            for unit, n in units[number].items():
                need[unit] = max(need[unit] - n, 0)


def _flat(units: Units) -> Counter[tuple[str, ...]]:
    return Counter({(kind, *u): n for kind in units for u, n in units[kind].items()})


def _gain(
    units: Mapping[tuple[str, ...], int],
    need: Mapping[tuple[str, ...], int],
    rarity: Mapping[tuple[str, ...], float],
    length: int,
) -> float:
    """Return how much a sentence helps per phone; rare units count more."""
    useful = sum(min(n, need[unit]) * (1.0 + rarity[unit]) for unit, n in units.items())
    return useful / (length + 4)


def _without_superfluous(
    chosen: list[int],
    units: Sequence[Mapping[tuple[str, ...], int]],
    offered: Mapping[tuple[str, ...], int],
    wanted: int,
) -> list[int]:
    """Drop sentences, first chosen first, whose every unit is there often enough without them."""
    have: Counter[tuple[str, ...]] = Counter()
    for number in chosen:
        have.update(units[number])
    kept = list(chosen)
    for number in chosen:
        if all(have[u] - n >= min(wanted, offered[u]) for u, n in units[number].items()):
            have.subtract(units[number])
            kept.remove(number)
    return kept


def coverage(
    lines: Sequence[Sequence[str]], chosen: Iterable[int], *, wanted: int = 2
) -> list[SentenceCoverage]:
    """Return how well the chosen lines cover all lines, per kind of unit."""
    per_line = [units_of(line) for line in lines]
    numbers = list(chosen)
    report = []
    for kind in KINDS:
        offered: Counter[tuple[str, ...]] = sum((u[kind] for u in per_line), Counter())
        have: Counter[tuple[str, ...]] = sum((per_line[i][kind] for i in numbers), Counter())
        running = sum(n for unit, n in offered.items() if have[unit])
        report.append(
            SentenceCoverage(
                kind,
                len(offered),
                sum(have[u] >= 1 for u in offered),
                sum(have[u] >= 2 for u in offered),
                sum(n >= wanted > have[u] for u, n in offered.items()),
                running / max(sum(offered.values()), 1),
            )
        )
    return report
