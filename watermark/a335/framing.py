"""A superframe as the lines' message bodies, and back from those that arrived.

In: the two classes of a superframe; out: one message block per frame; and back from any
sufficient set of blocks. Specification: spec/a335-carrier.md, sections 3 and 4.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from codec.errors import BitstreamError, CueError
from watermark.a335.erasure import ByteMatrix, decode_parts, encode_part
from watermark.a335.messages import (
    USER_PRIVATE_LONG,
    Block,
    Convention,
    checksum,
    pack_private,
    parse_private,
)
from watermark.a335.profile import CHECK_BYTES, A335Profile

SHORT_PARTS = 64  # six bits of the part's number

MESSAGE_CHECK_BYTES = 4
"""Bytes of the CRC-32 that ends a message and binds its columns together."""


def pack_block(l0: bytes, l1: bytes, profile: A335Profile) -> bytes:
    """Both classes and their checksum.

    Raises
    ------
    CueError
        If a class does not have the profile's length.
    """
    for name, data, size in (("L0", l0, profile.l0_bytes), ("L1", l1, profile.l1_bytes)):
        if len(data) != size:
            raise CueError(f"{name} holds {len(data)} bytes, profile {profile.name} {size}")
    return l0 + l1 + zlib.crc32(l0 + l1).to_bytes(CHECK_BYTES)


def unpack_block(block: bytes, profile: A335Profile) -> tuple[bytes, bytes] | None:
    """Both classes, None where the checksum is wrong."""
    data = block[: profile.block_bytes - CHECK_BYTES]
    check = block[profile.block_bytes - CHECK_BYTES : profile.block_bytes]
    if zlib.crc32(data).to_bytes(CHECK_BYTES) != check:
        return None
    return data[: profile.l0_bytes], data[profile.l0_bytes :]


def _matrix(block: bytes, size: int) -> ByteMatrix:
    rows = -(-len(block) // size)
    return np.frombuffer(block.ljust(rows * size, b"\0"), dtype=np.uint8).reshape(rows, size)


# --- self-contained frames (0x7F) ---


def short_block(
    block: bytes,
    profile: A335Profile,
    *,
    superframe: int,
    part: int,
    version: int,
    domain: str,
    convention: Convention,
) -> Block:
    """Message of one frame: superframe modulo 4, part number, one part of the erasure code."""
    size = profile.body_bytes - profile.overhead(domain) - 1
    if size < 1:
        raise CueError(f"domain {domain!r} leaves no room in {profile.body_bytes} bytes")
    if part >= SHORT_PARTS:
        raise CueError(f"part {part}: the message numbers parts up to {SHORT_PARTS - 1}")
    data = encode_part(_matrix(block, size), part).tobytes()
    message = pack_private(domain, bytes([(superframe & 3) << 6 | part]) + data)
    return Block(profile.message_id, version, 0, 0, message, None, convention)


def parse_short(block: Block, domain: str) -> tuple[int, int, bytes] | None:
    """Superframe modulo 4, part number and data of one frame's message, None if not ours."""
    try:
        name, payload = parse_private(block.body)
    except BitstreamError:
        return None
    if name != domain or len(payload) < 2:
        return None
    return payload[0] >> 6, payload[0] & 63, payload[1:]


def join_short(parts: Mapping[int, bytes], profile: A335Profile) -> tuple[bytes, bytes] | None:
    """Classes behind the parts of one superframe, None while there are too few."""
    size = len(next(iter(parts.values())))
    k = -(-profile.block_bytes // size)
    arrived = {p: np.frombuffer(d, dtype=np.uint8) for p, d in parts.items() if len(d) == size}
    data = decode_parts(arrived, k)
    return None if data is None else unpack_block(data.tobytes(), profile)


# --- one message over all frames (0xFF) ---


@dataclass(frozen=True, slots=True)
class LongGrid:
    """Where the payload of a message of `count` fragments lies.

    Fragments are rows and body bytes are columns. The domain takes the first columns of the first
    row, the message checksum the last columns of the last row; each column is a codeword of the
    erasure code whose last `parity` members are redundant.
    """

    count: int
    size: int
    head: int
    parity: int

    def members(self, column: int) -> NDArray[np.int64]:
        """Fragments whose body has a payload byte in this column."""
        first = 1 if column < self.head else 0
        last = self.count - (1 if column >= self.size - MESSAGE_CHECK_BYTES else 0)
        return np.arange(first, last)

    @property
    def capacity(self) -> int:
        """Protected bytes."""
        return sum(max(0, self.members(c).size - self.parity) for c in range(self.size))


def long_grid(profile: A335Profile, count: int, domain: str) -> LongGrid:
    """Grid with the most redundancy that still holds the profile's block.

    Raises
    ------
    CueError
        If a message of `count` fragments is too small.
    """
    size, head = profile.body_bytes, profile.overhead(domain)
    if head < size:
        for parity in range(count - 1, -1, -1):
            grid = LongGrid(count, size, head, parity)
            if grid.capacity >= profile.block_bytes:
                return grid
    raise CueError(
        f"{count} frames a superframe hold no {profile.block_bytes} bytes of profile {profile.name}"
    )


def long_blocks(
    block: bytes,
    profile: A335Profile,
    *,
    count: int,
    version: int,
    domain: str,
    convention: Convention,
) -> list[Block]:
    """Fragments of the message that carries a superframe over `count` frames."""
    grid = long_grid(profile, count, domain)
    body = np.zeros((count, grid.size), dtype=np.uint8)
    data = np.frombuffer(block.ljust(grid.capacity, b"\0"), dtype=np.uint8)
    used = 0
    for column in range(grid.size):
        members = grid.members(column)
        k = members.size - grid.parity
        codeword = data[used : used + k, None]
        body[members, column] = [encode_part(codeword, p)[0] for p in range(members.size)]
        used += k
    payload = body.tobytes()[grid.head : count * grid.size - MESSAGE_CHECK_BYTES]
    return _fragments(payload, profile, count, version, domain, convention)


def _fragments(
    payload: bytes,
    profile: A335Profile,
    count: int,
    version: int,
    domain: str,
    convention: Convention,
) -> list[Block]:
    """Cut a message with this payload into `count` blocks that are as long as fits."""
    message = pack_private(domain, payload, message_id=USER_PRIVATE_LONG)
    check = checksum(bytes([profile.message_id]) + message, convention)
    size = profile.body_bytes
    return [
        Block(
            profile.message_id,
            version,
            i,
            count - 1,
            message[i * size : (i + 1) * size],
            check if i == count - 1 else None,
            convention,
        )
        for i in range(count)
    ]


def join_long(
    bodies: Mapping[int, bytes], profile: A335Profile, *, count: int, domain: str
) -> tuple[bytes, bytes] | None:
    """Classes behind the fragments that arrived, None while there are too few."""
    try:
        grid = long_grid(profile, count, domain)
    except CueError:
        return None
    data = bytearray()
    for column in range(grid.size):
        members = grid.members(column)
        arrived = {
            p: np.array([bodies[int(f)][column]], dtype=np.uint8)
            for p, f in enumerate(members)
            if int(f) in bodies and column < len(bodies[int(f)])
        }
        decoded = decode_parts(arrived, members.size - grid.parity)
        if decoded is None:
            return None
        data += decoded.tobytes()
    return unpack_block(bytes(data), profile)


# --- several superframes in one message (0xFF), without redundancy ---


def rooms(profile: A335Profile, count: int, domain: str) -> list[range]:
    """Bytes of a message of `count` fragments that belong to each of its superframes.

    Raises
    ------
    CueError
        If they do not hold the profile's classes.
    """
    head = profile.overhead(domain)
    length = count * profile.body_bytes - MESSAGE_CHECK_BYTES - head
    cuts = [head + j * length // profile.superframes for j in range(profile.superframes + 1)]
    needed = profile.l0_bytes + profile.l1_bytes
    if min(b - a for a, b in pairwise(cuts)) < needed:
        raise CueError(
            f"{count} frames hold no {profile.superframes} superframes of {needed} bytes, which "
            f"profile {profile.name} has"
        )
    return [range(a, b) for a, b in pairwise(cuts)]


def shared_blocks(
    payloads: Sequence[tuple[bytes, bytes]],
    profile: A335Profile,
    *,
    count: int,
    version: int,
    domain: str,
    convention: Convention,
) -> list[Block]:
    """Fragments of the message that carries several superframes; room left over repeats them."""
    payload = b""
    for (l0, l1), room in zip(payloads, rooms(profile, count, domain), strict=True):
        data = l0 + l1
        payload += (data * -(-len(room) // len(data)))[: len(room)]
    return _fragments(payload, profile, count, version, domain, convention)


def read_shared(
    bodies: Mapping[int, bytes], profile: A335Profile, *, count: int, number: int, domain: str
) -> tuple[bytes, bytes] | None:
    """Classes of superframe `number` of a message, None while a byte of them is missing."""
    try:
        room = rooms(profile, count, domain)[number]
    except CueError:
        return None
    size = profile.body_bytes
    data = bytearray()
    for i in range(profile.l0_bytes + profile.l1_bytes):
        places = (room[j] for j in range(i, len(room), profile.l0_bytes + profile.l1_bytes))
        known = next((p for p in places if p % size < len(bodies.get(p // size, b""))), None)
        if known is None:
            return None
        data.append(bodies[known // size][known % size])
    return bytes(data[: profile.l0_bytes]), bytes(data[profile.l0_bytes :])
