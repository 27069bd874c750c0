"""The fixed fields of superframes and stream files, and their checksums.

The one door to bitstring. Every layout is one table of names and widths, used by the writer, the
reader and the printer; its total is asserted. Specification: spec/bitstream.md, sections 2 and 6.
"""

import binascii
from collections.abc import Mapping
from dataclasses import dataclass

from bitstring import Bits, Reader, pack

from codec.errors import BitstreamError

VERSION = 1
"""Version of the bitstream that this package writes."""

MODES = ("score", "plain", "score-only")
"""Names of the modes 0, 1 and 2: score with residual, residual alone, score alone."""

HEADER_FIELDS = {"version": 2, "mode": 2, "sequence": 6, "lead": 2, "voice": 4}
"""The header of L0: names and widths in bits, first field in the highest bits."""

FILE_FIELDS = {
    "magic": 32, "version": 8, "voice": 64, "first_tick": 32, "ticks": 32, "l0": 12, "l1": 12,
}  # fmt: skip
"""The head of a stream file, before its checksum."""

RECORD_FIELDS = {"l0": 12, "l1": 12}
"""The lengths before each superframe of a file whose head states none."""

MAGIC = int.from_bytes(b"CUES", "big")

HEADER_BYTES = 2
FILE_BYTES = 24
RECORD_BYTES = 3
SEQUENCES = 64

assert sum(HEADER_FIELDS.values()) == 8 * HEADER_BYTES
assert sum(FILE_FIELDS.values()) == 8 * FILE_BYTES
assert sum(RECORD_FIELDS.values()) == 8 * RECORD_BYTES


def pack_fields(layout: Mapping[str, int], values: Mapping[str, int]) -> bytes:
    """Return `values` as unsigned fields of `layout`.

    Examples
    --------
    >>> pack_fields({"a": 3, "b": 5}, {"a": 5, "b": 1}).hex()
    'a1'
    """
    widths = ", ".join(f"u:{width}" for width in layout.values())
    return bytes(pack(widths, *(values[name] for name in layout)).bytes)


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
    reader = Reader(Bits.from_bytes(data))
    return {name: reader.read_bits(width).u for name, width in layout.items()}


@dataclass(frozen=True, slots=True)
class Header:
    """What the first two bytes of L0 say.

    Attributes
    ----------
    mode : int
        Index in `MODES`.
    sequence : int
        Number of the superframe modulo 64.
    lead : int
        Superframes between the time on air and the time of presentation, 0..3.
    voice : int
        Hexadecimal digit number ``sequence % 16`` of the voice's identity.
    version : int
        Version of the bitstream.
    """

    mode: int
    sequence: int
    lead: int
    voice: int
    version: int = VERSION

    def to_bytes(self) -> bytes:
        """Return the two bytes."""
        return pack_fields(HEADER_FIELDS, {name: getattr(self, name) for name in HEADER_FIELDS})


def read_header(l0: bytes) -> Header:
    """Read the header of an L0 part; the checksum is not looked at.

    Raises
    ------
    BitstreamError
        If the part is too short (H1), its version unknown (H2) or its mode reserved (H3).

    Examples
    --------
    >>> read_header(Header(mode=0, sequence=5, lead=2, voice=10).to_bytes()).sequence
    5
    """
    header = Header(**unpack_fields(HEADER_FIELDS, l0))
    if header.version != VERSION:
        raise BitstreamError(f"version {header.version} is not {VERSION}", section="H2", bit=0)
    if header.mode >= len(MODES):
        raise BitstreamError(f"mode {header.mode} is reserved", section="H3", bit=2)
    return header


def voice_digit(identity: str, sequence: int) -> int:
    """Return the digit of a voice's identity that superframe `sequence` carries (H5).

    Examples
    --------
    >>> voice_digit("0123456789abcdef", 26)
    10
    """
    return int(identity[sequence % 16], 16)


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


def nearest_index(sequence: int, near: int) -> int:
    """Return the superframe number with this `sequence` that lies closest to `near`.

    Examples
    --------
    >>> nearest_index(2, 63), nearest_index(62, 64)
    (66, 62)
    """
    return near + (sequence - near + SEQUENCES // 2) % SEQUENCES - SEQUENCES // 2
