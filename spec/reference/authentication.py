"""Proof fields checked as spec/authentication.md says, with the standard library only.

Where a block stands in its period is known here: finding that out (paragraph E20) is the receiver's
own affair.
"""

import hashlib

LAYOUTS = {9: (16, 6, 7), 2: (96, 10, 59)}
PERIOD = 4147200


def before(key: bytes, channel: bytes, period: int, width: int, block: int) -> bytes:
    """Return the key of block `block - 1` of a period, or the end of the chain (E10)."""
    prefix = hashlib.sha256(
        b"cuecast-step-3" + channel + period.to_bytes(4, "big") + bytes([width])
    ).digest()
    return hashlib.sha256(prefix + block.to_bytes(4, "big") + key).digest()[:8]


def split(fields: list[int], width: int) -> tuple[list[int], int, int]:
    """Return checks, quick tag and the sent bits of the key of a block (E6)."""
    number = 0
    for value in fields:
        number = number << width | value
    count = LAYOUTS[width][1]
    checks = [number >> 72 + 12 * (count - 1 - j) & 0xFFF for j in range(count)]
    return checks, number >> 48 & 0xFFFFFF, number & (1 << 48) - 1


def key_of_block(
    sent: int, channel: bytes, period: int, width: int, block: int, known: tuple[int, bytes]
) -> bytes | None:
    """Return the key with these sent bits that leads to that of a known block, -1 the end (E19)."""
    for low in range(65536):
        key = earlier = (sent << 16 | low).to_bytes(8, "big")
        for at in range(block, known[0], -1):
            earlier = before(earlier, channel, period, width, at)
        if earlier == known[1]:
            return key
    return None


def tag_of(covered: bytes, channel: bytes, key: bytes, distance: int) -> int:
    """Return the tag of a superframe (E11)."""
    data = b"cuecast-tag-3" + channel + key + distance.to_bytes(2, "big") + covered
    return int.from_bytes(hashlib.sha256(data).digest()[:3], "big")


def times(a: int, b: int) -> int:
    """Return a product in GF(2^12) (E14)."""
    product = 0
    while b:
        if b & 1:
            product ^= a
        a <<= 1
        if a & 0x1000:
            a ^= 0x1053
        b >>= 1
    return product


def inverse(a: int) -> int:
    """Return the inverse in GF(2^12): the power 4094 (E14)."""
    result = 1
    for bit in f"{4094:b}":
        result = times(result, result)
        if bit == "1":
            result = times(result, a)
    return result


def checks_of(tags: dict[int, int], count: int) -> list[int]:
    """Return the checks of a block of which some superframes have tags, by place (E13, E14)."""
    checks = [0] * count
    for place, tag in tags.items():
        for j in range(count):
            checks[j] ^= times(tag >> 12, inverse(j ^ (16 + 2 * place)))
            checks[j] ^= times(tag & 0xFFF, inverse(j ^ (16 + 2 * place + 1)))
    return checks


def agree(checks: dict[int, int], tags: dict[int, int], length: int) -> bool | None:
    """Return whether checks that arrived agree with the tags that did, None if too few (E21)."""
    missing = [place for place in range(length) if place not in tags]
    unknown = [symbol for place in missing for symbol in (2 * place, 2 * place + 1)]
    if len(checks) - len(unknown) < 2:
        return None
    own = checks_of(tags, max(checks) + 1)
    rows = [
        [inverse(j ^ (16 + symbol)) for symbol in unknown] + [value ^ own[j]]
        for j, value in checks.items()
    ]
    for column in range(len(unknown)):
        pivot = rows.pop(0)
        for row in rows:
            factor = times(row[column], inverse(pivot[column]))
            for at, value in enumerate(pivot):
                row[at] ^= times(factor, value)
    return all(row[-1] == 0 for row in rows)
