"""The fixed fields of superframes and stream files, and their checksums.

Every layout is one table of names and widths, used by the writer, the
reader and the printer; its total is asserted. Specification: spec/bitstream.md, sections 2 and 6.
"""

import binascii
from collections.abc import Mapping
from dataclasses import dataclass

from codec.errors import BitstreamError

VERSION = 3
"""Version of the bitstream that this package writes."""

MODES = ("score", "plain", "compact")
"""Names of the modes: score with residual, residual alone, score alone in few bytes."""

SCORE, PLAIN, COMPACT = range(len(MODES))

HEADER_FIELDS = {"version": 2, "mode": 2, "sequence": 6, "lead": 2, "voice": 4}
"""The header of L0: names and widths in bits, first field in the highest bits."""

COMPACT_FIELDS = {"version": 2, "compact": 1, "voice": 1, "sequence": 4}
"""The header of L0 in compact mode: the lower bit of the mode is one of the voice's."""

COMPACT_LEAD = 2
"""Superframes by which compact ones are always on air ahead of their time."""

FILE_FIELDS = {
    "magic": 32, "version": 8, "voice": 64, "coding": 64, "first_tick": 32, "ticks": 32,
    "l0": 12, "l1": 12,
}  # fmt: skip
"""The head of a stream file, before its checksum."""

RECORD_FIELDS = {"l0": 12, "l1": 12}
"""The lengths before each superframe of a file whose head states none."""

MAGIC = int.from_bytes(b"CUES", "big")

HEADER_BYTES = 2
COMPACT_HEADER_BYTES = 1
FILE_BYTES = 32
RECORD_BYTES = 3
SEQUENCES = 64
COMPACT_SEQUENCES = 16

assert sum(HEADER_FIELDS.values()) == 8 * HEADER_BYTES
assert sum(COMPACT_FIELDS.values()) == 8 * COMPACT_HEADER_BYTES
assert sum(FILE_FIELDS.values()) == 8 * FILE_BYTES
assert sum(RECORD_FIELDS.values()) == 8 * RECORD_BYTES


def pack_fields(layout: Mapping[str, int], values: Mapping[str, int]) -> bytes:
    """Return `values` as unsigned fields of `layout`.

    Examples
    --------
    >>> pack_fields({"a": 3, "b": 5}, {"a": 5, "b": 1}).hex()
    'a1'
    """
    number = 0
    for name, width in layout.items():
        assert 0 <= values[name] < 1 << width, f"{name} {values[name]} in {width} bits"
        number = number << width | values[name]
    total = sum(layout.values())
    size = -(-total // 8)
    return (number << 8 * size - total).to_bytes(size, "big")


def unpack_fields(layout: Mapping[str, int], data: bytes) -> dict[str, int]:
    """Read the fields of `layout` from the start of `data`.

    Raises
    ------
    BitstreamError
        If `data` is too short (paragraph H1).
    """
    total = sum(layout.values())
    if 8 * len(data) < total:
        raise BitstreamError(f"{len(data)} bytes cannot hold {total} bits", section="H1")
    left = 8 * len(data)
    number, values = int.from_bytes(data, "big"), {}
    for name, width in layout.items():
        left -= width
        values[name] = number >> left & (1 << width) - 1
    return values


@dataclass(frozen=True, slots=True)
class Header:
    """What the first bytes of L0 say.

    Attributes
    ----------
    mode : int
        Index in `MODES`.
    sequence : int
        Number of the superframe modulo `sequences`.
    lead : int
        Superframes between the time on air and the time of presentation, 0..3.
    voice : int
        Hexadecimal digit number ``sequence % 16`` of the coding's identity; in compact mode bit
        number ``sequence`` of it.
    version : int
        Version of the bitstream.
    """

    mode: int
    sequence: int
    lead: int
    voice: int
    version: int = VERSION

    @property
    def sequences(self) -> int:
        """Number of sequence numbers: 64, or 16 in compact mode."""
        return COMPACT_SEQUENCES if self.mode == COMPACT else SEQUENCES

    def to_bytes(self) -> bytes:
        """Return the two bytes, or the one of compact mode."""
        fields = COMPACT_FIELDS if self.mode == COMPACT else HEADER_FIELDS
        values = {"version": self.version, "mode": self.mode, "compact": 1}
        values |= {"sequence": self.sequence, "lead": self.lead, "voice": self.voice}
        return pack_fields(fields, values)


def read_header(l0: bytes) -> Header:
    """Read the header of an L0 part; the checksum is not looked at.

    Raises
    ------
    BitstreamError
        If the part is too short (H1) or its version unknown (H2).

    Examples
    --------
    >>> read_header(Header(mode=0, sequence=5, lead=2, voice=10).to_bytes()).sequence
    5
    """
    fields = unpack_fields(COMPACT_FIELDS, l0[:COMPACT_HEADER_BYTES])
    if fields.pop("compact"):
        header = Header(**fields, mode=COMPACT, lead=COMPACT_LEAD)
    else:
        header = Header(**unpack_fields(HEADER_FIELDS, l0[:HEADER_BYTES]))
    if header.version != VERSION:
        raise BitstreamError(f"version {header.version} is not {VERSION}", section="H2", bit=0)
    return header


def voice_digit(identity: str, sequence: int) -> int:
    """Return the digit of a coding's identity that superframe `sequence` carries (H5).

    Examples
    --------
    >>> voice_digit("0123456789abcdef", 26)
    10
    """
    return int(identity[sequence % 16], 16)


def voice_bit(identity: str, sequence: int) -> int:
    """Return the bit of a coding's identity that compact superframe `sequence` carries (M2).

    Examples
    --------
    >>> [voice_bit("c0123456789abcde", k) for k in range(4)]
    [1, 1, 0, 0]
    """
    return int(identity[:4], 16) >> (15 - sequence % COMPACT_SEQUENCES) & 1


def crc16(data: bytes) -> int:
    """Return the CRC-16 of L0: polynomial 0x1021, register preset to 0xFFFF (H6).

    Examples
    --------
    >>> hex(crc16(b"123456789"))
    '0x29b1'
    """
    return binascii.crc_hqx(data, 0xFFFF)


def crc8(data: bytes) -> int:
    """Return the CRC-8 of L1: polynomial 0x2F, preset and inverted with 0xFF (H7).

    Examples
    --------
    >>> hex(crc8(b"123456789"))
    '0xdf'
    """
    register = 0xFF
    for byte in data:
        register = _CRC8[register ^ byte]
    return register ^ 0xFF


def _crc8_of(byte: int) -> int:
    for _ in range(8):
        byte = (byte << 1) ^ (0x12F if byte & 0x80 else 0)
    return byte


_CRC8 = tuple(_crc8_of(byte) for byte in range(256))
