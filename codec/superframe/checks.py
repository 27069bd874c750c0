"""What surrounds the payload of L0: its length, check, identity and proof.

The check of L0 is changed by the identity of the coding, so that a part of another voice, of other
tables or of another language fails it. A signed part carries a proof of who speaks, raw bits that
can be set after encoding; what they mean is not the bitstream's affair.
Specification: spec/bitstream.md, section 2.
"""

from codec.superframe.bits import (
    COMPACT,
    COMPACT_SEQUENCES,
    HEADER_BYTES,
    PROOF_BITS,
    crc16,
    identity_bits,
    identity_mask,
    read_header,
)
from codec.superframe.window import MAX_BYTES, MIN_BYTES

CRC16_BYTES = 2
"""Bytes of L0's check."""

MIN_L0_BYTES = HEADER_BYTES + CRC16_BYTES + 1
"""Bytes of the shortest L0: header, one byte, check."""

SIGNED_BYTES = 2
"""Bytes that signing adds to an L0 part at least."""

_COMPACT_BIT = 0x20
"""Bit of the first byte that marks a compact L0."""

_COMPACT_SIGNED_BIT = 0x10
"""Bit of its first byte that marks a signed one."""

_SIGNED_BIT = 0x08
"""Bit of the second byte that marks a signed L0."""


def is_compact(l0: bytes) -> bool:
    """Return whether the mode of an L0 part is compact (H3)."""
    return len(l0) > 0 and l0[0] & _COMPACT_BIT > 0


def least_bytes(l0: bytes) -> int:
    """Return the least length of a part that begins like this one and is not compact (H1)."""
    signed = len(l0) >= HEADER_BYTES and l0[1] & _SIGNED_BIT > 0
    return MIN_L0_BYTES + (SIGNED_BYTES if signed else 0)


def is_possible(l0: bytes) -> bool:
    """Return whether an L0 part has a possible length (H1)."""
    if is_compact(l0):
        return MIN_BYTES <= len(l0) <= MAX_BYTES
    return len(l0) >= least_bytes(l0)


def is_own(l0: bytes, identity: str) -> bool:
    """Return whether an L0 part is whole and of a coding (H1, H5, H6, M2).

    A compact part has no check: what carries it has to check it.

    Parameters
    ----------
    l0 : bytes
    identity : str
        Of the coding, sixteen hexadecimal digits.
    """
    if not is_possible(l0):
        return False
    if is_compact(l0):
        own = identity_bits(identity, l0[0] & COMPACT_SEQUENCES - 1)
        return compact_identity(l0) == own
    return heard_mask(l0) == identity_mask(identity)


def compact_identity(l0: bytes) -> int:
    """Return the two bits of the identity at the end of a compact L0 part (M2)."""
    signed = l0[0] & _COMPACT_SIGNED_BIT > 0
    return l0[-1] >> (PROOF_BITS[COMPACT] if signed else 0) & 3


def with_check(body: bytes, identity: str) -> bytes:
    """Return an L0 part with its check, which encodes the coding's identity, too (H5, H6)."""
    return body + (crc16(body) ^ identity_mask(identity)).to_bytes(CRC16_BYTES, "big")


def heard_mask(l0: bytes) -> int:
    """Return the 16 bits of identity in an intact L0 part; of a damaged one, any."""
    return crc16(l0[:-CRC16_BYTES]) ^ int.from_bytes(l0[-CRC16_BYTES:], "big")


def proof_of(l0: bytes) -> tuple[int, int] | None:
    """Return the proof of an L0 part and its width in bits, None if the part is unsigned.

    Raises
    ------
    BitstreamError
        If the version is unknown (H2) or the part has no header (H1).

    Examples
    --------
    >>> from codec.superframe.bits import Header
    >>> l0 = with_check(Header(0, 5, 2, signed=True).to_bytes() + bytes(16), 16 * "0")
    >>> proof_of(with_proof(l0, 300))
    (300, 9)
    """
    header = read_header(l0)
    if not header.signed or not is_possible(l0):
        return None
    width = PROOF_BITS[header.mode]
    return int.from_bytes(_body(l0), "big") & (1 << width) - 1, width


def with_proof(l0: bytes, value: int) -> bytes:
    """Return a signed L0 part with its proof set, its check renewed for the same identity.

    Parameters
    ----------
    l0 : bytes
        Of a signed superframe.
    value : int
        9 bits, of a compact part 2.
    """
    header = read_header(l0)
    width = PROOF_BITS[header.mode]
    assert header.signed, "an unsigned part has no room for a proof"
    assert 0 <= value < 1 << width, f"proof {value} in {width} bits"
    body = _body(l0)
    number = int.from_bytes(body, "big") >> width << width | value
    changed = number.to_bytes(len(body), "big")
    if header.mode == COMPACT:
        return changed
    return changed + (crc16(changed) ^ heard_mask(l0)).to_bytes(CRC16_BYTES, "big")


def check_of(l0: bytes) -> bytes:
    """Return the check that an L0 part has with a proof of zero: what L1 is bound to (H7)."""
    return (with_proof(l0, 0) if read_header(l0).signed else l0)[-CRC16_BYTES:]


def proved(l0: bytes) -> bytes:
    """Return the bytes that a proof covers: an L0 part with zero proof, without its check."""
    return _body(with_proof(l0, 0))


def _body(l0: bytes) -> bytes:
    return l0 if is_compact(l0) else l0[:-CRC16_BYTES]
