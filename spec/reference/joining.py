"""Section 4 of spec/bitstream.md in plain numbers, from the text: scores to phones and keys.

Standard library only. It joins a superframe of mode 0 and its two neighbours, of which any may be
missing or known by a preview only.
"""

from dataclasses import dataclass
from typing import Any

from spec.reference.superframe import Decoded
from spec.reference.tables import LANGUAGE, n_placements, silence

TICKS = 32


@dataclass
class Sound:
    """A phone on the line; times in ticks."""

    number: int
    start: int
    end: int


@dataclass
class Cue:
    """A key: its number (6 shape + placement), its times, the ticks of its consonant if of two."""

    number: int
    start: int
    end: int
    consonant: int


Told = dict[str, Any]
"""The score of a superframe, or what stands for it (J8): then `stands` is true."""


def near(index: int, parts: dict[int, Decoded]) -> dict[int, Told]:
    """(J1, J8, V8) Return the scores of a superframe and its neighbours, as far as known."""
    found: dict[int, Told] = {}
    for k in (index - 1, index, index + 1):
        if k in parts and parts[k].filmed and parts[k].mode == 0:
            # (V8)
            found[k] = stand_in(parts[k].previews["0"])
            continue
        if k in parts:
            # One of mode 1 tells no score, and is not lost.
            score = parts[k].score
            if score is not None:
                found[k] = score
            continue
        for distance in (-1, 2, 4, 6):
            before = parts.get(k - distance)
            if before is not None and str(distance) in before.previews:
                found[k] = stand_in(before.previews[str(distance)])
                break
    return found


def stand_in(preview: list[list[int]]) -> Told:
    """(J8) Return the score whose phones stand for the keys of a preview."""
    phones, stand_ins = LANGUAGE["phones"], LANGUAGE["stand_ins"]
    places = n_placements() - 1
    numbers: list[int] = []
    starts: list[int] = []
    ahead = 0
    for i, (tick, symbol) in enumerate(preview):
        numbers.append(0)
        starts.append(tick)
        if symbol < silence():
            end = preview[i + 1][0] if i + 1 < len(preview) else TICKS
            numbers[-1] = phones.index(stand_ins["consonants"][symbol // places])
            second = stand_ins["vowels"][symbol % places]
            if second is None:
                continue
            vowel = phones.index(second)
            middle = tick + max(40 * (end - tick) // 100, 1)
            if middle < TICKS:
                numbers.append(vowel)
                starts.append(middle)
            else:
                ahead = vowel
    return {
        "stands": True,
        "first_end": starts[0] if starts else TICKS,
        "numbers": numbers,
        "starts": starts,
        "ahead": ahead,
        "cheek": [0 for _ in LANGUAGE["alternatives"]],
        "overrides": {},
    }


def line_of(scores: dict[int, Told]) -> list[Sound]:
    """(J1 to J3, J8) Return the line of phones of superframes that follow one another."""
    line: list[Sound] = []
    for k in sorted(scores):
        told, begin = scores[k], TICKS * k
        end = begin + told["first_end"]
        before = scores.get(k - 1)
        if "stands" in told:
            if before is not None and line:
                lasting(line, before["ahead"], end)
        elif (
            before is not None and "stands" in before and line and line[-1].number and told["first"]
        ):
            taking(line, told["first"], end)
        elif before is not None and line and line[-1].number == told["first"]:
            line[-1].end = end
        else:
            if line:
                line[-1].end = max(begin - 1, line[-1].start)
            line.append(Sound(told["first"], begin - 1, end))
        ends = [*told["starts"], TICKS][1:]
        for number, start, stop in zip(told["numbers"], told["starts"], ends, strict=True):
            line.append(Sound(number, begin + start, begin + stop))
        if k + 1 not in scores and line:
            last = line[-1]
            last.end = max(begin + TICKS, last.start + 4)
            if told["ahead"]:
                line.append(Sound(told["ahead"], last.end, last.end + 4))
    return line


def lasting(line: list[Sound], ahead: int, end: int) -> None:
    """(J8) Let the last phone last until the first start of a preview, with the vowel of S7."""
    last = line[-1]
    last.end = end
    if ahead:
        last.end = (last.start + end) // 2
        line.append(Sound(ahead, last.end, end))


def taking(line: list[Sound], first: int, end: int) -> None:
    """(J8) Let the first phone of a superframe be the last stand-in of the one before."""
    phones, vowels = LANGUAGE["phones"], LANGUAGE["placement"]
    is_vowel = phones[first] in vowels
    if not is_vowel and phones[line[-1].number] in vowels:
        line.pop()
    last = line[-1]
    if is_vowel and phones[last.number] not in vowels:
        last.end = (last.start + end) // 2
        line.append(Sound(first, last.end, end))
    else:
        last.number, last.end = first, end


def cues_of(line: list[Sound], cheek: list[int]) -> list[Cue]:
    """(J4, S11) Return the keys that follow from a line by the chart."""
    placements = dict(LANGUAGE["placement"])
    for symbol, chosen in zip(LANGUAGE["alternatives"], cheek, strict=True):
        if chosen:
            placements[symbol] = "cheek"
    names, phones = LANGUAGE["placements"], LANGUAGE["phones"]

    def number(shape: int, placement: str) -> int:
        return len(names) * shape + int(names.index(placement))

    alone = LANGUAGE["placement_without_vowel"]
    cues: list[Cue] = []
    waiting: Sound | None = None
    for sound in (s for s in line if s.number):
        symbol = phones[sound.number]
        if waiting is not None:
            shape = LANGUAGE["shape"][phones[waiting.number]]
            if waiting.end == sound.start and symbol in placements:
                ticks = waiting.end - waiting.start
                key = number(shape, placements[symbol])
                cues.append(Cue(key, waiting.start, sound.end, ticks))
                waiting = None
                continue
            cues.append(Cue(number(shape, alone), waiting.start, waiting.end, 0))
            waiting = None
        if symbol in LANGUAGE["shape"]:
            waiting = sound
        else:
            key = number(LANGUAGE["shape_without_consonant"], placements[symbol])
            cues.append(Cue(key, sound.start, sound.end, 0))
    if waiting is not None:
        shape = LANGUAGE["shape"][phones[waiting.number]]
        cues.append(Cue(number(shape, alone), waiting.start, waiting.end, 0))
    return cues


def keys_of(line: list[Sound], scores: dict[int, Told]) -> list[Cue]:
    """(J4) Return the keys of a line, each under the options and replacements where it starts."""
    found = []
    by_options = [(k, cues_of(line, scores[k]["cheek"])) for k in scores]
    for i, cue in enumerate(by_options[0][1]):
        at = cue.start // TICKS
        _, _, chosen = min((abs(k - at), -k, cues[i]) for k, cues in by_options)
        if at in scores and str(cue.start % TICKS) in scores[at]["overrides"]:
            shape, place = scores[at]["overrides"][str(cue.start % TICKS)]
            chosen.number = len(LANGUAGE["placements"]) * shape + place
        found.append(chosen)
    return found
