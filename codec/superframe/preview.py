"""Previews: the keys of a superframe to come, in few bits, against its loss.

A superframe says which keys start in the second and the fourth one after it, and in the sixth
where little is said: shape, placement and start, and where silences begin, but not the phones. If
such a superframe is lost, its keys are known all the same, unless all that spoke of it are lost
too. The distances are even so that no run of two losses takes two of them; the nearest preview,
which serves nearly always, codes times to a tick, the others to two.
Specification: spec/bitstream.md, section 3.2.
"""

import itertools

from codec.cues.cueing import DEFAULT_OPTIONS
from codec.cues.language import Language, french
from codec.cues.timeline import TICKS
from codec.superframe.range_coder import RangeDecoder, RangeEncoder, cumulative
from codec.superframe.score_coding import ScorePart
from codec.superframe.tables import ScoreTables

FRENCH = french()

AHEAD = (2, 4, 6)
"""Distances of the superframes that a superframe can preview."""

CHOICES: tuple[tuple[int, ...], ...] = ((), (2,), (4,), (2, 4), (2, 4, 6))
"""Which of them it does, by symbol."""

EXACT = 2
"""Distance of the preview whose times are exact to a tick."""

CELL = 2
"""Resolution of times of the others, in ticks."""

SILENCE = french().silence
"""Symbol of a silence in French; those of keys are below (`Language.symbol_of`).

The symbol behind it is the context of a preview's first start: the superframe's beginning."""

_CELLS = TICKS // CELL

WHICH = cumulative([12, 1, 1, 4, 14])
"""Frequencies of the previews that there are (V1)."""

_CONSONANT_PERCENT = 40
"""Share of a key's length that is its consonant."""

Preview = tuple[tuple[int, int], ...]
"""Ticks at which keys and silences start, ascending, and their symbols."""


def preview_of(part: ScorePart, distance: int = EXACT) -> Preview:
    """Return the preview of a superframe's score.

    Examples
    --------
    >>> part = ScorePart(0, 5, (25, 7, 0), (5, 9, 20))
    >>> preview_of(part), preview_of(part, 4)
    (((5, 16), (20, 40)), ((5, 16), (21, 40)))
    """
    found: list[tuple[int, int]] = []
    before, least = part.first, 0
    following = (*part.numbers, part.ahead)[1:]
    for number, after, start in zip(part.numbers, following, part.starts, strict=True):
        if number == 0 or part.language.starts_key(before, number):
            symbol = _symbol(part, number, after, start)
            tick = max(start, CELL * least)
            if symbol >= 0 and tick < TICKS:
                least = tick // CELL + 1
                found.append((tick if distance == EXACT else CELL * least - 1, symbol))
        before = number
    return tuple(found)


def thinned(preview: Preview) -> Preview:
    """Return a preview without what lasts least in it.

    The last start stays, for the superframe after goes on from it.

    Examples
    --------
    >>> thinned(((5, 16), (9, 3), (20, 40)))
    ((9, 3), (20, 40))
    """
    lengths = [after[0] - start[0] for start, after in itertools.pairwise(preview)]
    least = lengths.index(min(lengths)) if lengths else len(preview)
    return preview[:least] + preview[least + 1 :]


def _symbol(part: ScorePart, number: int, after: int, start: int) -> int:
    """Return the symbol of a key or a silence, -1 for a hand at rest amid speech."""
    language = part.language
    if number == 0:
        return language.silence
    vowel = number if language.is_vowel(number) else after if language.is_vowel(after) else 0
    consonant = language.phones[number] if language.is_consonant(number) else ""
    shape, named = part.options.key_of(consonant, language.phones[vowel] if vowel else "")
    shape, placement = part.overrides.get(start, (shape, language.placements.index(named)))
    return language.symbol_of(shape, placement) if shape and placement else -1


def part_of_preview(preview: Preview, language: Language = FRENCH) -> ScorePart:
    """Return a score that gives the keys of a preview, with phones that stand for the true ones.

    Examples
    --------
    >>> part = part_of_preview(((5, 16), (20, 40)))
    >>> part.numbers, part.starts, part.coarse
    ((26, 6, 0), (5, 11, 20), True)
    """
    numbers, starts = list[int](), list[int]()
    ends = [*(tick for tick, _ in preview), TICKS][1:]
    for (tick, symbol), end in zip(preview, ends, strict=True):
        starts.append(tick)
        if symbol == language.silence:
            numbers.append(0)
            continue
        shape, placement = language.key_of(symbol)
        numbers.append(language.stand_ins[0][shape - 1])
        vowel = language.stand_ins[1][placement - 1]
        if vowel:
            numbers.append(vowel)
            starts.append(tick + max(1, _CONSONANT_PERCENT * (end - tick) // 100))
    # A vowel that would begin after the superframe's end is known to follow, as in S7.
    ahead = 0
    if starts and starts[-1] >= TICKS:
        starts.pop()
        ahead = numbers.pop()
    end = starts[0] if starts else TICKS
    options = DEFAULT_OPTIONS.in_language(language)
    return ScorePart(0, end, tuple(numbers), tuple(starts), ahead, options, coarse=True)


def write_previews(
    encoder: RangeEncoder, previews: dict[int, Preview], tables: ScoreTables
) -> None:
    """Append previews by their distance (V1 to V3)."""
    encoder.put(CHOICES.index(tuple(sorted(previews))), WHICH)
    for distance in sorted(previews):
        cell, before = -1, tables.beginning
        for tick, symbol in previews[distance]:
            encoder.put(tick // CELL - cell - 1, tables.gap[before], _CELLS - 1 - cell)
            if distance == EXACT:
                encoder.put_bits(tick % CELL, 1)
            encoder.put(symbol, tables.key[before])
            cell, before = tick // CELL, symbol
        if cell < _CELLS - 1:
            encoder.put(_CELLS - 1 - cell, tables.gap[before], _CELLS - 1 - cell)


def read_previews(decoder: RangeDecoder, tables: ScoreTables) -> dict[int, Preview]:
    """Read what `write_previews` wrote; any code gives previews."""
    return {
        distance: _read_preview(decoder, tables, distance)
        for distance in CHOICES[decoder.get(WHICH)]
    }


def _read_preview(decoder: RangeDecoder, tables: ScoreTables, distance: int) -> Preview:
    found: list[tuple[int, int]] = []
    cell, before = -1, tables.beginning
    while cell < _CELLS - 1:
        gap = decoder.get(tables.gap[before], _CELLS - 1 - cell)
        if gap == _CELLS - 1 - cell:
            break
        cell += gap + 1
        tick = CELL * cell + (decoder.get_bits(1) if distance == EXACT else CELL // 2)
        before = min(decoder.get(tables.key[before]), tables.beginning - 1)
        found.append((tick, before))
    return tuple(found)
