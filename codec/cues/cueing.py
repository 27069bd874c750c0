"""French Cued Speech: which key cues which phones.

Phones go in, keys come out, by the deterministic left-to-right rule of the code: a consonant
directly before a vowel shares its key, every other consonant is shown at the side, every other
vowel with shape 5. Both ends of the chain use this one rule, so keys need no bits.

Sources: Gibert, Bailly, Elisei 2004, sections 4 and 5.1 (shapes, isolated C and V); the tables
of the code agree over the published French charts; points where the charts differ are
`CueingOptions`.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from codec.cues.phonology import CONSONANTS, PAUSE, VOWELS
from codec.cues.score import PLACEMENTS, Key, Phone
from codec.errors import CueError

SHAPE_OF = {
    consonant: shape
    for shape, consonants in enumerate(
        ("", "p d ʒ", "k v z", "s ʁ", "b n ɥ", "m t f", "l ʃ ɲ w", "g", "j ŋ")
    )
    for consonant in consonants.split()
}
"""Hand shape of each consonant."""

PLACEMENT_OF = {
    vowel: placement
    for placement, vowels in {
        "side": "a ɑ o œ ə",
        "mouth": "i ɔ̃ ɑ̃",
        "chin": "ɛ ɔ u",
        "cheek": "ɛ̃ ø",
        "throat": "e y œ̃",
    }.items()
    for vowel in vowels.split()
}
"""Hand placement of each vowel, by the majority of the charts."""

NO_CONSONANT_SHAPE = 5
"""Shape of a vowel without a consonant (Cornett 1967)."""

NO_VOWEL_PLACEMENT = "side"

assert set(SHAPE_OF) == set(CONSONANTS)
assert set(PLACEMENT_OF) == set(VOWELS)


@dataclass(frozen=True, slots=True)
class CueingOptions:
    """Choices where the published charts of the code disagree.

    Attributes
    ----------
    un : str
        Placement of œ̃: ``throat`` (most charts) or ``cheek`` (merged with ɛ̃).
    schwa : str
        Placement of a pronounced ə: ``side``, or ``cheek`` as for ø.
    oe : str
        Placement of œ: ``side``, or ``cheek`` as for ø.
    rest_gap_s : float
        Silence after which the hand returns to rest; published values reach from 0.25 to 1.8 s.
    """

    un: str = "throat"
    schwa: str = "side"
    oe: str = "side"
    rest_gap_s: float = 0.5

    def __post_init__(self) -> None:
        for name in ("un", "schwa", "oe"):
            if getattr(self, name) not in PLACEMENTS[1:]:
                raise CueError(f"option {name}: unknown placement {getattr(self, name)!r}")
        if not 0 <= self.rest_gap_s <= 60:
            raise CueError(f"rest_gap_s is {self.rest_gap_s} s, not within 0..60")

    def placement(self, vowel: str) -> str:
        """Return the placement of `vowel` under these options."""
        special = {"œ̃": self.un, "ə": self.schwa, "œ": self.oe}
        return special.get(vowel) or PLACEMENT_OF[vowel]


DEFAULT_OPTIONS = CueingOptions()

_JOIN_TOLERANCE_S = 0.005
"""Seconds between phones that still count as adjacent: what rounding in files leaves."""


def cue(phones: Iterable[Phone], options: CueingOptions = DEFAULT_OPTIONS) -> Iterator[Key]:
    """Yield the keys of a line of phones.

    Parameters
    ----------
    phones : iterable of Phone
        In order of time. A pause symbol or a gap of more than 5 ms separates keys.
    options : CueingOptions

    Yields
    ------
    Key
        In order of time; rest is not listed.

    Examples
    --------
    >>> line = [Phone(s, i / 10, (i + 1) / 10) for i, s in enumerate(["b", "ɔ̃", "ʒ", "u", "ʁ"])]
    >>> [(k.shape, k.placement) for k in cue(line)]
    [(4, 'mouth'), (1, 'chin'), (3, 'side')]
    """
    waiting: Phone | None = None
    for phone in phones:
        if waiting is not None:
            adjacent = phone.start - waiting.end <= _JOIN_TOLERANCE_S
            if adjacent and phone.symbol in PLACEMENT_OF:
                yield Key(
                    waiting.start, phone.end, (waiting.symbol, phone.symbol),
                    SHAPE_OF[waiting.symbol], options.placement(phone.symbol),
                )  # fmt: skip
                waiting = None
                continue
            yield _consonant_key(waiting)
            waiting = None
        if phone.symbol in SHAPE_OF:
            waiting = phone
        elif phone.symbol != PAUSE:
            yield Key(
                phone.start, phone.end, (phone.symbol,),
                NO_CONSONANT_SHAPE, options.placement(phone.symbol),
            )  # fmt: skip
    if waiting is not None:
        yield _consonant_key(waiting)


def _consonant_key(phone: Phone) -> Key:
    return Key(phone.start, phone.end, (phone.symbol,), SHAPE_OF[phone.symbol], NO_VOWEL_PLACEMENT)


def rest_spans(
    keys: Sequence[Key], options: CueingOptions = DEFAULT_OPTIONS
) -> list[tuple[float, float]]:
    """Return the gaps between keys, (start, end) in seconds, while the hand rests.

    The time before the first key and after the last one is rest too and not listed.
    """
    return [
        (before.end, after.start)
        for before, after in itertools.pairwise(keys)
        if after.start - before.end >= options.rest_gap_s
    ]
