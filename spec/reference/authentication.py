"""A block of proof fields checked as spec/authentication.md says, with the standard library only.

Where the block stands in its period is known here: finding that out (paragraph E18) is the
receiver's own affair.
"""

import hashlib

LAYOUTS = {9: (8, (12, 2), (12, 16)), 2: (44, (16, 4), (24, 44))}
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
    """Return quick and whole tag over what was sent at some distances before a block (E12, E13)."""
    tags = []
    for bits, reach in LAYOUTS[width][1:]:
        window = b"cuecast-data-1"
        for distance in range(1, reach + 1):
            if distance in before:
                data = before[distance]
                window += distance.to_bytes(2, "big") + len(data).to_bytes(2, "big") + data
        digest = hashlib.sha256(window).digest()
        whole = hashlib.sha256(b"cuecast-tag-1" + bytes([reach]) + key + digest).digest()
        tags.append(int.from_bytes(whole, "big") >> 256 - bits)
    return tags


def told_tags(fields: list[int], width: int) -> list[int]:
    """Return quick and whole tag that a block's fields say (E6)."""
    number = 0
    for value in fields:
        number = number << width | value
    _, (quick, _), (whole, _) = LAYOUTS[width]
    return [number >> 48 + whole & (1 << quick) - 1, number >> 48 & (1 << whole) - 1]
