"""Bytes of stream files: heads, records, and files drawn at random by their number."""

import itertools
import random
import zlib

from spec.reference import files
from spec.reference.superframe import Decoded, MalformedError, crc, decode

EVEN = 4 * [31 * [32 * [0]]]
"""Scales that do for reading what comes before coefficients."""


def head(first: int, ticks: int, coding: str, lengths: int = 0) -> bytes:
    """(Section 8) Return the head of a file."""
    body = b"CUES\4" + bytes.fromhex(coding) + first.to_bytes(4, "big") + ticks.to_bytes(4, "big")
    body += lengths.to_bytes(3, "big")
    return body + crc(body, 16, 0x1021, 0xFFFF).to_bytes(2, "big")


def whole(start: bytes, records: list[bytes]) -> bytes:
    """(F7) Return a file of records."""
    data = start
    for one in records:
        long = len(one) >= 255
        data += bytes([255]) + len(one).to_bytes(3, "big") if long else bytes([len(one)])
        data += one
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


MOVING = (
    (0.5, 0.9), (2.0, 3.5), (0.1, 0.4), (0.02, 0.2), (0.2, 0.5), (0.0005, 0.004), (0.1, 0.5),
    (0.0, 0.95), (0.02, 0.25), (0.4, 2.5), (0.0, 0.2), (0.2, 0.5), (0.02, 0.15), (0.3, 1.0),
    (0.0, 0.4), (-0.04, 0.05), (-0.05, 0.06), (0.0, 0.05), (0.0, 0.15), (0.05, 0.05),
    (0.15, 0.15), (0.8, 1.3), (0.0, 0.5), (0.2, 0.8),
)  # fmt: skip
"""Bounds between which constants of movement (table 5) are drawn."""

Other = dict[str, list[float]]


def numbered(seed: int, coding: str, late: int) -> tuple[bytes, Other]:
    """Return a file of a number, and what is other than in the voice: movement and lateness.

    Of even numbers superframes of constant size, of which some are lost or of mode 1; of odd ones
    a file that tells its score once, of a voice with `late` numbers of lateness.
    """
    rng = random.Random(seed)
    if seed % 2 == 0:
        return losing(rng, coding), {}
    movement = [round(rng.uniform(*bounds), 4) for bounds in MOVING]
    other = {"movement": movement, "late": [rng.randrange(-50, 300) / 1000 for _ in range(late)]}
    once = told(rng, rng.randrange(2), rng.random() < 0.2, rng.random() < 0.2)
    return whole(head(32, 96, coding), [once] + 3 * [settled(rng)]), other


def resting(rng: random.Random, coding: str, rest_gap: int, ticks: int) -> bytes:
    """Return a file with a silence of so many ticks between two keys (P2)."""
    while True:
        once = told(rng, 0, rest_gap != 1, False)
        file = whole(head(32, 96, coding), [once] + 3 * [settled(rng)])
        found = files.read(file)
        gaps = [
            after.start - before.end
            for before, after in itertools.pairwise(files.keys(found))
            if 40 <= before.end < 70
        ]
        if found.rest_gap == rest_gap and ticks in gaps:
            return file


def settled(rng: random.Random) -> bytes:
    """Return a payload without coefficients (H10)."""
    return bytes([63 << 2 | rng.randrange(4), *rng.randbytes(2)])


def losing(rng: random.Random, coding: str) -> bytes:
    """Return a file of eight superframes of constant size, two of them lost."""
    wanted = rng.choice((None, strange, late, sparse, silent, (4,), (16,)))
    lost = rng.sample(range(8), 2)
    frames = []
    for k in range(8):
        mode = int(rng.random() < 0.1)
        while True:
            frame = one(rng, coding, mode, k + 1)
            found = decode(frame, None, EVEN, coding)
            if mode or wanted is None:
                break
            if isinstance(wanted, tuple):
                # The phone that takes a stand-in's place (J8).
                if k - 1 not in lost or (found.score or {})["first"] in wanted:
                    break
            elif wanted(found) or (wanted is not strange and k + 2 not in lost):
                break
        frames.append(frame if k not in lost else rng.randbytes(len(frame)))
    return head(32, 256, coding, len(frames[0]) << 12) + b"".join(frames)


def one(rng: random.Random, coding: str, mode: int, sequence: int) -> bytes:
    """Return an L0 whose payload tells nothing but a score and previews."""
    body = (mode << 12 | sequence << 6).to_bytes(2, "big") + settled(rng) + rng.randbytes(37)
    return body + (crc(body, 16, 0x1021, 0xFFFF) ^ int(coding[:4], 16)).to_bytes(2, "big")


def late(found: Decoded) -> bool:
    """Return whether a preview has a start at the last tick (J8)."""
    return any(tick == 31 for preview in found.previews.values() for tick, _ in preview)


def sparse(found: Decoded) -> bool:
    """Return whether a preview has its last start early (J8)."""
    return any(one and one[-1][0] in (0, 5, 10) for one in found.previews.values())


def silent(found: Decoded) -> bool:
    """Return whether a preview has a silence (V2)."""
    return any(symbol == 40 for preview in found.previews.values() for _, symbol in preview)


def strange(found: Decoded) -> bool:
    """Return whether a score has options or replaces keys (S9)."""
    score = found.score or {}
    return bool(score["overrides"]) or any(score["cheek"]) or score["rest_gap"] != 1
