"""Sections 2, 3 and 6.2 to 6.4 of spec/bitstream.md in plain integers, from the text.

Slow on purpose. What it needs of a voice: the identity of its coding, the scales of its bases.
"""

from dataclasses import dataclass, field
from typing import Any

from spec.reference.range_decoder import RangeDecoder
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

BASES = ([16384, 8192, 4096, 4096], [1024, 1024, 15360, 15360])
LEVEL = [14336, 5120, 5120, 3072, 2560, 1536, 1024]
COURSE = [24576, 4096, 2048, 2048]
USE = [16384, 8192, 8192]
SHARE = [12288, 4096, 16384]
FILMED_STEP = [512, 1024, 4096, 21504, 4096, 512, 512, 512]
FILMED_USE = [12288, 18432, 2048]
FILMED_BASIS = [1024, 1024, 3072, 27648]
LISTS = [1024, 20480, 4096, 1024, 6144]
AFTER_REST = [2560, 2560, 2560, 2048, 2048, 2048, 1536, 1536, 15872]
AFTER_KEY = [3072, 6656, 7168, 5632, 3584, 2560, 1536, 1024, 1536]
SLOW = [32512, 256]
SHIFTS = [20480, 4096, 4096, 2048, 2048]
SPECIAL = [32512, 256]
BEGIN = [512 * n for n in (3, 4, 5, 6, 7, 7, 6, 5, 4, 4, 3, 3, 2, 2, 2, 1)]
PACE = [2048, 7168, 8192, 6144, 4096, 2560, 1536, 1024]
PACES = (3, 4, 5, 6, 7, 8, 10, 13)
CORRECTION = [22528, 2560, 2048, 1536, 1536, 512, 1024, 1024]
CORRECTIONS = (0, -2, 2, -4, 4, -7, 7, 12)
LEVELS = (0, 4, -4, 8, -8, 12, -12)
WIDTHS = (65536, 77936, 92682, 110218)


class MalformedError(Exception):
    """A part breaks a rule; the argument is the paragraph."""


@dataclass
class Decoded:
    """The integers of a superframe."""

    mode: int = 0
    sequence: int = 0
    lead: int = 0
    signed: int = 0
    proof: int = 0
    filmed: int = 0
    slow: list[int] = field(default_factory=list)
    step: int = 63
    basis: int = 0
    level: int = 0
    course: int = 0
    shift: int = 0
    shares: list[int] = field(default_factory=lambda: [0, 0, 0, 0])
    score: dict[str, Any] | None = None
    previews: dict[str, list[list[int]]] = field(default_factory=dict)
    indices: list[int] = field(default_factory=list)
    values: list[int] = field(default_factory=list)


def crc(data: bytes, width: int, polynomial: int, preset: int) -> int:
    """(H6, H7) Return a check without reflection or inversion."""
    register, top = preset, 1 << (width - 1)
    for byte in data:
        register ^= byte << (width - 8)
        for _ in range(8):
            carry = register & top
            register = (register << 1) & ((1 << width) - 1)
            if carry:
                register ^= polynomial
    return register


def decode(l0: bytes, l1: bytes | None, bases: list[list[list[int]]], identity: str) -> Decoded:
    """Return what a superframe says.

    `bases` are the scales of the four bases (Q6), one list of 32 per channel each; `identity` is
    that of the coding. An L1 that does not fit is left out.
    """
    if l0 and l0[0] & 0x20:
        return compact(l0, bases, identity)
    if len(l0) < 5:
        raise MalformedError("H1")
    body, check = l0[:-2], int.from_bytes(l0[-2:], "big")
    head = int.from_bytes(body[:2], "big")
    signed = head >> 3 & 1
    if signed and len(l0) < 7:
        raise MalformedError("H1")
    if crc(body, 16, 0x1021, 0xFFFF) ^ int(identity[:4], 16) != check:
        raise MalformedError("H6")
    if head >> 14 != 0:
        raise MalformedError("H2")
    out = Decoded(head >> 12 & 3, head >> 6 & 63, head >> 4 & 3, signed)
    out.proof = int.from_bytes(body[-2:], "big") & 511 if signed else 0
    decoder = RangeDecoder(body[2:], tail=9 * signed)
    out.slow = [decoder.bits(16) for _ in range(head >> 1 & 3)]
    out.filmed = head & 1
    setting(decoder, out)
    if out.mode == 0 and out.filmed:
        out.previews = labels(decoder)
    elif out.mode == 0:
        out.score = score(decoder)
        out.previews = previews(decoder)
    scan, scales = prepared(out, bases)
    if out.step == 63:
        return out
    known = coefficients(decoder, out, scan, scales, 0)
    bare = int.from_bytes(body, "big") - out.proof
    bound = crc(bare.to_bytes(len(body), "big"), 16, 0x1021, 0xFFFF) ^ int(identity[:4], 16)
    fits = l1 and crc(bound.to_bytes(2, "big") + l1[:-1], 8, 0x2F, 0xFF) ^ 0xFF == l1[-1]
    if l1 and fits:
        coefficients(RangeDecoder(l1[:-1]), out, scan, scales, known)
    out.values = values(out, scan, scales)
    return out


def record(payload: bytes, mode: int, bases: list[list[list[int]]]) -> Decoded:
    """(F7) Return what a superframe says whose file tells its score once."""
    out, decoder = Decoded(mode), RangeDecoder(payload)
    setting(decoder, out)
    scan, scales = prepared(out, bases)
    if out.step != 63:
        coefficients(decoder, out, scan, scales, 0)
        out.values = values(out, scan, scales)
    return out


def setting(decoder: RangeDecoder, out: Decoded) -> None:
    """(H8, H13) Read how a superframe codes what its prediction lacks."""
    if out.filmed:
        out.step = 8 * decoder.symbol(FILMED_STEP)[0]
        out.step += decoder.bits(3)
    else:
        out.step = decoder.bits(6)
    if out.step == 63:
        return
    use = decoder.symbol(FILMED_USE if out.filmed else USE)[0] if out.mode == 0 else 1
    out.basis = decoder.symbol(FILMED_BASIS if out.filmed else BASES[1 if use == 1 else 0])[0]
    out.level = decoder.symbol(LEVEL)[0]
    if use == 1:
        out.shares = [2, 2, 2, 2] if out.mode == 0 else [0, 0, 0, 0]
        return
    out.course = decoder.symbol(COURSE)[0]
    out.shift = decoder.symbol(SHIFTS)[0]
    if use == 2:
        out.shares = [decoder.symbol(SHARE)[0] for _ in range(4)]


def prepared(
    out: Decoded, bases: list[list[list[int]]]
) -> tuple[list[tuple[int, int]], list[list[int]]]:
    """(T2, Q6) Return the order of the coefficients and their raised scales."""
    scales = bases[out.basis]
    scan = order(scales)
    out.indices = [0] * len(scan)
    out.values = [0] * len(scan)
    return scan, [[scale + LEVELS[out.level] for scale in row] for row in scales]


def values(out: Decoded, scan: list[tuple[int, int]], scales: list[list[int]]) -> list[int]:
    """(Q1 to Q4) Return the values of all coefficients."""
    return [value(q, scales[c][f], out.step) for q, (c, f) in zip(out.indices, scan, strict=True)]


def compact(l0: bytes, bases: list[list[list[int]]], identity: str) -> Decoded:
    """(H3, H11, M1 to M4) Return what a compact superframe says."""
    if not 4 <= len(l0) <= 12:
        raise MalformedError("H1")
    sequence, signed = l0[0] & 15, l0[0] >> 4 & 1
    told = l0[-1] >> 2 * signed & 3
    if told != int(identity[:4], 16) >> 14 - 2 * (sequence % 8) & 3:
        raise MalformedError("M2")
    if l0[0] >> 6 != 0:
        raise MalformedError("H2")
    decoder = RangeDecoder(l0[1:], tail=2 + 2 * signed)
    out = Decoded(2, sequence, 2, signed, l0[-1] & 3 if signed else 0)
    if decoder.symbol(SLOW)[0]:
        out.slow = [decoder.bits(16)]
    out.score = {"cheek": [0 for _ in LANGUAGE["alternatives"]], "rest_gap": 1}
    if decoder.symbol(SPECIAL)[0]:
        out.score["cheek"] = [decoder.bits(1) for _ in LANGUAGE["alternatives"]]
        out.score["rest_gap"] = decoder.bits(2)
    timing = decoder.symbol([8192, 24576])[0]
    begin = 8 * decoder.symbol(BEGIN)[0] - 16
    begin += 4 * decoder.bits(1) if timing == 1 else 2 * decoder.bits(2)
    pace = decoder.symbol(PACE)[0] if timing == 1 else 0
    phones = window(decoder, begin, timing, pace)
    while phones and phones[-1][0] == 0:
        phones.pop()
    starts = [begin]
    for _, length in phones:
        starts.append(starts[-1] + length)
    out.score |= {"begin": begin, "numbers": [number for number, _ in phones]}
    out.score |= {"end": starts.pop(), "starts": starts}
    out.indices = [0] * 32 * len(bases[0])
    out.values = [0] * 32 * len(bases[0])
    return out


def window(decoder: RangeDecoder, tick: int, timing: int, pace: int) -> list[tuple[int, int]]:
    """(M5, M6, M7) Return number and length of the phones that are determined."""
    tables = TABLES["score"]
    phones: list[tuple[int, int]] = []
    spoken = 0
    told = True
    while tick <= 110 and told:
        before = [n_phones(), n_phones(), *(number for number, _ in phones)]
        row = tables["next"][before[-2]][before[-1]] if phones else tables["opening"]
        letter, determined = decoder.symbol(row)
        if not determined:
            break
        this = number(letter)
        if not phones and this == 0:
            length = (2, 4)[timing]
        elif this and timing == 1:
            length = (tables["usual"][this] * PACES[pace] + 64) // 128
            if this <= n_vowels():
                symbol, told = decoder.symbol(CORRECTION)
                length += CORRECTIONS[symbol] if told else 0
            length = min(max(length, 1), 32)
        else:
            unit, limit = ((1, 31), (2, 15))[timing]
            row = tables["length"][this][tempo(spoken)] if timing == 0 else tables["pause"]
            symbol, determined = decoder.symbol(row, limit)
            if not determined or (this == 0 and symbol == limit):
                break
            length = unit * (symbol + 1)
        phones.append((this, length))
        spoken = length if this else 0
        tick += length
    return phones


def previews(decoder: RangeDecoder) -> dict[str, list[list[int]]]:
    """(V1, V2) Return tick and symbol of what starts, by distance."""
    tables = TABLES["score"]
    result: dict[str, list[list[int]]] = {}
    which = decoder.symbol([12288, 1024, 1024, 4096, 14336])[0]
    for distance in ([], [2], [4], [2, 4], [2, 4, 6])[which]:
        found = []
        cell, last = -1, silence() + 1
        while cell < 15:
            gap = decoder.symbol(tables["gap"][last], 15 - cell)[0]
            if gap == 15 - cell:
                break
            cell += 1 + gap
            tick = 2 * cell + (decoder.bits(1) if distance == 2 else 1)
            last = min(decoder.symbol(tables["key"][last])[0], silence())
            found.append([tick, last])
        result[str(distance)] = found
    return result


def labels(decoder: RangeDecoder) -> dict[str, list[list[int]]]:
    """(V6, V7) Return tick and symbol of what starts, by distance; 0 is the superframe itself."""
    result: dict[str, list[list[int]]] = {}
    which = decoder.symbol(LISTS)[0]
    for distance in [0, *([], [2], [-1], [2, -1], [2, 4])[which]]:
        found = []
        cell, last = -1, silence() + 1
        while cell < 7:
            row = AFTER_KEY if last < silence() else AFTER_REST
            gap = decoder.symbol(row, 7 - cell)[0]
            if gap == 7 - cell:
                break
            cell += 1 + gap
            last = min(decoder.symbol(TABLES["score"]["key"][last])[0], silence())
            found.append([4 * cell + 2, last])
        result[str(distance)] = found
    return result


def score(decoder: RangeDecoder) -> dict[str, Any]:
    """(S2 to S10) Return the score of a superframe."""
    tables = TABLES["score"]
    even = decoder.symbol([32640, 128])[0]
    special = decoder.symbol([32512, 256])[0]
    first = number(decoder.symbol(tables["first"])[0])
    numbers, starts = [], []
    earlier, before = n_phones(), first
    if even:
        first_end = 0
        n = decoder.bits(5) + 1
        for i in range(n):
            letter = decoder.symbol(tables["next"][earlier][before])[0]
            earlier, before = before, number(letter)
            numbers.append(before)
            starts.append(32 * i // n)
    else:
        first_end = start = decoder.symbol(tables["left"][first], 32)[0]
        length = 0
        while start < 32:
            letter = decoder.symbol(tables["next"][earlier][before])[0]
            earlier, before = before, number(letter)
            row = tables["length"][before][tempo(length)]
            length = decoder.symbol(row, 31 - start)[0] + 1
            numbers.append(before)
            starts.append(start)
            start += length
            if before == 0:
                length = 0
    ahead = 0
    if before > n_vowels():
        letter = decoder.symbol(tables["next"][earlier][before], n_vowels())[0]
        ahead = letter + 1 if letter < n_vowels() else 0
    result: dict[str, Any] = {
        "first": first,
        "first_end": first_end,
        "numbers": numbers,
        "starts": starts,
        "ahead": ahead,
        "cheek": [0 for _ in LANGUAGE["alternatives"]],
        "rest_gap": 1,
        "overrides": {},
    }
    if special:
        result["cheek"] = [decoder.bits(1) for _ in LANGUAGE["alternatives"]]
        result["rest_gap"] = decoder.bits(2)
        for start in key_starts(first, numbers, starts):
            if decoder.symbol([28672, 4096])[0]:
                shape = decoder.symbol(equal(n_shapes()))[0]
                place = decoder.symbol(equal(n_placements()))[0]
                result["overrides"][str(start)] = [shape, place]
    return result


def number(letter: int) -> int:
    """(S3) Return the phone number of a letter."""
    return (letter + 1) % n_phones()


def tempo(length: int) -> int:
    """(S6) Return the context of a length; 0 stands for a pause before."""
    if length == 0:
        return 0
    return 1 if length <= 3 else 2 if length <= 5 else 3


def key_starts(first: int, numbers: list[int], starts: list[int]) -> list[int]:
    """(S10) Return the starts of keys."""
    result = []
    before = first
    for this, start in zip(numbers, starts, strict=True):
        is_vowel = 1 <= this <= n_vowels()
        if this != 0 and not (is_vowel and before > n_vowels()):
            result.append(start)
        before = this
    return result


def order(scales: list[list[int]]) -> list[tuple[int, int]]:
    """(T2) Return (channel, frequency) of every coefficient by its number."""
    every = [(c, f) for c in range(len(scales)) for f in range(32)]
    return sorted(every, key=lambda cf: (-scales[cf[0]][cf[1]], cf[1], cf[0]))


def class_of(scale: int, step: int) -> tuple[int, int]:
    """(C1) Return class and shift."""
    ratio = scale - step + 16
    shift = max(0, (ratio - 21) // 4)
    return ratio - 4 * shift, shift


def coefficients(
    decoder: RangeDecoder,
    out: Decoded,
    scan: list[tuple[int, int]],
    scales: list[list[int]],
    first: int,
) -> int:
    """(C1 to C5) Fill in indices from number `first` on; return the first undetermined number."""
    number_of = {place: i for i, place in enumerate(scan)}
    for i in range(first, len(scan)):
        c, f = scan[i]
        kind, shift = class_of(scales[c][f], out.step)
        if kind < 0:
            continue
        context = 0
        for place in ((c, f - 1), (c, f - 2), (c - 1, f)):
            j = number_of.get(place, i)
            if j < i:
                context += min(abs(out.indices[j]) >> shift, 2)
        row = TABLES["coefficient"]["magnitude"][kind][min(context, 3)]
        q, determined = index(decoder, row, shift)
        if not determined:
            return i
        out.indices[i] = q
    return len(scan)


def index(decoder: RangeDecoder, row: list[int], shift: int) -> tuple[int, bool]:
    """(C4, C5) Return an index and whether all of its symbols were determined."""
    sure = []

    def get(freqs: list[int]) -> int:
        symbol, determined = decoder.symbol(freqs)
        sure.append(determined)
        return symbol

    def flip() -> int:
        return get([16384, 16384])

    q = get(row)
    if q == 15:
        u = 0
        while u < 20 and flip():
            u += 1
        rest = 0
        for _ in range(u):
            rest = 2 * rest + flip()
        q = 15 + 2**u + rest - 1
    for _ in range(shift):
        q = 2 * q + flip()
    if q and flip():
        q = -q
    return q, all(sure)


def value(q: int, scale: int, step: int) -> int:
    """(Q1 to Q4) Return the value of an index in 2**-16 mm."""
    kind, shift = class_of(scale, step)
    if q == 0:
        return 0
    width = WIDTHS[step % 4] * 2 ** (step // 4)
    inset = 0
    if shift == 0:
        inset = TABLES["coefficient"]["inset"][kind][min(abs(q), 3) - 1]
    magnitude: int = (256 * abs(q) - inset) * width // 256
    return -magnitude if q < 0 else magnitude
