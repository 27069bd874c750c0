"""Packets of a transport stream: PES taken out of them, and put into them.

Source: ISO/IEC 13818-1, sections 2.4.3.2 (packets), 2.4.3.4 (clock references) and 2.4.3.6 (PES).
"""

from collections.abc import Iterator
from dataclasses import dataclass

from cuecast.media.tables import NULL_PID, PACKET, SYNC, payload_of

TICKS_HZ = 90_000
"""Ticks of time stamps in a second (ISO/IEC 13818-1)."""

PERIOD = 1 << 33
"""Time stamps count ticks of 1/90000 s and begin anew after 33 bits."""

_LONGEST_PES = 1 << 18
"""Bytes of a sound's PES packet at most: more is damage."""

NULL_PACKET = bytes([SYNC, NULL_PID >> 8, NULL_PID & 0xFF, 0x10]) + b"\xff" * (PACKET - 4)
"""Bytes of a packet that holds nothing."""


def step(stamp: int, before: int) -> int:
    """Return how many ticks a time stamp lies after another one, the shorter way round.

    Examples
    --------
    >>> step(5, PERIOD - 5), step(PERIOD - 5, 5)
    (10, -10)
    """
    return (stamp - before + PERIOD // 2) % PERIOD - PERIOD // 2


def pid_of(packet: bytes) -> int:
    """Return the PID of a packet."""
    return (packet[1] & 0x1F) << 8 | packet[2]


def clock_of(packet: bytes) -> float | None:
    """Return the clock reference of a packet in seconds, None where it has none."""
    if not packet[3] & 0x20 or packet[4] < 7 or not packet[5] & 0x10:
        return None
    base = int.from_bytes(packet[6:10], "big") << 1 | packet[10] >> 7
    return base / TICKS_HZ + ((packet[10] & 1) << 8 | packet[11]) / 27_000_000


@dataclass(frozen=True, slots=True)
class Pes:
    """A PES packet.

    Attributes
    ----------
    stream_id : int
    pts : int or None
        Presentation time in ticks.
    parts : tuple of bytes
        Its data; between two parts packets were lost.
    """

    stream_id: int
    pts: int | None
    parts: tuple[bytes, ...]


class PesReader:
    """PES packets of one PID.

    Attributes
    ----------
    lost : int
        Holes in the counter of its packets.
    """

    def __init__(self) -> None:
        self._parts: list[bytearray] | None = None
        self._counter: int | None = None
        self._length = 0
        self.lost = 0

    def process(self, packet: bytes) -> Iterator[Pes]:
        """Take a packet; yield the PES packets that it completes."""
        if not packet[3] & 0x10:
            return
        counter, before = packet[3] & 15, self._counter
        if before is not None and counter == before:
            return  # sent twice
        self._counter = counter
        hole = before is not None and counter != (before + 1) & 15
        self.lost += hole
        payload = payload_of(packet)
        if packet[1] & 0x40:
            yield from self.flush()
            self._parts = [bytearray(payload)]
            declared = int.from_bytes(payload[4:6], "big")
            self._length = declared + 6 if declared else 0
        elif self._parts is not None:
            if hole:
                self._parts.append(bytearray())
            self._parts[-1] += payload
        if self._parts is not None:
            size = sum(map(len, self._parts))
            if size > _LONGEST_PES:
                self._parts = None
            elif self._length and size >= self._length and len(self._parts) == 1:
                yield from self.flush()

    def flush(self) -> Iterator[Pes]:
        """Yield the PES that is under way."""
        parts, self._parts = self._parts, None
        if parts is None or len(parts[0]) < 9 or parts[0][:3] != b"\x00\x00\x01":
            return
        head = bytes(parts[0])
        first = head[9 + head[8] : self._length or None]
        pts = read_stamp(head[9:14]) if head[7] & 0x80 and head[8] >= 5 else None
        yield Pes(head[3], pts, (first, *(bytes(part) for part in parts[1:])))


def read_stamp(data: bytes) -> int:
    """Return a time stamp of a PES header, five bytes, in ticks."""
    return (
        (data[0] >> 1 & 7) << 30
        | data[1] << 22
        | (data[2] >> 1) << 15
        | data[3] << 7
        | data[4] >> 1
    )


def write_stamp(pts: int) -> bytes:
    """Return a time stamp as it stands in a PES header.

    Examples
    --------
    >>> read_stamp(write_stamp(7_654_321_098))
    7654321098
    """
    pts %= PERIOD
    return bytes(
        [
            0x21 | pts >> 29 & 0x0E,
            pts >> 22 & 0xFF,
            1 | pts >> 14 & 0xFE,
            pts >> 7 & 0xFF,
            1 | pts << 1 & 0xFE,
        ]
    )


def write_pes(stream_id: int, pts: int, data: bytes) -> bytes:
    """Return a PES packet of coded sound."""
    length = len(data) + 8
    size = (length if length < 1 << 16 else 0).to_bytes(2, "big")
    return b"\x00\x00\x01" + bytes([stream_id]) + size + b"\x84\x80\x05" + write_stamp(pts) + data


def packed(pid: int, counter: int, payload: bytes, *, starts: bool, fields: bytes = b"") -> bytes:
    """Return one packet with as much of a payload as it holds, see `room`.

    Parameters
    ----------
    pid, counter : int
    payload : bytes
        At most `room` bytes: the rest is stuffed.
    starts : bool
        Whether a PES starts in it.
    fields : bytes
        Adaptation field to keep, without its length: a clock reference.
    """
    missing = PACKET - 4 - len(payload) - (1 + len(fields) if fields else 0)
    control = 0x10
    adaptation = b""
    if fields or missing:
        control = 0x30 if payload else 0x20
        if fields:
            fields += b"\xff" * missing
        else:
            fields = (b"\x00" + b"\xff" * (missing - 2)) if missing > 1 else b""
        adaptation = bytes([len(fields)]) + fields
    head = bytes([SYNC, (0x40 if starts else 0) | pid >> 8, pid & 0xFF, control | counter & 15])
    return head + adaptation + payload


def room(fields: bytes = b"") -> int:
    """Return how many bytes of payload a packet holds beside an adaptation field."""
    return PACKET - 4 - (1 + len(fields) if fields else 0)


def kept_fields(packet: bytes) -> bytes:
    """Return the part of a packet's adaptation field that has to stay: its clock reference."""
    if clock_of(packet) is None:
        return b""
    return bytes([packet[5] & 0xF0]) + packet[6:12]
