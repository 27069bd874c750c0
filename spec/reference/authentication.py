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


def _bits(fields: list[int | None], width: int, at: int, count: int) -> int | None:
    """Return some bits of a block's fields, None where one of these fields did not arrive (E21)."""
    first, last = at // width, (at + count - 1) // width
    value = 0
    for arrived in fields[first : last + 1]:
        if arrived is None:
            return None
        value = value << width | arrived
    return value >> (last + 1) * width - at - count & (1 << count) - 1


def _wrong(checks: dict[int, int], tags: dict[int, int], length: int) -> set[int] | None:
    """Return the places of a block that its checks deny, None if too many were lost (E22)."""
    found = agree(checks, tags, length) if any(checks.values()) else None
    if found is not False:
        return None if found is None else set()
    for place in tags:
        rest = {at: tag for at, tag in tags.items() if at != place}
        lost = length - len(rest)
        if len(checks) - 2 * lost >= 4 and agree(checks, rest, length):
            return {place}
    return set(tags)


def statuses(
    taken: dict[int, tuple[bytes, int, float]],
    channel: bytes,
    width: int,
    end: bytes,
    tolerance_s: float,
) -> dict[int, str]:
    """Return the status of each superframe that arrived, of one period, when all have (E22, E24).

    `taken` has by public number what is covered, the field and the age at arrival in seconds.
    A changed field is not looked for, only changed superframes of the block before.
    """
    length, count, quick = LAYOUTS[width]
    period, blocks = min(taken) // PERIOD, PERIOD // length
    keys: dict[int, bytes] = {}
    known, fields = (-1, end), {}
    for block in range(min(taken) // length, max(taken) // length + 1):
        numbers = range(block * length, (block + 1) * length)
        fields[block % blocks] = [taken[n][1] if n in taken else None for n in numbers]
        sent = _bits(fields[block % blocks], width, 12 * count + 24, 48)
        if sent is None:
            continue
        key = key_of_block(sent, channel, period, width, block % blocks, known)
        if key is not None:
            keys[block % blocks] = key
            known = block % blocks, key
    for block in range(known[0], min(fields), -1):
        keys[block - 1] = before(keys[block], channel, period, width, block)
    result = dict.fromkeys(taken, "unknown")
    for block in sorted(keys):
        begin = period * PERIOD + block * length
        tags = {
            n - begin: tag_of(taken[n][0], channel, keys[block], begin + length - n)
            for n in range(begin - length, begin + length)
            if n in taken
        }
        told = {j: _bits(fields[block], width, 12 * j, 12) for j in range(count)}
        checks = {j: value for j, value in told.items() if value is not None}
        earlier = {at + length: tag for at, tag in tags.items() if at < 0}
        denied = _wrong(checks, earlier, length)
        late = any(abs(taken[begin + at][2]) > tolerance_s for at in tags)
        judged = {} if denied is None else {at - length: at not in denied for at in earlier}
        quick_tag = _bits(fields[block], width, 12 * count, 24)
        if quick in tags and quick_tag == tags[quick]:
            judged[quick] = True
        for at, agreed in judged.items():
            if result[begin + at] != "verified":
                result[begin + at] = "verified" if agreed and not late else "forged"
    return result
