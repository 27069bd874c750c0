"""Coding of the score: which phones start in a superframe, and when.

A superframe says which phone sounds as it begins and for how long, then every phone that starts
in it with its length; the last one is cut off at the superframe's end, because the next
superframe has its length. If the last one is a consonant, the vowel that completes its key
follows, so that every key that starts in the superframe is right without its neighbours.
Keys cost nothing: both ends derive them with `codec.cues.cueing`.
Specification: spec/bitstream.md, section 3.
"""

from dataclasses import dataclass, field, replace

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.language import Language, french
from codec.cues.timeline import TICKS, ScoreLine
from codec.superframe.range_coder import RangeDecoder, RangeEncoder, cumulative
from codec.superframe.tables import ScoreTables, equal

FRENCH = french()

_OTHER = "cheek"
"""The other placement that options have for some vowels of French (S9)."""

_NAMES = {"œ̃": "un", "ə": "schwa", "œ": "oe"}
"""Names of these options."""

REST_GAPS_S = (0.25, 0.5, 1.0, 1.8)
"""Silences after which the hand rests that a superframe can name."""

_ON_GRID, _EVEN = 0, 1
"""Forms of timing (S2)."""

TIMING = cumulative([255, 1])
"""Their frequencies."""

PLAIN_OR_SPECIAL = cumulative([127, 1])
"""Frequencies of special rules (S2)."""

AS_RULED = cumulative([7, 1])
"""Frequencies of a key as the rule has it (S9)."""


@dataclass(frozen=True, slots=True)
class ScorePart:
    """The score of one superframe, in ticks from its beginning.

    Attributes
    ----------
    first : int
        Number of the phone that sounds just before the superframe begins.
    first_end : int
        Tick at which it ends, 0..32; 32 says that it lasts to the end at least.
    numbers, starts : tuple of int
        Phones that start within the superframe; each ends where the next one starts, the last
        one not before the superframe's end.
    ahead : int
        Number of the vowel that completes the key of a final consonant, else 0.
    options : CueingOptions
        Under which keys that start here follow from the phones.
    overrides : dict of int to (int, int)
        Shape and placement number of keys that do not follow the rule, by their start.
    coarse : bool
        Whether it is known from a preview only: keys are right, phones and times are not.

    Examples
    --------
    >>> part = ScorePart(first=0, first_end=4, numbers=(1, 2), starts=(4, 9))
    >>> part.without_last().starts
    (4,)
    """

    first: int
    first_end: int
    numbers: tuple[int, ...]
    starts: tuple[int, ...]
    ahead: int = 0
    options: CueingOptions = DEFAULT_OPTIONS
    overrides: dict[int, tuple[int, int]] = field(default_factory=dict)
    coarse: bool = False

    @property
    def language(self) -> Language:
        """That of the options."""
        return self.options.language

    def without_last(self) -> "ScorePart":
        """Return the part without its last phone."""
        overrides = {k: v for k, v in self.overrides.items() if k < self.starts[-1]}
        return ScorePart(
            self.first,
            self.first_end,
            self.numbers[:-1],
            self.starts[:-1],
            0,
            self.options,
            overrides,
        )

    def key_starts(self) -> list[int]:
        """Return the starts of the keys that begin within the superframe."""
        result = []
        before = self.first
        for number, start in zip(self.numbers, self.starts, strict=True):
            if self.language.starts_key(before, number):
                result.append(start)
            before = number
        return result


def part_of(line: ScoreLine, index: int, options: CueingOptions = DEFAULT_OPTIONS) -> ScorePart:
    """Return the part of `line` that superframe `index` carries."""
    begin = index * TICKS
    i = line.first_after(begin)
    j = line.first_after(begin + TICKS)
    starts = [tick - begin for tick in line.starts[i:j]]
    # The phone that began before is sent with its end; a last consonant with the vowel after it,
    # because one key shows both.
    following = line.starts[i] - begin if i < len(line.starts) else TICKS
    ahead = 0
    language = options.language
    if language.is_consonant(line.numbers[j - 1]) and j < len(line.numbers):
        ahead = line.numbers[j] if language.is_vowel(line.numbers[j]) else 0
    part = ScorePart(
        line.numbers[i - 1], min(following, TICKS), line.numbers[i:j], tuple(starts), ahead, options
    )
    overrides = {
        start: line.overrides[begin + start]
        for start in part.key_starts()
        if begin + start in line.overrides
    }
    return ScorePart(
        part.first, part.first_end, part.numbers, part.starts, ahead, options, overrides
    )


def evenly(part: ScorePart) -> ScorePart:
    """Return the same phones at even distances: what remains when their times do not fit (S8)."""
    n = len(part.numbers)
    starts = tuple(TICKS * i // n for i in range(n))
    moved = dict(zip(part.starts, starts, strict=True))
    overrides = {moved[start]: value for start, value in part.overrides.items()}
    return ScorePart(part.first, 0, part.numbers, starts, part.ahead, part.options, overrides)


def write_score(
    encoder: RangeEncoder, part: ScorePart, tables: ScoreTables, *, even: bool = False
) -> None:
    """Append a superframe's score; `even` for a part that `evenly` made."""
    encoder.put(_EVEN if even else _ON_GRID, TIMING)
    special = not part.options.are_usual or bool(part.overrides)
    language = part.language
    encoder.put(int(special), PLAIN_OR_SPECIAL)
    encoder.put(language.letter_of(part.first), tables.first)
    context, length = (language.n_phones, part.first), 0
    if even:
        encoder.put_bits(len(part.numbers) - 1, 5)
    else:
        encoder.put(part.first_end, tables.left[part.first], TICKS)
    for i, (number, start) in enumerate(zip(part.numbers, part.starts, strict=True)):
        encoder.put(language.letter_of(number), tables.next[context])
        if not even:
            end = part.starts[i + 1] if i + 1 < len(part.starts) else TICKS
            row = tables.length[number, tables.tempo(length)]
            # p(length | phone, tempo of the phone before it), of those that end within the
            # superframe.
            encoder.put(end - start - 1, row, TICKS - start - 1)
            length = end - start if number else 0
        context = context[1], number
    if language.is_consonant(context[1]):
        none = language.n_vowels
        encoder.put(part.ahead - 1 if part.ahead else none, tables.next[context], none)
    if special:
        _write_special(encoder, part)


def read_score(
    decoder: RangeDecoder, tables: ScoreTables, language: Language = FRENCH
) -> ScorePart:
    """Read what `write_score` wrote; any code is a valid score."""
    even = decoder.get(TIMING) == _EVEN
    special = decoder.get(PLAIN_OR_SPECIAL) == 1
    first = language.phone_of(decoder.get(tables.first))
    if even:
        first_end, numbers, starts = 0, *_read_even(decoder, tables, first, language)
    else:
        first_end = decoder.get(tables.left[first], TICKS)
        numbers, starts = _read_on_grid(decoder, tables, (first, first_end), language)
    ahead = 0
    context = (language.n_phones, first, *numbers)[-2:]
    if language.is_consonant(context[1]):
        letter = decoder.get(tables.next[context], language.n_vowels)
        ahead = letter + 1 if letter < language.n_vowels else 0
    options = DEFAULT_OPTIONS.in_language(language)
    part = ScorePart(first, first_end, tuple(numbers), tuple(starts), ahead, options)
    return _read_special(decoder, part) if special else part


def _read_even(
    decoder: RangeDecoder, tables: ScoreTables, first: int, language: Language
) -> tuple[list[int], list[int]]:
    n = decoder.get_bits(5) + 1
    numbers, context = [], (language.n_phones, first)
    for _ in range(n):
        context = context[1], language.phone_of(decoder.get(tables.next[context]))
        numbers.append(context[1])
    return numbers, [TICKS * i // n for i in range(n)]


def _read_on_grid(
    decoder: RangeDecoder, tables: ScoreTables, first: tuple[int, int], language: Language
) -> tuple[list[int], list[int]]:
    """Return phones and starts behind the first phone, whose number and end are given."""
    start = first[1]
    numbers, starts, length, context = [], [], 0, (language.n_phones, first[0])
    while start < TICKS:
        number = language.phone_of(decoder.get(tables.next[context]))
        row = tables.length[number, tables.tempo(length)]
        length = decoder.get(row, TICKS - start - 1) + 1
        numbers.append(number)
        starts.append(start)
        start += length
        length = length if number else 0
        context = context[1], number
    return numbers, starts


def write_options(encoder: RangeEncoder, options: CueingOptions) -> None:
    """Append the options of cueing (S9)."""
    for vowel in options.language.alternatives:
        encoder.put_bits(options.placement(vowel) == _OTHER, 1)
    gap = min(range(4), key=lambda i: abs(REST_GAPS_S[i] - options.rest_gap_s))
    encoder.put_bits(gap, 2)


def read_options(decoder: RangeDecoder, language: Language = FRENCH) -> CueingOptions:
    """Read what `write_options` wrote."""
    chosen = [vowel for vowel in language.alternatives if decoder.get_bits(1)]
    named = {name: _OTHER for vowel, name in _NAMES.items() if vowel in chosen}
    gap = REST_GAPS_S[decoder.get_bits(2)]
    return replace(DEFAULT_OPTIONS, rest_gap_s=gap, language=language, **named)


def _write_special(encoder: RangeEncoder, part: ScorePart) -> None:
    write_options(encoder, part.options)
    for start in part.key_starts():
        override = part.overrides.get(start)
        encoder.put(int(override is not None), AS_RULED)
        if override is not None:
            encoder.put(override[0], equal(part.language.n_shapes))
            encoder.put(override[1], equal(part.language.n_placements))


def _read_special(decoder: RangeDecoder, part: ScorePart) -> ScorePart:
    options, language = read_options(decoder, part.language), part.language
    overrides = {
        start: (decoder.get(equal(language.n_shapes)), decoder.get(equal(language.n_placements)))
        for start in part.key_starts()
        if decoder.get(AS_RULED)
    }
    return ScorePart(
        part.first, part.first_end, part.numbers, part.starts, part.ahead, options, overrides
    )
