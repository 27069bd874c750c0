"""Joints of a recording, where the clock of its containers jumps, as at cuts and splices.

Time stamps of MPEG's streams jump where a broadcaster changes over, and where recordings were put
together (ISO/IEC 13818-1, 2.7.4). Behind a joint everything goes on where it was, in step.
"""

from collections import deque
from fractions import Fraction
from typing import Any

FORMATS = "mpegts", "mpeg"
"""Containers whose clock may jump, by FFmpeg's names."""

_BACK_S = Fraction(1, 2)
"""Time stamps of one stream that go back by more are a jump."""

_FORWARD_S = 10
"""Time stamps that go forward by more are one, too; less is a hole."""

_LEAD_S = 2
"""How much earlier one stream may begin behind a joint than another: what waits in decoders of
sound and picture differs by a second at most (ISO/IEC 13818-1, 2.4.2.6)."""

_REMEMBERED = 8
"""Clocks that a stream may come back to."""


class Joints:
    """The way of a container's time stamps to one clock.

    Attributes
    ----------
    count : int
        Jumps so far.

    Examples
    --------
    >>> joints = Joints()
    >>> [float(joints.place(0, Fraction(s), Fraction(1))) for s in (100, 101, 5, 6, 101, 104)]
    [100.0, 101.0, 102.0, 103.0, 104.0, 107.0]
    >>> joints.count
    2
    """

    def __init__(self) -> None:
        self.count = 0
        self._offsets: deque[Fraction] = deque([Fraction(0)], _REMEMBERED)
        self._streams: dict[Any, tuple[Fraction, Fraction]] = {}

    def move(self, packet: Any, key: Any) -> None:
        """Move the time stamps of a packet of the stream `key`; those of text follow the others."""
        stamp = packet.dts if packet.dts is not None else packet.pts
        if stamp is None or packet.time_base is None:
            return
        steady = packet.stream.type in ("audio", "video")
        at = stamp * packet.time_base
        length = (packet.duration or 0) * packet.time_base
        moved = self.place(key, at, length) if steady else self._beside(at)
        ticks = round((moved - at) / packet.time_base)
        if ticks:
            packet.dts = None if packet.dts is None else packet.dts + ticks
            packet.pts = None if packet.pts is None else packet.pts + ticks

    def place(self, key: Any, at: Fraction, length: Fraction) -> Fraction:
        """Return the time in seconds of sound or picture of the stream `key`."""
        offset, end = self._streams.get(key, (None, None))
        if offset is None or end is None:
            moved = self._beside(at)
        elif -_BACK_S <= at + offset - end <= _FORWARD_S:
            moved = at + offset
        else:
            moved = self._behind_joint(at, end)
        end = moved + length if end is None else max(end, moved + length)
        self._streams[key] = moved - at, end
        return moved

    def _beside(self, at: Fraction) -> Fraction:
        """Return the time of a stream without a clock of its own so far: as others have it."""
        now = self._now
        if now is None:
            return at
        return min((at + one for one in reversed(self._offsets)), key=lambda to: abs(to - now))

    def _behind_joint(self, at: Fraction, end: Fraction) -> Fraction:
        for offset in reversed(self._offsets):
            if -_LEAD_S <= at + offset - end <= _FORWARD_S:
                return at + offset
        self.count += 1
        now = self._now
        assert now is not None
        self._offsets.append(now - at)
        return now

    @property
    def _now(self) -> Fraction | None:
        return max((end for _, end in self._streams.values()), default=None)
