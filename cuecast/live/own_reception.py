"""The sender's own receiver: the output is received and compared with the superframes sent.

`cuecast.live.own_receiver`, in a process of its own, takes the sound's PES packets as they go out
and yields the superframes that it receives. `ReceptionCount`, in the playout, knows which
superframes went out whole, and reports the share received, minute by minute.
"""

import queue
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

import numpy as np

from codec.errors import CueError
from cuecast.live.options import RunClock
from cuecast.live.packets import PERIOD, TICKS_HZ, Pes, step
from watermark.link.superframe import SUPERFRAME_S

ENOUGH = 0.98
"""Share received in a minute below which an alarm is raised."""

_MINUTE_S = 60.0
"""Seconds of output in a report, as operators read logs by the minute."""

_SAME = round(0.25 * TICKS_HZ)
"""Ticks within which a received superframe is one that went out: coders delay it by up to .1 s."""

_JOINED = round(0.08 * TICKS_HZ)
"""Ticks between two stretches of sound that are one."""

_SETTLED_S = 12.0
"""Seconds of sound that the receiver has to have heard after a superframe which it did not receive:
it may tune in meanwhile, and on a busy machine it lags."""

_GIVEN_UP_S = 90.0
"""Seconds after which a superframe is not judged: the receiver stopped, or the clock changed."""

_PROGRESS = 16
"""PES packets between reports of how far the receiver has heard."""

_SETTLED = round(_SETTLED_S * TICKS_HZ)

_LENGTH = round(SUPERFRAME_S * TICKS_HZ)

_WAITING = 2000
"""PES packets that may wait for the receiver."""

_NICENESS = 10
"""How far the receiver's priority is below the playout's."""


@dataclass(frozen=True, slots=True)
class MinuteReport:
    """Superframes of a minute that went out whole, and those of them that were received."""

    sent: int
    received: int

    @property
    def share(self) -> float:
        """Share received, 1 of none."""
        return self.received / self.sent if self.sent else 1.0

    @property
    def alarms(self) -> bool:
        """Whether fewer arrived than ought to."""
        return self.share < ENOUGH

    def __str__(self) -> str:
        alarm = f"alarm, below {100 * ENOUGH:.0f} %: " if self.alarms else ""
        return (
            f"{alarm}read back {self.received} of {self.sent} superframes of the last minute "
            f"({100 * self.share:.1f} %)"
        )


class ReceptionCount:
    """Compares the superframes sent with those received.

    Attributes
    ----------
    sent, received : int
        Superframes so far, up to some seconds ago.
    last : MinuteReport or None
        Of the last whole minute with output.
    alarms : int
        Minutes with an alarm.
    """

    def __init__(self) -> None:
        self._clocks: deque[RunClock] = deque(maxlen=8)
        self._until: int | None = None
        self._next: int | None = None
        self._open: deque[tuple[float, int]] = deque()
        self._arrived: deque[int] = deque(maxlen=256)
        self._heard: int | None = None
        self._minute = [0.0, 0, 0]
        self.sent = self.received = self.alarms = 0
        self.last: MinuteReport | None = None

    def clock(self, clock: RunClock) -> None:
        """Take the clock of the sound that is being marked."""
        if clock not in self._clocks:
            self._clocks.append(clock)

    def went_out(self, pts: int, length: int, marked: bool, now_s: float) -> None:
        """Take a stretch of sound that goes out, in ticks, marked or not."""
        if not marked:
            self._until = None
            return
        if self._until is None or abs(step(pts, self._until)) > _JOINED:
            self._next = None
        self._until = (pts + length) % PERIOD
        clock = self._clock_at(pts)
        if clock is None:
            return
        if self._next is None:
            self._next = _next_start(clock, pts)
        while step(self._until, self._next) >= _LENGTH:
            self._open.append((now_s, self._next))
            self._next = _next_start(clock, (self._next + _LENGTH // 2) % PERIOD)

    def _clock_at(self, pts: int) -> RunClock | None:
        """Return the clock of the run that a time stamp is of: the last one to begin before it."""
        for clock in reversed(self._clocks):
            if step(pts, clock.stamp) > -_JOINED:
                return clock
        return None

    def arrived(self, stamp: int) -> None:
        """Take the time stamp of a superframe that was received."""
        self._arrived.append(stamp)

    def heard(self, stamp: int) -> None:
        """Take the time stamp up to which the receiver has heard the sound."""
        self._heard = stamp

    def settle(self, now_s: float) -> MinuteReport | None:
        """Count superframes that are certain by now; return the report of a minute that is over."""
        while self._open:
            went_s, start = self._open[0]
            judged = self._heard is not None and step(self._heard, start) > _SETTLED
            if not judged and now_s - went_s < _GIVEN_UP_S:
                break
            self._open.popleft()
            if not judged:
                continue
            found = any(abs(step(one, start)) <= _SAME for one in self._arrived)
            self.sent += 1
            self.received += found
            self._minute[1] += 1
            self._minute[2] += found
        if now_s - self._minute[0] < _MINUTE_S:
            return None
        _, sent, received = self._minute
        begun = bool(self._minute[0])
        self._minute = [now_s, 0, 0]
        if not begun or not sent:
            return None
        self.last = MinuteReport(int(sent), int(received))
        self.alarms += self.last.alarms
        return self.last


def _next_start(clock: RunClock, pts: int) -> int:
    """Return the stamp of the first superframe of a run that begins at a stamp or after it."""
    number = np.ceil((clock.at(pts) - clock.grid_s) / SUPERFRAME_S - 1e-3)
    ahead_s = clock.grid_s + float(number) * SUPERFRAME_S - clock.at(pts)
    return (pts + round(ahead_s * TICKS_HZ)) % PERIOD


class ReceivingProcess:
    """A process that receives the playout's output.

    Parameters
    ----------
    key : int
    through : str or None
        See `OwnReceiver`.
    tell : callable
        Called if the process ended.
    """

    def __init__(self, key: int, through: str | None, tell: Callable[[str], None]) -> None:
        context = get_context("spawn")
        self._packets: Any = context.Queue(_WAITING)
        self._results, theirs = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_receive, args=(key, through, self._packets, theirs), daemon=True
        )
        self._process.start()
        theirs.close()
        self._tell = tell
        self.alive = True

    def send(self, kind: str, pes: Pes) -> bool:
        """Give it a PES packet that goes out; return whether there was room for it."""
        try:
            self._packets.put_nowait((kind, pes))
        except (queue.Full, ValueError, OSError):
            return False
        return True

    def results(self) -> Iterator[tuple[str, int]]:
        """Yield ``arrived`` or ``heard`` with a time stamp, as of `ReceptionCount`."""
        try:
            while self.alive and self._results.poll(0):
                yield self._results.recv()
        except (EOFError, OSError):
            self.alive = False
            self._tell(f"the receiver of the own output ended ({self._process.exitcode})")

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.join(5.0)
        self._packets.cancel_join_thread()
        self._packets.close()
        self._results.close()


class OwnOutput:
    """The playout's output, received again: a `cuecast.live.multiplex.Watch`.

    Parameters
    ----------
    key, through, tell
        As of `ReceivingProcess`.

    Attributes
    ----------
    count : ReceptionCount
    """

    def __init__(self, key: int, through: str | None, tell: Callable[[str], None]) -> None:
        self._arguments = key, through, tell
        self._tell = tell
        self._process: ReceivingProcess | None = None
        self._missed = False
        self.count = ReceptionCount()

    def went_out(self, pts: int, length: int, marked: bool) -> None:
        """Take the time stamp and the length of a stretch of sound, ticks."""
        if self._process is not None:
            missed, self._missed = self._missed, False
            self.count.went_out(pts, length, marked and not missed, time.monotonic())

    def sound(self, kind: str, pes: Pes) -> None:
        """Take a PES packet of the sound; one that the receiver is too slow for is not judged."""
        if self._process is not None:
            self._missed |= not self._process.send(kind, pes)

    def look(self) -> None:
        """Take received superframes; log a minute's result. The first call starts receiving."""
        if self._process is None:
            self._process = ReceivingProcess(*self._arguments)
        for kind, stamp in self._process.results():
            (self.count.arrived if kind == "arrived" else self.count.heard)(stamp)
        report = self.count.settle(time.monotonic())
        if report is not None:
            self._tell(str(report))

    def figures(self) -> dict[str, float]:
        """Return the figures of `/metrics`."""
        count = self.count
        return {
            "read_back_sent_total": count.sent,
            "read_back_received_total": count.received,
            "read_back_share": count.last.share if count.last else 0.0,
            "read_back_alarms_total": count.alarms,
        }

    def close(self) -> None:
        """End the receiving process."""
        if self._process is not None:
            self._process.close()


def _receive(key: int, through: str | None, packets: Any, results: Any) -> None:
    """Receive until the playout is gone, with what the marking leaves of the processor."""
    import os
    import signal

    from cuecast.live.own_receiver import OwnReceiver

    for number in (signal.SIGINT, signal.SIGHUP):  # of the terminal, for the playout
        signal.signal(number, signal.SIG_IGN)
    os.nice(_NICENESS)
    parent, count = os.getppid(), 0
    receiver = OwnReceiver(key, through)
    try:
        while True:
            try:
                kind, pes = packets.get(timeout=1.0)
            except queue.Empty:
                if os.getppid() != parent:
                    return
                continue
            try:
                for stamp in receiver.process(kind, pes):
                    results.send(("arrived", stamp))
                count += 1
                if count % _PROGRESS == 0 and pes.pts is not None:
                    results.send(("heard", pes.pts))
            except CueError:  # a form that cannot be received: nothing is sent in it either
                continue
    except (BrokenPipeError, EOFError, KeyboardInterrupt):
        return
