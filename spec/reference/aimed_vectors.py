"""Vectors that aim: for misreadings which random superframes do not show, identities, a voice.

``python -m spec.reference.aimed_vectors spec/vectors`` writes `misread.json`, `identity.json`,
`slow.json`, `voice.json` and `voice-random.npz`, the same ones each time.
"""

import io
import json
import random
import struct
import sys
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

from spec.reference import markers as voices
from spec.reference import superframe
from spec.reference.range_decoder import RangeDecoder
from spec.reference.superframe_vectors import (
    BASES,
    IDENTITY,
    MASK,
    case_of,
    compact,
    full,
    l1_of,
    with_check,
)

ORIGIN = (
    "bytes aimed at by spec/reference/aimed_vectors.py; what they say by spec/reference, which was "
    "written from the text"
)
Case = dict[str, Any]


def symbols(l0: bytes) -> list[int]:
    """Return the symbols of a superframe in their order."""
    seen: list[int] = []
    read = RangeDecoder.symbol

    def noted(self: RangeDecoder, *args: Any) -> tuple[int, bool]:
        found = read(self, *args)
        seen.append(found[0])
        return found

    with patch.object(RangeDecoder, "symbol", noted):
        superframe.decode(l0, None, BASES, IDENTITY)
    return seen


def aimed(wanted: Sequence[int], size: int = 20) -> bytes:
    """Return an L0 part of mode 0 whose payload begins with some symbols.

    Greater codes have greater symbols (R3): the least code of these symbols is found by halving.
    """

    def part(value: int) -> bytes:
        return with_check(bytes([0x00, 0xD0]) + value.to_bytes(size, "big"))

    return part(least(part, wanted, 8 * size) + (1 << 8 * size - 90))


def aimed_window(wanted: Sequence[int], size: int = 11) -> bytes:
    """Return a compact L0 part whose payload begins with some symbols, see `aimed`."""

    def part(value: int) -> bytes:
        told = int(IDENTITY[:4], 16) >> 14 - 2 * 3 & 3
        return bytes([0x23]) + (value << 2 | told).to_bytes(size, "big")

    return part(least(part, wanted, 8 * size - 2) + 5)


def least(part: Callable[[int], bytes], wanted: Sequence[int], bits: int) -> int:
    """Return the least code of some bits whose symbols begin with those wanted."""
    below, above = -1, (1 << bits) - 1
    while above - below > 1:
        middle = (below + above) // 2
        enough = symbols(part(middle))[: len(wanted)] >= list(wanted)
        below, above = (below, middle) if enough else (middle, above)
    return above


def misread() -> list[Case]:
    """Return vectors for misreadings that other vectors do not show."""
    cases = []
    for letter in (16, 19, 36):
        for ahead in (0, 7, 16):
            # Step 63, on the grid, nothing special; a consonant that lasts to the end; the vowel.
            l0 = aimed([1, 1, 1, 1, 1, 1, 0, 0, letter, 32, ahead])
            case = case_of(f"silent-consonant-{letter}-{ahead}", "S7", l0, b"")
            assert case["score"]["numbers"] == []
            assert case["score"]["ahead"] == (ahead + 1) % 17
            cases.append(
                case
                | {
                    "purpose": "a superframe in which no phone starts, and whose first is "
                    "a consonant",
                    "failure_suggests": "look-ahead read only where a phone starts (S7)",
                }
            )
    for length in (30, 31):
        # Nothing slow or special, lengths in ticks, the begin; a, then a pause, then i.
        # A reader stops at the limit: what follows is whatever the code then says.
        behind = [5, 4] if length == 30 else []
        l0 = aimed_window([0, 0, 0, 3, 0, 0, 0, 4, 37, length, *behind])
        case = case_of(f"window-pause-{length}", "M6", l0, b"")
        assert case["score"]["numbers"][:3] == ([1, 0, 6] if behind else [1])
        cases.append(
            case
            | {
                "purpose": "a pause between phones told in ticks, at its limit and one below",
                "failure_suggests": "the limit's symbol of a pause ends the window before it, with "
                "lengths in ticks too (M6)",
            }
        )
    # The vowel a may have the length of the limit: it lasts 32 ticks.
    l0 = aimed_window([0, 0, 0, 3, 0, 0, 0, 31, 5, 4])
    case = case_of("window-phone-31", "M6", l0, b"")
    assert case["score"]["starts"][1] - case["score"]["begin"] == 32
    cases.append(
        case
        | {
            "purpose": "a vowel told in ticks at the limit of lengths",
            "failure_suggests": "the limit's symbol ends a window at pauses only (M6)",
        }
    )
    rng = random.Random(7)
    for flags in (0, 8):
        more, alone = 0, 0
        while not more > alone > 0:
            l0 = full(rng, 1, 8 if flags else 5, rng.randrange(12, 24), flags)
            l1 = l1_of(l0, rng.randbytes(24))
            right = case_of(f"l1-fits-{flags}", "H7", l0, l1)
            wrong = case_of(f"l1-does-not-fit-{flags}", "H7", l0, l1[:-1] + bytes([l1[-1] ^ 1]))
            more, alone = len(right["indices"]), len(wrong["indices"])
        for case in (right, wrong):
            cases.append(
                case
                | {
                    "purpose": "an L1 of much weight, and the same with a wrong check",
                    "failure_suggests": "L1's check is not asked, or by other bytes (H7)",
                }
            )
    return cases


def verdicts(parts: Sequence[bytes]) -> list[str]:
    """(H1, H2, H6, M2) Return what a receiver makes of parts that follow one another."""
    found: list[str] = []
    before: tuple[int, bytes] | None = None
    for part in parts:
        try:
            superframe.decode(part, None, BASES, IDENTITY)
            found.append("own")
            before = None
        except superframe.MalformedError as error:
            if str(error) != "H6":
                found.append({"H2": "version", "M2": "another"}.get(str(error), "lost"))
                continue
            check = superframe.crc(part[:-2], 16, 0x1021, 0xFFFF) ^ int.from_bytes(part[-2:], "big")
            alike = before is not None and before[0] == check and before[1] != part
            foreign = "version" if part[0] >> 6 else "another"
            found.append(foreign if alike else "lost")
            before = check, part
    return found


def version_of(part: bytes) -> int:
    """(H2, X1) Return the version that a part states."""
    return {0: 4, 1: 5 + (part[0] & 31)}.get(part[0] >> 6, part[0] >> 6)


def identities() -> list[Case]:
    """Return vectors of sequences of parts: own, lost, of another coding or version."""
    rng = random.Random(9)
    own = [full(rng, 1, 12, 30) for _ in range(3)]
    other = [part[:-2] + bytes([part[-2] ^ 0x5A, part[-1] ^ 0xC3]) for part in own]
    third = [part[:-2] + bytes([part[-2] ^ 0x11, part[-1]]) for part in own]
    zero, ones = bytes(16), bytes([0] + 15 * [255])
    sequences = {
        "own": own,
        "one-damaged": [own[0], other[1], own[2]],
        "another": [other[0], other[1]],
        "another-with-a-gap": [other[0], own[1], other[2]],
        "two-others": [other[0], third[1], other[2]],
        "zeroed": [own[0], zero, zero, own[2]],
        "zeroed-for-long": 5 * [zero],
        "ones": [ones, ones, ones],
        "repeated": 3 * [other[0]],
        "repeated-then-more": [*2 * [other[0]], other[1]],
        "version": [with_check(bytes([0x41, 0xD0]) + bytes(12))],
        "version-5-compact": [
            bytes([0x60]) + bytes(5) + bytes([MASK >> 14])  # sequence 0
        ],
        "version-36": [with_check(bytes([0x5F, 0xD0]) + bytes(12))],
        "version-2": [with_check(bytes([0x81, 0xD0]) + bytes(12))],
        "version-3": [with_check(bytes([0xC1, 0xD0]) + bytes(12))],
        "version-5-of-another": [
            part[:-2] + bytes([part[-2] ^ 0x5A, part[-1] ^ 0xC3])
            for part in (with_check(bytes([0x40, i]) + bytes(12)) for i in range(2))
        ],
        "compact": [compact(rng, 7), compact(rng, 9)],
    }
    cases: list[Case] = [
        {
            "id": f"parts-{name}",
            "section": "H6",
            "valid": True,
            "identity": IDENTITY,
            "parts": [part.hex() for part in parts],
            "verdicts": verdicts(parts),
            "versions": [version_of(part) for part in parts],
            "purpose": "whether parts that fail their check are lost or another stream's",
            "failure_suggests": "two parts of equal bytes are lost, two of different bytes and the "
            "same other identity are another's (H6), or of another version (X1)",
        }
        for name, parts in sequences.items()
    ]
    return cases


def slow_part(sequence: int, pieces: Sequence[int], number: int) -> bytes:
    """(H6, H8) Return an L0 part of mode 1 with pieces, of the coding whose identity is a number.

    What a payload decodes to grows with it as a number: the one wanted is found by halves.
    """

    def says(number: int) -> list[int]:
        decoder = RangeDecoder(number.to_bytes(8, "big"))
        return [decoder.bits(16) for _ in pieces]

    low, high = 0, (1 << 64) - 1
    while (middle := (low + high) // 2) != low and says(middle) != list(pieces):
        low, high = (middle, high) if says(middle) < list(pieces) else (low, middle)
    assert says(middle) == list(pieces)
    head = 1 << 12 | sequence << 6 | 2 << 4 | len(pieces) << 1
    body = head.to_bytes(2, "big") + middle.to_bytes(8, "big")
    return body + (superframe.crc(body, 16, 0x1021, 0xFFFF) ^ number).to_bytes(2, "big")


def pieces_of(parts: Sequence[bytes]) -> list[int]:
    """(X6) Return the pieces of the parts that H6 gives to one other coding, in their order."""
    found: list[int] = []
    before: tuple[int, bytes] | None = None
    known = -1
    for part in parts:
        number = superframe.crc(part[:-2], 16, 0x1021, 0xFFFF) ^ int.from_bytes(part[-2:], "big")
        mine = number == MASK
        alike = before is not None and before[0] == number and before[1] != part
        if not mine and (alike or number == known):
            taken = [part] if number == known or before is None else [before[1], part]
            known = number
            for one in taken:
                decoder = RangeDecoder(one[2:-2])
                found += [decoder.bits(16) for _ in range(one[1] >> 1 & 3)]
        before = None if mine else (number, part)
    return found


def foreign() -> list[Case]:
    """Return vectors of streams that cannot be drawn, and what their slow channel says."""
    pieces = [
        *written(5, b"en"),
        *written(8, bytes.fromhex("03d1a2c4e5f60718")),
        *written(128, b"cue.example.org\0"),
    ]
    parts = [slow_part(k % 64, pieces[k : k + 1], 0x03D1) for k in range(len(pieces))]
    pairs = [slow_part(k, pieces[2 * k : 2 * k + 2], 0x03D1) for k in range(13)]
    other = [slow_part(k, [0x0566, 0x0672], 0x7777) for k in (9, 10)]
    lists = {
        "one-by-one": parts,
        "in-pairs": pairs,
        "a-part-of-its-own-between": [*pairs[:4], slow_part(8, [0x0401], MASK), *pairs[4:]],
        "damaged-between": [*pairs[:4], pairs[4][:3] + b"\xff" + pairs[4][4:], *pairs[4:]],
        "one-only": parts[:1],
        "the-same-twice": [parts[0], parts[0]],
        "another-once": [*pairs, other[0]],
        "another-after": [*pairs, *other],
    }
    cases: list[Case] = []
    for name, taken in lists.items():
        known = {piece >> 8: piece & 255 for piece in pieces_of(taken)}
        cases.append({
            "id": f"foreign-{name}", "section": "X6", "valid": True, "identity": IDENTITY,
            "parts": [part.hex() for part in taken],
            "registers": {str(k): value for k, value in known.items()}, **meaning(known),
            "purpose": "what the slow channel of a stream says that cannot be drawn",
            "failure_suggests": "pieces of both parts by which H6 knows it and of all with its "
            "number after them, of no others (X6)",
        })  # fmt: skip
    return cases


SHAPES = {
    "face.mean": (63, 3), "face.directions": (7, 63, 3), "face.pivot": (3,),
    "face.motion_mean": (6,), "face.motion_directions": (3, 6), "face.weights": (63, 6),
    "hand.angle_mean": (4,), "hand.angle_directions": (12, 4), "hand.regression": (9, 50, 3),
    "hand.pivot": (3,), "hand.motion_mean": (6,), "hand.motion_directions": (5, 6),
    "hand.deviations": (1, 50, 3), "gestures.shape_targets": (9, 12),
    "gestures.placement_targets": (9, 6, 5), "gestures.viseme_targets": (38, 7),
    "gestures.neutral_head": (3,),
}  # fmt: skip
"""(O2) With three parameters of the head, five of the forearm, four angles, one deviation."""


HEAD = 6 * 45
"""(O8) Weights of the markers of the head, which are 1."""


def npy(kind: str, shape: tuple[int, ...], data: bytes) -> bytes:
    """(O1) Return an array as a member of an archive."""
    head = str({"descr": kind, "fortran_order": False, "shape": shape}).encode("ascii")
    head += b" " * (-(len(head) + 11) % 64) + b"\n"
    return b"\x93NUMPY\1\0" + len(head).to_bytes(2, "little") + head + data


def random_voice() -> bytes:
    """(O1 to O3) Return the archive of a voice of random numbers, no two weights alike."""
    rng = random.Random(11)
    arrays = {}
    for name, shape in SHAPES.items():
        count = 1
        for size in shape:
            count *= size
        # Angles in radians, places in mm.
        scale = 0.3 if "motion" in name or "angle" in name else 1.0 if "weights" in name else 20.0
        numbers = [round(rng.uniform(-scale, scale), 2) for _ in range(count)]
        if name == "face.weights":
            numbers[:HEAD] = HEAD * [1.0]
        data = struct.pack(f"<{count}f", *numbers)
        arrays[name] = voices.Array(shape, list(struct.unpack(f"<{count}f", data)), data)
    texts = {"format": "cuecast-voice-1", "name": "random", "identity": voices.identity(arrays)}
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        members = {name: npy("<f4", one.shape, one.data) for name, one in arrays.items()}
        for name, text in texts.items():
            members[name] = npy(f"<U{len(text)}", (), text.encode("utf-32-le"))
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", (2026, 1, 1, 0, 0, 0)), data)
    return memory.getvalue()


def drawn(path: Path) -> list[Case]:
    """Return vectors of a voice: its markers at random parameters."""
    rng = random.Random(12)
    voice = voices.read_voice(path)
    cases = []
    for i in range(3):
        row = [round(rng.uniform(-1.5, 1.5), 2) * (i > 0) for _ in range(7 + 12 + 3 + 5)]
        points = [[round(x, 3) for x in point] for point in voices.markers(voice, row)]
        cases.append({
            "id": f"random-{i}", "section": "O6 to O9", "valid": True, "file": path.name,
            "identity": voices.identity(voice), "parameters": row, "markers": points,
            "purpose": "markers of a voice of large rotations whose throat's weights all differ",
            "failure_suggests": "order of parameters (O4); shares of rotation and of "
            "translation (O8); order of cosines and sines (O9); rotation (O6)",
        })  # fmt: skip
    return cases


def registers() -> list[Case]:
    """Return vectors of the slow channel: pieces in any order, some lost, some unknown."""
    rng = random.Random(13)
    number = [0xC0, 0xFF, 0xEE, 0x01]
    pieces = [register << 8 | value for register, value in enumerate(number)]
    lists = {
        "in-order": pieces, "backwards": pieces[::-1], "one-missing": pieces[:3],
        "repeated": [*pieces, *pieces], "changed": [*pieces, 0x0002],
        "unknown-between": [0x2A07, pieces[0], 0xC899, *pieces[1:], 0xFF00],
        "nothing": [], "unknown-only": [rng.randrange(4, 256) << 8 | 5 for _ in range(6)],
        "second-stream": [0x0401], "language": written(5, b"en"),
        "half-a-language": written(5, b"e"), "no-language": written(5, b"E?"),
        "voice": written(8, bytes.fromhex("9508bed717aef097")) + written(128, b"cue.example.org\0"),
        "voice-without-a-byte": written(8, bytes.fromhex("9508bed717aef0")),
        "host-without-its-end": written(128, b"cue.example.org"),
        "host-of-32-letters": written(128, 28 * b"a" + b".org"),
        "no-host": written(128, b"cue.example.org/x?\0"), "empty-host": written(128, b"\0"),
        "private": [*pieces, 0xC011, 0xFF22], "reserved": [0x0711, 0xA022, 0xBF33],
    }  # fmt: skip
    cases = []
    for name, taken in lists.items():
        known = {str(piece >> 8): piece & 255 for piece in taken}
        cases.append({
            "id": name, "section": "V4, V5, X2 to X5", "valid": True, "pieces": taken,
            "registers": known, **meaning({int(k): value for k, value in known.items()}),
            "purpose": "registers from pieces in any order, and what those of section 10 say",
            "failure_suggests": "upper eight bits are the register; highest byte in register 0; no "
            "identifier before all of it arrived; the last value of a register counts; what is "
            "malformed says nothing (X4, X5)",
        })  # fmt: skip
    return cases


def written(first: int, values: bytes) -> list[int]:
    """Return the pieces of values in registers that follow one another."""
    return [register << 8 | value for register, value in enumerate(values, first)]


def meaning(known: dict[int, int]) -> Case:
    """(V5, X2 to X5) Return what registers say; None where they say nothing."""

    def run(first: int, count: int) -> bytes | None:
        values = [known.get(register) for register in range(first, first + count)]
        return None if None in values else bytes(value or 0 for value in values)

    programme, language, coding = run(0, 4), run(5, 2), run(8, 8)
    letters = b"abcdefghijklmnopqrstuvwxyz"
    host = bytearray()
    register = 128
    while register < 160 and known.get(register):
        host.append(known[register])
        register += 1
    ended = register == 160 or known.get(register) == 0
    named = ended and host and all(one in letters + b"0123456789-." for one in host)
    return {
        "programme": None if programme is None else int.from_bytes(programme, "big"),
        "stream": known.get(4, 0),
        "language": language.decode() if language and all(x in letters for x in language) else None,
        "coding": None if coding is None else coding.hex(),
        "host": host.decode() if named else None,
    }


def write(path: Path, cases: list[Case], **more: Any) -> None:
    """Write a document of cases, one a line."""
    lines = ",\n".join("  " + json.dumps(case, ensure_ascii=False) for case in cases)
    head = json.dumps({"origin": ORIGIN, **more})[:-1]
    path.write_text(f'{head}, "cases": [\n{lines}\n]}}\n', encoding="utf-8")


def main(folder: Path) -> None:
    """Write the vectors."""
    write(folder / "misread.json", misread(), identity=IDENTITY, bases=BASES)
    write(folder / "identity.json", identities(), identity=IDENTITY)
    (folder / "voice-random.npz").write_bytes(random_voice())
    write(folder / "foreign.json", foreign(), identity=IDENTITY)
    write(folder / "slow.json", registers())
    write(folder / "voice.json", drawn(folder / "voice-random.npz"))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
