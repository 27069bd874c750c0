"""Joining of decoded score parts: phones and keys of neighbouring superframes, each once.

Parts go in, in any number and with holes; one line of phones on the programme's clock comes out,
with the keys that follow from it. Where a part is missing, the phone that reached into it ends
after a nominal length, and a vowel whose consonant was lost gives no key: rather none than a
wrong one. Specification: spec/bitstream.md, section 4.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.cues.language import Language
from codec.cues.score import Key, Phone, Score
from codec.cues.timeline import TICK_S, TICKS, ScoreLine, Sounding
from codec.superframe.score_coding import ScorePart
from codec.superframe.window import Window, join_windows

NOMINAL_TICKS = 4
"""Length in ticks of a phone whose end is unknown."""


Parts = Mapping[int, ScorePart | Window]
"""Scores by the number of their superframe; the kind that is rarer counts as missing."""


@dataclass(frozen=True, slots=True)
class MergedScore:
    """The scores of superframes as one.

    Attributes
    ----------
    parts : mapping of int to ScorePart or Window
        The merged parts.
    line : list of Sounding
        Phones, pauses included, in order of time.
    every : list of Key
        Keys in order of time, with those whose consonant may have been lost, as vowels alone.
    """

    parts: Parts
    line: list[Sounding]
    every: list[Key]

    @property
    def language(self) -> Language:
        """That of the parts."""
        return language_of_parts(self.parts)

    def keys(self) -> list[Key]:
        """Return the keys that are certain (J5, J7)."""
        opened = {s.start for s in self.line if s.open_start and s.number}
        language = self.language
        unfinished = {s.start for s in self.line if s.open_end and language.is_consonant(s.number)}
        if not opened and not unfinished:
            return self.every
        return [
            key
            for before, key in itertools.pairwise([None, *self.every])
            if key
            and not (round(key.start / TICK_S) in opened and self._doubtful(key, before))
            and not (round(key.start / TICK_S) in unfinished and len(key.phones) == 1)
        ]

    def spoken(self) -> list[Sounding]:
        """Return the line without what merely stands for keys (J8)."""
        coarse = self._coarse()
        return [s for s in self.line if s.start // TICKS not in coarse]

    def _coarse(self) -> set[int]:
        parts = self.parts.items()
        return {k for k, part in parts if isinstance(part, ScorePart) and part.coarse}

    def _doubtful(self, key: Key, before: Key | None) -> bool:
        """Return whether a key with an unknown start may lack its consonant, be known, or differ.

        Where keys are exceptions from the rule, one that began before may be one of them.
        """
        part = self.parts.get((round(key.start / TICK_S) + 1) // TICKS)
        return (
            key.phones[0] in self.language.placement_of
            or (before is not None and before.phones == key.phones)
            or (part is not None and bool(part.overrides))
        )

    def score(self) -> Score:
        """Return phones and keys; those that are known from previews only have no phones."""
        coarse = self._coarse()
        if not coarse:
            return Score(tuple(phones_of(self.line, self.language)), tuple(self.keys()))
        return Score(
            tuple(phones_of(self.spoken(), self.language)),
            tuple(
                replace(key, phones=()) if round(key.start / TICK_S) // TICKS in coarse else key
                for key in self.keys()
            ),
        )


def language_of_parts(parts: Parts) -> Language:
    """Return the language of parts, which is the same for all."""
    return next((part.options for part in parts.values()), DEFAULT_OPTIONS).language


def join(parts: Parts) -> MergedScore:
    """Join the scores of superframes."""
    line = _line_of(parts)
    return MergedScore(parts, line, _keys_of(line, parts))


def join_line(line: ScoreLine, parts: Parts) -> MergedScore:
    """Return a whole line as one score; its parts have options and replaced keys."""
    sounds = [
        Sounding(number, start, end)
        for number, start, end in zip(
            line.numbers[1:], line.starts[1:], [*line.starts[1:], line.starts[-1]][1:], strict=True
        )
    ]
    return MergedScore(parts, sounds, _keys_of(sounds, parts))


def score_of(parts: Parts) -> Score:
    """Return the merged score of superframes."""
    return join(parts).score()


def _line_of(parts: Parts) -> list[Sounding]:
    """Return the phones of superframes, pauses included, in order of time."""
    windows = {k: part for k, part in parts.items() if isinstance(part, Window)}
    if 2 * len(windows) > len(parts):
        return join_windows(windows)
    line: list[Sounding] = []
    known = {k: part for k, part in parts.items() if isinstance(part, ScorePart)}
    for index in sorted(known):
        part, begin = known[index], index * TICKS
        if line and not line[-1].open_end:
            # Superframes between were lost: nothing is known to sound there.
            line.append(Sounding(0, line[-1].end, begin - 1, open_start=True, open_end=True))
        _begin(line, part, known.get(index - 1), begin)
        ends = (*part.starts, TICKS)[1:]
        for number, start, end in zip(part.numbers, part.starts, ends, strict=True):
            line.append(Sounding(number, begin + start, begin + end))
        if line:
            line[-1] = replace(line[-1], open_end=True)
            if index + 1 not in known:
                line += _completed(line.pop(), part, begin + TICKS)
    return line


def _begin(line: list[Sounding], part: ScorePart, before: ScorePart | None, begin: int) -> None:
    """Append what sounds as a superframe begins, or prolong it (J1, J2, J8)."""
    end = begin + part.first_end
    if part.coarse:
        if before is not None and line:
            line += _completed(line.pop(), before, end, exact=True)
        return
    if before is not None and before.coarse and line and part.first and line[-1].number:
        _continue_coarse(line, part.first, end, part.language)
        return
    hole = before is None
    if not hole and line and line[-1].number == part.first and line[-1].start < begin:
        line[-1] = _ended(line[-1], end)
        return
    if line and not hole:
        line[-1] = _ended(line[-1], max(begin - 1, line[-1].start))
    line.append(Sounding(part.first, begin - 1, end, open_start=True))


def _ended(sounding: Sounding, end: int) -> Sounding:
    return Sounding(sounding.number, sounding.start, end, open_start=sounding.open_start)


def _continue_coarse(line: list[Sounding], number: int, end: int, language: Language) -> None:
    """Let the phone that sounds after a preview be the last one that the preview implies."""
    if language.is_consonant(number) and language.is_vowel(line[-1].number) and len(line) > 1:
        line.pop()
    last = line.pop()
    if language.is_vowel(number) and language.is_consonant(last.number):
        middle = (last.start + end) // 2
        line.append(_ended(last, middle))
        line.append(Sounding(number, middle, end))
    else:
        line.append(replace(last, number=number, end=end, open_end=False))


def _completed(
    last: Sounding, part: ScorePart, end: int, *, exact: bool = False
) -> Iterator[Sounding]:
    """End the last phone, continued in the next superframe, by nominal lengths.

    If `exact`, it and the vowel that completes its key end at `end`.
    """
    if last.number == 0 or (exact and not part.ahead):
        yield _ended(last, max(end, last.start))
        return
    reach = (last.start + end) // 2 if exact else max(end, last.start + NOMINAL_TICKS)
    yield _ended(last, reach)
    if part.ahead:
        yield Sounding(part.ahead, reach, end if exact else reach + NOMINAL_TICKS)


def _keys_of(line: Sequence[Sounding], parts: Parts) -> list[Key]:
    """Return the keys of a line under the options and overrides where they start."""
    phones = phones_of(line, language_of_parts(parts))
    every = {part.options for part in parts.values()} or {DEFAULT_OPTIONS}
    if len(every) == 1 and not any(part.overrides for part in parts.values()):
        return list(cue(phones, *every))
    keys = [
        _overridden(key, tick, parts)
        for options in every
        for key in cue(phones, options)
        for tick in (round(key.start / TICK_S),)
        if len(every) == 1 or options_at(parts, tick // TICKS) == options
    ]
    return sorted(keys, key=lambda key: key.start)


def options_at(parts: Parts, index: int) -> CueingOptions:
    """Return the options of the superframe nearest to one, of two the later (J4)."""
    if not parts:
        return DEFAULT_OPTIONS
    return parts[min(parts, key=lambda k: (abs(k - index), -k))].options


def _overridden(key: Key, tick: int, parts: Parts) -> Key:
    part = parts.get(tick // TICKS)
    change = None if part is None else part.overrides.get(tick % TICKS)
    if part is None or change is None:
        return key
    return replace(key, shape=change[0], placement=part.options.language.placements[change[1]])


def phones_of(line: Sequence[Sounding], language: Language) -> list[Phone]:
    """Return the phones of a joined line without its pauses."""
    names = language.phones
    return [Phone(names[s.number], s.start * TICK_S, s.end * TICK_S) for s in line if s.number]
