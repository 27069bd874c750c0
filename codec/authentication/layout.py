"""Blocks of superframes and the bits of them that prove where they come from.

Superframes are numbered on a public clock. A block's proof fields together hold, in this order, the
checks, the quick tag and the part of the block's key that is sent. Specification:
spec/authentication.md, sections 1 and 2.
"""

from dataclasses import dataclass

SUPERFRAME_S = 0.64
"""Duration of a superframe in seconds."""

EPOCH_S = 1_767_225_600
"""Superframe 0 of the public clock was due at 2026-01-01 00:00 UTC (seconds since 1970)."""

PERIOD = 4_147_200
"""Superframes that share a chain of keys: 30.72 days, whole blocks of each kind."""

KEY_BYTES = 8
"""Bytes of a key of a block."""

SENT_BITS = 48
"""Bits of it that are sent; receivers try all values of the others, which saves a quarter of the
time that a key takes."""

HIDDEN_BITS = 8 * KEY_BYTES - SENT_BITS
"""Bits of a key that are not sent."""

CHECK_BITS = 12
"""Bits of a check, and of each of the two symbols of a superframe."""

TAG_BITS = 2 * CHECK_BITS
"""Bits of a superframe's tag, and bits that have to agree before a superframe counts as verified: a
forged one does by chance once in 2**24."""


@dataclass(frozen=True, slots=True)
class ProofLayout:
    """Use of the proof fields of one width.

    Attributes
    ----------
    width : int
        Bits of a superframe's field.
    block : int
        Superframes of a block.
    checks : int
        Checks of the superframes of the block before, at the beginning of the fields.
    """

    width: int
    block: int
    checks: int

    def __post_init__(self) -> None:
        assert self.width * self.block == CHECK_BITS * self.checks + TAG_BITS + SENT_BITS
        assert PERIOD % self.block == 0
        assert CHECK_BITS * self.checks % self.width == 0

    @property
    def quick(self) -> int:
        """Place in the block of the superframe that the quick tag covers: just before the tag."""
        return CHECK_BITS * self.checks // self.width - 1

    @property
    def blocks(self) -> int:
        """Blocks, and keys, of a period."""
        return PERIOD // self.block


LAYOUTS = {layout.width: layout for layout in (ProofLayout(9, 16, 6), ProofLayout(2, 96, 10))}
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


def join(checks: list[int], quick: int, sent: int) -> int:
    """Return a block's fields as one number.

    Examples
    --------
    >>> hex(join([0x123, 0xABC], 0xDEF012, 0x456789ABCDEF))
    '0x123abcdef012456789abcdef'
    """
    number = 0
    for check in checks:
        number = number << CHECK_BITS | check
    return (number << TAG_BITS | quick) << SENT_BITS | sent
