"""The vectors of superframes: bytes drawn at random or set by hand, decoded by the reference.

``python -m spec.reference.superframe_vectors spec/vectors/superframe.json`` writes them, the same
ones each time. To be run for a new version of the format only.
"""

import itertools
import json
import random
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from spec.reference import superframe
from spec.reference.purposes import described
from spec.reference.range_decoder import RangeDecoder
from spec.reference.superframe import (
    CORRECTIONS,
    LEVELS,
    PACES,
    Decoded,
    MalformedError,
    class_of,
    crc,
    decode,
    order,
)
from spec.reference.tables import TABLES

ORIGIN = (
    "bytes drawn at random or set by hand by spec/reference/superframe_vectors.py, given checks "
    "and decoded by spec/reference/superframe.py, which was written from the text"
)
SCALES = [[30 - 5 * channel - 2 * frequency for frequency in range(32)] for channel in range(4)]
STEEP = [[44 - 9 * channel - 3 * frequency for frequency in range(32)] for channel in range(4)]
FLAT = [[24 - 3 * channel - frequency for frequency in range(32)] for channel in range(4)]
MIXED = [
    [31 - (7 * channel + 5 * frequency) % 11 - frequency for frequency in range(32)]
    for channel in range(4)
]
BASES = [SCALES, STEEP, FLAT, MIXED]
IDENTITY = "9c3a5b17f0e2d468"
MASK = int(IDENTITY[:4], 16)
Case = dict[str, Any]


def with_check(body: bytes) -> bytes:
    """(H5, H6) Return an L0 part."""
    return body + (crc(body, 16, 0x1021, 0xFFFF) ^ MASK).to_bytes(2, "big")


def l1_of(l0: bytes, body: bytes) -> bytes:
    """(H7) Return an L1 part."""
    if l0[1] & 8:
        l0 = with_check(l0[:-4] + bytes([l0[-4] & 0xFE, 0]))
    return body + bytes([crc(l0[-2:] + body, 8, 0x2F, 0xFF) ^ 0xFF])


def full(
    rng: random.Random, mode: int, size: int, step: int | None = None, flags: int = 0
) -> bytes:
    """Return an L0 part of modes 0 or 1 with a random payload, its step chosen or random.

    `flags` are the last four bits of the header: signed, slow and filmed.
    """
    head = mode << 12 | rng.randrange(64) << 6 | rng.randrange(4) << 4 | flags
    payload = bytearray(rng.randbytes(size))
    if step is not None:
        payload[0] = step << 2 | payload[0] & 3
    return with_check(head.to_bytes(2, "big") + payload)


def compact(rng: random.Random, size: int, signed: int = 0, first: int | None = None) -> bytes:
    """Return a compact L0 part with a random payload."""
    sequence = rng.randrange(16)
    body = bytearray([0x20 | signed << 4 | sequence]) + rng.randbytes(size - 1)
    if first is not None:
        body[1] = first
    told = MASK >> 14 - 2 * (sequence % 8) & 3
    body[-1] = body[-1] & ~(3 << 2 * signed) | told << 2 * signed
    return bytes(body)


def filled(sequence: int, size: int, byte: int) -> bytes:
    """Return a compact L0 part of one byte's value over and over, but for the identity."""
    told = MASK >> 14 - 2 * (sequence % 8) & 3
    return bytes([0x20 | sequence] + (size - 2) * [byte] + [byte & 0xFC | told])


def found(make: Callable[[], bytes], wanted: Callable[[Decoded], bool]) -> bytes:
    """Return the first L0 part that says what is wanted."""
    while True:
        l0 = make()
        if wanted(decode(l0, None, BASES, IDENTITY)):
            return l0


def is_even(out: Decoded) -> bool:
    """Return whether a score has phones at even distances (S8)."""
    starts = out.score["starts"] if out.score else []
    even = [32 * i // len(starts) for i in range(len(starts))]
    return len(starts) > 4 and bool(starts == even)


def parts() -> Iterator[tuple[str, str, bytes, bytes]]:
    """Yield identifier, section, L0 and L1 of the valid vectors."""
    rng = random.Random(4)
    yield "score-of-zeros", "3", with_check(bytes([0x00, 0x50, 0xFC] + 9 * [0])), b""
    ones = with_check(bytes([0x01, 0x20] + 8 * [255]))
    yield "step-63-all-ones", "H10", ones, l1_of(ones, b"\xff\xff")
    for i in range(16):
        l0 = full(rng, i % 2, rng.randrange(8, 40))
        yield f"random-mode-{i % 2}-{i}", "2, 3, 6", l0, l1_of(l0, rng.randbytes(5 * i))
    for i in range(2):
        even = found(lambda: full(rng, 0, 20, 63), is_even)
        yield f"even-{i}", "S8", even, b""
    for i in range(4):
        special = found(lambda: full(rng, 0, 20, 63), lambda out: any(_score(out)["overrides"]))
        yield f"special-{i}", "S9", special, b""
    for i in range(4):
        l0 = full(rng, 1, 40, i)
        yield f"large-indices-{i}", "C4", l0, l1_of(l0, rng.randbytes(20))
    for i in range(3):
        l0 = found(lambda: full(rng, 1, 30, 8 + 4 * i), escapes)  # noqa: B023
        yield f"escape-{i}", "C4", l0, l1_of(l0, rng.randbytes(16))
    for basis in range(4):
        for mode in (0, 1):
            l0 = found(lambda: full(rng, mode, 24, 20), lambda out, b=basis: out.basis == b)  # type: ignore[misc] # noqa: B023
            yield f"basis-{basis}-mode-{mode}", "H8, Q6", l0, l1_of(l0, rng.randbytes(16))
    for level in range(1, 7):
        l0 = found(lambda: full(rng, 1, 24, 18), lambda out, n=level: out.level == n)  # type: ignore[misc]
        yield f"level-{level}", "H8, Q6", l0, l1_of(l0, rng.randbytes(16))
    for course in (1, 2, 3):
        l0 = found(lambda: full(rng, 0, 20, 24), lambda out, c=course: out.course == c)  # type: ignore[misc]
        yield f"course-{course}", "H8", l0, b""
    for shift in (1, 2, 3, 4):
        l0 = found(lambda: full(rng, 0, 20, 24), lambda out, shift=shift: out.shift == shift)  # type: ignore[misc]
        yield f"shift-{shift}", "H8", l0, b""
    for i in range(4):
        l0 = found(lambda: full(rng, 0, 24, 22), lambda out, i=i: out.shares[i] == 1 + i % 2)  # type: ignore[misc]
        yield f"shares-{i}", "H8, P10", l0, b""
    for which in (["2"], ["4"], ["2", "4"], ["2", "4", "6"]):
        l0 = found(lambda: full(rng, 0, 30, 24), lambda out, w=which: [*out.previews] == w)  # type: ignore[misc]
        yield "preview-" + "-".join(which), "V1, V2", l0, b""
    for pieces in (1, 2, 3):
        l0 = full(rng, pieces % 2, 24, None, 2 * pieces)
        yield f"slow-{pieces}", "H8, 3.3", l0, l1_of(l0, rng.randbytes(8))
    for i in range(28):
        l0 = full(rng, i % 4 // 3 ^ 1, 3 + i, 16 + i % 5, 8 | i % 4)
        yield f"signed-{i}", "H12, R8", l0, l1_of(l0, rng.randbytes(12))
    l0, other = full(rng, 1, 5, 24), full(rng, 1, 5, 24)
    yield "l1-of-another-l0", "H7", l0, l1_of(other, rng.randbytes(12))
    for i in range(4):
        l0 = full(rng, i % 2, 6 + 5 * (i % 2 == 0), 20)
        yield f"l1-continues-{i}", "H9, C5", l0, l1_of(l0, rng.randbytes(12 + i))
    for size in (4, 7, 12):
        yield f"compact-zeros-{size}", "3.1", filled(3, size, 0), b""
        yield f"compact-ones-{size}", "3.1", filled(15, size, 255), b""
    for i in range(72):
        yield f"compact-random-{i}", "M1 to M6", compact(rng, 5 + i % 8), b""
    for i in range(12):
        yield f"compact-signed-{i}", "H12, R8", compact(rng, 4 + i % 8, 1), b""
    for i in range(2):
        yield f"compact-slow-{i}", "M1", compact(rng, 9 + i, i, 255), b""
    l0 = found(lambda: compact(rng, 7), lambda out: _score(out)["numbers"][:1] == [0])
    yield "compact-pause-first", "M7", l0, b""
    l0 = found(lambda: compact(rng, 7), lambda out: not _score(out)["numbers"])
    yield "compact-silent", "M5", l0, b""
    yield (
        "compact-special",
        "M1, S9",
        found(lambda: compact(rng, 7), lambda out: any(_score(out)["cheek"])),
        b"",
    )
    for i in range(3):
        l0 = found(lambda: full(rng, 1, 30, 4 + 2 * i), lambda out: out.level == 6)  # noqa: B023
        yield f"level-6-fine-{i}", "H8, Q6", l0, l1_of(l0, rng.randbytes(16))
    for i in range(12):
        l0 = full(rng, 1, 4 + i % 3, 14)
        yield f"l1-short-{i}", "H9, C5", l0, l1_of(l0, rng.randbytes(1 + i % 4))
    for i in range(48):
        yield f"compact-more-{i}", "M6", compact(rng, 9 + i % 4), b""
    l0 = found(
        lambda: compact(rng, 12),
        lambda out: 32 in [b - a for a, b in itertools.pairwise(_score(out)["starts"])],
    )
    yield "compact-length-32", "M6", l0, b""
    l0 = found(lambda: compact(rng, 12), lambda out: paced(out, 32, 0))
    yield "compact-rounded", "M6", l0, b""
    l0 = found(lambda: full(rng, 0, 24, 63), lambda out: _score(out)["numbers"][-1:] == [16])
    yield "last-vowel-16", "S7", l0, b""
    l0 = found(lambda: full(rng, 1, 30, 6), lambda out: escapes(out, 19))
    yield "escape-deep", "C4", l0, b""
    l0 = full(rng, 0, 40, 63)
    while not has_key_41(l0):
        l0 = full(rng, 0, 40, 63)
    yield "key-41", "V2", l0, b""
    for nth in range(1, 8):
        l0 = found(lambda: compact(rng, 12), lambda out, n=nth: corrects(out, n))  # type: ignore[misc]
        yield f"correction-{nth}", "M6", l0, b""
    for vowel in (1, 16):
        for i in range(3):
            l0 = found(lambda: replacing(rng), lambda out, n=vowel: bordering(out, n))  # type: ignore[misc]
            yield f"special-vowel-{vowel}-{i}", "S10", l0, b""
    for step in (8, 15, 35):
        yield f"last-symbols-{step}", "C1, C4", last_symbols(step), b""
    yield from filmed(random.Random(5))


def filmed(rng: random.Random) -> Iterator[tuple[str, str, bytes, bytes]]:
    """Yield the vectors of filmed superframes (H13, section 3.4)."""
    for which in (["0"], ["0", "2"], ["0", "-1"], ["0", "2", "-1"], ["0", "2", "4"]):
        for i in range(3):
            l0 = found(
                lambda: full(rng, 0, 12 + 6 * i, None, 1),  # noqa: B023
                lambda out, w=which: [*out.previews] == w and out.step != 63,  # type: ignore[misc]
            )
            name = "-".join(["before" if one == "-1" else one for one in which])
            yield f"filmed-lists-{name}-{i}", "H13, V6, V7", l0, l1_of(l0, rng.randbytes(8 * i))
    for basis in range(4):
        for mode in (0, 1):
            l0 = found(lambda: full(rng, mode, 20, None, 1), lambda out, b=basis: out.basis == b)  # type: ignore[misc] # noqa: B023
            yield f"filmed-basis-{basis}-mode-{mode}", "H13", l0, l1_of(l0, rng.randbytes(8))
    for eighth in range(8):
        l0 = found(lambda: full(rng, 1, 24, None, 1), lambda out, e=eighth: out.step // 8 == e)  # type: ignore[misc]
        yield f"filmed-step-{eighth}", "H13", l0, l1_of(l0, rng.randbytes(8))
    l0 = found(lambda: full(rng, 0, 24, None, 1), lambda out: out.step == 63)
    yield "filmed-step-63", "H10, H13", l0, b""
    l0 = found(lambda: full(rng, 0, 24, None, 1), lambda out: 0 < sum(out.shares) < 8)
    yield "filmed-shares", "H13, P10", l0, b""
    for i in range(6):
        l0 = full(rng, i % 2, 12 + i, None, 9 | 2 * (i % 3))
        yield f"filmed-signed-{i}", "H12, H13, R8", l0, l1_of(l0, rng.randbytes(8))
    l0 = full(rng, 0, 30, None, 1)
    while not has_key_41(l0):
        l0 = full(rng, 0, 30, None, 1)
    yield "filmed-key-41", "V2, V7", l0, b""


def replacing(rng: random.Random) -> bytes:
    """Return an L0 part of mode 0 without coefficients whose score is marked as special (S9)."""
    # Ten bits behind the step: the last 256 of 32768 of the first 32640 of 32768.
    bits = bytes([255, rng.randrange(0xF5, 0xFB)])
    head = rng.randrange(1 << 6) << 6
    return with_check(head.to_bytes(2, "big") + bits + rng.randbytes(18))


def last_symbols(step: int, size: int = 24) -> bytes:
    """Return an L0 part of mode 1 in which every symbol behind the step is its row's last one.

    Indices are then as large as can be; at step 35 the largest scale is of class 0.
    """
    below, above = 0, 1 << 8 * size
    while above - below > 1:
        middle = (below + above) // 2
        decoder = RangeDecoder(middle.to_bytes(size, "big"))
        below, above = (middle, above) if decoder.bits(6) <= step else (below, middle)
    return with_check(bytes([0x11, 0x20]) + below.to_bytes(size, "big"))


def bordering(out: Decoded, vowel: int) -> bool:
    """Return whether keys are replaced behind a pair that a border of the vowels decides (S10)."""
    score = _score(out)
    replaced = [int(start) for start in score["overrides"]]
    numbers = [score["first"], *score["numbers"]]
    pairs = zip(itertools.pairwise(numbers), score["starts"], strict=True)
    return any(
        (this == 1 and before > 16 if vowel == 1 else before == 16 and 0 < this <= 16)
        and max(replaced, default=0) > start
        for (before, this), start in pairs
    )


def paced(out: Decoded, phone: int, pace: int) -> bool:
    """Return whether a phone and other consonants have the lengths of a pace (M6)."""
    score = _score(out)
    ends = [*score["starts"][1:], score["end"]]
    usual = TABLES["score"]["usual"]
    lengths = [
        (number, stop - start, (usual[number] * PACES[pace] + 64) // 128)
        for number, start, stop in zip(score["numbers"], score["starts"], ends, strict=True)
        if number > 16
    ]
    shown = {number for number, _, _ in lengths}
    return phone in shown and len(shown) > 2 and all(a == b for _, a, b in lengths)


def has_key_41(l0: bytes) -> bool:
    """Return whether the code of a preview has the symbol that does not occur (V2)."""
    told: list[int] = []

    def least(*values: Any) -> Any:
        told.extend(values[:1] if values[1:] == (40,) else ())
        return min(*values)

    vars(superframe)["min"] = least
    try:
        decode(l0, None, BASES, IDENTITY)
    finally:
        del vars(superframe)["min"]
    return 41 in told


def corrects(out: Decoded, which: int) -> bool:
    """Return whether a vowel has a length that a correction alone can give, at some pace (M6)."""
    score = _score(out)
    ends = [*score["starts"][1:], score["end"]]
    lengths = {
        (number, stop - start)
        for number, start, stop in zip(score["numbers"], score["starts"], ends, strict=True)
    }
    usual = TABLES["score"]["usual"]
    for pace in PACES:
        ruled = {n: (usual[n] * pace + 64) // 128 for n, _ in lengths}
        plain = [length == ruled[n] for n, length in lengths if n > 16]
        corrected = [
            length == ruled[n] + CORRECTIONS[which] > 1 for n, length in lengths if 0 < n <= 16
        ]
        if len(plain) > 1 and all(plain) and any(corrected):
            return True
    return False


def escapes(out: Decoded, least: int = 16) -> bool:
    """Return whether an index is so large that it takes bits beyond its symbol (C4)."""
    scales = BASES[out.basis]
    return any(
        abs(q) >> class_of(scales[c][f] + LEVELS[out.level], out.step)[1] > least
        for q, (c, f) in zip(out.indices, order(scales), strict=True)
    )


def _score(out: Decoded) -> dict[str, Any]:
    return out.score or {}


def invalid() -> Iterator[tuple[str, str, bytes]]:
    """Yield identifier, the paragraph that is broken, and L0."""
    yield "too-short", "H1", bytes([0x01, 0, 0, 0])
    yield "signed-too-short", "H1", with_check(bytes([0x01, 0x08, 0, 0]))
    yield "signed-still-too-short", "H1", with_check(bytes([0x11, 0x08, 0, 0x80]))
    yield "compact-too-short", "H1", bytes([0x21, 0, 0])
    yield "compact-too-long", "H1", bytes([0x21] + 12 * [0])
    yield "version-1", "H2", with_check(bytes([0x41, 0, 0]))
    yield "version-3", "H2", with_check(bytes([0xC1, 0, 0]))
    yield "compact-version-1", "H2", bytes([0x60]) + filled(0, 5, 0)[1:]
    yield "compact-version-2", "H2", bytes([0xA0]) + filled(0, 5, 0)[1:]
    yield "wrong-check", "H6", with_check(bytes([0x01, 0, 0]))[:-1] + b"\0"
    body = bytes([0x01, 0, 0])
    yield "check-without-identity", "H6", body + crc(body, 16, 0x1021, 0xFFFF).to_bytes(2, "big")
    yield "compact-of-another", "M2", filled(2, 6, 0)[:-1] + bytes([filled(2, 6, 0)[-1] ^ 1])


def case_of(name: str, section: str, l0: bytes, l1: bytes) -> Case:
    """Return a vector with what the reference says."""
    out = decode(l0, l1, BASES, IDENTITY)
    return {
        "id": name, "section": section, "valid": True, "l0": l0.hex(), "l1": l1.hex(),
        "header": [out.mode, out.sequence, out.lead, out.signed, out.proof], "slow": out.slow,
        "setting": [out.step, out.basis, out.level, out.course, out.shift, *out.shares],
        "score": out.score, "previews": out.previews,
        "indices": {str(i): q for i, q in enumerate(out.indices) if q},
        "values": {str(i): v for i, v in enumerate(out.values) if v},
    }  # fmt: skip


def main(path: str) -> None:
    """Write the vectors."""
    cases = [case_of(*part) for part in parts()]
    for name, section, l0 in invalid():
        try:
            decode(l0, b"", BASES, IDENTITY)
        except MalformedError as error:
            broken = str(error)
        else:
            broken = ""
        assert broken == section, name
        cases.append({"id": name, "section": section, "valid": False, "l0": l0.hex(), "l1": ""})
    cases = [case | described("superframe", case["id"]) for case in cases]
    lines = ",\n".join("  " + json.dumps(case, ensure_ascii=False) for case in cases)
    head = json.dumps(
        {"section": "2, 3, 6", "origin": ORIGIN, "identity": IDENTITY, "bases": BASES}
    )[:-1]
    Path(path).write_text(f'{head}, "cases": [\n{lines}\n]}}\n', encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
