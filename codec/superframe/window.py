"""Windows: the score of a compact superframe, as many phones as its few bytes hold.

A window begins near its superframe's time and goes on, phone after phone, until its bytes end; the
next window begins where it stopped. Windows therefore run ahead while little is said and fall back
while much is. Each can be read without the others; only a key that two share needs both. Lengths
are coded to 20 ms, or predicted and corrected where that drifts off, whichever keeps up with speech
(`codec.superframe.window_writer`). Specification: spec/bitstream.md, section 3.1.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.language import Language, french
from codec.cues.timeline import TICKS, Sounding
from codec.superframe.bits import COMPACT_HEADER_BYTES, read_header
from codec.superframe.range_coder import RangeDecoder, cumulative
from codec.superframe.score_coding import read_options
from codec.superframe.tables import ScoreTables, score_tables

FRENCH = french()

MIN_BYTES, MAX_BYTES = 4, 12
"""Sizes of L0 in compact mode."""

EARLIEST = -16
"""Earliest tick at which a window can begin, from its superframe's beginning."""

LAST = 3 * TICKS + 14
"""Last tick at which a phone of a window starts: the next window can begin with the one after."""

BEGIN_CELL = 8
"""Ticks of a cell of the window's begin (M4)."""

BEGIN = cumulative([3, 4, 5, 6, 7, 7, 6, 5, 4, 4, 3, 3, 2, 2, 2, 1])
"""Table of a window's first cell."""

FINE, RULED = range(2)

TIMING = cumulative([1, 3])
"""Frequencies of the forms of timing (M3)."""

PACES = (3, 4, 5, 6, 7, 8, 10, 13)
"""Durations of phones by the rule, in eighths of their usual length."""

PACE = cumulative([4, 14, 16, 12, 8, 5, 3, 2])
"""Frequencies of paces (table 3)."""

CORRECTIONS = (0, -2, 2, -4, 4, -7, 7, 12)
"""Lengthening of a vowel beyond the rule, in ticks."""

CORRECTION = cumulative([44, 5, 4, 3, 3, 1, 2, 2])
"""Frequencies of corrections (table 3)."""

PLAIN_OR_SPECIAL = cumulative([127, 1])
"""Frequencies of special rules (M1)."""

SLOW = cumulative([127, 1])
"""Table of whether a piece of the slow channel comes first."""

PIECE_BITS = 16
"""Bits of a piece of the slow channel."""

UNIT = (1, 2)
"""Ticks of a unit of pauses, by timing (M6)."""

BEGIN_UNIT = (2, 4)
"""Ticks between begins, by timing (M4)."""

_UNITS = (32, 16)
"""Greatest length by timing, in units; a pause of that length lasts until the next window."""


@dataclass(frozen=True, slots=True)
class Window:
    """The score of one compact superframe, in ticks from its beginning.

    Attributes
    ----------
    begin, end : int
        Where the first phone begins and the last one ends.
    numbers, starts : tuple of int
        Phones, pauses among them; each ends where the next one starts.
    options : CueingOptions
        Under which keys follow from the phones.
    slow : tuple of int
        Pieces of the slow channel, one at most.

    Examples
    --------
    >>> window = Window(begin=3, end=17, numbers=(1, 2), starts=(3, 9))
    >>> window.end - window.begin, window.overrides
    (14, {})
    """

    begin: int
    end: int
    numbers: tuple[int, ...]
    starts: tuple[int, ...]
    options: CueingOptions = DEFAULT_OPTIONS
    slow: tuple[int, ...] = ()

    @property
    def overrides(self) -> dict[int, tuple[int, int]]:
        """Keys that do not follow the rule: never any."""
        return {}


_GAP = 6
"""Most ticks between two windows that are not a silence."""


def read_window(
    l0: bytes, decoder: RangeDecoder | None = None, language: Language = FRENCH
) -> Window:
    """Return the window of a compact L0 part; `decoder` reads the bits behind its header.

    Any bytes behind the header give a window.
    """
    decoder = decoder or RangeDecoder(l0[COMPACT_HEADER_BYTES:], tail=read_header(l0).tail)
    slow = (decoder.get_bits(PIECE_BITS),) if decoder.get(SLOW) else ()
    options = DEFAULT_OPTIONS.in_language(language)
    if decoder.get(PLAIN_OR_SPECIAL):
        options = read_options(decoder, language)
    timing = decoder.get(TIMING)
    begin = EARLIEST + BEGIN_CELL * decoder.get(BEGIN)
    begin += BEGIN_UNIT[timing] * decoder.get_bits(begin_bits(timing))
    pace = decoder.get(PACE) if timing == RULED else 0
    numbers, lengths = _read_phones(decoder, (begin, timing, pace), language)
    while numbers and numbers[-1] == 0:
        numbers.pop()
    ends = list(itertools.accumulate(lengths[: len(numbers)], initial=begin))
    return Window(begin, ends[-1], tuple(numbers), tuple(ends[:-1]), options, slow)


def _read_phones(
    decoder: RangeDecoder, opened: tuple[int, int, int], language: Language
) -> tuple[list[int], list[int]]:
    """Return numbers and lengths of the phones, as far as they are determined.

    `opened` are the tick at which the window begins, its timing and its pace.
    """
    tick, timing, pace = opened
    tables = score_tables(language)
    numbers, lengths = list[int](), list[int]()
    context, spoken = (language.n_phones, language.n_phones), 0
    correction = 0
    while tick <= LAST and correction >= 0:
        # Bits behind the part's end are unknown: the phones end where those would decide.
        letter = decoder.get_certain(tables.next[context] if numbers else tables.opening)
        if letter < 0:
            break
        number = language.phone_of(letter)
        if number and timing == RULED:
            correction = decoder.get_certain(CORRECTION) if language.is_vowel(number) else 0
            ticks = ruled(number, tables, pace, max(correction, 0))
        elif not numbers and number == 0:
            ticks = BEGIN_UNIT[timing]
        else:
            row, limit = length_row(number, spoken, timing, tables)
            units = decoder.get_certain(row, limit)
            if units < 0 or (number == 0 and units == limit):
                break
            ticks = UNIT[timing] * (units + 1)
        numbers.append(number)
        lengths.append(ticks)
        context, spoken = (context[1], number), ticks if number else 0
        tick += ticks
    return numbers, lengths


def begin_bits(timing: int) -> int:
    """Return the bits for where in its cell a window begins."""
    return (BEGIN_CELL // BEGIN_UNIT[timing]).bit_length() - 1


def ruled(number: int, tables: ScoreTables, pace: int, correction: int = 0) -> int:
    """Return the predicted length of a phone, in ticks (M6)."""
    ticks = int(tables.usual[number]) * PACES[pace] + 64 >> 7
    return min(max(ticks + CORRECTIONS[correction], 1), TICKS)


def length_row(
    number: int, spoken: int, timing: int, tables: ScoreTables
) -> tuple[NDArray[np.int64], int]:
    """Return table and limit of a phone's length."""
    row = tables.length[number, tables.tempo(spoken)] if timing == FINE else tables.pause
    return row, _UNITS[timing] - 1


def join_windows(windows: Mapping[int, Window]) -> list[Sounding]:
    """Return the phones of windows and the silences between them (J6, J7)."""
    line = list[Sounding]()
    hole, before = False, min(windows, default=0) - 1
    for index in sorted(windows):
        window, base = windows[index], index * TICKS
        language = window.options.language
        hole, before = hole or index != before + 1, index
        if not window.numbers:
            continue
        begin = base + window.begin
        _squeeze(line, begin)
        if line and hole:
            if language.is_consonant(line[-1].number):
                line[-1] = replace(line[-1], open_end=True)
            line.append(Sounding(0, line[-1].end, begin, open_start=True, open_end=True))
        # A gap of some ticks is a phone that lasts, a longer one a silence (J7).
        elif line and (begin - line[-1].end <= _GAP or _continues(line[-1], window)):
            line[-1] = replace(line[-1], end=begin)
        elif line:
            line.append(Sounding(0, line[-1].end, begin))
        ends = (*window.starts[1:], window.end)
        line += [
            Sounding(number, base + start, base + end)
            for number, start, end in zip(window.numbers, window.starts, ends, strict=True)
        ]
        if index - 1 not in windows and language.is_vowel(window.numbers[0]):
            at = len(line) - len(window.numbers)
            line[at] = replace(line[at], open_start=True)
        hole = False
    told = max((k for k, window in windows.items() if window.numbers), default=0)
    if line and told + 1 not in windows and _ends_open(line[-1], windows[told]):
        line[-1] = replace(line[-1], open_end=True)
    return line


def _continues(last: Sounding, window: Window) -> bool:
    """Return whether a window begins with the vowel of a consonant that ended the one before.

    A pause between them would be coded.
    """
    return _ends_open(last, window) and window.options.language.is_vowel(window.numbers[0])


def _ends_open(last: Sounding, window: Window) -> bool:
    """Return whether a vowel could complete the key of a phone."""
    return window.options.language.is_consonant(last.number)


def _squeeze(line: list[Sounding], end: int) -> None:
    """Move what reaches beyond `end` before it."""
    for k in range(len(line) - 1, -1, -1):
        if line[k].end <= end:
            break
        line[k] = replace(line[k], start=min(line[k].start, end - 1), end=end)
        end = line[k].start
