"""Blocks of superframes and the bits of them that prove where they come from.

Superframes are numbered on a public clock. A block's proof fields together hold, in this order,
the quick tag, the whole tag and the part of the block's key that is sent. Specification:
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
    """A tag of `bits` bits over the `reach` superframes before its block."""

    bits: int
    reach: int


@dataclass(frozen=True, slots=True)
class Layout:
    """How the proof fields of one width are used.

    Attributes
    ----------
    width : int
        Bits of a superframe's field.
    block : int
        Superframes of a block.
    quick : Tag
        Of the last few superframes: verifies soon after tuning in.
    whole : Tag
        Of so many superframes that each is covered by `NEEDED_BITS` bits of tags in all.
    """

    width: int
    block: int
    quick: Tag
    whole: Tag

    def __post_init__(self) -> None:
        assert self.width * self.block == self.quick.bits + self.whole.bits + SENT_BITS
        assert PERIOD % self.block == 0
        assert self.whole.reach % self.block == 0
        assert self.whole.bits * self.whole.reach >= NEEDED_BITS * self.block

    @property
    def blocks(self) -> int:
        """Blocks, and keys, of a period."""
        return PERIOD // self.block

    @property
    def start(self) -> int:
        """Place within a block at which a programme best begins: verified soonest."""
        return self.block - self.quick.reach


NEEDED_BITS = 24
"""Bits of tags that have to agree before a superframe counts as verified: a forged one does by
chance once in 2**24."""

LAYOUTS = {
    layout.width: layout
    for layout in (
        Layout(9, 8, Tag(12, 2), Tag(12, 16)),
        Layout(2, 44, Tag(16, 4), Tag(24, 44)),
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


def split(proof: int, layout: Layout) -> tuple[int, int, int]:
    """Return quick tag, whole tag and the key's sent bits of a block's fields as one number."""
    sent = proof & (1 << SENT_BITS) - 1
    whole = proof >> SENT_BITS & (1 << layout.whole.bits) - 1
    return proof >> SENT_BITS + layout.whole.bits, whole, sent


def join(quick: int, whole: int, sent: int, layout: Layout) -> int:
    """Return a block's fields as one number: the inverse of `split`.

    Examples
    --------
    >>> layout = LAYOUTS[9]
    >>> split(join(0xABC, 0x123, 0x456789ABCDEF, layout), layout) == (0xABC, 0x123, 0x456789ABCDEF)
    True
    """
    return (quick << layout.whole.bits | whole) << SENT_BITS | sent
