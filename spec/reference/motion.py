"""Sections 5 and 6 of spec/bitstream.md in plain numbers, from the text: scores to parameters.

Standard library only, slow on purpose. Superframes without windows; the superframe itself is there.
"""

import ast
import itertools
import math
import struct
import zipfile
from dataclasses import dataclass
from pathlib import Path

from spec.reference.joining import TICKS, Cue, Sound, keys_of, line_of, near
from spec.reference.markers import Array
from spec.reference.superframe import Decoded, order
from spec.reference.tables import LANGUAGE

PARTS = ("face", "hand", "head", "forearm")
BASES = ("residual", "loose", "plain", "filmed")
POWERS = (1.0, 0.75, 0.55, 0.42)
EARLIER = (0, 3, -3, 6, -6)
SHARES = (1.0, 0.5, 0.0)
REST_GAPS = (0.25, 0.5, 1.0, 1.8)
NAMES = (
    "lead_share", "calm_share", "hurried", "least_lead", "most_lead", "lead_per_mm", "lag_share",
    "overlap", "shortest", "fastest", "late", "first_lead", "rest_delay", "rest_move", "stroke",
    "fingers_begin", "fingers_end", "head_begin", "head_end", "turn_begin", "turn_end", "power",
    "undershoot", "natural",
)  # fmt: skip
"""Table 5."""


@dataclass
class Stroke:
    """A movement of the hand; hundredths of a tick."""

    number: int
    leave: int
    reach: int


def read_coding(path: Path) -> dict[str, Array]:
    """(Table 4) Return the arrays of a voice's coding tables."""
    arrays = {}
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            data = archive.read(name)
            end = 10 + int.from_bytes(data[8:10], "little")
            described = ast.literal_eval(data[10:end].decode("ascii"))
            kind, size = {"<f4": ("f", 4), "<i2": ("h", 2)}.get(described["descr"], ("", 0))
            if kind:
                numbers = list(struct.unpack(f"<{(len(data) - end) // size}{kind}", data[end:]))
                shape = tuple(described["shape"])
                arrays[name.removesuffix(".npy")] = Array(shape, numbers, data[end:])
    return arrays


def constants(coding: dict[str, Array]) -> dict[str, float]:
    """(Table 5) Return the constants of the hand's movement."""
    numbers = coding["targets.movement"].numbers
    return {name: round(value, 6) for name, value in zip(NAMES, numbers, strict=True)}


def parts_of(seconds: float) -> int:
    """(P1) Return a time in hundredths of a tick."""
    return round(5000 * seconds)


def strokes(cues: list[Cue], rest_gap: float, coding: dict[str, Array]) -> list[Stroke]:
    """(P1 to P3) Return the strokes that keys ask for."""
    c = constants(coding)
    places = coding["targets.places"]
    shortest = parts_of(c["shortest"])

    def free(stroke: Stroke) -> int:
        return stroke.reach - round(c["overlap"] * (stroke.reach - stroke.leave))

    def to_rest(end: int, before: int) -> Stroke:
        leave = end + parts_of(c["rest_delay"])
        reach = max(min(leave + parts_of(c["rest_move"]), before), leave + shortest)
        return Stroke(0, leave, reach)

    def distance(one: int, two: int) -> float:
        return math.dist(*([places.at(n, k) for k in range(3)] for n in (one, two)))

    def least_time(way: float) -> int:
        return round(5000 * (1.875 / (1000 * c["fastest"])) * way)

    found = [Stroke(0, -(2**40), -(2**40))]
    before: Cue | None = None
    for cue in cues:
        a = 100 * cue.start
        lead = parts_of(c["first_lead"])
        rested = before is None or a - 100 * before.end >= 100 * round(rest_gap * 50)
        if rested and before is not None:
            lead = min(lead, (a - 100 * before.end) // 2)
            found.append(to_rest(100 * before.end, a - lead))
        last, begun = found[-1], beginning(cue.number)
        way = distance(last.number, begun)
        if not rested and before is not None:
            d, hurried = cue.start - before.start, round(50 * c["hurried"])
            q = min(d, hurried)
            lead = round(100 * c["lead_share"]) * q + round(100 * c["calm_share"]) * (d - q)
            lead = min(lead, round(5000 * (c["most_lead"] + c["lead_per_mm"] * way)))
            lead = max(lead, parts_of(c["least_lead"]))
        lag = round(100 * c["lag_share"]) * cue.consonant
        least = least_time(way)
        leave = max(min(a - lead, a + lag - least), free(last))
        late = min(leave + least, a + lag + parts_of(c["late"]))
        found.append(Stroke(begun, leave, max(a + lag, late, leave + shortest)))
        if begun != cue.number:
            leave = max(found[-1].reach, a + 100 * cue.consonant)
            time = max(shortest, least_time(distance(begun, cue.number)))
            found.append(Stroke(cue.number, leave, leave + time))
        before = cue
    if before is not None:
        found.append(to_rest(100 * before.end, 2**40))
    for g in range(1, len(found)):
        found[g].leave = max(found[g].leave, free(found[g - 1]))
        found[g].reach = max(found[g].reach, found[g].leave + 1, found[g - 1].reach + 1)
    return found


def beginning(number: int) -> int:
    """(P12) Return the key at which a key begins: itself, if its placement does not move."""
    names = LANGUAGE["placements"]
    place = number % len(names)
    return number - place + int(names.index(LANGUAGE["movement"].get(names[place], names[place])))


def jerk(u: float) -> float:
    """(P5) Return the course of progress."""
    return 10 * u**3 - 15 * u**4 + 6 * u**5


def held(found: list[Stroke], targets: list[list[float]], c: dict[str, float]) -> list[list[float]]:
    """(P6) Return what is held at the end of each stroke."""
    rows = [list(targets[stroke.number]) for stroke in found]
    natural = parts_of(c["natural"])
    for g in range(1, len(found) - 1):
        h = found[g + 1].leave - found[g].leave
        if h < natural:
            missed = c["undershoot"] * min((natural - h) / (natural / 2), 1.5)
            rows[g] = [x + missed * (y - x) for x, y in zip(rows[g], rows[g - 1], strict=True)]
    return rows


def moving(
    found: list[Stroke], coding: dict[str, Array], first: int, course: int, shift: int
) -> list[list[float]]:
    """(P4, P5, P9) Return hand, head and forearm in 32 frames from tick `first` on."""
    c = constants(coding)
    widths = [coding[f"targets.{part}"].shape[1] for part in PARTS[1:]]
    targets = [
        [
            coding[f"targets.{part}"].at(n, k)
            for part, w in zip(PARTS[1:], widths, strict=True)
            for k in range(w)
        ]
        for n in range(coding["targets.hand"].shape[0])
    ]
    rows = held(found, targets, c)
    arm = widths[0] + widths[1]
    far = [0.0] + [
        math.dist(targets[one.number][arm:], targets[two.number][arm:])
        for one, two in itertools.pairwise(found)
    ]
    arc = [0.0] * arm + coding["targets.arc"].numbers
    group = (("fingers", widths[0]), ("head", widths[1]), ("", widths[2]))
    begins, ends = (
        [c[f"{name}_{side}"] if name else 0.0 for name, w in group for _ in range(w)]
        for side in ("begin", "end")
    )
    late = coding["targets.late"].numbers
    lateness = [(b + x, e + x) for b, e, x in zip(begins, ends, late, strict=True)]
    bends = [[distance * x for x in arc] for distance in far]
    return travelled(found, rows, lateness, bends, c, 100 * (first + EARLIER[shift]), course)


def travelled(
    found: list[Stroke],
    rows: list[list[float]],
    lateness: list[tuple[float, float]],
    bends: list[list[float]],
    c: dict[str, float],
    first: int,
    course: int,
) -> list[list[float]]:
    """(P4, P5) Return parameters in 32 frames from a time on, in hundredths of a tick.

    `rows` are the targets of the strokes, `bends` how far their middles leave the straight way.
    """
    frames = []
    for t in range(TICKS):
        time = float(first + 100 * t)
        frame = []
        for k, (late, later) in enumerate(lateness):
            value, base = 0.0, 0
            begun = False
            for g in range(1, len(found)):
                length = found[g].reach - found[g].leave
                f = min(1.0, length / (5000 * c["stroke"])) if c["stroke"] > 0 else 1.0
                begin = found[g].leave + f * 5000 * late
                if begin > time:
                    break
                end = found[g].reach + f * 5000 * later
                lasts = max(end - begin, length / 2, 1.0)
                if not begun and time >= begin + lasts:
                    base = g
                    continue
                begun = True
                u = min((time - begin) / lasts, 1.0) ** (c["power"] * POWERS[course])
                p = jerk(u)
                value += p * (rows[g][k] - rows[g - 1][k]) + 4 * p * (1 - p) * bends[g][k]
            frame.append(rows[base][k] + value)
        frames.append(frame)
    return frames


def mouths(line: list[Sound], coding: dict[str, Array], first: int) -> list[list[float]]:
    """(P7) Return the face in 32 frames from tick `first` on."""
    targets = coding["targets.face"]
    frames = []
    for t in range(first, first + TICKS):
        weights = [0.05] + [0.0] * (targets.shape[0] - 1)
        for sound in line:
            length = sound.end - sound.start
            x = abs(t - (sound.start + sound.end) / 2)
            f = max((x - length / 2) / max(22.5 - length / 2, 2.5), 0.0)
            if sound.number and f < 1:
                pull = math.exp(-((x / (0.3 * length + 2.5)) ** 1.5)) * (1 - f) ** 2
                weights[sound.number] += pull
        total = sum(weights)
        frames.append(
            [
                sum(w * targets.at(n, k) for n, w in enumerate(weights)) / total
                for k in range(targets.shape[1])
            ]
        )
    return frames


def solve(matrix: list[list[float]], right: list[float]) -> list[float]:
    """Return x with x times the matrix equal to the right side, by elimination with pivots."""
    n = len(right)
    rows = [[matrix[i][j] for i in range(n)] + [right[j]] for j in range(n)]
    for i in range(n):
        best = max(range(i, n), key=lambda r: abs(rows[r][i]))
        rows[i], rows[best] = rows[best], rows[i]
        for r in range(i + 1, n):
            factor = rows[r][i] / rows[i][i]
            for j in range(i, n + 1):
                rows[r][j] -= factor * rows[i][j]
    x = [0.0] * n
    for i in range(n - 1, -1, -1):
        x[i] = (rows[i][n] - sum(rows[i][j] * x[j] for j in range(i + 1, n))) / rows[i][i]
    return x


def residual(decoded: Decoded, coding: dict[str, Array]) -> list[list[float]]:
    """(T1, Q5) Return the inverse transform of the values, 32 frames of parameters."""
    name = BASES[decoded.basis]
    scales = coding[f"{name}.scales"]
    count = scales.shape[0]
    rows = [[int(scales.at(c, f)) for f in range(TICKS)] for c in range(count)]
    channels = [[0.0] * TICKS for _ in range(count)]
    for value, (c, f) in zip(decoded.values, order(rows), strict=True):
        if value:
            norm = math.sqrt((1 if f == 0 else 2) / TICKS)
            for t in range(TICKS):
                wave = math.cos(math.pi * (2 * t + 1) * f / (2 * TICKS))
                channels[c][t] += norm * wave * value / 65536
    matrix = [[coding[f"{name}.matrix"].at(i, j) for j in range(count)] for i in range(count)]
    return [solve(matrix, [channel[t] for channel in channels]) for t in range(TICKS)]


def parameters(
    index: int, parts: dict[int, Decoded], coding: dict[str, Array]
) -> list[list[float]]:
    """(Q5, Q7) Return the parameters of a superframe, blended with its neighbours if filmed."""
    frames = unblended(index, parts, coding)
    sides = [
        unblended(k, parts, coding)
        if parts[index].filmed and k in parts and parts[k].filmed
        else None
        for k in (index - 1, index + 1)
    ]
    blended = [list(frame) for frame in frames]
    for i, weight in enumerate((0.4, 0.225, 0.1, 0.025)):
        if sides[0] is not None:
            added = zip(frames[i], jump(sides[0], frames), strict=True)
            blended[i] = [x - weight * y for x, y in added]
        if sides[1] is not None:
            added = zip(frames[-1 - i], jump(frames, sides[1]), strict=True)
            blended[-1 - i] = [x + weight * y for x, y in added]
    return blended


def jump(former: list[list[float]], latter: list[list[float]]) -> list[float]:
    """(Q7) Return how far two superframes are apart at their border."""
    around = zip(former[-2], former[-1], latter[0], latter[1], strict=True)
    return [(3 * c - d - 3 * b + a) / 2 for a, b, c, d in around]


def unblended(index: int, parts: dict[int, Decoded], coding: dict[str, Array]) -> list[list[float]]:
    """(P8, P10, Q5) Return the parameters of a superframe from it and its neighbours."""
    told = parts[index]
    predicted = None
    if told.mode == 0:
        scores = near(index, parts)
        line = line_of(scores)
        found = strokes(keys_of(line, scores), REST_GAPS[scores[index].get("rest_gap", 1)], coding)
        first = TICKS * index
        face = mouths(line, coding, first)
        rest = moving(found, coding, first, told.course, told.shift)
        predicted = [[*a, *b] for a, b in zip(face, rest, strict=True)]
    return drawn(told, predicted, coding)


def drawn(
    told: Decoded, predicted: list[list[float]] | None, coding: dict[str, Array]
) -> list[list[float]]:
    """(P8, P10, Q5) Return the parameters of a superframe from its prediction, if it has one."""
    mean = coding["mean"].numbers
    frames = [list(mean) for _ in range(TICKS)]
    if predicted is not None:
        shares = [
            SHARES[share]
            for share, part in zip(told.shares, PARTS, strict=True)
            for _ in range(coding[f"targets.{part}"].shape[1])
        ]
        frames = [
            [m + w * (x - m) for m, w, x in zip(mean, shares, row, strict=True)]
            for row in predicted
        ]
    if told.step == 63:
        return frames
    return [
        [x + y for x, y in zip(a, b, strict=True)]
        for a, b in zip(frames, residual(told, coding), strict=True)
    ]
