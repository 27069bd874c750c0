"""Bit rates of coded sounds, measured where headers state none or that of the first frame."""

import os
from collections import deque
from fractions import Fraction

from receiver.media.programme import open_programme

_RATE_SCAN_S, _RATE_SCAN_ENOUGH_S = 600, 30
"""How many seconds of a programme are read at most to learn a bit rate that its headers do not
state, and how many that are not silent."""

_SILENT_BITS = 12_000
"""Bits per second and channel below which AAC is taken for silence: of digital silence FFmpeg makes
4000, and the least on air has 16000."""


class RateMeter:
    """Bit rate of a coded sound: the mean of its fullest seconds, for silence takes few bits.

    Examples
    --------
    >>> meter = RateMeter()
    >>> for bits in (4_000, 5_000, 128_000, 132_000):
    ...     complete = meter.add(bits, 1.0)
    >>> meter.rate(2), RateMeter().rate(2)
    (130000, 0)
    """

    def __init__(self) -> None:
        self._seconds: deque[float] = deque(maxlen=_RATE_SCAN_S)
        self._bits, self._length_s = 0, 0.0

    def add(self, bits: int, length_s: float) -> bool:
        """Take a frame; return whether it completes a second."""
        self._bits, self._length_s = self._bits + bits, self._length_s + length_s
        complete = self._length_s >= 1
        if complete:
            self._seconds.append(self._bits / self._length_s)
            self._bits, self._length_s = 0, 0.0
        return complete

    def full(self) -> list[float]:
        """Return the rates of the seconds that have at least half as much as the fullest."""
        seconds = list(self._seconds)
        if not seconds and self._length_s:
            seconds = [self._bits / self._length_s]
        return [rate for rate in seconds if rate >= max(seconds) / 2]

    def rate(self, channels: int) -> int:
        """Return the rate in bit/s, 0 where there was nothing, or nothing but silence."""
        full = self.full()
        mean = sum(full) / len(full) if full else 0.0
        return round(mean) if mean >= _SILENT_BITS * channels else 0


def measured_bit_rate(path: str | os.PathLike[str], *, track: int = 0) -> int:
    """Return the bit rate of a sound whose container does not state it, in bit/s.

    Reads the packets of half a minute that is not silent, if there is one in ten minutes; 0 if they
    have no durations, or there is none.
    """
    meter, length = RateMeter(), Fraction(0)
    with open_programme(path, track=track) as programme:
        framing = 0
        for packet in programme.container.demux(programme.sound):
            if packet.duration and packet.time_base is not None:
                if not length:
                    framing = _framing(bytes(packet)[:2], programme.format.codec)
                length += packet.duration * packet.time_base
                bits = 8 * (packet.size - framing)
                complete = meter.add(bits, float(packet.duration * packet.time_base))
                if (complete and len(meter.full()) >= _RATE_SCAN_ENOUGH_S) or length > _RATE_SCAN_S:
                    break
        return meter.rate(programme.format.channels)


def _framing(opening: bytes, codec: str) -> int:
    """Bytes of a packet that are the header of ADTS (ISO 13818-7, 6.2), which has no CRC or one."""
    if not codec.startswith("aac") or len(opening) < 2 or opening[0] != 0xFF:
        return 0
    return 0 if opening[1] & 0xF6 != 0xF0 else 7 if opening[1] & 1 else 9
