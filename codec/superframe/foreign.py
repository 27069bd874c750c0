"""Streams that a receiver cannot draw: how it recognises and reports them.

A part whose check fails is damaged or of another coding; two different ones in a row with the same
other identity are another stream's. The pieces of its slow channel can be read all the same: they
stand first and depend on no tables. Specification: spec/bitstream.md, H6 and section 10.
"""

from codec.superframe.bits import HEADER_BYTES, read_header
from codec.superframe.checks import CRC16_BYTES, heard_mask, is_compact
from codec.superframe.range_coder import RangeDecoder
from codec.superframe.slow_channel import SlowReceiver

_PIECE_BITS = 16
"""Bits of a piece of the slow channel (spec/bitstream.md, section 3.3)."""


class ForeignStream:
    """Another coding's parts, as far as they can be distinguished from damaged ones.

    Attributes
    ----------
    slow : SlowReceiver
        Registers of its slow channel.
    """

    def __init__(self) -> None:
        self.slow = SlowReceiver()
        self._before: tuple[int, bytes] | None = None
        self._number = -1

    def own(self) -> None:
        """Note that a part of one's own coding arrived."""
        self._before = None

    def take(self, l0: bytes) -> bool:
        """Take a part that is not of one's own coding; return whether it is another stream's.

        Parameters
        ----------
        l0 : bytes
            Of a possible length, not compact.
        """
        number, before = heard_mask(l0), self._before
        self._before = number, l0
        known = number == self._number
        alike = before is not None and before[0] == number and before[1] != l0
        if alike or known:
            self._number = number
            for part in [l0] if known or before is None else [before[1], l0]:
                self._read(part)
        return alike

    def _read(self, l0: bytes) -> None:
        header = read_header(l0)
        decoder = RangeDecoder(l0[HEADER_BYTES:-CRC16_BYTES], tail=header.tail)
        for _ in range(header.slow):
            self.slow.take(decoder.get_bits(_PIECE_BITS))

    def describe(self, l0: bytes) -> str:
        """Return the known facts about the stream, to stand between commas; "" if none."""
        told = [] if is_compact(l0) else [f"its identity begins with {heard_mask(l0):04x}"]
        if self.slow.language:
            told.append(f"its language is {self.slow.language!r}")
        if self.slow.coding:
            where = f", offered by {self.slow.host}" if self.slow.host else ""
            told.append(f"its coding is {self.slow.coding}{where}")
        return ", ".join(told)
