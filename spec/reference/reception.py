"""What sections 4 and 5.1 of spec/bitstream.md say of losses, windows and lips, in plain numbers.

From the text: keys of a line with holes, the line of compact superframes, lips as they are shown.
"""

import itertools
import math
from dataclasses import dataclass, field

from spec.reference.joining import TICKS, Cue, Sound, Told, cues_of, line_of, stand_in
from spec.reference.markers import Array
from spec.reference.motion import REST_GAPS, Stroke, drawn, mouths, moving, solve, strokes
from spec.reference.motion import parameters as joined
from spec.reference.superframe import Decoded
from spec.reference.tables import LANGUAGE, n_placements, n_vowels

NEXT_TICKS = 6
SHOWN_LIPS = range(12, 24)
"""(K2) Markers UL, LC and LL."""

UPPER, LOWER = 12, 19
"""UL0 and LL0."""

TOLERANCES = {"p": (0.1, 0.3), "b": (0.1, 0.3), "m": (0.1, 0.3), "f": (0.4, 0.4), "v": (0.4, 0.4)}
"""(K5)"""


def is_vowel(number: int) -> bool:
    """(G4) Return whether a phone is a vowel."""
    return 0 < number <= n_vowels()


def is_consonant(number: int) -> bool:
    """(G4) Return whether a phone is a consonant."""
    return number > n_vowels()


@dataclass
class Line:
    """Phones, and which of them have an unknown start or end (places in the list)."""

    sounds: list[Sound]
    open_start: set[int] = field(default_factory=set)
    open_end: set[int] = field(default_factory=set)
    lost: list[tuple[int, int]] = field(default_factory=list)
    """Ticks in which silence is not known (P2)."""


def scores_near(parts: dict[int, Decoded], first: int, end: int) -> dict[int, Told]:
    """(J1, J8, V8) Return the scores of superframes, as far as they are known."""
    found: dict[int, Told] = {}
    for k in range(first, end):
        if k in parts and parts[k].filmed and parts[k].mode == 0:
            found[k] = stand_in(parts[k].previews["0"])  # (V8)
            continue
        if k in parts:
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


def line_with_holes(scores: dict[int, Told]) -> Line:
    """(J1 to J3, J8) Return the line of superframes of which some are missing."""
    out = Line([])
    for k in sorted(scores):
        if k - 1 in scores:
            continue
        run = {k: scores[k]}
        while max(run) + 1 in scores:
            run[max(run) + 1] = scores[max(run) + 1]
        sounds = line_of(run)
        if out.sounds and sounds:
            out.lost.append((out.sounds[-1].end, TICKS * k - 1))
        base = len(out.sounds)
        out.sounds += sounds
        for j, told in run.items():
            if unknown_start(told, run.get(j - 1)):
                for i in range(base, len(out.sounds)):
                    sound = out.sounds[i]
                    if sound.start == TICKS * j - 1 and sound.number == told["first"]:
                        out.open_start.add(i)
    return out


def unknown_start(told: Told, before: Told | None) -> bool:
    """(J2) Return whether the first phone of a superframe starts at an unknown time."""
    if "stands" in told:
        return False
    if before is None:
        return True
    numbers = before["numbers"] or [before.get("first", 0)]
    if "stands" in before and told["first"] and (numbers[-1] or before["ahead"]):
        return False
    return bool(numbers[-1] != told["first"])


def line_of_windows(windows: dict[int, Told]) -> Line:
    """(J6, J7) Return the line of compact superframes; those that are missing are holes."""
    out = Line([])
    last = None
    for k in sorted(windows):
        told = windows[k]
        if not told["numbers"]:
            continue
        begin = TICKS * k + told["begin"]
        hole = last is not None and any(j not in windows for j in range(last, k))
        squeeze(out.sounds, begin)
        if out.sounds:
            before = out.sounds[-1]
            follows = is_consonant(before.number) and is_vowel(told["numbers"][0])
            if hole:
                out.lost.append((before.end, begin))
                if is_consonant(before.number):
                    out.open_end.add(len(out.sounds) - 1)
            elif begin - before.end <= NEXT_TICKS or follows:
                before.end = begin
        if k - 1 not in windows and is_vowel(told["numbers"][0]):
            out.open_start.add(len(out.sounds))
        ends = [*told["starts"], told["end"]][1:]
        for number, start, end in zip(told["numbers"], told["starts"], ends, strict=True):
            out.sounds.append(Sound(number, TICKS * k + start, TICKS * k + end))
        last = k
    if last is not None and last + 1 not in windows and is_consonant(out.sounds[-1].number):
        out.open_end.add(len(out.sounds) - 1)
    return out


def squeeze(sounds: list[Sound], end: int) -> None:
    """(J6) Let what reaches beyond the beginning of a window end there."""
    for sound in reversed(sounds):
        if sound.end <= end:
            break
        sound.end = end
        sound.start = min(sound.start, end - 1)
        end = sound.start


def keys_of(line: Line, scores: dict[int, Told]) -> list[Cue]:
    """(J4) Return all keys of a line, also those that are not reported."""
    found = []
    by_options = [(k, cues_of(line.sounds, scores[k]["cheek"])) for k in scores]
    for i, cue in enumerate(by_options[0][1] if by_options else []):
        at = cue.start // TICKS
        _, _, chosen = min((abs(k - at), -k, cues[i]) for k, cues in by_options)
        replaced = scores[at].get("overrides", {}) if at in scores else {}
        if str(cue.start % TICKS) in replaced:
            shape, place = replaced[str(cue.start % TICKS)]
            chosen.number = n_placements() * shape + place
        found.append(chosen)
    return found


def reported(line: Line, scores: dict[int, Told]) -> list[Cue]:
    """(J5, J7) Return the keys that are certain."""
    every = keys_of(line, scores)
    opened = {line.sounds[i].start for i in line.open_start if line.sounds[i].number}
    ended = {line.sounds[i].start for i in line.open_end}
    sure = []
    spelt: list[int] = []
    for cue in every:
        before, spelt = spelt, phones_of(line, cue)
        replaces = scores.get((cue.start + 1) // TICKS, {}).get("overrides")
        if cue.start in opened and (is_vowel(spelt[0]) or spelt == before or replaces):
            continue
        if cue.start in ended and len(spelt) == 1 and is_consonant(spelt[0]):
            continue
        sure.append(cue)
    return sure


def phones_of(line: Line, cue: Cue) -> list[int]:
    """Return the phones of a key."""
    middle = cue.start + cue.consonant
    times = [(cue.start, middle), (middle, cue.end)] if cue.consonant else [(cue.start, cue.end)]
    return [s.number for span in times for s in line.sounds if (s.start, s.end) == span][:2]


def strokes_of(
    cues: list[Cue], line: Line, rest_gap: float, coding: dict[str, Array]
) -> list[Stroke]:
    """(P1 to P3) Return strokes; where a superframe was lost there is no silence (P2).

    The pause that is not known is closed by counting the key before it as lasting until the next.
    """
    held = [Cue(c.number, c.start, c.end, c.consonant) for c in cues]
    limit = round(rest_gap * 50)
    for one, two in itertools.pairwise(held):
        lost = any(one.end <= begin and end <= two.start for begin, end in line.lost)
        if lost and two.start - one.end >= limit:
            one.end = two.start
    return strokes(held, rest_gap, coding)


def parameters(
    index: int, parts: dict[int, Decoded], coding: dict[str, Array]
) -> tuple[list[list[float]], Line]:
    """(Section 5) Return the parameters of a superframe that arrived, and the line it is from."""
    told = parts[index]
    if told.mode != 2:
        line = line_with_holes(scores_near(parts, index - 1, index + 2))
        return joined(index, parts, coding), line
    scores = {
        k: score
        for k in range(index - 4, index + 2)
        if k in parts and (score := parts[k].score) is not None
    }
    line = line_of_windows(scores)
    found = strokes_of(keys_of(line, scores), line, REST_GAPS[scores[index]["rest_gap"]], coding)
    first = TICKS * index
    rest = moving(found, coding, first, told.course, told.shift)
    face = mouths(line.sounds, coding, first)
    predicted = [[*a, *b] for a, b in zip(face, rest, strict=True)]
    return drawn(told, predicted, coding), line


def lips(
    frames: list[list[float]], first: int, line: Line, voice: dict[str, Array]
) -> list[list[float]]:
    """(K1 to K5) Return frames whose lips show what the phones demand."""
    visemes = voice["gestures.viseme_targets"]
    open_ends = line.open_start | line.open_end
    sure = [s for i, s in enumerate(line.sounds) if s.number and i not in open_ends]
    change = lip_change(voice)
    near = {s.number: radius(s.number, voice) for s in sure}
    result = []
    for t, frame in enumerate(frames):
        face = frame[:7]
        weighted = [(s.number, weight(s, first + t)) for s in sure]
        total = max(sum(w for _, w in weighted), 1.0)
        moved = [0.0] * 7
        for number, w in weighted:
            if w:
                own = [visemes.at(number, j) for j in range(7)]
                far = apart(face, own, voice)
                part = w * max(1 - near[number] / max(far, 1e-9), 0.0)
                moved = [m + part * (a - b) for m, a, b in zip(moved, own, face, strict=True)]
        face = [x + m / total for x, m in zip(face, moved, strict=True)]
        have, off = features(face, voice), [0.0, 0.0]
        for number, w in weighted:
            if w and LANGUAGE["phones"][number] in TOLERANCES:
                wanted = features([visemes.at(number, j) for j in range(7)], voice)
                for e, free in enumerate(TOLERANCES[LANGUAGE["phones"][number]]):
                    d = have[e] - wanted[e]
                    off[e] -= w * (d - max(-free, min(d, free)))
        face = [
            x + sum(row[e] * off[e] / total for e in range(2))
            for x, row in zip(face, change, strict=True)
        ]
        result.append(face + frame[7:])
    return result


def weight(sound: Sound, time: float) -> float:
    """(K1) Return the weight of a phone."""
    half = (sound.end - sound.start) / 2
    core = max(0.4 * half, min(1.0, half))
    x = abs(time - (sound.start + sound.end) / 2)
    if x >= core + 2.5:
        return 0.0
    return 1.0 if x <= core else 0.5 + 0.5 * math.cos(math.pi * (x - core) / 2.5)


def apart(face: list[float], other: list[float], voice: dict[str, Array]) -> float:
    """(K2) Return how far two faces are from each other."""
    directions = voice["face.directions"]
    change = [a - b for a, b in zip(face, other, strict=True)]
    return sum(
        math.sqrt(
            sum(
                sum(c * directions.at(j, i, k) for j, c in enumerate(change)) ** 2 for k in range(3)
            )
        )
        for i in SHOWN_LIPS
    ) / len(SHOWN_LIPS)


def radius(number: int, voice: dict[str, Array]) -> float:
    """(K3) Return how far a face may be from a phone's viseme."""
    visemes, phones = voice["gestures.viseme_targets"], LANGUAGE["phones"]
    chart = LANGUAGE["placement" if is_vowel(number) else "shape"]
    own = [visemes.at(number, j) for j in range(7)]
    ways = [
        apart([visemes.at(n, j) for j in range(7)], own, voice)
        for n, phone in enumerate(phones)
        if n != number and phone in chart and chart[phone] == chart[phones[number]]
    ]
    ways = [way for way in ways if way > 0.7]
    return min(0.4 * min(ways), 2.0) if ways else 2.0


def features(face: list[float], voice: dict[str, Array]) -> list[float]:
    """(K5) Return y and z of UL0 less those of LL0."""
    mean, directions = voice["face.mean"], voice["face.directions"]
    return [
        mean.at(UPPER, k)
        - mean.at(LOWER, k)
        + sum(
            x * (directions.at(j, UPPER, k) - directions.at(j, LOWER, k))
            for j, x in enumerate(face)
        )
        for k in (1, 2)
    ]


def lip_change(voice: dict[str, Array]) -> list[list[float]]:
    """(K5) Return `D`, 7 rows of 2."""
    directions = voice["face.directions"]
    rows = [directions.numbers[189 * j : 189 * (j + 1)] for j in range(7)]
    square = [
        [
            sum(a * b for a, b in zip(one, two, strict=True)) + 0.001 * (i == j)
            for j, two in enumerate(rows)
        ]
        for i, one in enumerate(rows)
    ]
    slopes = [
        [directions.at(j, UPPER, k) - directions.at(j, LOWER, k) for k in (1, 2)] for j in range(7)
    ]
    # The square is symmetric: x times it is it times x.
    columns = [solve(square, [slope[e] for slope in slopes]) for e in range(2)]
    small = [
        [sum(slopes[j][e] * columns[f][j] for j in range(7)) for f in range(2)] for e in range(2)
    ]
    det = small[0][0] * small[1][1] - small[0][1] * small[1][0]
    inverse = [[small[1][1] / det, -small[0][1] / det], [-small[1][0] / det, small[0][0] / det]]
    return [
        [sum(columns[e][j] * inverse[e][f] for e in range(2)) for f in range(2)] for j in range(7)
    ]
