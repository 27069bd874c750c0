"""Marked sound on its way into a transport stream: PES packets in, packets of 188 bytes out.

It knows how far the marked sound has gone out, and whether the rest covers the programme's next
PES packet. Times are ticks of `cuecast.live.packets`.
"""

import itertools
from collections import deque

from cuecast.live.options import MarkedPes
from cuecast.live.packets import NULL_PACKET, TICKS_HZ, packed, room, step

STALE = round(0.3 * TICKS_HZ)
"""Marked sound that is later than this is not sent any more."""


class MarkedSound:
    """Marked packets that wait to go out, and the one that is going out.

    Attributes
    ----------
    came, stale : int
        Packets that came in, and that came too late to go out.
    pid : int
        Of the sound that leaves.
    until : int or None
        End of the last packet that began to go out.
    """

    def __init__(self) -> None:
        self.came = self.stale = self.pid = 0
        self.until: int | None = None
        self._waiting: deque[tuple[int, MarkedPes]] = deque()
        self._pending, self._begins = b"", False
        self._counter = 0

    def put(self, epoch: int, pes: MarkedPes) -> None:
        """Take a marked packet of the sound with this number."""
        self.came += 1
        self._waiting.append((epoch, pes))

    def forget(self, epoch: int, pts: int, *, jumped: bool) -> None:
        """Leave out marked packets of a former sound, and late ones unless the clock jumped."""
        waiting = self._waiting
        while waiting and (
            waiting[0][0] < epoch or (step(waiting[0][1].end, pts) < -STALE and not jumped)
        ):
            waiting.popleft()
            self.stale += 1

    def covers(self, epoch: int, pts: int, wanted: int, *, follows: bool) -> bool:
        """Return whether marked sound goes on from `pts` for `wanted` ticks, without a hole.

        Parameters
        ----------
        epoch : int
            Number of the sound.
        pts, wanted : int
        follows : bool
            Whether marked sound goes out up to `pts`.
        """
        waiting = self._waiting
        if follows and self.until is not None:
            first, reached = 0, self.until
        else:
            first = self._first(pts)
            if first == len(waiting):
                return False
            reached = waiting[first][1].pts
        for number, mark in itertools.islice(waiting, first, None):
            if (
                step(reached, pts) >= wanted
                or number != epoch
                or step(mark.pts, reached) > mark.end - mark.pts
            ):
                break
            reached = mark.end
        return step(reached, pts) >= wanted

    def _first(self, pts: int) -> int:
        """Return the place of the marked packet that this time begins with, past all if none does.

        Behind a jump of the clock it comes after those of before.
        """
        covering = [
            n
            for n, (_, mark) in enumerate(self._waiting)
            if step(mark.pts, pts) <= mark.end - mark.pts and step(mark.end, pts) > 0
        ]
        while len(covering) > 1 and covering[-2] == covering[-1] - 1:
            covering.pop()
        return covering[-1] if covering else len(self._waiting)

    def begin(self, pts: int, *, jumped: bool) -> bytes:
        """Go on with the marked sound of this time; return the packets of that before.

        It belongs there where the programme's clock jumped; else it is left out.
        """
        out = self._whole()
        for _ in range(self._first(pts)):
            _, mark = self._waiting.popleft()
            out += self._whole(mark) if jumped else b""
        return out

    def rest(self, pts: int) -> bytes:
        """Return the packets up to this time, whose own sound follows."""
        out, waiting = self._whole(), self._waiting
        while waiting and self.until is not None:
            mark = waiting[0][1]
            length = mark.end - mark.pts
            if step(mark.pts, self.until) > length or step(mark.end, pts) > length // 2:
                break
            out += self._whole(waiting.popleft()[1])
        return out

    def last(self, epoch: int) -> bytes:
        """Return all packets of the sound with this number."""
        out = self._whole()
        while self._waiting and self._waiting[0][0] == epoch:
            out += self._whole(self._waiting.popleft()[1])
        return out

    def _whole(self, mark: MarkedPes | None = None) -> bytes:
        """Return the rest of the packet that is going out, and this one."""
        out = b""
        while self._pending:
            out += self._piece()
        if mark is not None:
            self._start(mark)
            out += self._whole()
        return out

    def late(self, pts: int | None) -> int:
        """Return how far the next marked packet is behind this time."""
        if pts is None or not self._waiting:
            return 0
        return step(pts, self._waiting[0][1].pts)

    @property
    def under_way(self) -> bool:
        """Whether a packet is going out while the next one waits."""
        return bool(self._pending and self._waiting)

    def next(self, pts: int | None, fields: bytes = b"") -> bytes:
        """Return the next packet, or an empty one where its sound would be too early at `pts`.

        `fields` are those of the packet whose place it takes.
        """
        if not self._pending and self._waiting and pts is not None:
            mark = self._waiting[0][1]
            if step(mark.pts, pts) <= mark.end - mark.pts:
                self._waiting.popleft()
                self._start(mark)
        if self._pending:
            return self._piece(fields)
        if not fields:
            return NULL_PACKET
        return packed(self.pid, self._counter, b"", starts=False, fields=fields)

    def _start(self, mark: MarkedPes) -> None:
        self._pending, self._begins, self.until = mark.data, True, mark.end

    def _piece(self, fields: bytes = b"") -> bytes:
        size = room(fields)
        payload, self._pending = self._pending[:size], self._pending[size:]
        self._counter = (self._counter + 1) & 15
        starts, self._begins = self._begins, False
        return packed(self.pid, self._counter, payload, starts=starts, fields=fields)

    def renumbered(self, packet: bytes) -> bytes:
        """Return a packet of the programme's own sound with the counter that follows."""
        if self.until is None:  # none was exchanged yet
            self._counter = packet[3] & 15
            return packet
        if packet[3] & 0x10:
            self._counter = (self._counter + 1) & 15
        return packet[:3] + bytes([packet[3] & 0xF0 | self._counter]) + packet[4:]
