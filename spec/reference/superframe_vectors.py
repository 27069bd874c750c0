"""The vectors of superframes: bytes drawn at random or set by hand, decoded by the reference.

``python -m spec.reference.superframe_vectors spec/vectors/superframe.json`` writes them, the same
ones each time. To be run for a new version of the format only.
"""

import json
import random
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from spec.reference.superframe import Decoded, MalformedError, crc, decode

ORIGIN = (
    "bytes drawn at random or set by hand by spec/reference/superframe_vectors.py, given checks "
    "and decoded by spec/reference/superframe.py, which was written from the text"
)
SCALES = [[30 - 5 * channel - 2 * frequency for frequency in range(32)] for channel in range(4)]
Case = dict[str, Any]


def with_check(body: bytes) -> bytes:
    """(H6) Return an L0 part."""
    return body + crc(body, 16, 0x1021, 0xFFFF).to_bytes(2, "big")


def l1_of(l0: bytes, body: bytes) -> bytes:
    """(H7) Return an L1 part."""
    return body + bytes([crc(l0[-2:] + body, 8, 0x2F, 0xFF) ^ 0xFF])


def full(rng: random.Random, mode: int, size: int, step: int | None = None) -> bytes:
    """Return an L0 part of modes 0 or 1 with a random payload, its step chosen or random."""
    head = bytes([0xC0 | mode << 4 | rng.randrange(16), rng.randrange(256)])
    payload = bytearray(rng.randbytes(size))
    if step is not None:
        payload[0] = step << 2 | payload[0] & 3
    return with_check(head + payload)


def compact(rng: random.Random, size: int) -> bytes:
    """Return a compact L0 part with a random payload."""
    return bytes([0xE0 | rng.randrange(32)]) + rng.randbytes(size - 1)


def found(make: Callable[[], bytes], wanted: Callable[[Decoded], bool]) -> bytes:
    """Return the first L0 part that says what is wanted."""
    while True:
        l0 = make()
        if wanted(decode(l0, None, SCALES)):
            return l0


def is_even(out: Decoded) -> bool:
    """Return whether a score has phones at even distances (S8)."""
    starts = out.score["starts"] if out.score else []
    even = [32 * i // len(starts) for i in range(len(starts))]
    return len(starts) > 4 and bool(starts == even)


def parts() -> Iterator[tuple[str, str, bytes, bytes]]:
    """Yield identifier, section, L0 and L1 of the valid vectors."""
    rng = random.Random(2)
    yield "score-of-zeros", "3", with_check(bytes([0xC0, 0x5A, 0xFC] + 9 * [0])), b""
    ones = with_check(bytes([0xC1, 0x20] + 8 * [255]))
    yield "step-63-all-ones", "H10", ones, l1_of(ones, b"\xff\xff")
    for i in range(6):
        l0 = full(rng, i % 2, rng.randrange(8, 40))
        yield f"random-mode-{i % 2}-{i}", "2, 3, 6", l0, l1_of(l0, rng.randbytes(5 * i))
    for i in range(2):
        even = found(lambda: full(rng, 0, 20, 63), is_even)
        yield f"even-{i}", "S8", even, b""
    for i in range(2):
        special = found(lambda: full(rng, 0, 20, 63), lambda out: any(_score(out)["overrides"]))
        yield f"special-{i}", "S9", special, b""
    for i in range(2):
        l0 = full(rng, 1, 40, i)
        yield f"large-indices-{i}", "C4", l0, l1_of(l0, rng.randbytes(20))
    for gain in (1, 2, 3):
        l0 = found(lambda: full(rng, 1, 20, 24), lambda out, gain=gain: out.gain == gain)  # type: ignore[misc]
        yield f"gain-{gain}", "H8, Q6", l0, l1_of(l0, rng.randbytes(16))
    for shift in (1, 2, 3, 4):
        l0 = found(lambda: full(rng, 0, 20, 24), lambda out, shift=shift: out.shift == shift)  # type: ignore[misc]
        yield f"shift-{shift}", "H8", l0, b""
    for which in (["2"], ["4"], ["2", "4"], ["2", "4", "6"]):
        l0 = found(lambda: full(rng, 0, 30, 24), lambda out, w=which: [*out.previews] == w)  # type: ignore[misc]
        yield "preview-" + "-".join(which), "V1, V2", l0, b""
    l0, other = full(rng, 1, 5, 24), full(rng, 1, 5, 24)
    yield "l1-of-another-l0", "H7", l0, l1_of(other, rng.randbytes(12))
    yield "l1-continues", "H9", l0, l1_of(l0, rng.randbytes(12))
    for size in (4, 7, 12):
        yield f"compact-zeros-{size}", "3.1", bytes([0xE3] + (size - 1) * [0]), b""
        yield f"compact-ones-{size}", "3.1", bytes([0xFF] + (size - 1) * [255]), b""
    for i in range(8):
        yield f"compact-random-{i}", "M1 to M6", compact(rng, 5 + i), b""
    l0 = found(lambda: compact(rng, 7), lambda out: _score(out)["numbers"][:1] == [0])
    yield "compact-pause-first", "M7", l0, b""
    l0 = found(lambda: compact(rng, 7), lambda out: not _score(out)["numbers"])
    yield "compact-silent", "M5", l0, b""
    yield (
        "compact-special", "M1, S9",
        found(lambda: compact(rng, 7), lambda out: any(_score(out)["cheek"])), b"",
    )  # fmt: skip


def _score(out: Decoded) -> dict[str, Any]:
    return out.score or {}


def invalid() -> Iterator[tuple[str, str, bytes]]:
    """Yield identifier, the paragraph that is broken, and L0."""
    yield "too-short", "H1", bytes([0xC1, 0, 0, 0])
    yield "compact-too-short", "H1", bytes([0xE1, 0, 0])
    yield "compact-too-long", "H1", bytes([0xE1] + 12 * [0])
    yield "version-1", "H2", with_check(bytes([0x41, 0, 0]))
    yield "version-2", "H2", with_check(bytes([0x81, 0, 0]))
    yield "compact-version-2", "H2", bytes([0xA1, 0, 0, 0])
    yield "wrong-check", "H6", with_check(bytes([0xC1, 0, 0]))[:-1] + b"\0"


def case_of(name: str, section: str, l0: bytes, l1: bytes) -> Case:
    """Return a vector with what the reference says."""
    out = decode(l0, l1, SCALES)
    return {
        "id": name, "section": section, "valid": True, "l0": l0.hex(), "l1": l1.hex(),
        "scales": SCALES, "setting": [out.step, out.gain, out.course, out.shift],
        "score": out.score, "previews": out.previews,
        "indices": {str(i): q for i, q in enumerate(out.indices) if q},
    }  # fmt: skip


def main(path: str) -> None:
    """Write the vectors."""
    cases = [case_of(*part) for part in parts()]
    for name, section, l0 in invalid():
        try:
            decode(l0, b"", SCALES)
        except MalformedError as error:
            broken = str(error)
        else:
            broken = ""
        assert broken == section, name
        cases.append({
            "id": name, "section": section, "valid": False, "l0": l0.hex(), "l1": "",
            "scales": SCALES,
        })  # fmt: skip
    lines = ",\n".join("  " + json.dumps(case, ensure_ascii=False) for case in cases)
    head = json.dumps({"section": "2, 3, 6", "origin": ORIGIN})[:-1]
    Path(path).write_text(f'{head}, "cases": [\n{lines}\n]}}\n', encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
