"""Message blocks of ATSC A/336 inside the line: fragments, versions, two checksums.

In: a message (identifier and bytes); out: the blocks of one or several lines; and back. Section 5
of ATSC A/336:2022. The text defines the MPEG-2 checksum; broadcasts use the reflected one of
IEEE 802.3, so a reader accepts either and a writer offers both.
"""

import zlib
from dataclasses import dataclass
from typing import Literal

from codec.errors import BitstreamError, CueError
from watermark.a335.line import RUN_IN, LineSystem

Convention = Literal["ieee", "mpeg"]

CONTENT_ID, PRESENTATION_TIME, URI, VP1, DYNAMIC_EVENT, DISPLAY_OVERRIDE = 1, 2, 3, 4, 5, 6
"""Numbers of the messages (ATSC A/336)."""

EXTENDED_VP1, USER_PRIVATE_SHORT, USER_PRIVATE_LONG = 7, 0x7F, 0xFF
"""Numbers of the messages that carry a payload of their own (ATSC A/336)."""

_CHECKSUM_BYTES = 4
"""Bytes of a CRC-32."""

_SECTION = "ATSC A/336 5.2"


def checksum(data: bytes, convention: Convention) -> int:
    """Checksum of 32 bits in one of the two conventions.

    Examples
    --------
    >>> hex(checksum(b"123456789", "ieee")), hex(checksum(b"123456789", "mpeg"))
    ('0xcbf43926', '0x376e6e7')
    """
    if convention == "ieee":
        return zlib.crc32(data)
    register = 0xFFFFFFFF
    for byte in data:
        register = (register << 8 & 0xFFFFFFFF) ^ _MPEG_TABLE[register >> 24 ^ byte]
    return register


def _mpeg_entry(byte: int) -> int:
    register = byte << 24
    for _ in range(8):
        carry = register & 0x80000000
        register = (register << 1 & 0xFFFFFFFF) ^ (0x04C11DB7 if carry else 0)
    return register


_MPEG_TABLE = [_mpeg_entry(byte) for byte in range(256)]


@dataclass(frozen=True, slots=True)
class Block:
    """One message block: a fragment of a message.

    Attributes
    ----------
    message_id : int
        1..255; identifiers from 128 up use the long form (up to 256 fragments instead of 4).
    version : int
        0..15, one more (modulo 16) whenever the message changes.
    fragment, last_fragment : int
        Number of this fragment and of the last one.
    body : bytes
        This fragment's part of the message.
    message_check : int or None
        Checksum over identifier and whole message, in the last of several fragments.
    convention : "ieee" or "mpeg"
        How the block's own checksum is (to be) computed.
    """

    message_id: int
    version: int
    fragment: int
    last_fragment: int
    body: bytes
    message_check: int | None = None
    convention: Convention = "ieee"

    def __post_init__(self) -> None:
        limit = 255 if self.is_long else 3
        if not 1 <= self.message_id <= 255:
            raise CueError(f"message identifier {self.message_id}: must be 1..255")
        if not 0 <= self.fragment <= self.last_fragment <= limit:
            raise CueError(f"fragment {self.fragment} of {self.last_fragment}, limit {limit}")

    @property
    def is_long(self) -> bool:
        """Whether the block has the long form of its header."""
        return self.message_id >= 0x80

    def pack(self) -> bytes:
        """Bytes of the block, checksum included."""
        if self.is_long:
            head = bytes([self.version << 4 | 15, self.fragment, self.last_fragment])
        else:
            head = bytes([self.version << 4 | self.fragment << 2 | self.last_fragment])
        body = head + self.body
        if self.message_check is not None:
            body += self.message_check.to_bytes(_CHECKSUM_BYTES)
        block = bytes([self.message_id, len(body) + _CHECKSUM_BYTES]) + body
        return block + checksum(block, self.convention).to_bytes(_CHECKSUM_BYTES)


def body_capacity(system: LineSystem, message_id: int) -> int:
    """Message bytes in one line that holds a single block: 21 or 51 short, 19 or 49 long."""
    header = 3 if message_id >= 0x80 else 1
    return system.payload_bytes - len(RUN_IN) - 2 - header - _CHECKSUM_BYTES


def fragments(
    message_id: int, message: bytes, *, version: int, size: int, convention: Convention = "ieee"
) -> list[Block]:
    """Cut a message into blocks of at most `size` body bytes, message checksum included.

    Raises
    ------
    CueError
        If the message needs more fragments than its identifier allows.

    Examples
    --------
    >>> [len(b.body) for b in fragments(0xFF, bytes(50), version=0, size=19)]
    [19, 19, 12]
    """
    if len(message) <= size:
        return [Block(message_id, version, 0, 0, message, None, convention)]
    count = -(-(len(message) + _CHECKSUM_BYTES) // size)
    check = checksum(bytes([message_id]) + message, convention)
    # The checksum may fill a last fragment of its own, whose body is then empty.
    parts = [message[i * size : (i + 1) * size] for i in range(count)]
    return [
        Block(
            message_id, version, i, count - 1, part, check if i == count - 1 else None, convention
        )
        for i, part in enumerate(parts)
    ]


def parse_blocks(payload: bytes) -> list[Block]:
    """Blocks of a line's payload (run-in first) whose checksum is right.

    Parameters
    ----------
    payload : bytes
        As `watermark.a335.line.line_candidates` gives it.

    Returns
    -------
    list of Block
        Reading stops at the padding and at the first damaged block.

    Raises
    ------
    BitstreamError
        If the payload does not start with the run-in.
    """
    if not payload.startswith(RUN_IN):
        raise BitstreamError(
            f"run-in {payload[:2].hex()}: must be {RUN_IN.hex()}", section=_SECTION, bit=0
        )
    blocks: list[Block] = []
    position = len(RUN_IN)
    while position + 2 <= len(payload) and payload[position]:
        end = position + 2 + payload[position + 1]
        block = _parse_block(payload[position:end]) if end <= len(payload) else None
        if block is None:
            break
        blocks.append(block)
        position = end
    return blocks


def _parse_block(data: bytes) -> Block | None:
    header = 3 if data[0] >= 0x80 else 1
    if len(data) < 2 + header + _CHECKSUM_BYTES:
        return None
    convention = _convention(data)
    if convention is None:
        return None
    if header == 3:
        fragment, last = data[3], data[4]
    else:
        fragment, last = data[2] >> 2 & 3, data[2] & 3
    body = data[2 + header : -_CHECKSUM_BYTES]
    check = None
    if fragment == last > 0:
        body, check = body[:-_CHECKSUM_BYTES], int.from_bytes(body[-_CHECKSUM_BYTES:])
    if fragment > last:
        return None
    return Block(data[0], data[2] >> 4, fragment, last, body, check, convention)


def _convention(block: bytes) -> Convention | None:
    stored = int.from_bytes(block[-_CHECKSUM_BYTES:])
    conventions: tuple[Convention, ...] = ("ieee", "mpeg")
    for convention in conventions:
        if checksum(block[:-_CHECKSUM_BYTES], convention) == stored:
            return convention
    return None


def pack_private(domain: str, payload: bytes, *, message_id: int = USER_PRIVATE_SHORT) -> bytes:
    """Bytes of a user_private_message.

    Parameters
    ----------
    domain : str
        Tagging entity of RFC 4151: a domain name its owner held in that year, "cue.tv,2026".
    payload : bytes
        1 to 256 bytes in the short form, 1 to 16384 in the long one.
    message_id : int
        0x7F or 0xFF.

    Raises
    ------
    CueError
        If domain or payload do not fit their length fields.

    Examples
    --------
    >>> pack_private("cue.tv,2026", b"a")[:4].hex()
    '0a637565'
    """
    name = domain.encode("ascii")
    limit = 16384 if message_id == USER_PRIVATE_LONG else 256
    if not 1 <= len(name) <= 256 or not 1 <= len(payload) <= limit:
        raise CueError(f"domain of {len(name)} and payload of {len(payload)}: 1..256, 1..{limit}")
    if message_id == USER_PRIVATE_LONG:
        length = (len(payload) - 1 << 2 | 3).to_bytes(2)
    else:
        length = bytes([len(payload) - 1])
    return bytes([len(name) - 1]) + name + length + payload


def private_overhead(domain: str, message_id: int) -> int:
    """Bytes that `pack_private` puts before the payload."""
    return 1 + len(domain) + (2 if message_id == USER_PRIVATE_LONG else 1)


def parse_private(message: bytes, *, message_id: int = USER_PRIVATE_SHORT) -> tuple[str, bytes]:
    """Domain and payload of a user_private_message.

    Raises
    ------
    BitstreamError
        If the lengths do not agree with the message.
    """
    size = 2 if message_id == USER_PRIVATE_LONG else 1
    start = (2 + message[0] + size) if message else 0
    if not message or start >= len(message):
        raise BitstreamError(f"user private message of {len(message)} bytes", section=_SECTION)
    field = int.from_bytes(message[start - size : start])
    length = (field >> 2 if size == 2 else field) + 1
    if start + length > len(message):
        raise BitstreamError(
            f"payload of {length} bytes, {len(message) - start} left", section=_SECTION
        )
    name = message[1 : start - size].decode("ascii", errors="replace")
    return name, message[start : start + length]
