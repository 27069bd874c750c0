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
    epoch, until : int and int or None
        Number of the sound that goes out, and the end of its last packet that began to.
    """

    def __init__(self) -> None:
        self.came = self.stale = self.pid = self.epoch = 0
        self.until: int | None = None
        self._waiting: deque[tuple[int, MarkedPes]] = deque()
        self._pending, self._begins = b"", False
        self._counter = 0

    def put(self, epoch: int, pes: MarkedPes) -> None:
        """Take a marked packet of the sound with this number."""
        self.came += 1
        self._waiting.append((epoch, pes))

    def forget(self, epoch: int, pts: int, keeps: int | None = None) -> None:
        """Leave out marked packets that come too late for `pts`, and those of former sounds.

        Those of the sound with the number `keeps` are still to go out.
        """
        waiting = self._waiting
        while waiting and waiting[0][0] != keeps:
            number, mark = waiting[0]
            if number > epoch or (number == epoch and step(mark.end, pts) >= -STALE):
                return
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
            first = self._first(epoch, pts)
            if first == len(waiting):
                return False
            reached = waiting[first][1].pts
        for number, mark in itertools.islice(waiting, first, None):
            if step(reached, pts) >= wanted or number != epoch or not _follows(mark, reached):
                break
            reached = mark.end
        return step(reached, pts) >= wanted

    def _first(self, epoch: int, pts: int) -> int:
        """Return the place of the marked packet that this time begins with, past all if none does.

        It begins at most its own length later.
        """
        for place, (number, mark) in enumerate(self._waiting):
            if (
                number == epoch
                and step(mark.pts, pts) <= mark.end - mark.pts
                and step(mark.end, pts) > 0
            ):
                return place
        return len(self._waiting)

    def begin(self, epoch: int, pts: int, before: int | None) -> bytes:
        """Go on with the marked sound of this time, which `covers` found.

        Return the packets of that before it with the number `before`; others are left out.
        """
        out = b"" if before is None else self.last(before)
        for _ in range(self._first(epoch, pts)):
            self._waiting.popleft()
        self.epoch, self.until = epoch, self._waiting[0][1].pts
        return out + self._whole()

    def rest(self, pts: int) -> bytes:
        """Return the packets up to this time, whose own sound follows."""
        out = self._whole()
        while (mark := self._following()) and step(mark.end, pts) <= (mark.end - mark.pts) // 2:
            self._waiting.popleft()
            out += self._whole(mark)
        return out

    def last(self, epoch: int) -> bytes:
        """Return all packets of the sound with this number, leaving out those of former ones."""
        out = self._whole()
        while self._waiting and self._waiting[0][0] < epoch:
            self._waiting.popleft()
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
        mark = self._following()
        return 0 if pts is None or mark is None else step(pts, mark.pts)

    def _following(self) -> MarkedPes | None:
        """Return the next marked packet of the sound, None behind a hole."""
        if not self._waiting or self.until is None:
            return None
        epoch, mark = self._waiting[0]
        return mark if epoch == self.epoch and _follows(mark, self.until) else None

    @property
    def under_way(self) -> bool:
        """Whether a packet is going out while the next one waits."""
        return bool(self._pending) and self._following() is not None

    def next(self, pts: int | None, fields: bytes = b"") -> bytes:
        """Return the next packet, or an empty one where its sound would be too early at `pts`.

        `fields` are those of the packet whose place it takes.
        """
        mark = None if self._pending or pts is None else self._following()
        if mark is not None and step(mark.pts, pts or 0) <= mark.end - mark.pts:
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


def _follows(mark: MarkedPes, until: int) -> bool:
    """Whether marked sound begins at most its own length from the end of that before."""
    return abs(step(mark.pts, until)) <= mark.end - mark.pts
