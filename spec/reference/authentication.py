"""A block of proof fields checked as spec/authentication.md says, with the standard library only.

Where the block stands in its period is known here: finding that out (paragraph E18) is the
receiver's own affair.
"""

import hashlib

LAYOUTS = {9: (8, (12, 9, 24), (12, 7, 7)), 2: (44, (24, 45, 88), (16, 32, 35))}
PERIOD = 5632


def key_of_block(
    fields: list[int], width: int, block: int, period: int, channel: bytes, end: bytes
) -> bytes | None:
    """Return the key of a block whose fields these are, None if no key leads to the end (E17)."""
    number = 0
    for value in fields:
        number = number << width | value
    prefix = hashlib.sha256(
        b"cuecast-step-1" + channel + period.to_bytes(4, "big") + bytes([width])
    ).digest()
    for low in range(65536):
        key = ((number & (1 << 48) - 1) << 16 | low).to_bytes(8, "big")
        earlier = key
        for _ in range(block + 1):
            earlier = hashlib.sha256(prefix + earlier).digest()[:8]
        if earlier == end:
            return key
    return None


def tags_of(before: dict[int, bytes], width: int, key: bytes) -> list[int]:
    """Return whole and quick tag by distance of what was sent before a block's end (E12, E13)."""
    tags = []
    for bits, nearest, farthest in LAYOUTS[width][1:]:
        window = b"cuecast-data-1"
        for distance in range(nearest, farthest + 1):
            if distance in before:
                data = before[distance]
                window += distance.to_bytes(2, "big") + len(data).to_bytes(2, "big") + data
        digest = hashlib.sha256(window).digest()
        reach = bytes([farthest - nearest + 1])
        whole = hashlib.sha256(b"cuecast-tag-1" + reach + key + digest).digest()
        tags.append(int.from_bytes(whole, "big") >> 256 - bits)
    return tags


def told_tags(fields: list[int], width: int) -> list[int]:
    """Return whole and quick tag that a block's fields say (E6)."""
    number = 0
    for value in fields:
        number = number << width | value
    _, (whole, _, _), (quick, _, _) = LAYOUTS[width]
    return [number >> 48 + quick & (1 << whole) - 1, number >> 48 & (1 << quick) - 1]
