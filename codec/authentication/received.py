"""Superframes of a stream as they arrived, and what their proof fields say, block by block."""

from dataclasses import dataclass, field

from codec.authentication.layout import CHECK_BITS, LAYOUTS, SENT_BITS, TAG_BITS, ProofLayout


@dataclass(slots=True)
class ArrivedSuperframe:
    """A superframe that arrived.

    Attributes
    ----------
    covered : bytes
        The superframe, as far as it is proved.
    proof : (int, int) or None
        Its field and the field's width.
    utc_s : float or None
        When it arrived by a clock that one trusts, seconds since 1970.
    agreed : bool or None
        Whether a tag agreed; None while none has been compared.
    reason : str
        Why it is forged.
    """

    covered: bytes
    proof: tuple[int, int] | None
    utc_s: float | None
    agreed: bool | None = None
    reason: str = ""


@dataclass(slots=True)
class ReceivedProofs:
    """Superframes of a stream in memory, by index.

    Attributes
    ----------
    layout : ProofLayout
        Use of the fields; fields of another width count as lost.
    by_index : dict of int to ArrivedSuperframe
    """

    layout: ProofLayout = field(default_factory=lambda: LAYOUTS[9])
    by_index: dict[int, ArrivedSuperframe] = field(default_factory=dict)

    def between(self, first: int, stop: int) -> dict[int, ArrivedSuperframe]:
        """Return what arrived from index `first` on and before `stop`."""
        known = self.by_index
        return {index: known[index] for index in range(first, stop) if index in known}

    def sent(self, begin: int) -> int | None:
        """Return the bits of the key of the block that begins at an index, None if one is lost."""
        return self._bits(begin, CHECK_BITS * self.layout.checks + TAG_BITS, SENT_BITS)

    def quick(self, begin: int) -> tuple[int, bytes] | None:
        """Return a block's quick tag and the bytes it covers, None if one of them is lost."""
        arrived = self.by_index.get(begin + self.layout.quick)
        tag = self._bits(begin, CHECK_BITS * self.layout.checks, TAG_BITS)
        return None if arrived is None or tag is None else (tag, arrived.covered)

    def checks(self, begin: int, without: int | None = None) -> dict[int, int]:
        """Return the checks of a block that arrived, by number; as if one superframe had not."""
        found = {}
        for check in range(self.layout.checks):
            value = self._bits(begin, CHECK_BITS * check, CHECK_BITS, without)
            if value is not None:
                found[check] = value
        return found

    def _bits(self, begin: int, at: int, count: int, without: int | None = None) -> int | None:
        """Return some bits of a block's fields, None where one of the fields was lost."""
        width, value = self.layout.width, 0
        first, last = at // width, (at + count - 1) // width
        for index in range(begin + first, begin + last + 1):
            arrived = self.by_index.get(index)
            if arrived is None or arrived.proof is None or index == without:
                return None
            if arrived.proof[1] != width:
                return None
            value = value << width | arrived.proof[0]
        return value >> (last + 1) * width - at - count & (1 << count) - 1
