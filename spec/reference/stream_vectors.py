"""The vectors of stream files: files of bytes drawn at random, read and drawn by the reference.

``python -m spec.reference.stream_vectors spec/vectors/stream.json`` writes them, the same ones each
time. To be run for a new version of the format, of the built-in voice or of its tables only.
"""

import json
import random
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from spec.reference import files
from spec.reference.identity import identity as identity_of
from spec.reference.markers import identity, markers, read_voice
from spec.reference.motion import BASES, read_coding
from spec.reference.superframe import MalformedError, crc

ASSETS = Path(__file__).parents[2] / "codec" / "assets"
ORIGIN = (
    "bytes drawn at random by spec/reference/stream_vectors.py, given checks, read and drawn by "
    "spec/reference/files.py, motion.py and markers.py, which were written from the text"
)
FRAMES = (0, 1, 13, 31, 37, 63, 70, 95)
"""Frames of which markers are stated."""

SHOWN = (5, 25, 63 + 7, 63 + 30)
"""Markers that are: nose bridge, lower lip, two of the hand."""

Case = dict[str, Any]


def head(first: int, ticks: int, coding: str, lengths: int = 0) -> bytes:
    """(Section 8) Return the head of a file."""
    body = b"CUES\4" + bytes.fromhex(coding) + first.to_bytes(4, "big") + ticks.to_bytes(4, "big")
    body += lengths.to_bytes(3, "big")
    return body + crc(body, 16, 0x1021, 0xFFFF).to_bytes(2, "big")


def whole(start: bytes, records: list[bytes]) -> bytes:
    """(F7) Return a file of records."""
    data = start
    for record in records:
        long = len(record) >= 255
        data += bytes([255]) + len(record).to_bytes(3, "big") if long else bytes([len(record)])
        data += record
    return data + zlib.crc32(data).to_bytes(4, "big")


def payload(rng: random.Random, size: int) -> bytes:
    """Return a payload of a step at which nothing is beyond drawing."""
    data = bytearray(rng.randbytes(size))
    data[0] = rng.randrange(20, 26) << 2 | data[0] & 3
    return bytes(data)


def told(rng: random.Random, form: int, special: bool, learns: bool) -> bytes:
    """Return what a file says once, at random but for its first symbols."""
    while True:
        data = bytearray(rng.randbytes(60))
        data[0] = form << 7 | data[0] & 127
        if special:
            data[0] |= 127
            data[1] |= 192
        try:
            found = files.read(whole(head(40, 96, 16 * "0"), [bytes(data)] + 4 * [b"\xfc"]))
        except MalformedError:
            continue
        line = found.line or []
        sounding = [phone for phone in line if phone[0] and 32 <= phone[1] < 96]
        replaces = bool(found.replaced) or any(found.cheek)
        if found.learns == learns and len(sounding) > 4 and (not special or form or replaces):
            return bytes(data)


def cases(coding: str) -> Iterator[tuple[str, str, bytes, bool]]:
    """Yield identifier, section, file, and whether it is drawn."""
    rng = random.Random(8)
    for i in range(24):
        once = told(rng, i % 2, i % 6 > 3, bool(i // 2 % 2))
        count = -(-(120 + i) // 32) - 1
        records = [once] + [payload(rng, 9) for _ in range(count)]
        name = f"{('spoken', 'keyed')[i % 2]}-{i}"
        yield name, "F8 to F12", whole(head(40 + i, 80, 16 * "0"), records), False
    for i, name in enumerate(("without-score", "fixed", "learning", "learning-keyed")):
        once = told(rng, i // 3, False, i >= 2) if i else b""
        records = [once] + [payload(rng, 14) for _ in range(3)]
        yield f"drawn-{name}", "4 to 8", whole(head(32, 96, coding), records), True
    silent = whole(head(0, 32, 16 * "0"), [b"", bytes(300)])
    yield "long-record", "F7", silent, False
    yield "constant", "F6", head(0, 64, 16 * "0", 5 << 12 | 1) + bytes(12), False


def invalid() -> Iterator[tuple[str, str, bytes]]:
    """Yield identifier, the paragraph that is broken, and a file."""
    good = whole(head(0, 32, 16 * "0"), [b"", b"\xfc"])
    yield "short", "F1", good[:25]
    yield "magic", "F2", b"CUET" + good[4:]
    yield "version-5", "F3", good[:4] + b"\5" + good[5:]
    yield "head", "F4", good[:20] + b"\1" + good[21:]
    yield "no-ticks", "F5", whole(head(0, 0, 16 * "0"), [b""])
    yield "too-late", "F5", whole(head(4320001, 1, 16 * "0"), [b"", b"\xfc"])
    yield "too-long", "F5", whole(head(0, 4320001, 16 * "0"), [b"", b"\xfc"])
    yield "check", "F7", good[:-1] + bytes([good[-1] ^ 1])
    yield "no-record", "F6", whole(head(0, 32, 16 * "0"), [b""])
    yield "record-too-many", "F6", whole(head(0, 32, 16 * "0"), [b"", b"\xfc", b""])
    cut = good[:26] + b"\0\2\xfc"
    yield "cut-record", "F6", cut + zlib.crc32(cut).to_bytes(4, "big")
    yield "constant-cut", "F6", head(0, 64, 16 * "0", 5 << 12 | 1) + bytes(11)
    yield "endless", "F10", whole(head(0, 4320000, 16 * "0"), [b"\0"] + 135000 * [b""])


def said(found: files.File) -> Case:
    """Return what a file says in words of the vectors."""
    return {
        "span": [found.first_tick, found.ticks, found.l0, found.l1], "learns": found.learns,
        "line": found.line, "payloads": [payload.hex() for payload in found.payloads],
        "keys": [[cue.number, cue.start, cue.end] for cue in files.keys(found)],
    }  # fmt: skip


def main(path: str) -> None:
    """Write the vectors."""
    voice = read_voice(ASSETS / "claire.npz")
    own = ASSETS / "coding" / f"{identity(voice)}.npz"
    coding, name = read_coding(own), identity_of(ASSETS / "tables.json", own, identity(voice))
    scales = [
        [
            [int(coding[f"{basis}.scales"].at(c, f)) for f in range(32)]
            for c in range(coding[f"{basis}.scales"].shape[0])
        ]
        for basis in BASES
    ]
    rows = []
    for case, section, data, shown in cases(name):
        found = files.read(data)
        row = {"id": case, "section": section, "valid": True, "file": data.hex(), **said(found)}
        if shown:
            frames = files.parameters(found, scales, coding)
            row["markers"] = {
                str(t): [[round(x, 3) for x in markers(voice, frames[t])[m]] for m in SHOWN]
                for t in FRAMES
            }
        rows.append(row)
    for case, section, data in invalid():
        try:
            files.read(data)
            broken = ""
        except MalformedError as error:
            broken = str(error)
        assert broken == section, (case, broken)
        stated = data.hex() if len(data) < 1000 else zlib.compress(data, 9).hex()
        rows.append({
            "id": case, "section": section, "valid": False, "file": stated,
            "packed": len(data) >= 1000,
        })  # fmt: skip
    lines = ",\n".join("  " + json.dumps(row, ensure_ascii=False) for row in rows)
    start = json.dumps({"section": "4 to 8", "origin": ORIGIN, "shown": SHOWN})[:-1]
    Path(path).write_text(f'{start}, "cases": [\n{lines}\n]}}\n', encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
