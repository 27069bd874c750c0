"""Blocks of superframes and the bits of them that prove where they come from.

Superframes are numbered on a public clock. A block's proof fields together hold, in this order,
the whole tag, the quick tag and the part of the block's key that is sent. Specification:
spec/authentication.md, section 2.
"""

from dataclasses import dataclass

SUPERFRAME_S = 0.64
"""Duration of a superframe in seconds."""

EPOCH_S = 1_767_225_600
"""Superframe 0 of the public clock was due at 2026-01-01 00:00 UTC (seconds since 1970)."""

PERIOD = 5632
"""Superframes that share a chain of keys: an hour and four seconds, whole blocks of each kind."""

KEY_BYTES = 8
"""Bytes of a key of a block."""

SENT_BITS = 48
"""Bits of it that are sent; the others are found by trying."""

HIDDEN_BITS = 8 * KEY_BYTES - SENT_BITS
"""Bits of a key that are not sent: the receiver tries them all, and so saves a quarter of the time
that a key takes."""


@dataclass(frozen=True, slots=True)
class Tag:
    """A tag over some superframes, told by their distance before the end of its block.

    Attributes
    ----------
    bits : int
    nearest, farthest : int
        Distances of the superframes that are covered; 1 is the last one of the block.
    """

    bits: int
    nearest: int
    farthest: int

    @property
    def reach(self) -> int:
        """Superframes that it covers."""
        return self.farthest - self.nearest + 1


@dataclass(frozen=True, slots=True)
class ProofLayout:
    """How the proof fields of one width are used.

    Attributes
    ----------
    width : int
        Bits of a superframe's field.
    block : int
        Superframes of a block.
    whole : Tag
        Of so many superframes that each is covered by `NEEDED_BITS` bits of tags in all.
    quick : Tag
        Of few, the last ones that can be covered: verifies soon after tuning in.
    """

    width: int
    block: int
    whole: Tag
    quick: Tag

    def __post_init__(self) -> None:
        assert self.width * self.block == self.quick.bits + self.whole.bits + SENT_BITS
        assert PERIOD % self.block == 0
        assert self.whole.reach % self.block == 0
        assert self.whole.bits * self.whole.reach >= NEEDED_BITS * self.block
        # A tag covers no superframe that is on air after its first bit.
        assert self.whole.nearest >= self.block
        assert self.quick.nearest >= self.block - self.whole.bits // self.width

    @property
    def blocks(self) -> int:
        """Blocks, and keys, of a period."""
        return PERIOD // self.block


NEEDED_BITS = 24
"""Bits of tags that have to agree before a superframe counts as verified: a forged one does by
chance once in 2**24."""

LAYOUTS = {
    layout.width: layout
    for layout in (
        ProofLayout(9, 8, whole=Tag(12, 9, 24), quick=Tag(12, 7, 7)),
        ProofLayout(2, 44, whole=Tag(24, 45, 88), quick=Tag(16, 32, 35)),
    )
}
"""Layouts by the width of the field: normal superframes, and compact ones."""


def number_at(utc_s: float) -> float:
    """Return the number, with a fraction, of the superframe at a time.

    Examples
    --------
    >>> number_at(EPOCH_S + 16)
    25.0
    """
    return (utc_s - EPOCH_S) / SUPERFRAME_S


def time_of(number: float) -> float:
    """Return the time of a superframe, in seconds since 1970 (UTC)."""
    return EPOCH_S + number * SUPERFRAME_S


def join(whole: int, quick: int, sent: int, layout: ProofLayout) -> int:
    """Return a block's fields as one number.

    Examples
    --------
    >>> hex(join(0x123, 0xABC, 0x456789ABCDEF, LAYOUTS[9]))
    '0x123abc456789abcdef'
    """
    return (whole << layout.quick.bits | quick) << SENT_BITS | sent
