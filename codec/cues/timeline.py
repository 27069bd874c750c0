"""The score on the grid: a gapless line of phones whose boundaries are whole ticks of 20 ms.

A score goes in; out comes a `ScoreLine` of phone numbers and start ticks, pauses included, that
still gives the same keys: two phones that the cueing rule joins stay adjacent, two that it
separates keep a pause of one tick at least. Specification: spec/bitstream.md, section 3.
"""

import bisect
from dataclasses import dataclass

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.cues.language import PAUSE
from codec.cues.score import Phone, Score
from codec.errors import CueError

TICK_S = 0.02
"""Length of a tick in seconds."""

TICKS = 32
"""Ticks of a superframe."""

SUPERFRAME_S = 0.64
"""Length of a superframe in seconds."""

_TICKS_PER_S = 50
"""Ticks of the grid in a second."""

_JOIN_S = 0.005
"""Seconds between phones that are no pause: what rounding in files leaves."""

_BEFORE_ALL = -(1 << 40)
"""Tick before any that occurs: the pause since ever begins there."""


@dataclass(frozen=True, slots=True)
class ScoreLine:
    """Phones without gaps, from the beginning of time to its end.

    Attributes
    ----------
    numbers : tuple of int
        Phone numbers (`codec.cues.phonology`), first and last a pause.
    starts : tuple of int
        First tick of every phone, strictly ascending; a phone ends where the next one starts.
    overrides : dict of int to (int, int)
        Shape and placement number of keys that the rule does not give, by the key's first tick.
    """

    numbers: tuple[int, ...]
    starts: tuple[int, ...]
    overrides: dict[int, tuple[int, int]]

    def first_after(self, tick: int) -> int:
        """Return the index of the first phone that starts at `tick` or later."""
        return bisect.bisect_left(self.starts, tick)


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


def to_ticks(time_s: float) -> int:
    """Return the tick nearest to a time, halves upwards."""
    return int((time_s * _TICKS_PER_S + 0.5) // 1)


def to_line(score: Score | None, options: CueingOptions = DEFAULT_OPTIONS) -> ScoreLine:
    """Put a score on the grid.

    Parameters
    ----------
    score : Score or None
        None is silence. A score of keys alone takes its phones from the keys.
    options : CueingOptions
        Under which the receiver derives keys; keys of the score that differ become overrides.

    Returns
    -------
    ScoreLine

    Raises
    ------
    CueError
        If the language of the options lacks a phone or a placement of the score.

    Examples
    --------
    >>> line = to_line(Score((Phone("b", 0.1, 0.17), Phone("a", 0.17, 0.3)), ()))
    >>> line.numbers[1:3], line.starts[1:]
    ((25, 1), (5, 9, 15))
    """
    phones, language = _phones_of(score), options.language
    numbers, starts = [0], [_BEFORE_ALL]
    end_s = float("-inf")
    for phone in phones:
        if phone.symbol not in language.number_of:
            raise CueError(f"{language.name} has no phone {phone.symbol!r}")
        if phone.start - end_s > _JOIN_S and numbers[-1] != 0:
            numbers.append(0)
            starts.append(max(to_ticks(end_s), starts[-1] + 1))
        numbers.append(language.number_of[phone.symbol])
        starts.append(max(to_ticks(phone.start), starts[-1] + 1))
        end_s = phone.end
    if phones:
        numbers.append(0)
        starts.append(max(to_ticks(end_s), starts[-1] + 1))
    return ScoreLine(
        tuple(numbers), tuple(starts), _overrides(score, phones, starts, numbers, options)
    )


def _phones_of(score: Score | None) -> list[Phone]:
    if score is None:
        return []
    if score.phones or not score.keys:
        return [phone for phone in score.phones if phone.symbol != PAUSE]
    line = []
    for key in score.keys:
        length = (key.end - key.start) / max(len(key.phones), 1)
        for i, symbol in enumerate(key.phones):
            line.append(Phone(symbol, key.start + i * length, key.start + (i + 1) * length))
    return line


def _overrides(
    score: Score | None,
    phones: list[Phone],
    starts: list[int],
    numbers: list[int],
    options: CueingOptions,
) -> dict[int, tuple[int, int]]:
    """Return the exceptions of the score's keys from the rule, by first tick of the key."""
    if score is None or not score.keys:
        return {}
    sounding = [start for start, number in zip(starts, numbers, strict=True) if number]
    tick_of = {phone.start: tick for phone, tick in zip(phones, sounding, strict=True)}
    sent = {key.start: key for key in score.keys}
    overrides = {}
    for rule in cue(phones, options):
        key = sent.get(rule.start)
        if key is not None and (key.shape, key.placement) != (rule.shape, rule.placement):
            if key.placement not in options.language.placements:
                raise CueError(f"{options.language.name} has no placement {key.placement!r}")
            place = options.language.placements.index(key.placement)
            overrides[tick_of[rule.start]] = (key.shape, place)
    return overrides
