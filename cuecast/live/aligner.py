"""Whole packets of a transport stream out of bytes that begin anywhere.

In: bytes as they arrive; out: packets of 188 bytes; what lies between them is counted.
"""

from cuecast.media.tables import PACKET, SYNC


class Aligner:
    """Cuts a stream of bytes into whole packets; other bytes are skipped.

    Attributes
    ----------
    dropped : int
        Bytes that were no packets.
    """

    def __init__(self) -> None:
        self._held = b""
        self.dropped = 0

    def process(self, data: bytes) -> bytes:
        """Take bytes; return the whole packets that are known now."""
        held = self._held + data if self._held else data
        if len(held) % PACKET == 0 and all(held[i] == SYNC for i in range(0, len(held), PACKET)):
            self._held = b""
            return held
        out, at = bytearray(), 0
        while at + PACKET <= len(held):
            follows = at + PACKET >= len(held) or held[at + PACKET] == SYNC
            if held[at] == SYNC and follows:
                out += held[at : at + PACKET]
                at += PACKET
                continue
            found = held.find(bytes([SYNC]), at + 1)
            found = len(held) if found < 0 else found
            self.dropped += found - at
            at = found
        self._held = held[at:]
        return bytes(out)
