"""Units of concatenation: diphones, polysounds and dikeys, cut out of labelled lines.

A *diphone* reaches from the middle of one phone to the middle of the next. A *polysound* reaches
from one stable phone to the next, so that glides stay inside. A *dikey* is the movement from the
target of one key to the target of the next (Gibert, Bailly, Elisei 2004, section 5.1).
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from codec.cues.phonology import PAUSE
from codec.cues.score import Phone
from synth.motion.rules.movement import Gestures

GLIDES = frozenset(("j", "ɥ", "w"))
"""Phones without a stable middle."""

REST = "00"
"""Name of the rest key, placement then shape as the paper prints keys."""

_PAUSE_REACH_S = 0.05
"""Seconds of a pause that belong to the unit beside it."""


@dataclass(frozen=True, slots=True)
class Unit:
    """A stretch of a labelled line.

    Attributes
    ----------
    label : tuple of str
        Names of the phones, or of the two keys as the paper prints them (``"24"``).
    edges_s : tuple of float
        Start, inner boundaries and end in seconds, ascending. A diphone has one inner boundary,
        where its phones meet; a dikey has none.
    """

    label: tuple[str, ...]
    edges_s: tuple[float, ...]

    @property
    def parts_s(self) -> tuple[float, ...]:
        """Lengths of the parts between the edges, seconds."""
        return tuple(b - a for a, b in itertools.pairwise(self.edges_s))


def with_pauses(phones: Sequence[Phone], start_s: float, end_s: float) -> list[Phone]:
    """Return the line with every gap, and both ends, filled by pauses.

    Gaps of less than 1 ms are rounding and stay closed.
    """
    line: list[Phone] = []
    time = start_s
    for phone in phones:
        if phone.symbol == PAUSE:
            continue
        if phone.start - time >= 0.001 or not line:
            line.append(Phone(PAUSE, min(time, phone.start), phone.start))
        line.append(phone)
        time = phone.end
    line.append(Phone(PAUSE, time, max(end_s, time)))
    return line


def cut_sounds(line: Sequence[Phone], *, polysounds: bool = True) -> list[Unit]:
    """Cut a line of phones into polysounds, or into diphones.

    Parameters
    ----------
    line : sequence of Phone
        Without gaps, pauses included, as `with_pauses` gives it.
    polysounds : bool
        Keep glides inside their units.

    Examples
    --------
    >>> line = [Phone(s, i, i + 1) for i, s in enumerate(["_", "p", "j", "e", "_"])]
    >>> [unit.label for unit in cut_sounds(line)]
    [('_', 'p'), ('p', 'j', 'e'), ('e', '_')]
    >>> [unit.label for unit in cut_sounds(line, polysounds=False)]
    [('_', 'p'), ('p', 'j'), ('j', 'e'), ('e', '_')]
    """
    stable = [
        i
        for i, phone in enumerate(line)
        if not polysounds or phone.symbol not in GLIDES or i in (0, len(line) - 1)
    ]
    units = []
    for first, last in itertools.pairwise(stable):
        inner = [line[i].end for i in range(first, last)]
        edges = (_cut_point(line[first], False), *inner, _cut_point(line[last], True))
        units.append(Unit(tuple(p.symbol for p in line[first : last + 1]), edges))
    return units


def split_polysound(unit: Unit) -> list[Unit]:
    """Return the diphones of a polysound, cut in the middle of its glides."""
    middles = [(a + b) / 2 for a, b in itertools.pairwise(unit.edges_s[1:-1])]
    cuts = [unit.edges_s[0], *middles, unit.edges_s[-1]]
    return [
        Unit(unit.label[i : i + 2], (cuts[i], unit.edges_s[i + 1], cuts[i + 1]))
        for i in range(len(unit.label) - 1)
    ]


def _cut_point(phone: Phone, entering: bool) -> float:
    """Return where a phone is cut: its middle; a pause near the neighbouring sound."""
    half = (phone.end - phone.start) / 2
    if phone.symbol != PAUSE:
        return phone.start + half
    reach = min(half, _PAUSE_REACH_S)
    return phone.start + reach if entering else phone.end - reach


def cut_dikeys(gestures: Gestures) -> list[Unit]:
    """Cut a line of gestures into dikeys.

    Each reaches from one target to the next. A dikey out of rest begins when the hand leaves:
    the time spent at rest belongs to no unit.

    Examples
    --------
    >>> from codec.cues.score import Key, Score
    >>> from synth.motion.rules.movement import plan_gestures
    >>> score = Score((Phone("b", 1.0, 1.1),), (Key(1.0, 1.1, ("b",), 4, "side"),))
    >>> [unit.label for unit in cut_dikeys(plan_gestures(score))]
    [('00', '14'), ('14', '00')]
    """
    names = [
        f"{placement}{shape}"
        for shape, placement in zip(gestures.shape, gestures.placement, strict=True)
    ]
    units = []
    for k in range(1, len(names)):
        start = gestures.leave[k] if names[k - 1] == REST else gestures.reach[k - 1]
        end = max(float(gestures.reach[k]), float(start))
        units.append(Unit((names[k - 1], names[k]), (float(start), end)))
    return units
