"""Windows: the score of a compact superframe, as many phones as its few bytes hold.

A window begins near its superframe's time and goes on, phone after phone, until its bytes end;
the next window begins where it stopped. Windows therefore run ahead while little is said and fall
back while much is. Each can be read without the others; only a key that two share needs both.
Lengths are told to 20 ms, to 40 ms or by rule, whichever keeps up with speech.
Specification: spec/bitstream.md, section 3.1.
"""

import bisect
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.bits import COMPACT, COMPACT_HEADER_BYTES, COMPACT_SEQUENCES, Header, voice_bit
from codec.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.range_coder import TOTAL, RangeDecoder, RangeEncoder, cumulative
from codec.score_coding import (
    NOTHING,
    is_consonant,
    is_vowel,
    letter_of,
    number_of,
    read_options,
    write_options,
)
from codec.tables import ScoreTables, score_tables
from codec.timeline import TICKS, Line, Sounding

MIN_BYTES, MAX_BYTES = 4, 12
"""Sizes of L0 in compact mode."""

EARLIEST = -16
"""Earliest tick at which a window can begin, from its superframe's beginning."""

LAST = 2 * TICKS + 14
"""Last tick at which a phone of a window starts: the next window can begin with the one after."""

_BEGIN_CELL = 8
_BEGIN = cumulative([1, 2, 4, 6, 8, 8, 4, 2, 1, 1, 1, 1])
"""Table of the cells in which a window begins."""

FINE, COARSE, RULED = range(3)
_TIMING = cumulative([1, 1, 2])
_PACE = cumulative([2, 6, 10, 6, 4, 2, 1, 1])
_PLAIN_OR_SPECIAL = cumulative([127, 1])
_UNIT = (1, 2, 2)
_BEGIN_UNIT = (2, 2, 4)
_UNITS = (32, 16, 16)
"""Greatest length by timing, in units; a pause of that length lasts until the next window."""

_KEEPS_UP = (20, 4, EARLIEST)
"""Where the next window may begin, from its superframe's beginning, for a timing to be used."""


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
    """

    begin: int
    end: int
    numbers: tuple[int, ...]
    starts: tuple[int, ...]
    options: CueingOptions = DEFAULT_OPTIONS

    @property
    def overrides(self) -> dict[int, tuple[int, int]]:
        """Keys that do not follow the rule: never any."""
        return {}


@dataclass(frozen=True, slots=True)
class _Length:
    """How a window tells lengths: timing and pace."""

    timing: int
    pace: int = 0

    def ruled(self, number: int, tables: ScoreTables) -> int:
        """Return the length of a phone by rule, in ticks (M6)."""
        return min(max(int(tables.usual[number]) * (4 + self.pace) + 64 >> 7, 1), TICKS)


_PACES = tuple(_Length(RULED, pace) for pace in range(len(_PACE) - 1))
_PACED = 8
"""Phones by whose lengths the pace is chosen."""

_BEYOND = 40
"""Bits beyond its room up to which a code is written, before it is cut off."""

_HORIZON = 16
"""Windows over which a writer looks ahead."""

_PAUSE_BITS = 3.0
"""Bits of a pause's length, about."""

_RULED_BITS = 18.0
"""Bits of a window with timing by rule that are not phones, about."""

_GAP = 6
"""Most ticks between two windows that are not a silence."""


def read_window(l0: bytes) -> tuple[int, Window]:
    """Return the voice's bit and the window of a compact L0 part.

    Any bytes behind the header give a window.
    """
    decoder, tables = RangeDecoder(l0[COMPACT_HEADER_BYTES:]), score_tables()
    bit = decoder.get_bits(1)
    options = DEFAULT_OPTIONS
    if decoder.get(_PLAIN_OR_SPECIAL):
        options = read_options(decoder)
    timing = decoder.get(_TIMING)
    begin = EARLIEST + _BEGIN_CELL * decoder.get(_BEGIN)
    begin += _BEGIN_UNIT[timing] * decoder.get_bits(_begin_bits(timing))
    length = _Length(timing, decoder.get(_PACE) if timing == RULED else 0)
    numbers, lengths = _read_phones(decoder, begin, length, tables)
    while numbers and numbers[-1] == 0:
        numbers.pop()
    ends = list(itertools.accumulate(lengths[: len(numbers)], initial=begin))
    return bit, Window(begin, ends[-1], tuple(numbers), tuple(ends[:-1]), options)


def _read_phones(
    decoder: RangeDecoder, tick: int, length: _Length, tables: ScoreTables
) -> tuple[list[int], list[int]]:
    """Return numbers and lengths of the phones, as far as they are determined."""
    numbers, lengths = list[int](), list[int]()
    context, spoken = (NOTHING, NOTHING), 0
    while tick <= LAST:
        letter = decoder.get_certain(tables.next[context] if numbers else tables.opening)
        if letter < 0:
            break
        number = number_of(letter)
        if number and length.timing == RULED:
            ticks = length.ruled(number, tables)
        else:
            row, limit = _row(number, spoken, length.timing, tables)
            units = decoder.get_certain(row, limit)
            if units < 0 or (number == 0 and units == limit):
                break
            ticks = _UNIT[length.timing] * (units + 1)
        numbers.append(number)
        lengths.append(ticks)
        context, spoken = (context[1], number), ticks if number else 0
        tick += ticks
    return numbers, lengths


def _begin_bits(timing: int) -> int:
    return (_BEGIN_CELL // _BEGIN_UNIT[timing]).bit_length() - 1


def _row(
    number: int, spoken: int, timing: int, tables: ScoreTables
) -> tuple[NDArray[np.int64], int]:
    """Return table and limit of a phone's length."""
    table = tables.length if timing == FINE else tables.coarse
    return table[number, tables.tempo(spoken)], _UNITS[timing] - 1


class WindowWriter:
    """Compact superframes of a line of phones, each of the same size.

    Parameters
    ----------
    line : Line
    options : CueingOptions
        Under which the receiver derives keys.
    identity : str
        Of the voice.
    size : int
        Bytes of L0.
    first : int
        Number of the first superframe that will be on air.
    """

    def __init__(
        self, line: Line, options: CueingOptions, identity: str, size: int, *, first: int = 0
    ) -> None:
        self._line = line
        self._options = options
        self._identity = identity
        self._room = size - COMPACT_HEADER_BYTES
        self._first = max(first, line.starts[1] // TICKS if len(line.starts) > 1 else 0)
        self._payloads: list[bytes] = []
        self._next = 1
        self._spent, self._silence = _spent(line), _silences(line)

    def l0(self, index: int) -> bytes:
        """Return the L0 part of superframe `index`."""
        while index >= self._first + len(self._payloads) and self._next < len(self._line.starts):
            self._payloads.append(self._payload(self._first + len(self._payloads)))
        place = index - self._first
        inside = 0 <= place < len(self._payloads)
        payload = self._payloads[place] if inside else self._empty(index)
        sequence = index % COMPACT_SEQUENCES
        return Header(COMPACT, sequence, 0, 0).to_bytes() + payload

    def _payload(self, index: int) -> bytes:
        """Return the next payload, and go on behind the phones that it holds."""
        line, begin = self._line, index * TICKS
        while self._next < len(line.starts) and not line.numbers[self._next]:
            self._next += 1
        if self._next < len(line.starts) and line.starts[self._next] < begin + EARLIEST:
            # Speech that no timing keeps up with loses keys.
            while self._next < len(line.starts) and (
                line.starts[self._next] < begin or not self._starts_key(self._next)
            ):
                self._next += 1
        if self._next == len(line.starts) or line.starts[self._next] > begin + LAST:
            return self._empty(index)
        start = self._next - self._needs_pause(self._next)
        best = start, self._empty(index)
        for length in (_Length(FINE), _Length(COARSE), self._ruled()):
            payload = self._code(index, start, length)
            window = read_window(bytes(COMPACT_HEADER_BYTES) + payload)[1]
            reached = start + len(window.numbers)
            best = max(best, (reached, payload), key=lambda pair: pair[0])
            rest = [k for k in range(reached, len(line.starts)) if line.numbers[k]][:1]
            ahead = line.starts[rest[0]] - begin - TICKS if rest else TICKS
            if ahead >= _KEEPS_UP[length.timing] and self._keeps_up(index + 1, reached):
                best = reached, payload
                break
        self._next = best[0]
        return best[1]

    def _keeps_up(self, index: int, k: int) -> bool:
        """Return whether windows from `index` on keep up with speech from phone `k` on.

        It is tried with timing by rule, which takes least, over a few windows to come.
        """
        starts, numbers = self._line.starts, self._line.numbers
        for tick in range(index * TICKS, (index + _HORIZON) * TICKS, TICKS):
            while k < len(starts) and not numbers[k]:
                k += 1
            if k == len(starts) or starts[k] > tick + LAST:
                continue
            if starts[k] < tick + EARLIEST:
                return False
            full = self._spent[k] + 8 * self._room - _RULED_BITS
            k = min(
                max(bisect.bisect_right(self._spent, full) - 1, k + 1),
                bisect.bisect_right(starts, tick + LAST),
                self._silence[k],
            )
        return True

    def _needs_pause(self, k: int) -> bool:
        """Return whether a window that begins with a phone has to tell the pause before it.

        It could be taken for the vowel of a consonant in the window before, or in a lost one.
        """
        numbers = self._line.numbers
        return (
            is_vowel(numbers[k])
            and numbers[k - 1] == 0
            and (not self._payloads or is_consonant(numbers[k - 2]))
        )

    def _starts_key(self, k: int) -> bool:
        numbers = self._line.numbers
        return numbers[k] > 0 and not (is_vowel(numbers[k]) and is_consonant(numbers[k - 1]))

    def _ruled(self) -> _Length:
        """Return the pace that fits the next phones best."""
        line, tables = self._line, score_tables()
        ahead = range(self._next, min(self._next + _PACED, len(line.starts) - 1))
        lengths = [
            (line.numbers[k], line.starts[k + 1] - line.starts[k]) for k in ahead if line.numbers[k]
        ]

        def error(pace: _Length) -> int:
            late = [pace.ruled(number, tables) - ticks for number, ticks in lengths]
            return max(map(abs, itertools.accumulate(late)), default=0)

        return min(_PACES, key=error)

    def _empty(self, index: int) -> bytes:
        """Return the payload of a superframe in which nothing begins."""
        encoder = self._opened(index, 0, _Length(FINE))
        encoder.put(letter_of(0), score_tables().opening)
        row, limit = _row(0, 0, FINE, score_tables())
        encoder.put(limit, row, limit)
        return encoder.finish(certain=True)[: self._room].ljust(self._room, b"\0")

    def _opened(self, index: int, begin: int, length: _Length) -> RangeEncoder:
        encoder = RangeEncoder()
        encoder.put_bits(voice_bit(self._identity, index), 1)
        special = self._options != DEFAULT_OPTIONS
        encoder.put(int(special), _PLAIN_OR_SPECIAL)
        if special:
            write_options(encoder, self._options)
        timing = length.timing
        cell, rest = divmod(begin - EARLIEST, _BEGIN_CELL)
        encoder.put(timing, _TIMING)
        encoder.put(cell, _BEGIN)
        encoder.put_bits(rest // _BEGIN_UNIT[timing], _begin_bits(timing))
        if timing == RULED:
            encoder.put(length.pace, _PACE)
        return encoder

    def _code(self, index: int, first: int, length: _Length) -> bytes:
        """Return the code of the phones from number `first` on, cut off at its room."""
        line, tables = self._line, score_tables()
        unit = _BEGIN_UNIT[length.timing]
        tick = line.starts[first] - index * TICKS
        if line.numbers[first] == 0:
            tick = line.starts[first + 1] - index * TICKS - unit
        tick = min(max(tick + unit // 4, EARLIEST), LAST) - EARLIEST
        tick += EARLIEST - tick % unit
        encoder = self._opened(index, tick, length)
        context, spoken = (NOTHING, NOTHING), 0
        for k in range(first, len(line.starts)):
            number = line.numbers[k]
            encoder.put(letter_of(number), tables.opening if k == first else tables.next[context])
            if number and length.timing == RULED:
                ticks = length.ruled(number, tables)
            else:
                row, limit = _row(number, spoken, length.timing, tables)
                unit, units = _UNIT[length.timing], limit + 1
                if k + 1 < len(line.starts):
                    end = line.starts[k + 1] - index * TICKS
                    units = min(max((end - tick + unit // 2) // unit, 1), limit + 1)
                encoder.put(units - 1, row, limit)
                if number == 0 and units > limit:
                    break
                ticks = unit * units
            context, spoken = (context[1], number), ticks if number else 0
            tick += ticks
            if tick > LAST or encoder.bits > 8 * self._room + _BEYOND:
                break
        return encoder.finish(certain=True)[: self._room].ljust(self._room, b"\0")


def _spent(line: Line) -> list[float]:
    """Return the bits of all phones before each one, timed by rule, and of all at last."""
    tables = score_tables()
    bits, context = [0.0], (NOTHING, NOTHING)
    for number in line.numbers:
        row, letter = tables.next[context[0], context[1] % NOTHING], letter_of(number)
        bits.append(bits[-1] - math.log2((row[letter + 1] - row[letter]) / TOTAL))
        if not number:
            bits[-1] += _PAUSE_BITS
        context = context[1], number
    return bits


def _silences(line: Line) -> list[int]:
    """Return the number of the next pause that ends a window, for each phone."""
    after, found = len(line.starts), list[int]()
    for k in range(len(line.starts) - 1, -1, -1):
        end = line.starts[k + 1] if k + 1 < len(line.starts) else line.starts[k] + TICKS
        if not line.numbers[k] and end - line.starts[k] >= TICKS:
            after = k
        found.append(after)
    return found[::-1]


def join_windows(windows: Mapping[int, Window]) -> list[Sounding]:
    """Return the phones of windows and the silences between them (J6, J7)."""
    line = list[Sounding]()
    hole, before = False, min(windows, default=0) - 1
    for index in sorted(windows):
        window, base = windows[index], index * TICKS
        hole, before = hole or index != before + 1, index
        if not window.numbers:
            continue
        begin = base + window.begin
        _squeeze(line, begin)
        if line and hole:
            if is_consonant(line[-1].number):
                line[-1] = replace(line[-1], open_end=True)
            line.append(Sounding(0, line[-1].end, begin, open_start=True, open_end=True))
        elif line and begin - line[-1].end <= _GAP:
            line[-1] = replace(line[-1], end=begin)
        elif line:
            line.append(Sounding(0, line[-1].end, begin))
        ends = (*window.starts[1:], window.end)
        line += [
            Sounding(number, base + start, base + end)
            for number, start, end in zip(window.numbers, window.starts, ends, strict=True)
        ]
        if index - 1 not in windows and is_vowel(window.numbers[0]):
            at = len(line) - len(window.numbers)
            line[at] = replace(line[at], open_start=True)
        hole = False
    told = max((k for k, window in windows.items() if window.numbers), default=0)
    if line and told + 1 not in windows and is_consonant(line[-1].number):
        line[-1] = replace(line[-1], open_end=True)
    return line


def _squeeze(line: list[Sounding], end: int) -> None:
    """Move what reaches beyond `end` before it."""
    for k in range(len(line) - 1, -1, -1):
        if line[k].end <= end:
            break
        line[k] = replace(line[k], start=min(line[k].start, end - 1), end=end)
        end = line[k].start
