"""The vectors of stream files: files of bytes drawn at random, read and drawn by the reference.

``python -m spec.reference.stream_vectors spec/vectors/stream.json`` writes them, the same ones each
time. To be run for a new version of the format, of the built-in voice or of its tables only.
"""

import itertools
import json
import random
import sys
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

from spec.reference import files
from spec.reference.identity import identity as identity_of
from spec.reference.markers import Array, identity, markers, read_voice
from spec.reference.motion import BASES, read_coding
from spec.reference.purposes import described
from spec.reference.stream_bytes import EVEN, head, numbered, payload, resting, told, whole
from spec.reference.superframe import MalformedError, crc, decode, record

DATA = Path(__file__).parents[1] / "data"
ORIGIN = (
    "bytes drawn at random by spec/reference/stream_vectors.py, given checks, read and drawn by "
    "spec/reference/files.py, motion.py and markers.py, which were written from the text"
)
FRAMES = (0, 1, 13, 31, 37, 63, 70, 95)
"""Frames of which markers are stated."""

SHOWN = (5, 25, 63 + 7, 63 + 30)
"""Markers that are: nose bridge, lower lip, two of the hand."""

EVERY = 11
"""Of how many frames of numbered files the markers of one are stated."""

SEEDS = (0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 16, 18, 30, 31, 48, 54, 72, 116, 124, 148, 175)
"""Numbers of files, each of which tells a misreading of sections 4 and 5 that others do not."""

AFTERWARDS = 0
"""Number of the first file whose second superframe repeats the labels of the first."""

RESTING = 118
"""Number of the first filmed file where the hand rests in a pause by the usual gap alone."""

MOVEMENTS = (
    (0.6, 2.5, 0.33, 0.05, 0.35, 0.003, 0.4, 0.4, 0.2, 0.5, 0.15, 0.4, 0.12, 0.5, 0.3, 0.02, -0.04,
     0.03, 0.06, 0.05, 0.15, 0.9, 0.35, 0.4),
    (0.8, 3.0, 0.2, 0.15, 0.25, 0.001, 0.2, 0.7, 0.14, 2.0, 0.02, 0.3, 0.04, 0.9, 0.0, -0.03, 0.05,
     0.0, 0.12, 0.05, 0.15, 1.2, 0.2, 0.6),
)  # fmt: skip
"""Constants of movement (table 5) of other voices: with undershoot, and with no usual stroke."""

Case = dict[str, Any]


def shifted(rng: random.Random, shift: int) -> bytes:
    """Return a payload whose prediction is shifted."""
    while True:
        data = payload(rng, 12)
        if record(data, 0, EVEN).shift == shift:
            return data


def constant(rng: random.Random, coding: str, mode: int, sequence: int, filmed: int = 0) -> bytes:
    """Return a superframe of constant size, whose score replaces nothing."""
    while True:
        body = (mode << 12 | sequence << 6 | filmed).to_bytes(2, "big") + payload(rng, 20)
        check = crc(body, 16, 0x1021, 0xFFFF) ^ int(coding[:4], 16)
        l0 = body + check.to_bytes(2, "big")
        score = decode(l0, None, EVEN, coding).score
        if score is None or not score["overrides"]:
            return l0 + bytes(6)


def searched(rng: random.Random, form: int, wanted: Callable[[list[list[int]]], bool]) -> bytes:
    """Return a file of four silent superframes whose line is as wanted."""
    while True:
        data = bytearray(rng.randbytes(60))
        data[0] = form << 7 | data[0] & 127
        file = whole(head(0, 128, 16 * "0"), [bytes(data)] + 4 * [b"\xfc"])
        try:
            if wanted(files.read(file).line or []):
                return file
        except MalformedError:
            continue


def replacing(rng: random.Random, before: int, most: int, this: int) -> bytes:
    """Return a file that replaces keys behind two phones on a border (S10).

    The first is from `before` to `most`; the second is `this`, or any vowel for 0.
    """
    while True:
        data = bytearray(rng.randbytes(60))
        data[0] = data[0] & 127 | 127
        data[1] |= 192
        file = whole(head(0, 128, 16 * "0"), [bytes(data)] + 4 * [b"\xfc"])
        try:
            found = files.read(file)
        except MalformedError:
            continue
        for one, two in itertools.pairwise(found.line or []):
            second = two[0] == this or (not this and 0 < two[0] <= 16)
            if before <= one[0] <= most and second and max(found.replaced, default=0) > two[1]:
                return file


def of_neither(rng: random.Random) -> bytes:
    """Return a file with a key of neither consonant nor vowel (F11)."""
    read, seen = files.open_phone, list[int]()

    def noted(*args: Any) -> int:
        seen.append(read(*args))
        return seen[-1]

    with patch.object(files, "open_phone", noted):
        while True:
            seen.clear()
            file = searched(rng, 1, lambda line: len(line) > 5)
            if (0, 0) in zip(seen[-20::2], seen[-19::2], strict=False):
                return file


def outrun(rng: random.Random, bytes_behind: int) -> bytes:
    """Return a file whose line is read up to some bytes behind its code (F10)."""
    seen: list[int] = []
    with patch.object(files, "check_end", lambda d: seen.append(d.position - len(d.data))):
        while True:
            data = bytearray(rng.randbytes(rng.randrange(1, 20)))
            data[0] &= 127
            file = whole(head(0, 128, 16 * "0"), [bytes(data)] + 4 * [b"\xfc"])
            seen.clear()
            files.read(file)
            if seen and max(seen) == bytes_behind:
                return file


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
    for i in range(8):
        once = told(rng, i % 2, False, i > 5)
        records = [once] + [shifted(rng, 1 + (i + k) % 4) for k in range(3)]
        yield f"drawn-more-{i}", "4 to 8", whole(head(32, 96, coding), records), True
    for i in range(4):
        frames = [constant(rng, coding, i % 2, 1 + k) for k in range(3)]
        data = head(32, 96, coding, 24 << 12 | 6) + b"".join(frames)
        yield f"drawn-constant-{i}", "4, 8", data, True
    end = 32 * 4
    for name, form, wanted in (
        ("ends-in-pause", 0, lambda line: line[-1][0] == 0 and line[-1][1] < line[-1][2] == end),
        ("ends-in-time", 0, lambda line: line[-1] == [0, end, end]),
        ("one-silence", 1, lambda line: len(line) == 1),
        ("ends-in-time-keyed", 1, lambda line: line[-1] == [0, end, end]),
    ):
        yield name, "F10 to F12", searched(rng, form, wanted), False
    for name, pair in (("17-second", (17, 99, 17)), ("16-first", (16, 16, 0))):
        yield f"special-{name}", "F8", replacing(rng, *pair), False
    for i in range(12):
        yield f"keyed-more-{i}", "F11", searched(rng, 1, lambda line: len(line) > 9), False
    yield "code-just-long-enough", "F10", outrun(rng, 8), False
    yield "one-tick", "F5", whole(head(4320000, 1, 16 * "0"), [b"", b"\xfc"]), False
    silent = whole(head(0, 32, 16 * "0"), [b"", bytes(300)])
    yield "long-record", "F7", silent, False
    yield "constant", "F6", head(0, 64, 16 * "0", 5 << 12 | 1) + bytes(12), False


def following(
    rng: random.Random, coding: str, before: bytes, sequence: int, consonant: bool
) -> bytes:
    """Return a superframe that begins with the phone that ends another one (J1).

    If wanted, it ends with a consonant of its own, which no vowel follows (J4).
    """
    score = decode(before[:24], None, EVEN, coding).score or {}
    last = (score["numbers"] or [score["first"]])[-1]
    while True:
        frame = constant(rng, coding, 0, sequence)
        own = decode(frame[:24], None, EVEN, coding).score or {}
        ends = own["numbers"][-1:]
        alone = ends and ends[0] > 16 and not own["ahead"] and 8 <= own["starts"][-1] < 20
        if own["first"] == last and (alone or not consonant):
            return frame


def more_drawn(coding: str) -> Iterator[tuple[str, bytes]]:
    """Yield identifier and file: superframes that tell one line, and the last of the phones."""
    rng = random.Random(11)
    for i in range(3):
        frames = [constant(rng, coding, 0, 1)]
        for k in (2, 3):
            frames.append(following(rng, coding, frames[-1], k, consonant=k == 3 and i > 0))
        yield f"drawn-joined-{i}", head(32, 96, coding, 24 << 12 | 6) + b"".join(frames)
    while True:
        once = told(rng, 0, False, False)
        file = whole(head(32, 96, coding), [once] + 3 * [b"\xfc"])
        if any(n == 37 and 32 <= a < 96 for n, a, _ in files.read(file).line or []):
            yield "drawn-last-phone", file
            return


def filmed(coding: str) -> Iterator[tuple[str, bytes]]:
    """Yield identifier and file: filmed superframes (V8, Q7).

    Of each case the modes and the marks of its superframes; a mark of 2 is a lost one.
    """
    rng = random.Random(14)
    for i, (modes, marks) in enumerate((
        ("000", "111"), ("000", "101"), ("011", "111"), ("0000000", "1121111"),
        ("0001000", "1121211"), ("0000000", "0112110"), ("0000000", "1121121"),
    )):  # fmt: skip
        frames = [
            constant(rng, coding, int(mode), 1 + k, int(mark == "1"))
            for k, (mode, mark) in enumerate(zip(modes, marks, strict=True))
        ]
        parts = [
            rng.randbytes(30) if mark == "2" else frame
            for frame, mark in zip(frames, marks, strict=True)
        ]
        ticks = 32 * len(frames)
        yield f"drawn-filmed-{i}", head(32, ticks, coding, 24 << 12 | 6) + b"".join(parts)
    # Labels of a lost first superframe, which only the one after it repeats.
    rng = random.Random(AFTERWARDS)
    parts = [rng.randbytes(30), *(constant(rng, coding, 0, k, 1) for k in (2, 3))]
    yield "drawn-filmed-afterwards", head(32, 96, coding, 24 << 12 | 6) + b"".join(parts)
    rng = random.Random(RESTING)
    parts = [constant(rng, coding, 0, 1 + k, 1) for k in range(3)]
    yield "drawn-filmed-resting", head(32, 96, coding, 24 << 12 | 6) + b"".join(parts)


def others(coding: dict[str, Array]) -> Iterator[tuple[str, bytes, dict[str, list[float]]]]:
    """Yield identifier, file, and what is other than in the voice: movement and lateness."""
    rng = random.Random(10)
    count = coding["targets.late"].shape[0]
    for i in range(6):
        late = [rng.randrange(-50, 80) / 1000 for _ in range(count)]
        records = [told(rng, i // 2 % 2, False, i > 1)] + [payload(rng, 9) for _ in range(3)]
        other = {"movement": list(MOVEMENTS[i % 2]), "late": late}
        yield f"other-movement-{i}", whole(head(32, 96, 16 * "0"), records), other


def moved(coding: dict[str, Array], other: Case) -> dict[str, Array]:
    """Return coding tables with another voice's movement, if a case states one."""
    return coding | {
        f"targets.{name}": Array((len(other[name]),), other[name], b"")
        for name in ("movement", "late")
        if name in other
    }


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
    yield "head-alone", "F6", head(0, 64, 16 * "0", 5 << 12 | 1)
    yield "code-just-too-short", "F10", outrun(random.Random(9), 9)
    cut = good[:26] + b"\0\2\xfc"
    yield "cut-record", "F6", cut + zlib.crc32(cut).to_bytes(4, "big")
    yield "constant-cut", "F6", head(0, 64, 16 * "0", 5 << 12 | 1) + bytes(11)
    yield "endless", "F10", whole(head(0, 4320000, 16 * "0"), [b"\0"] + 135000 * [b""])


def said(found: files.File) -> Case:
    """Return what a file says in words of the vectors."""
    return {
        "coding": found.coding,
        "span": [found.first_tick, found.ticks, found.l0, found.l1],
        "learns": found.learns,
        "line": found.line,
        "payloads": [payload.hex() for payload in found.payloads],
        "keys": [[cue.number, cue.start, cue.end] for cue in files.keys(found)],
    }


def main(path: str) -> None:
    """Write the vectors."""
    voice = read_voice(DATA / "voices" / "claire.npz")
    own = DATA / "coding" / f"{identity(voice)}.npz"
    coding, name = read_coding(own), identity_of(DATA / "tables.json", own, identity(voice))
    scales = [
        [
            [int(coding[f"{basis}.scales"].at(c, f)) for f in range(32)]
            for c in range(coding[f"{basis}.scales"].shape[0])
        ]
        for basis in BASES
    ]

    def seen(found: files.File, tables: dict[str, Array], shown: Sequence[int] = FRAMES) -> Case:
        frames = files.parameters(found, scales, tables)
        return {
            str(t): [[round(x, 3) for x in markers(voice, frames[t])[m]] for m in SHOWN]
            for t in shown
            if frames[t]
        }

    rows = []
    for case, section, data, shown in cases(name):
        found = files.read(data)
        row = {"id": case, "section": section, "valid": True, "file": data.hex(), **said(found)}
        if shown:
            row["markers"] = seen(found, coding)
        rows.append(row)
    rng = random.Random(12)
    for case, data in (
        ("silence-to-the-end", searched(rng, 1, lambda line: line == [[0, -33, 128]])),
        ("neither-phone", of_neither(rng)),
    ):
        found = files.read(data)
        rows.append(
            {"id": case, "section": "F11, F12", "valid": True, "file": data.hex(), **said(found)}
        )
    for case, data in more_drawn(name):
        found = files.read(data)
        row = {"id": case, "section": "4 to 8", "valid": True, "file": data.hex(), **said(found)}
        rows.append(row | {"markers": seen(found, coding)})
    for case, data in filmed(name):
        found = files.read(data)
        row = {"id": case, "section": "3.4, 4 to 8", "valid": True, "file": data.hex()}
        points = seen(found, coding, range(0, found.ticks, EVERY // 2))
        rows.append(row | said(found) | {"markers": points})
    for case, data, other in others(coding):
        found = files.read(data)
        row = {"id": case, "section": "4 to 8", "valid": True, "file": data.hex(), **said(found)}
        rows.append(row | other | {"markers": seen(found, moved(coding, other))})
    rng = random.Random(13)
    for gap, ticks in ((1, 25), (0, 12)):
        data = resting(rng, name, gap, ticks)
        found = files.read(data)
        row = {"id": f"drawn-rest-{ticks}", "section": "4 to 8", "valid": True, "file": data.hex()}
        rows.append(row | said(found) | {"markers": seen(found, coding, range(0, 96, EVERY))})
    for seed in SEEDS:
        data, other = numbered(seed, name, coding["targets.late"].shape[0])
        found = files.read(data)
        row = {"id": f"drawn-number-{seed}", "section": "4 to 8", "valid": True, "file": data.hex()}
        points = seen(found, moved(coding, other), range(0, found.ticks, EVERY))
        rows.append(row | said(found) | other | {"markers": points})
    for case, section, data in invalid():
        try:
            files.read(data)
            broken = ""
        except MalformedError as error:
            broken = str(error)
        assert broken == section, (case, broken)
        stated = data.hex() if len(data) < 1000 else zlib.compress(data, 9).hex()
        rows.append(
            {
                "id": case,
                "section": section,
                "valid": False,
                "file": stated,
                "packed": len(data) >= 1000,
            }
        )
    rows = [row | described("stream", row["id"]) for row in rows]
    lines = ",\n".join("  " + json.dumps(row, ensure_ascii=False) for row in rows)
    start = json.dumps({"section": "4 to 8", "origin": ORIGIN, "shown": SHOWN})[:-1]
    Path(path).write_text(f'{start}, "cases": [\n{lines}\n]}}\n', encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
