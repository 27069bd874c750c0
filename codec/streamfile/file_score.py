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

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.language import Language, french
from codec.cues.timeline import TICKS, ScoreLine
from codec.errors import BitstreamError
from codec.superframe._kernels import POSITION
from codec.superframe.range_coder import FLIP, RangeDecoder, RangeEncoder, cumulative
from codec.superframe.score_coding import AS_RULED, PLAIN_OR_SPECIAL, read_options, write_options
from codec.superframe.tables import equal, score_tables

Table = NDArray[np.int64]
FRENCH = french()

SPOKEN, KEYED = range(2)
"""Forms of the score (F8)."""

FORMS = cumulative([1, 1])
"""Their frequencies."""

BY_RULE = cumulative([31, 1])
"""Frequencies of whether a key's consonant has the usual part of it (F11)."""

SILENCES = cumulative([4, 1, 1, 1, 2, 4, 8, 8, 6, 3, 2, 1, 1, 1, 0.5, 0.5])
"""Frequencies of how many bits the length of a silence has, 0 for one that does not end (F12)."""

_OFTEN = 10
"""Times that a language's common consonants count against each of the others (F11)."""

_LONGEST_WIDTH = 14
"""Bits of the longest silence: five minutes and more than a key can last (F12)."""
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


NO_SCORE = FileScore(None, DEFAULT_OPTIONS, learning=False)
"""Score of a file that has none."""


def usual_consonant(ticks: int) -> int:
    """Return the ticks of the consonant in a key of `ticks` (F11).

    Examples
    --------
    >>> usual_consonant(5), usual_consonant(30)
    (2, 7)
    """
    return max(1, min((4 * ticks + 5) // 10, 7))


def trimmed(line: ScoreLine, indices: range, language: Language = FRENCH) -> ScoreLine:
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
        ended = start >= stop and (number == 0 or language.starts_key(numbers[-1], number))
        if ended and numbers[-1]:
            numbers.append(0)
            starts.append(start)
        if ended:
            break
        numbers.append(number)
        starts.append(start)
    return ScoreLine(tuple(numbers), tuple(starts), overrides)


def write_common(score: FileScore, indices: range) -> bytes:
    """Return the bytes of a file's common data, in the shorter form.

    Parameters
    ----------
    score : FileScore
        With a line that `trimmed` made.
    indices : range
        Superframes of the file.
    """
    if score.line is None:
        return b""
    spoken = _begun(score, SPOKEN)
    _write_spoken(spoken, score.line, indices, score.options.language)
    if _is_special(score):
        _write_overrides(spoken, score.line, score.options.language)
    forms = [spoken]
    keys = _keys_of(score.line, score.options)
    if keys is not None:
        keyed = _begun(score, KEYED)
        if _write_keyed(keyed, keys, indices, score.options):
            forms.append(keyed)
    return min(forms, key=lambda form: form.bits).finish(certain=True)


def _is_special(score: FileScore) -> bool:
    assert score.line is not None
    return not score.options.are_usual or bool(score.line.overrides)


def _begun(score: FileScore, form: int) -> RangeEncoder:
    encoder = RangeEncoder()
    encoder.put(form, FORMS)
    encoder.put(int(_is_special(score)), PLAIN_OR_SPECIAL)
    if _is_special(score):
        write_options(encoder, score.options)
    encoder.put(int(score.learning), FLIP)
    return encoder


def read_common(data: bytes, indices: range, language: Language = FRENCH) -> FileScore:
    """Read what `write_common` wrote.

    Raises
    ------
    BitstreamError
        If it has more phones than possible (F10).
    """
    if not data:
        return NO_SCORE
    decoder, usual = RangeDecoder(data), DEFAULT_OPTIONS.in_language(language)
    form = decoder.get(FORMS)
    special = decoder.get(PLAIN_OR_SPECIAL) == 1
    options = read_options(decoder, language) if special else usual
    learning = decoder.get(FLIP) == 1
    read = _read_keyed if form == KEYED else _read_spoken
    line = read(decoder, indices, options)
    if special and form == SPOKEN:
        line = replace(line, overrides=_read_overrides(decoder, line, language))
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


def _write_spoken(
    encoder: RangeEncoder, line: ScoreLine, indices: range, language: Language
) -> None:
    tables, stop, length = score_tables(language), TICKS * indices.stop, 0
    starts = (TICKS * (indices.start - 1) - 1, *line.starts[1:], stop)
    _put_length(encoder, starts[1] - starts[0], tables.length[0, 0])
    context = (language.n_phones, 0)
    for number, start, end in zip(line.numbers[1:], starts[1:], starts[2:], strict=False):
        encoder.put(language.letter_of(number), tables.next[context])
        if number == 0 and start >= stop:
            return
        _put_length(encoder, end - start, tables.length[number, tables.tempo(length)])
        length = end - start if number else 0
        context = context[1], number


def _read_spoken(decoder: RangeDecoder, indices: range, options: CueingOptions) -> ScoreLine:
    language = options.language
    tables = score_tables(language)
    clock, length, context = _LineClock(indices, decoder), 0, (language.n_phones, 0)
    clock.tick += _get_length(decoder, tables.length[0, 0])
    while clock.room > 0 or clock.numbers[-1]:
        number = language.phone_of(decoder.get(tables.next[context]))
        if number == 0 and clock.room <= 0:
            clock.add(0, 0)
            break
        row = tables.length[number, tables.tempo(length)]
        length = _get_length(decoder, row)
        clock.add(number, length)
        length = length if number else 0
        context = context[1], number
    return ScoreLine(tuple(clock.numbers), tuple(clock.starts), {})


def _key_starts(line: ScoreLine, language: Language) -> list[int]:
    """Return the starts of a line's keys (S10)."""
    return [
        start
        for before, number, start in zip(
            line.numbers, line.numbers[1:], line.starts[1:], strict=False
        )
        if language.starts_key(before, number)
    ]


def _write_overrides(encoder: RangeEncoder, line: ScoreLine, language: Language) -> None:
    for start in _key_starts(line, language):
        override = line.overrides.get(start)
        encoder.put(int(override is not None), AS_RULED)
        if override is not None:
            encoder.put(override[0], equal(language.n_shapes))
            encoder.put(override[1], equal(language.n_placements))


def _read_overrides(
    decoder: RangeDecoder, line: ScoreLine, language: Language
) -> dict[int, tuple[int, int]]:
    shapes, placements = equal(language.n_shapes), equal(language.n_placements)
    return {
        start: (decoder.get(shapes), decoder.get(placements))
        for start in _key_starts(line, language)
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
    language = options.language
    shape, placement = language.key_of(symbol)
    place, phones, last = language.placements[placement], language.phones, language.n_vowels
    consonants = [n for n in range(last + 1, len(phones)) if language.shapes[phones[n]] == shape]
    vowels = [n for n in range(1, last + 1) if options.placement(phones[n]) == place]
    weights = [_OFTEN if phones[n] in language.common else 1 for n in consonants]
    if shape == language.shape_alone:
        consonants, weights = [*consonants, 0], [*weights, _OFTEN]
    if place == language.placement_alone:
        vowels = [*vowels, 0]
    return [(consonants, cumulative(weights)), (vowels, cumulative([1] * len(vowels)))]


def _keys_of(line: ScoreLine, options: CueingOptions) -> list[_Keyed] | None:
    """Return a line key by key, None if it cannot be encoded so."""
    if line.overrides:
        return None
    rows: list[_Keyed] = []
    numbers, starts, language = line.numbers, line.starts, options.language
    k = 1
    # A key is a silence, a vowel alone, or a consonant with the vowel after it, if there is one.
    while k < len(numbers):
        if numbers[k] == 0:
            rows.append(_Keyed(language.silence, (0,), starts[k]))
        elif language.is_vowel(numbers[k]):
            if language.is_consonant(numbers[k - 1]):
                return None
            symbol = _symbol(0, numbers[k], options)
            rows.append(_Keyed(symbol, (0, numbers[k]), starts[k]))
        else:
            paired = k + 1 < len(numbers) and language.is_vowel(numbers[k + 1])
            vowel = numbers[k + 1] if paired else 0
            symbol = _symbol(numbers[k], vowel, options)
            consonant = starts[k + 1] - starts[k] if paired else 0
            rows.append(_Keyed(symbol, (numbers[k], vowel), starts[k], consonant))
            k += paired
        k += 1
    return rows


def _symbol(consonant: int, vowel: int, options: CueingOptions) -> int:
    """Return the symbol of a key of one or two phones; 0 is none."""
    language = options.language
    first, second = (language.phones[n] if n else "" for n in (consonant, vowel))
    shape, place = options.key_of(first, second)
    return language.symbol_of(shape, language.placements.index(place))


def _write_keyed(
    encoder: RangeEncoder, rows: list[_Keyed], indices: range, options: CueingOptions
) -> bool:
    """Append keys; return whether all could be encoded."""
    tables, stop = score_tables(options.language), TICKS * indices.stop
    begin = TICKS * (indices.start - 1) - 1
    starts = [begin, *(row.start for row in rows), stop]
    _put_silence(encoder, starts[1] - begin)
    # Per key: symbol, phones of its look-alikes, length, and where the consonant ends unless that
    # follows the rule.
    for row, start, end in zip(rows, starts[1:-1], starts[2:], strict=True):
        encoder.put(row.symbol, tables.alone)
        if row.symbol == options.language.silence:
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


def _read_keyed(decoder: RangeDecoder, indices: range, options: CueingOptions) -> ScoreLine:
    clock, language = _LineClock(indices, decoder), options.language
    tables = score_tables(language)
    clock.tick += max(_get_silence(decoder, clock.room), 1)
    while clock.room > 0 or clock.numbers[-1]:
        symbol = decoder.get(tables.alone)
        if symbol == language.silence:
            silent = clock.room > 0
            clock.add(0, _get_silence(decoder, clock.room) if silent else 0)
            continue
        consonant, vowel = (among[decoder.get(table)] for among, table in _choices(symbol, options))
        ticks = _get_length(decoder, tables.held)
        if consonant and vowel:
            by_rule = decoder.get(BY_RULE) == 1
            part = decoder.get_bits(5) + 1 if by_rule else usual_consonant(ticks)
            clock.add(consonant, part)
            ticks = max(ticks - part, 1)
        # A code that tells neither, which no sender writes, is the first consonant.
        clock.add(vowel or consonant or language.n_vowels + 1, ticks)
    return ScoreLine(tuple(clock.numbers), tuple(clock.starts), {})
