"""Section 8 of spec/bitstream.md in plain numbers, from the text: a file to keys and parameters.

Of files that tell their score once (8.1); those of constant superframes are decoded one by one.
"""

import zlib
from contextlib import suppress
from dataclasses import dataclass, field

from spec.reference.joining import Cue, Sound, cues_of
from spec.reference.markers import Array
from spec.reference.motion import (
    EARLIER,
    PARTS,
    REST_GAPS,
    Stroke,
    constants,
    drawn,
    held,
    mouths,
    moving,
    solve,
    strokes,
    travelled,
)
from spec.reference.motion import parameters as joined
from spec.reference.range_decoder import RangeDecoder
from spec.reference.superframe import Decoded, MalformedError, crc, decode, number, record, tempo
from spec.reference.tables import (
    LANGUAGE,
    TABLES,
    equal,
    n_phones,
    n_placements,
    n_shapes,
    n_vowels,
    silence,
)

SILENCES = [2978, 744, 744, 744, 1489, 2978, 5967, 5957, 4468, 2234, 1489, 744, 744, 744, 372, 372]
"""Table 6."""

Scales = list[list[list[int]]]


@dataclass
class File:
    """What a file says; ticks count from the programme's beginning."""

    coding: str
    first_tick: int
    ticks: int
    l0: int
    l1: int
    learns: bool = False
    cheek: list[int] = field(default_factory=lambda: [0 for _ in LANGUAGE["alternatives"]])
    rest_gap: int = 1
    line: list[list[int]] | None = None
    """Number, start and end of each phone, pauses too; the first pause begins at `b`."""
    replaced: dict[int, list[int]] = field(default_factory=dict)
    payloads: list[bytes] = field(default_factory=list)

    @property
    def indices(self) -> range:
        """(F6) The numbers of the superframes."""
        return range(self.first_tick // 32, -(-(self.first_tick + self.ticks) // 32))


def read(data: bytes) -> File:
    """(F1 to F8) Return what a file says."""
    if len(data) < 26:
        raise MalformedError("F1")
    if data[:4] != b"CUES":
        raise MalformedError("F2")
    if data[4] != 4:
        raise MalformedError("F3")
    if crc(data[:24], 16, 0x1021, 0xFFFF) != int.from_bytes(data[24:26], "big"):
        raise MalformedError("F4")
    lengths = int.from_bytes(data[21:24], "big")
    out = File(
        data[5:13].hex(),
        int.from_bytes(data[13:17], "big"),
        int.from_bytes(data[17:21], "big"),
        lengths >> 12,
        lengths & 4095,
    )
    if out.first_tick > 4320000 or not 1 <= out.ticks <= 4320000:
        raise MalformedError("F5")
    if out.l0:
        size = out.l0 + out.l1
        if len(data) != 26 + size * len(out.indices):
            raise MalformedError("F6")
        out.payloads = [data[26 + size * i :][:size] for i in range(len(out.indices))]
        return out
    if zlib.crc32(data[:-4]) != int.from_bytes(data[-4:], "big"):
        raise MalformedError("F7")
    records = list(cut(data[26:-4], 1 + len(out.indices)))
    if records[0]:
        tell(records[0], out)
    out.payloads = records[1:]
    return out


def cut(data: bytes, count: int) -> list[bytes]:
    """(F7) Return records."""
    records, place = [], 0
    for _ in range(count):
        if place >= len(data):
            raise MalformedError("F6")
        length, place = data[place], place + 1
        if length == 255:
            length, place = int.from_bytes(data[place : place + 3], "big"), place + 3
        if place + length > len(data):
            raise MalformedError("F6")
        records.append(data[place : place + length])
        place += length
    if place != len(data):
        raise MalformedError("F6")
    return records


def tell(data: bytes, out: File) -> None:
    """(F8) Read what a file says once."""
    decoder = RangeDecoder(data)
    form = decoder.bits(1)
    special = decoder.symbol([32512, 256])[0]
    if special:
        out.cheek = [decoder.bits(1) for _ in LANGUAGE["alternatives"]]
        out.rest_gap = decoder.bits(2)
    out.learns = bool(decoder.bits(1))
    begin, end = 32 * out.indices.start - 33, 32 * out.indices.stop
    (keyed if form else spoken)(decoder, out, begin, end)
    if special and not form:
        before = 0
        for phone, start, _ in out.line or []:
            if (
                phone
                and not (1 <= phone <= n_vowels() and before > n_vowels())
                and decoder.symbol([28672, 4096])[0]
            ):
                shape = decoder.symbol(equal(n_shapes()))[0]
                out.replaced[start] = [shape, decoder.symbol(equal(n_placements()))[0]]
            before = phone


def length(decoder: RangeDecoder, row: list[int]) -> int:
    """(F9) Return a length in ticks."""
    ticks = 0
    while (symbol := decoder.symbol(row, 32)[0]) == 32:
        ticks += 32
    return ticks + symbol + 1


def rest(decoder: RangeDecoder, left: int) -> int:
    """(F12) Return the length of a silence; `left` are the ticks until the end."""
    width = decoder.symbol(SILENCES)[0]
    return 2 ** (width - 1) + decoder.bits(width - 1) if width else left


def check_end(decoder: RangeDecoder) -> None:
    """(F10) Refuse a line that goes on behind its code."""
    if decoder.position > len(decoder.data) + 8:
        raise MalformedError("F10")


def spoken(decoder: RangeDecoder, out: File, begin: int, end: int) -> None:
    """(F10) Read a line of phones."""
    tables = TABLES["score"]
    tick = begin + length(decoder, tables["length"][0][0])
    line = [[0, begin, tick]]
    earlier, before, spoken_ticks = n_phones(), 0, 0
    while tick < end or before:
        this = number(decoder.symbol(tables["next"][earlier][before])[0])
        check_end(decoder)
        if this == 0 and tick >= end:
            line.append([0, tick, tick])
            break
        ticks = length(decoder, tables["length"][this][tempo(spoken_ticks)])
        line.append([this, tick, tick + ticks])
        tick += ticks
        spoken_ticks = ticks if this else 0
        earlier, before = before, this
    out.line = line


def keyed(decoder: RangeDecoder, out: File, begin: int, end: int) -> None:
    """(F11) Read a line of keys."""
    tables = TABLES["score"]
    tick = begin + max(rest(decoder, end - begin), 1)
    line = [[0, begin, tick]]
    while tick < end or line[-1][0]:
        symbol = decoder.symbol(tables["alone"])[0]
        check_end(decoder)
        if symbol == silence():
            ticks = rest(decoder, end - tick) if tick < end else 0
            line.append([0, tick, tick + ticks])
            tick += ticks
            continue
        consonant, vowel = (open_phone(decoder, *kind) for kind in choices(symbol, out.cheek))
        ticks = length(decoder, tables["held"])
        if consonant and vowel:
            part = max(1, min((4 * ticks + 5) // 10, 7))
            if decoder.symbol([31744, 1024])[0]:
                part = decoder.bits(5) + 1
            line.append([consonant, tick, tick + part])
            tick += part
            ticks = max(ticks - part, 1)
        line.append([vowel or consonant or n_vowels() + 1, tick, tick + ticks])
        tick += ticks
    out.line = line


def choices(symbol: int, cheek: list[int]) -> list[tuple[list[int], list[int]]]:
    """(F11) Return the phones that a key leaves open, 0 for none, and their weights."""
    places = n_placements() - 1
    shape, place = 1 + symbol // places, LANGUAGE["placements"][1 + symbol % places]
    phones, placements = LANGUAGE["phones"], dict(LANGUAGE["placement"])
    for name, chosen in zip(LANGUAGE["alternatives"], cheek, strict=True):
        if chosen:
            placements[name] = "cheek"
    last = n_vowels()
    consonants = [n for n in range(last + 1, n_phones()) if LANGUAGE["shape"][phones[n]] == shape]
    vowels = [n for n in range(1, last + 1) if placements[phones[n]] == place]
    weights = [10 if phones[n] in LANGUAGE["common"] else 1 for n in consonants]
    if shape == LANGUAGE["shape_without_consonant"]:
        consonants, weights = [*consonants, 0], [*weights, 10]
    if place == LANGUAGE["placement_without_vowel"]:
        vowels = [*vowels, 0]
    return [(consonants, weights), (vowels, [1] * len(vowels))]


def open_phone(decoder: RangeDecoder, phones: list[int], weights: list[int]) -> int:
    """Return a phone of some, by their weights."""
    row = [32768 * weight // sum(weights) for weight in weights]
    row[weights.index(max(weights))] += 32768 - sum(row)
    return phones[decoder.symbol(row)[0]]


def keys(out: File) -> list[Cue]:
    """(J4, S9) Return the keys of a file."""
    sounds = [Sound(*phone) for phone in out.line or []]
    found = cues_of(sounds, out.cheek)
    for cue in found:
        if cue.start in out.replaced:
            shape, place = out.replaced[cue.start]
            cue.number = n_placements() * shape + place
    return found


def parameters(out: File, scales: Scales, coding: dict[str, Array]) -> list[list[float]]:
    """(F6, F13) Return the parameters of all superframes of a file, frame by frame.

    Frames of a missing superframe are empty.
    """
    if out.l0:
        parts = {}
        for k, payload in zip(out.indices, out.payloads, strict=True):
            with suppress(MalformedError):
                parts[k] = decode(payload[: out.l0], payload[out.l0 :], scales, out.coding)
        return [
            frame
            for k in out.indices
            for frame in (joined(k, parts, coding) if k in parts else 32 * [[]])
        ]
    decoded = [record(payload, 0 if out.line else 1, scales) for payload in out.payloads]
    if out.line is None:
        return [frame for told in decoded for frame in drawn(told, None, coding)]
    cues = keys(out)
    found = strokes(cues, REST_GAPS[out.rest_gap], coding)
    line = [Sound(*phone) for phone in out.line]
    learner = Learner(coding) if out.learns else None
    frames = []
    for index, told in zip(out.indices, decoded, strict=True):
        first = 32 * index

        def predicted(course: int, shift: int, first: int = first) -> list[list[float]]:
            rest = moving(found, coding, first, course, shift)
            return [[*a, *b] for a, b in zip(mouths(line, coding, first), rest, strict=True)]

        likely = predicted(told.course, told.shift)
        if learner:
            likely = learner.corrected(likely, found, first, told)
        block = drawn(told, likely, coding)
        if learner:
            learner.take(block, predicted(0, 0), found, first)
        frames += block
    return frames


class Learner:
    """(F13) Corrections of the hand's and the forearm's targets from what was decoded."""

    def __init__(self, coding: dict[str, Array]) -> None:
        self.coding = coding
        widths = [coding[f"targets.{part}"].shape[1] for part in PARTS]
        self.columns = [
            range(widths[0], widths[0] + widths[1]),
            range(sum(widths[:3]), sum(widths)),
        ]
        sizes = [n_shapes(), n_placements() + n_shapes()]
        self.squares = [[[25.0 * (i == j) for j in range(n)] for i in range(n)] for n in sizes]
        self.rights = [
            [[0.0] * n for _ in columns] for n, columns in zip(sizes, self.columns, strict=True)
        ]
        self.tables = [[list(row) for row in right] for right in self.rights]

    def weights(
        self, found: list[Stroke], first: int, course: int, shift: int
    ) -> list[list[list[float]]]:
        """Return W and V, 32 rows each."""
        c = constants(self.coding)
        late = self.coding["targets.late"].numbers
        places, shapes = n_placements(), n_shapes()
        kinds = [
            [[float(n // places == s) for s in range(shapes)] for n in range(shapes * places)],
            [
                [float(n % places == p) for p in range(places)]
                + [float(n // places == s) for s in range(shapes)]
                for n in range(shapes * places)
            ],
        ]
        latest = [(c["fingers_begin"] + late[0], c["fingers_end"] + late[0]), (late[-1], late[-1])]
        result = []
        for kind, one in zip(kinds, latest, strict=True):
            rows = held(found, kind, c)
            width = len(kind[0])
            still = [[0.0] * width for _ in rows]
            begin = 100 * (first + EARLIER[shift])
            result.append(travelled(found, rows, [one] * width, still, c, begin, course))
        return result

    def corrected(
        self, likely: list[list[float]], found: list[Stroke], first: int, told: Decoded
    ) -> list[list[float]]:
        """Return a prediction with the corrections so far."""
        frames = [list(frame) for frame in likely]
        weights = self.weights(found, first, told.course, told.shift)
        for rows, columns, table in zip(weights, self.columns, self.tables, strict=True):
            for frame, row in zip(frames, rows, strict=True):
                for column, wanted in zip(columns, table, strict=True):
                    frame[column] += sum(w * x for w, x in zip(row, wanted, strict=True))
        return frames

    def take(
        self, block: list[list[float]], bare: list[list[float]], found: list[Stroke], first: int
    ) -> None:
        """Learn from a superframe as it was decoded."""
        for group, rows in enumerate(self.weights(found, first, 0, 0)):
            square, right = self.squares[group], self.rights[group]
            for row, frame, predicted in zip(rows, block, bare, strict=True):
                for i, w in enumerate(row):
                    for j, v in enumerate(row):
                        square[i][j] += w * v
                    for k, column in enumerate(self.columns[group]):
                        right[k][i] += w * (frame[column] - predicted[column])
            # The matrix is symmetric: x times it is it times x.
            self.tables[group] = [solve(square, one) for one in right]
