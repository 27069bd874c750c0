"""Joining of decoded score parts: phones and keys of neighbouring superframes, each once.

Parts go in, in any number and with holes; one line of phones on the programme's clock comes out,
with the keys that follow from it. Where a part is missing, the phone that reached into it ends
after a nominal length, and a vowel whose consonant was lost gives no key: rather none than a
wrong one. Specification: spec/bitstream.md, section 4.
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from codec.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.phonology import PHONE_NUMBER, PHONES
from codec.score import PLACEMENTS, Key, Phone, Score
from codec.score_coding import N_VOWELS, ScorePart
from codec.timeline import TICK_S, TICKS

NOMINAL_TICKS = 4
"""Length of a phone of which only the beginning is known."""


@dataclass(frozen=True, slots=True)
class Sounding:
    """A phone on the grid.

    Attributes
    ----------
    number : int
        Phone number, 0 for a pause.
    start, end : int
        Ticks on the programme's clock.
    open_start, open_end : bool
        Whether the true start lies earlier, or the true end elsewhere.
    """

    number: int
    start: int
    end: int
    open_start: bool = False
    open_end: bool = False


def join(parts: Mapping[int, ScorePart]) -> list[Sounding]:
    """Return the phones of the superframes `parts`, pauses included, in order of time."""
    line: list[Sounding] = []
    for index in sorted(parts):
        part = parts[index]
        begin = index * TICKS
        hole = bool(line) and not line[-1].open_end
        if hole:
            # Superframes between were lost: nothing is known to sound there.
            line.append(Sounding(0, line[-1].end, begin - 1, open_start=True, open_end=True))
        same = bool(line) and line[-1].number == part.first and line[-1].start < begin
        if same and not hole:
            line[-1] = replace(line[-1], end=begin + part.first_end, open_end=False)
        else:
            if line and not hole:
                line[-1] = replace(line[-1], end=begin - 1, open_end=False)
            line.append(Sounding(part.first, begin - 1, begin + part.first_end, open_start=True))
        ends = (*part.starts, TICKS)[1:]
        for number, start, end in zip(part.numbers, part.starts, ends, strict=True):
            line.append(Sounding(number, begin + start, begin + end))
        line[-1] = replace(line[-1], open_end=True)
        if index + 1 not in parts:
            line += _completed(line.pop(), part, begin + TICKS)
    return line


def _completed(last: Sounding, part: ScorePart, end: int) -> Iterator[Sounding]:
    """End the last phone, of which the next superframe was to tell more, by nominal lengths."""
    if last.number == 0:
        yield replace(last, end=end, open_end=False)
        return
    reach = max(end, last.start + NOMINAL_TICKS)
    yield replace(last, end=reach, open_end=False)
    if part.ahead:
        yield Sounding(part.ahead, reach, reach + NOMINAL_TICKS)


def keys_of(
    line: list[Sounding], parts: Mapping[int, ScorePart], *, unsure: bool = False
) -> list[Key]:
    """Return the keys of a joined line, in order of time.

    Parameters
    ----------
    line : list of Sounding
        From `join`.
    parts : mapping of int to ScorePart
        The same parts: their options and overrides apply to the keys that start in them.
    unsure : bool
        Whether to list keys whose consonant may have been lost, as vowels alone.

    Returns
    -------
    list of Key
    """
    open_starts = {s.start for s in line if s.open_start and s.number}
    phones = phones_of(line)
    keys: list[Key] = []
    for options in {part.options for part in parts.values()} or {DEFAULT_OPTIONS}:
        for key in cue(phones, options):
            tick = round(key.start / TICK_S)
            if _options_at(tick, parts) == options:
                keys.append(_overridden(key, tick, parts))
    keys.sort(key=lambda key: key.start)
    if unsure:
        return keys
    return [
        key
        for before, key in itertools.pairwise([None, *keys])
        if key and not (round(key.start / TICK_S) in open_starts and _doubtful(key, before))
    ]


def _doubtful(key: Key, before: Key | None) -> bool:
    """Return whether a key with an unknown start may lack its consonant, or be known already."""
    return PHONE_NUMBER[key.phones[0]] <= N_VOWELS or (
        before is not None and before.phones == key.phones
    )


def _options_at(tick: int, parts: Mapping[int, ScorePart]) -> CueingOptions:
    part = parts.get(tick // TICKS) or parts.get(tick // TICKS + 1)
    return DEFAULT_OPTIONS if part is None else part.options


def _overridden(key: Key, tick: int, parts: Mapping[int, ScorePart]) -> Key:
    part = parts.get(tick // TICKS)
    change = None if part is None else part.overrides.get(tick % TICKS)
    if change is None:
        return key
    return replace(key, shape=change[0], placement=PLACEMENTS[change[1]])


def phones_of(line: list[Sounding]) -> list[Phone]:
    """Return the phones of a joined line without its pauses."""
    return [Phone(PHONES[s.number], s.start * TICK_S, s.end * TICK_S) for s in line if s.number]


def score_of(parts: Mapping[int, ScorePart]) -> Score:
    """Return the score that superframes tell together."""
    line = join(parts)
    return Score(tuple(phones_of(line)), tuple(keys_of(line, parts)))
