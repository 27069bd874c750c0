"""The score of a whole file, encoded once: phones or keys one after another, with their lengths.

On air every superframe has to stand alone. A file is read from its beginning, so that its score
needs no beginnings and no look-ahead. Scores that were read off a hand follow no language's
phonology: they are encoded key by key. A `ScoreLine` goes in, bytes come out, and back.
Specification: spec/bitstream.md, section 8.1.
"""

import functools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cues.cueing import (
    DEFAULT_OPTIONS,
    NO_CONSONANT_SHAPE,
    NO_VOWEL_PLACEMENT,
    SHAPE_OF,
    CueingOptions,
)
from codec.cues.phonology import PHONES
from codec.cues.score import PLACEMENT_NUMBER, PLACEMENTS
from codec.cues.timeline import TICKS, ScoreLine
from codec.errors import BitstreamError
from codec.superframe._kernels import POSITION
from codec.superframe.range_coder import FLIP, RangeDecoder, RangeEncoder, cumulative
from codec.superframe.score_coding import (
    AS_RULED,
    N_VOWELS,
    NOTHING,
    PLACEMENTS_TABLE,
    PLAIN_OR_SPECIAL,
    SHAPES,
    is_consonant,
    is_vowel,
    letter_of,
    number_of,
    read_options,
    write_options,
)
from codec.superframe.tables import ScoreTables, score_tables

Table = NDArray[np.int64]

SPOKEN, KEYED = range(2)
"""Forms of the score (F8)."""

FORMS = cumulative([1, 1])
"""Their frequencies."""

BY_RULE = cumulative([31, 1])
"""Frequencies of whether a key's consonant has the usual part of it (F11)."""

SILENCES = cumulative([4, 1, 1, 1, 2, 4, 8, 8, 6, 3, 2, 1, 1, 1, 0.5, 0.5])
"""Frequencies of how many bits the length of a silence has, 0 for one that does not end (F12)."""

USUAL_CONSONANTS = "dkʁntlgj"
"""The consonant of each shape that French has most (F11)."""

_OFTEN = 10
"""Times that it counts against each of the others."""

_LONGEST_WIDTH = 14
"""Bits of the longest silence: five minutes and more than a key can last (F12)."""
_SILENCE = 40
"""Symbol of silence (V2)."""

_BEFORE_ALL = -(1 << 40)
"""Tick before any that occurs: the first pause begins there."""

_SPARE_BYTES = 8
"""Bytes that a code's end can lie behind what its decoder has taken in."""


@dataclass(frozen=True, slots=True)
class FileScore:
    """A file's common data.

    Attributes
    ----------
    line : ScoreLine or None
        None if the file has no score.
    options : CueingOptions
    learning : bool
        Whether the prediction learns from past superframes (F13).
    """

    line: ScoreLine | None
    options: CueingOptions
    learning: bool


NOTHING_TOLD = FileScore(None, DEFAULT_OPTIONS, learning=False)
"""What a file without a score says."""


def usual_consonant(ticks: int) -> int:
    """Return the ticks of the consonant in a key of `ticks` (F11).

    Examples
    --------
    >>> usual_consonant(5), usual_consonant(30)
    (2, 7)
    """
    return max(1, min((4 * ticks + 5) // 10, 7))


def trimmed(line: ScoreLine, indices: range) -> ScoreLine:
    """Return the part of a line that superframes cover, with the phone that completes its last key.

    It begins with a pause, or with what sounds, one superframe before the first, and ends with a
    pause.
    """
    begin, stop = TICKS * (indices.start - 1), TICKS * indices.stop
    i = line.first_after(begin)
    numbers, starts = [line.numbers[0]], [line.starts[0]]
    if line.numbers[i - 1] and (i == len(line.starts) or line.starts[i] > begin):
        numbers.append(line.numbers[i - 1])
        starts.append(begin)
    overrides = {k: v for k, v in line.overrides.items() if begin <= k < stop}
    for number, start in zip(line.numbers[i:], line.starts[i:], strict=True):
        ended = start >= stop and not (is_vowel(number) and is_consonant(numbers[-1]))
        if ended and numbers[-1]:
            numbers.append(0)
            starts.append(start)
        if ended:
            break
        numbers.append(number)
        starts.append(start)
    return ScoreLine(tuple(numbers), tuple(starts), overrides)


def write_told(told: FileScore, indices: range) -> bytes:
    """Return the bytes of a file's common data, in the shorter form.

    Parameters
    ----------
    told : FileScore
        With a line that `trimmed` made.
    indices : range
        Superframes of the file.
    """
    if told.line is None:
        return b""
    spoken = _begun(told, SPOKEN)
    _write_spoken(spoken, told.line, indices)
    if _is_special(told):
        _write_overrides(spoken, told.line)
    forms = [spoken]
    keys = _keys_of(told.line, told.options)
    if keys is not None:
        keyed = _begun(told, KEYED)
        if _write_keyed(keyed, keys, indices, told.options):
            forms.append(keyed)
    return min(forms, key=lambda form: form.bits).finish(certain=True)


def _is_special(told: FileScore) -> bool:
    assert told.line is not None
    return told.options != DEFAULT_OPTIONS or bool(told.line.overrides)


def _begun(told: FileScore, form: int) -> RangeEncoder:
    encoder = RangeEncoder()
    encoder.put(form, FORMS)
    encoder.put(int(_is_special(told)), PLAIN_OR_SPECIAL)
    if _is_special(told):
        write_options(encoder, told.options)
    encoder.put(int(told.learning), FLIP)
    return encoder


def read_told(data: bytes, indices: range) -> FileScore:
    """Read what `write_told` wrote.

    Raises
    ------
    BitstreamError
        If it has more phones than possible (F10).
    """
    if not data:
        return NOTHING_TOLD
    decoder, tables = RangeDecoder(data), score_tables()
    form = decoder.get(FORMS)
    special = decoder.get(PLAIN_OR_SPECIAL) == 1
    options = read_options(decoder) if special else DEFAULT_OPTIONS
    learning = decoder.get(FLIP) == 1
    read = _read_keyed if form == KEYED else _read_spoken
    line = read(decoder, tables, indices, options)
    if special and form == SPOKEN:
        line = replace(line, overrides=_read_overrides(decoder, line))
    return FileScore(line, options, learning)


def _put_length(encoder: RangeEncoder, ticks: int, row: Table) -> None:
    """Append a length of any size: each symbol 32 adds 32 ticks, the last one the rest (F10)."""
    while ticks > TICKS:
        encoder.put(TICKS, row, TICKS)
        ticks -= TICKS
    encoder.put(ticks - 1, row, TICKS)


def _get_length(decoder: RangeDecoder, row: Table) -> int:
    ticks = 0
    while (symbol := decoder.get(row, TICKS)) == TICKS:
        ticks += TICKS
    return ticks + symbol + 1


def _put_silence(encoder: RangeEncoder, ticks: int) -> None:
    """Append the length of a silence: how many bits it has, then these without the first (F12)."""
    width = ticks.bit_length()
    encoder.put(min(width, _LONGEST_WIDTH), SILENCES)
    encoder.put_bits(ticks - (1 << width - 1), width - 1)


def _get_silence(decoder: RangeDecoder, room: int) -> int:
    """Return the length of a silence, one that lasts to the end if it has no bits."""
    width = decoder.get(SILENCES)
    return (1 << width - 1) + decoder.get_bits(width - 1) if width else max(room, 0)


class _LineClock:
    """A line as it grows, from one superframe before a file's first one on."""

    def __init__(self, indices: range, decoder: RangeDecoder) -> None:
        self.numbers, self.starts = [0], [_BEFORE_ALL]
        self.tick, self.stop = TICKS * (indices.start - 1) - 1, TICKS * indices.stop
        self._decoder = decoder

    def add(self, number: int, ticks: int) -> None:
        """Append a phone.

        Raises
        ------
        BitstreamError
            If the data ended long ago.
        """
        if self._decoder.state[POSITION] > len(self._decoder.data) + _SPARE_BYTES:
            raise BitstreamError("the score of the file has no end", section="F10")
        self.numbers.append(number)
        self.starts.append(self.tick)
        self.tick += ticks

    @property
    def room(self) -> int:
        """Ticks until the last superframe ends."""
        return self.stop - self.tick


def _write_spoken(encoder: RangeEncoder, line: ScoreLine, indices: range) -> None:
    tables, stop, length = score_tables(), TICKS * indices.stop, 0
    starts = (TICKS * (indices.start - 1) - 1, *line.starts[1:], stop)
    _put_length(encoder, starts[1] - starts[0], tables.length[0, 0])
    context = (NOTHING, 0)
    for number, start, end in zip(line.numbers[1:], starts[1:], starts[2:], strict=False):
        encoder.put(letter_of(number), tables.next[context])
        if number == 0 and start >= stop:
            return
        _put_length(encoder, end - start, tables.length[number, tables.tempo(length)])
        length = end - start if number else 0
        context = context[1], number


def _read_spoken(
    decoder: RangeDecoder, tables: ScoreTables, indices: range, _: CueingOptions
) -> ScoreLine:
    clock, length, context = _LineClock(indices, decoder), 0, (NOTHING, 0)
    clock.tick += _get_length(decoder, tables.length[0, 0])
    while clock.room > 0 or clock.numbers[-1]:
        number = number_of(decoder.get(tables.next[context]))
        if number == 0 and clock.room <= 0:
            clock.add(0, 0)
            break
        row = tables.length[number, tables.tempo(length)]
        length = _get_length(decoder, row)
        clock.add(number, length)
        length = length if number else 0
        context = context[1], number
    return ScoreLine(tuple(clock.numbers), tuple(clock.starts), {})


def _key_starts(line: ScoreLine) -> list[int]:
    """Return the starts of a line's keys (S10)."""
    return [
        start
        for before, number, start in zip(
            line.numbers, line.numbers[1:], line.starts[1:], strict=False
        )
        if number and not (is_vowel(number) and is_consonant(before))
    ]


def _write_overrides(encoder: RangeEncoder, line: ScoreLine) -> None:
    for start in _key_starts(line):
        override = line.overrides.get(start)
        encoder.put(int(override is not None), AS_RULED)
        if override is not None:
            encoder.put(override[0], SHAPES)
            encoder.put(override[1], PLACEMENTS_TABLE)


def _read_overrides(decoder: RangeDecoder, line: ScoreLine) -> dict[int, tuple[int, int]]:
    return {
        start: (decoder.get(SHAPES), decoder.get(PLACEMENTS_TABLE))
        for start in _key_starts(line)
        if decoder.get(AS_RULED)
    }


@dataclass(frozen=True, slots=True)
class _Keyed:
    """A silence or key of the keyed form: its symbol, phones and times."""

    symbol: int
    phones: tuple[int, ...]
    start: int
    consonant: int = 0


@functools.lru_cache(maxsize=256)
def _choices(symbol: int, options: CueingOptions) -> list[tuple[list[int], Table]]:
    """Return the consonants and vowels that a key leaves open, 0 for none, with their tables (F11).

    Recognised keys rarely have more information on lips than the usual consonant.
    """
    shape, place = 1 + symbol // 5, PLACEMENTS[1 + symbol % 5]
    consonants = [n for n in range(N_VOWELS + 1, len(PHONES)) if SHAPE_OF[PHONES[n]] == shape]
    vowels = [n for n in range(1, N_VOWELS + 1) if options.placement(PHONES[n]) == place]
    weights = [_OFTEN if PHONES[n] in USUAL_CONSONANTS else 1 for n in consonants]
    if shape == NO_CONSONANT_SHAPE:
        consonants, weights = [*consonants, 0], [*weights, _OFTEN]
    if place == NO_VOWEL_PLACEMENT:
        vowels = [*vowels, 0]
    return [(consonants, cumulative(weights)), (vowels, cumulative([1] * len(vowels)))]


def _keys_of(line: ScoreLine, options: CueingOptions) -> list[_Keyed] | None:
    """Return a line key by key, None if it cannot be encoded so."""
    if line.overrides:
        return None
    rows: list[_Keyed] = []
    numbers, starts = line.numbers, line.starts
    k = 1
    while k < len(numbers):
        if numbers[k] == 0:
            rows.append(_Keyed(_SILENCE, (0,), starts[k]))
        elif is_vowel(numbers[k]):
            if is_consonant(numbers[k - 1]):
                return None
            symbol = _symbol(NO_CONSONANT_SHAPE, numbers[k], options)
            rows.append(_Keyed(symbol, (0, numbers[k]), starts[k]))
        else:
            paired = k + 1 < len(numbers) and is_vowel(numbers[k + 1])
            vowel = numbers[k + 1] if paired else 0
            symbol = _symbol(SHAPE_OF[PHONES[numbers[k]]], vowel, options)
            consonant = starts[k + 1] - starts[k] if paired else 0
            rows.append(_Keyed(symbol, (numbers[k], vowel), starts[k], consonant))
            k += paired
        k += 1
    return rows


def _symbol(shape: int, vowel: int, options: CueingOptions) -> int:
    place = options.placement(PHONES[vowel]) if vowel else NO_VOWEL_PLACEMENT
    return 5 * (shape - 1) + PLACEMENT_NUMBER[place] - 1


def _write_keyed(
    encoder: RangeEncoder, rows: list[_Keyed], indices: range, options: CueingOptions
) -> bool:
    """Append keys; return whether all could be encoded."""
    tables, stop = score_tables(), TICKS * indices.stop
    begin = TICKS * (indices.start - 1) - 1
    starts = [begin, *(row.start for row in rows), stop]
    _put_silence(encoder, starts[1] - begin)
    for row, start, end in zip(rows, starts[1:-1], starts[2:], strict=True):
        encoder.put(row.symbol, tables.alone)
        if row.symbol == _SILENCE:
            if start < stop and end == stop:
                encoder.put(0, SILENCES)
            elif start < stop:
                _put_silence(encoder, end - start)
            continue
        for phone, (among, table) in zip(row.phones, _choices(row.symbol, options), strict=True):
            encoder.put(among.index(phone), table)
        if end <= start:
            return False
        _put_length(encoder, end - start, tables.held)
        if all(row.phones):
            ruled = row.consonant == usual_consonant(end - start)
            encoder.put(int(not ruled), BY_RULE)
            if not ruled:
                if row.consonant > TICKS:
                    return False
                encoder.put_bits(row.consonant - 1, 5)
    return True


def _read_keyed(
    decoder: RangeDecoder, tables: ScoreTables, indices: range, options: CueingOptions
) -> ScoreLine:
    clock = _LineClock(indices, decoder)
    clock.tick += max(_get_silence(decoder, clock.room), 1)
    while clock.room > 0 or clock.numbers[-1]:
        symbol = decoder.get(tables.alone)
        if symbol == _SILENCE:
            silent = clock.room > 0
            clock.add(0, _get_silence(decoder, clock.room) if silent else 0)
            continue
        consonant, vowel = (among[decoder.get(table)] for among, table in _choices(symbol, options))
        ticks = _get_length(decoder, tables.held)
        if consonant and vowel:
            told = decoder.get(BY_RULE) == 1
            part = decoder.get_bits(5) + 1 if told else usual_consonant(ticks)
            clock.add(consonant, part)
            ticks = max(ticks - part, 1)
        # A code that tells neither, which no sender writes, is the first consonant.
        clock.add(vowel or consonant or N_VOWELS + 1, ticks)
    return ScoreLine(tuple(clock.numbers), tuple(clock.starts), {})
