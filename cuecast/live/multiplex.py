"""A transport stream held for a while, with one of its sounds exchanged.

Packets in; the same packets out later, in the same order, with all times, clocks and tables as
they were. Only the packets of one sound carry other bytes: those that are marked by then, or their
own as long as there are none. No input, output or clock of its own: times are given.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

from cuecast.live.frames import KINDS
from cuecast.live.marked_sound import STALE, MarkedSound
from cuecast.live.options import MarkedPes
from cuecast.live.packets import (
    PERIOD,
    TICKS_HZ,
    Pes,
    PesReader,
    clock_of,
    kept_fields,
    pid_of,
    read_stamp,
    step,
)
from cuecast.media.subtitles import FRENCH
from cuecast.media.tables import (
    NULL_PID,
    PACKET,
    ElementaryStream,
    ProgrammeMap,
    TableReader,
    payload_of,
)

_BEHIND, _FAR_BEHIND = round(0.02 * TICKS_HZ), round(0.08 * TICKS_HZ)
"""Lateness in ticks: beyond it empty packets, and further packets, carry the sound too."""

_BURST, _LONGEST_BURST = 4, 32
"""Packets at most in place of one where marked sound is far behind, and half of `STALE`: sound
that is left out is heard."""

_RESUMED = 0.2
"""Share of the delay for which marked sound has to be ready before marking resumes after a bypass:
on a busy machine a shorter stretch would end at once, and each change is a joint in the sound."""

TIES = "_send", "_tell", "_wait", "_watch"
"""Functions outside of a passage; everything else follows from its calls alone."""

_LONGEST_TICK_S = 1.0
"""A greater step of the stream's clock is a new beginning of it."""

_LONGEST_PACKET_S = 6.0
"""A greater step between the time stamps of the sound likewise, and one back by `STALE`."""

_MOST_SLOTS = 512
"""Packets of a PES whose time is shared: one of sound has 64 KiB at most (ISO/IEC 13818-1,
2.4.3.7), and a sound may be made that never begins another."""

_TOLD_S = 10.0
"""Seconds between two lines on jumps: a stream can be made to jump with each packet."""

READ_ON_S, MOST_HELD = 12.0, 256 << 20
"""Seconds beyond the delay, by the stream's own clock, that packets wait for marked sound at most;
one packet can hold 4.8 s of silence, FFmpeg's of AAC (13 bytes a frame). And bytes that wait at
most where that clock stands still: the delay at 400 Mbit/s."""


class Send(Protocol):
    """Takes a message for the marking process."""

    def __call__(self, *message: object) -> None:
        """Take it."""


@dataclass(slots=True)
class _Slot:
    """A packet of the sound: its share of its PES's time, whether that begins with it, and its end.

    The end is that of a PES that begins with it, once it is known.
    """

    epoch: int
    pts: int | None
    starts: bool
    end: int | None = None


@dataclass(frozen=True, slots=True)
class _HeldPackets:
    """Some packets that wait for their time, and which of them are of the sound."""

    due_s: float
    data: bytes
    slots: dict[int, _Slot]


class Watch(Protocol):
    """Takes notice of the sound that goes out."""

    def went_out(self, pts: int, length: int, marked: bool) -> None:
        """Take the time stamp and the length of a stretch of sound, ticks."""

    def sound(self, kind: str, pes: Pes) -> None:
        """Take a PES packet of the sound."""


class Multiplex:
    """The stream between its arrival and its departure.

    Parameters
    ----------
    delay_s : float
    send : callable
        Takes ``sound, epoch, kind, Pes`` and ``subtitle, pts, bytes``.
    track : int
        Which sound of those that can be marked.
    tell : callable
    wait : callable, optional
        Called where marked sound is missing; returns whether asking again makes sense.
    by_stream : bool
        Whether the delay is one of the stream's own clock, whatever the time of day.
    watch : Watch, optional
        Takes notice of the sound that goes out.

    Attributes
    ----------
    figures : dict of str to float
    held_bytes : int
        How much waits.
    """

    def __init__(
        self, delay_s: float, send: Send, *, track: int = 0,
        tell: Callable[[str], None] = lambda line: None,
        wait: Callable[[], bool] = lambda: False, by_stream: bool = False,
        programme: int | None = None, watch: Watch | None = None,
    ) -> None:  # fmt: skip
        self._delay_s, self._send, self._tell, self._wait = delay_s, send, tell, wait
        self._track, self._by_stream, self._programme = track, by_stream, programme
        self._tables = TableReader(programme)
        self._sound: ElementaryStream | None = None
        self._chosen = False
        self._reader, self._texts = PesReader(), dict[int, PesReader]()
        self._watch, self._out = watch, PesReader()
        self._kinds: dict[int, str] = {}
        self._leaving = 0
        self._epoch = 0
        self._under_way: list[_Slot] = []
        self._heard: int | None = None
        self._came_s, self._told_s = 0.0, -_TOLD_S
        self._held: deque[_HeldPackets] = deque()
        self.held_bytes = 0
        self._due_s = self._stream_s = 0.0
        self._clock_s: float | None = None
        self._has_clock = False
        self._marked, self._marking = MarkedSound(), False
        self._last: int | None = None
        self._now: int | None = None
        self.figures = dict.fromkeys(
            ("packets_total", "packets_lost_total", "marked_seconds_total",
             "bypass_seconds_total", "bypasses_total", "stale_packets_total"), 0.0
        )  # fmt: skip

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in TIES}

    def tie(self, **ties: Any) -> None:
        """Set the functions that a pickled one comes without: `TIES`, without their underscore."""
        vars(self).update({f"_{name}": one for name, one in ties.items()})

    @property
    def marking(self) -> bool:
        """Whether the sound that goes out is marked."""
        return self._marking

    @property
    def marks(self) -> int:
        """Marked packets that came in."""
        return self._marked.came

    @property
    def audible(self) -> bool:
        """Whether there is a sound that can be marked, as far as the tables have been read."""
        return self._tables.programme is None or self._sound is not None

    @property
    def held_s(self) -> float:
        """How long the oldest packet has still to wait, by the clock that counts."""
        return self._held[0].due_s if self._held else float("inf")

    @property
    def can_wait(self) -> bool:
        """Whether the packets on their way out can wait for further input."""
        return self._stream_s - self._due_s <= READ_ON_S and self.held_bytes <= MOST_HELD

    def take(self, data: bytes, now_s: float) -> None:
        """Take whole packets that arrived at `now_s`."""
        slots: dict[int, _Slot] = {}
        self._came_s = now_s
        tables, sound = self._tables.pids, -1 if self._sound is None else self._sound.pid
        self.figures["packets_total"] += len(data) // PACKET
        for at in range(0, len(data), PACKET):
            pid = (data[at + 1] & 0x1F) << 8 | data[at + 2]
            if pid != sound and pid not in tables and pid not in self._texts:
                if data[at + 3] & 0x20:
                    self._tick(data[at : at + PACKET], pid)
                continue
            packet = data[at : at + PACKET]
            self._tick(packet, pid)
            if pid == sound:
                slots[at] = self._hear(packet)
            elif pid in tables:
                if self._tables.process(packet):
                    self._choose()
                tables, sound = self._tables.pids, -1 if self._sound is None else self._sound.pid
            else:
                for pes in self._texts[pid].process(packet):
                    self._read(pes)
        due_s = (self._stream_s if self._by_stream else now_s) + self._delay_s
        self._held.append(_HeldPackets(due_s, data, slots))
        self.held_bytes += len(data)

    def _tick(self, packet: bytes, pid: int) -> None:
        """Follow the programme's clock, and the sound's time stamps where there is none."""
        programme = self._tables.programme
        if programme is None or pid != programme.pcr_pid:
            return
        clock_s = clock_of(packet)
        if clock_s is None:
            return
        if not self._has_clock:
            self._has_clock, self._clock_s = True, None
        self._follow(clock_s, _LONGEST_TICK_S)

    def _follow(self, clock_s: float, longest_s: float) -> None:
        if self._clock_s is not None and 0 < clock_s - self._clock_s < longest_s:
            self._stream_s += clock_s - self._clock_s
        self._clock_s = clock_s

    def _hear(self, packet: bytes) -> _Slot:
        assert self._sound is not None
        starts = bool(packet[1] & 0x40)
        if starts:
            head = payload_of(packet)
            told = len(head) > 13 and head[:3] == b"\x00\x00\x01" and head[7] & 0x80
            pts = read_stamp(head[9:14]) if told else None
            if pts is not None and not self._has_clock:
                self._follow(pts / TICKS_HZ, _LONGEST_PACKET_S)
            self._share(pts)
            if pts is not None:
                self._join(pts)
        else:
            pts = self._under_way[0].pts if self._under_way else None
        slot = _Slot(self._epoch, pts, starts)
        if len(self._under_way) < _MOST_SLOTS:
            self._under_way.append(slot)
        lost = self._reader.lost
        for pes in self._reader.process(packet):
            self._send("sound", self._epoch, self._sound.kind, pes)
        self.figures["packets_lost_total"] += self._reader.lost - lost
        return slot

    def _join(self, pts: int) -> None:
        """Begin another sound where the time stamps of this one jump."""
        before, self._heard = self._heard, pts
        if before is None or -STALE <= step(pts, before) < _LONGEST_PACKET_S * TICKS_HZ:
            return
        assert self._sound is not None
        self.end()
        self._begin(self._sound)
        if abs(self._came_s - self._told_s) >= _TOLD_S:
            self._told_s = self._came_s
            self._tell(f"sound: a jump by {step(pts, before) / TICKS_HZ:.1f} s")

    def _begin(self, sound: ElementaryStream | None) -> None:
        """Give the sound from here on a number of its own."""
        self._epoch += 1
        self._kinds = {e: kind for e, kind in self._kinds.items() if e >= self._leaving}
        if sound is not None:
            self._kinds[self._epoch] = sound.kind

    def _share(self, pts: int | None) -> None:
        """Share the time of a PES among its packets, as the next one begins at `pts`."""
        slots, self._under_way = self._under_way, []
        if pts is None or not slots or slots[0].pts is None:
            return
        start, length = slots[0].pts, step(pts, slots[0].pts)
        if 0 < length < _LONGEST_PACKET_S * TICKS_HZ:
            slots[0].end = pts
            for number, slot in enumerate(slots):
                slot.pts = (start + length * number // len(slots)) % PERIOD

    def _read(self, pes: Pes) -> None:
        if pes.pts is not None and len(pes.parts) == 1:
            self._send("subtitle", pes.pts, pes.parts[0])

    def _choose(self) -> None:
        """Find the sound and the text in the current tables."""
        programme = self._tables.programme
        assert programme is not None
        sound = chosen_sound(programme, self._track)
        self._texts = {
            s.pid: self._texts.get(s.pid, PesReader())
            for s in programme.streams
            if s.kind in ("ttml", "data") and (not s.language or s.language in FRENCH)
        }
        before = self._sound
        same = (before and (before.pid, before.kind)) == (sound and (sound.pid, sound.kind))
        if same and self._chosen:
            self._sound = sound
            return
        if before is not None:
            for pes in self._reader.flush():
                self._send("sound", self._epoch, before.kind, pes)
        self._sound, self._reader, self._chosen = sound, PesReader(), True
        self._begin(sound)
        self._under_way, self._heard = [], None
        self._tell(self._choice(programme, sound))

    def _choice(self, programme: ProgrammeMap, sound: ElementaryStream | None) -> str:
        """Say the programme and the sound, and where they are not those that were asked for."""
        line = f"programme {programme.number}"
        if self._programme not in (None, programme.number):
            line += f" (there is no {self._programme})"
        if sound is None:
            return f"{line}: no sound that can be marked"
        line += f": sound {sound.kind} on PID {sound.pid}"
        sounds = sum(stream.kind in KINDS for stream in programme.streams)
        return line if self._track < sounds else f"{line} (there is no sound {self._track})"

    def put(self, epoch: int, pes: MarkedPes) -> None:
        """Take a marked packet."""
        self._marked.put(epoch, pes)

    def end(self) -> None:
        """Tell that nothing more comes."""
        if self._sound is not None:
            for pes in self._reader.flush():
                self._send("sound", self._epoch, self._sound.kind, pes)

    def give(self, now_s: float) -> Iterator[bytes]:
        """Yield the packets due, in pieces of whole packets."""
        while self._held and (
            self._held[0].due_s <= (self._stream_s if self._by_stream else now_s)
            or self.held_bytes > MOST_HELD
        ):
            yield self._made(self._held.popleft())

    def rest(self) -> Iterator[bytes]:
        """Yield all that is held, whenever it is due, and the end of the marked sound.

        Its last packets were taken for sound before them that came out longer.
        """
        while self._held:
            yield self._made(self._held.popleft())
        while self._marking and self._wait():
            pass
        if self._marking:
            yield self._marked.last(self._leaving)

    def _made(self, held: _HeldPackets) -> bytes:
        self._due_s = held.due_s
        self.held_bytes -= len(held.data)
        if not held.slots:
            return held.data
        out = bytearray()
        for at in range(0, len(held.data), PACKET):
            packet = held.data[at : at + PACKET]
            slot = held.slots.get(at)
            if slot is not None:
                out += self._exchanged(packet, slot)
            elif self._marking and pid_of(packet) == NULL_PID and self._behind():
                out += self._marked.next(self._now)
            else:
                out += packet
        if self._watch is not None and self._leaving in self._kinds:
            for at in range(0, len(out), PACKET):
                packet = bytes(out[at : at + PACKET])
                if pid_of(packet) == self._marked.pid:
                    for pes in self._out.process(packet):
                        self._watch.sound(self._kinds[self._leaving], pes)
        return bytes(out)

    def _exchanged(self, packet: bytes, slot: _Slot) -> bytes:
        """Return the output in place of a packet of the sound."""
        marked = self._marked
        same = marked.pid == pid_of(packet)
        marked.pid = pid_of(packet)
        out = self._decide(slot, same=same) if slot.starts else b""
        self._leaving = slot.epoch
        self._now = slot.pts
        if not self._marking:
            return out + marked.renumbered(packet)
        out += marked.next(slot.pts, kept_fields(packet))
        for late, most in ((_FAR_BEHIND, _BURST), (STALE // 2, _LONGEST_BURST)):
            while marked.late(slot.pts) > late and len(out) < most * PACKET:
                out += marked.next(slot.pts)
        return out

    def _decide(self, slot: _Slot, *, same: bool) -> bytes:
        """Choose at a PES's start whether marked sound goes out; return the packets still open.

        `same`: the sound before had this PID too.
        """
        pts, before, jumped = slot.pts, self._last, slot.epoch != self._leaving
        if pts is None:
            return b""
        follows = self._marking and not jumped
        ready = self._ready(slot, pts, follows=follows)
        while not ready and self._wait():
            ready = self._ready(slot, pts, follows=follows)
        self._last = pts
        length = 0 if before is None else step(pts, before)
        if 0 < length < TICKS_HZ:
            name = "marked_seconds_total" if self._marking else "bypass_seconds_total"
            self.figures[name] += length / TICKS_HZ
            if self._watch is not None and before is not None:
                self._watch.went_out(before, length, self._marking)
        out = b""
        if ready and not follows:
            rest = self._leaving if self._marking and same else None
            out = self._marked.begin(slot.epoch, pts, rest)
        elif not ready and self._marking:
            out = self._marked.last(self._leaving) if jumped and same else self._marked.rest(pts)
            self.figures["bypasses_total"] += 1
        self._marking = ready
        return out

    def _ready(self, slot: _Slot, pts: int, *, follows: bool) -> bool:
        """Whether marked sound covers most of a PES that begins at `pts`, without a hole.

        `follows`: marked sound goes out up to this PES.
        """
        rest = self._leaving if self._marking and not follows else None
        self._marked.forget(slot.epoch, pts, rest)
        self.figures["stale_packets_total"] = self._marked.stale
        wanted = 1 if slot.end is None else (step(slot.end, pts) + 1) // 2
        if not self._marking and self.figures["bypasses_total"]:
            wanted = max(wanted, round(_RESUMED * self._delay_s * TICKS_HZ))
        return self._marked.covers(slot.epoch, pts, wanted, follows=follows)

    def _behind(self) -> bool:
        """Whether marked sound is so late that an empty packet is to carry it."""
        return self._marked.late(self._now) > _BEHIND or self._marked.under_way


def chosen_sound(programme: ProgrammeMap, track: int) -> ElementaryStream | None:
    """Return the sound with this number among those that can be marked, else the first of them."""
    sounds = [stream for stream in programme.streams if stream.kind in KINDS]
    return sounds[track] if track < len(sounds) else next(iter(sounds), None)
