"""Cued Speech: which key cues which phones.

Phones go in, keys come out, by the deterministic left-to-right rule of the code: a consonant
directly before a vowel shares its key, every other consonant is shown at the side, every other
vowel with shape 5. Both ends of the chain use this one rule, so keys need no bits.

Sources: Gibert, Bailly, Elisei 2004, sections 4 and 5.1 (shapes, isolated C and V); the tables
of the code agree over the published French charts; points where the charts differ are
`CueingOptions`.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

from codec.cues.language import PAUSE, Language, french
from codec.cues.score import PLACEMENTS, Key, Phone
from codec.errors import CueError

SHAPE_OF = french().shapes
"""Hand shape of each consonant of French."""

PLACEMENT_OF = french().placement_of
"""Hand placement of each vowel of French, by the majority of the charts."""

NO_CONSONANT_SHAPE, NO_VOWEL_PLACEMENT = french().shape_alone, french().placement_alone
"""Shape of a vowel without a consonant (Cornett 1967), placement of a consonant without a vowel."""


@dataclass(frozen=True, slots=True)
class CueingOptions:
    """How phones are cued: the language, and choices where published charts of French disagree.

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
    language : Language
        Whose phones these are; the three placements count if its `alternatives` have their vowels.

    Examples
    --------
    >>> CueingOptions(oe="cheek").oe
    'cheek'
    """

    un: str = "throat"
    schwa: str = "side"
    oe: str = "side"
    rest_gap_s: float = 0.5
    language: Language = field(default_factory=french)

    def __post_init__(self) -> None:
        for name in ("un", "schwa", "oe"):
            if getattr(self, name) not in PLACEMENTS[1:]:
                raise CueError(f"option {name}: unknown placement {getattr(self, name)!r}")
        if not 0 <= self.rest_gap_s <= 60:
            raise CueError(f"rest_gap_s is {self.rest_gap_s} s, not within 0..60")

    @property
    def are_usual(self) -> bool:
        """Whether nothing but the language differs from the default."""
        return self == CueingOptions(language=self.language)

    def in_language(self, language: Language) -> "CueingOptions":
        """Return the same choices for another language."""
        return self if self.language == language else replace(self, language=language)

    def placement(self, vowel: str) -> str:
        """Return the placement of `vowel` under these options."""
        special = {"œ̃": self.un, "ə": self.schwa, "œ": self.oe}
        if vowel in special and vowel in self.language.alternatives:
            return special[vowel]
        return self.language.placement_of[vowel]

    def key_of(self, consonant: str, vowel: str) -> tuple[int, str]:
        """Return shape and placement of a key of one or two phones; "" is none."""
        language = self.language
        shape = language.shapes[consonant] if consonant else language.shape_alone
        return shape, self.placement(vowel) if vowel else language.placement_alone


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

    Raises
    ------
    CueError
        If a phone is not one of the language's.

    Examples
    --------
    >>> line = [Phone(s, i / 10, (i + 1) / 10) for i, s in enumerate(["b", "ɔ̃", "ʒ", "u", "ʁ"])]
    >>> [(k.shape, k.placement) for k in cue(line)]
    [(4, 'mouth'), (1, 'chin'), (3, 'side')]
    """
    waiting: Phone | None = None
    shapes, vowels = options.language.shapes, options.language.placement_of
    for phone in phones:
        # A consonant waits for its vowel: CV is one key, C alone takes the placement of no vowel, V
        # alone the shape of no consonant.
        if waiting is not None:
            adjacent = phone.start - waiting.end <= _JOIN_TOLERANCE_S
            if adjacent and phone.symbol in vowels:
                yield Key(
                    waiting.start,
                    phone.end,
                    (waiting.symbol, phone.symbol),
                    *options.key_of(waiting.symbol, phone.symbol),
                )
                waiting = None
                continue
            yield _consonant_key(waiting, options)
            waiting = None
        if phone.symbol in shapes:
            waiting = phone
        elif phone.symbol in vowels:
            yield Key(phone.start, phone.end, (phone.symbol,), *options.key_of("", phone.symbol))
        elif phone.symbol != PAUSE:
            raise CueError(f"{options.language.name} has no phone {phone.symbol!r}")
    if waiting is not None:
        yield _consonant_key(waiting, options)


def _consonant_key(phone: Phone, options: CueingOptions) -> Key:
    return Key(phone.start, phone.end, (phone.symbol,), *options.key_of(phone.symbol, ""))
