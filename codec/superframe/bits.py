"""The fixed fields of superframes and stream files, and their checksums.

Every layout is one table of names and widths, used by the writer, the
reader and the printer; its total is asserted. Specification: spec/bitstream.md, sections 2 and 6.
"""

import binascii
from collections.abc import Mapping
from dataclasses import dataclass

from codec.errors import BitstreamError

VERSION = 4
"""Version of the bitstream that this package writes; stream files state it as it is."""

VERSION_CODE = 0
"""Its code in superframes; codes 2 and 3 are those versions."""

_ESCAPE = 1
"""Code of all later versions: five bits behind the next bit say which (X1)."""

MODES = ("score", "plain", "compact")
"""Names of the modes: score with residual, residual alone, score alone in few bytes."""

SCORE, PLAIN, COMPACT = range(len(MODES))

HEADER_FIELDS = {
    "version": 2, "mode": 2, "sequence": 6, "lead": 2, "signed": 1, "slow": 2, "filmed": 1,
}  # fmt: skip
"""The header of L0: names and widths in bits, first field in the highest bits."""

COMPACT_FIELDS = {"version": 2, "compact": 1, "signed": 1, "sequence": 4}
"""The header of L0 in compact mode: the lower bit of the mode is `signed`."""

COMPACT_LEAD = 2
"""Superframes: compact ones are always on air so far ahead of their time."""

FILE_FIELDS = {
    "magic": 32, "version": 8, "coding": 64, "first_tick": 32, "ticks": 32, "l0": 12, "l1": 12,
}  # fmt: skip
"""The head of a stream file, before its checksum."""

RECORD_FIELDS = {"mode": 1, "bytes": 7}
"""What precedes each superframe of a file whose head states no lengths."""

MAGIC = int.from_bytes(b"CUES", "big")

HEADER_BYTES = 2
"""Bytes of L0's header."""

COMPACT_HEADER_BYTES = 1
"""Bytes of a compact L0's header."""

FILE_BYTES = 24
"""Bytes of a file's head, without its check."""

RECORD_BYTES = 1
"""Bytes of the head of a superframe in a file."""

SEQUENCES = 64
"""Numbers of superframes that the header distinguishes."""

COMPACT_SEQUENCES = 16
"""The same in compact ones."""

PROOF_BITS = {SCORE: 9, PLAIN: 9, COMPACT: 2}
"""Bits of the proof that a signed superframe carries, by mode."""

IDENTITY_BITS = 2
"""Bits of the coding's identity at the end of a compact superframe's payload."""

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
    """The header: the first bytes of L0.

    Attributes
    ----------
    mode : int
        Index in `MODES`.
    sequence : int
        Number of the superframe modulo `sequences`.
    lead : int
        Superframes between the time on air and the time of presentation, 0..3.
    signed : bool
        Whether a proof follows the payload.
    slow : int
        Pieces of the slow channel that the payload begins with, 0..3; compact superframes state it
        in the payload.
    filmed : bool
        Whether the cuer was filmed: her score is coded as labels, and superframes are blended.
    """

    mode: int
    sequence: int
    lead: int
    signed: bool = False
    slow: int = 0
    filmed: bool = False

    @property
    def sequences(self) -> int:
        """Number of sequence numbers: 64, or 16 in compact mode."""
        return COMPACT_SEQUENCES if self.mode == COMPACT else SEQUENCES

    def to_bytes(self) -> bytes:
        """Return the two bytes, or the one of compact mode."""
        fields = COMPACT_FIELDS if self.mode == COMPACT else HEADER_FIELDS
        values = {
            "version": VERSION_CODE,
            "mode": self.mode,
            "compact": 1,
            "filmed": int(self.filmed),
        }
        values |= {"sequence": self.sequence, "lead": self.lead}
        values |= {"signed": int(self.signed), "slow": self.slow}
        return pack_fields(fields, values)

    @property
    def tail(self) -> int:
        """Bits between the payload and the check, or the end."""
        proof = PROOF_BITS[self.mode] if self.signed else 0
        return proof + (IDENTITY_BITS if self.mode == COMPACT else 0)


def read_header(l0: bytes) -> Header:
    """Read the header of an L0 part; the checksum is not looked at.

    Raises
    ------
    BitstreamError
        If the part is too short (H1) or its version unknown (H2).

    Examples
    --------
    >>> read_header(Header(mode=0, sequence=5, lead=2).to_bytes()).sequence
    5
    """
    fields = unpack_fields(COMPACT_FIELDS, l0[:COMPACT_HEADER_BYTES])
    if fields["version"] != VERSION_CODE:
        raise BitstreamError(
            f"version {version_of(l0)} of the bitstream is not {VERSION}", section="H2", bit=0
        )
    if fields["compact"]:
        return Header(COMPACT, fields["sequence"], COMPACT_LEAD, bool(fields["signed"]))
    fields = unpack_fields(HEADER_FIELDS, l0[:HEADER_BYTES])
    return Header(
        fields["mode"],
        fields["sequence"],
        fields["lead"],
        bool(fields["signed"]),
        fields["slow"],
        bool(fields["filmed"]),
    )


def version_of(l0: bytes) -> int:
    """Return the version of the bitstream that an L0 part states (H2, X1).

    Examples
    --------
    >>> [version_of(bytes([first])) for first in (0x00, 0x41, 0x60, 0xC0)]
    [4, 6, 5, 3]
    """
    code = l0[0] >> 6
    return {VERSION_CODE: VERSION, _ESCAPE: VERSION + 1 + (l0[0] & 31)}.get(code, code)


def identity_mask(identity: str) -> int:
    """Return the 16 bits that a coding's identity changes in the check of L0 (H5).

    Examples
    --------
    >>> hex(identity_mask("0123456789abcdef"))
    '0x123'
    """
    return int(identity[:4], 16)


def identity_bits(identity: str, sequence: int) -> int:
    """Return the two bits of a coding's identity that a compact superframe carries (M2).

    Examples
    --------
    >>> [identity_bits("c0123456789abcde", k) for k in range(4)]
    [3, 0, 0, 0]
    """
    return identity_mask(identity) >> (14 - 2 * (sequence % 8)) & 3


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
