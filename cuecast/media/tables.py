"""The tables of an MPEG transport stream: which programmes and streams it holds.

Packets in, the association table (PAT) and the map of one programme (PMT) out. Source: ISO/IEC
13818-1, section 2.4.4; descriptors of DVB: ETSI EN 300 468, of TTML: ETSI EN 303 560.
"""

from collections.abc import Iterator
from dataclasses import dataclass

PACKET = 188
"""Bytes of a packet (ISO/IEC 13818-1)."""

SYNC = 0x47
"""First byte of each."""

NULL_PID = 0x1FFF
"""Number of packets that hold nothing (ISO/IEC 13818-1)."""

_LONGEST_SECTION = 4096
"""Bytes of a section of a table at most."""

_POLYNOMIAL = 0x04C11DB7
"""Polynomial of the tables' CRC-32 (ISO/IEC 13818-1, annex A)."""

_SOUNDS = {0x03: "mp2", 0x04: "mp2", 0x0F: "aac", 0x11: "latm", 0x81: "ac3", 0x87: "eac3"}
"""Coding of the sound by stream type."""

_PRIVATE = {0x05, 0x06}
_PRIVATE_KINDS = {
    0x6A: "ac3",
    0x7A: "eac3",
    0x59: "dvb bitmaps",
    0x56: "teletext",
    0x46: "teletext",
}
_EXTENSION, _EXTENDED_KINDS = 0x7F, {0x20: "ttml"}
_REGISTRATION, _REGISTERED = 0x05, {b"AC-3": "ac3", b"EAC3": "eac3", b"Opus": "opus"}

_DATA_COMPONENT, _ARIB_CAPTIONS = 0xFD, 0x0008
"""Descriptor and component that mark ARIB captions."""

_VIDEO = {0x01, 0x02, 0x10, 0x1B, 0x24, 0x33}
_LANGUAGE_AT = {0x0A: 0, 0x59: 0, 0x56: 0, 0x46: 0}
"""Where a descriptor has its first language."""


@dataclass(frozen=True, slots=True)
class ElementaryStream:
    """One stream of a programme.

    Attributes
    ----------
    pid : int
    kind : str
        ``mp2``, ``aac``, ``latm``, ``ac3``, ``eac3``, ``opus``, ``video``, ``ttml``,
        ``teletext``, ``dvb bitmaps``, ``arib captions`` or ``data``.
    language : str
        ISO 639 code, empty where not stated.
    """

    pid: int
    kind: str
    language: str

    @property
    def is_sound(self) -> bool:
        """Whether it is a sound."""
        return self.kind in {"mp2", "aac", "latm", "ac3", "eac3", "opus"}


@dataclass(frozen=True, slots=True)
class ProgrammeMap:
    """Content of a PMT: number of the programme, PID of its clock, its streams."""

    number: int
    pcr_pid: int
    streams: tuple[ElementaryStream, ...]


class SectionReader:
    """Sections of one PID, put together from the payloads of its packets.

    A section whose checksum is wrong is left out; bytes before a first start are skipped.
    """

    def __init__(self) -> None:
        self._held: bytearray | None = None

    def process(self, payload: bytes, starts: bool) -> Iterator[bytes]:
        """Take a packet's payload, and whether a section starts in it; yield whole sections."""
        if starts:
            if not payload:
                return
            pointer = payload[0]
            if self._held is not None:
                self._held += payload[1 : 1 + pointer]
                yield from self._whole()
            self._held = bytearray(payload[1 + pointer :])
        elif self._held is not None:
            self._held += payload
        yield from self._whole()

    def _whole(self) -> Iterator[bytes]:
        while self._held is not None and len(self._held) >= 3 and self._held[0] != 0xFF:
            length = 3 + ((self._held[1] & 0x0F) << 8 | self._held[2])
            if length > _LONGEST_SECTION:
                self._held = None
                return
            if len(self._held) < length:
                return
            section = bytes(self._held[:length])
            del self._held[:length]
            if checksum(section) == 0:
                yield section


def checksum(data: bytes) -> int:
    """Return the CRC of MPEG systems; 0 over a section that ends with its own.

    Examples
    --------
    >>> hex(checksum(b"123456789"))
    '0x376e6e7'
    """
    crc = 0xFFFFFFFF
    for byte in data:
        crc = (crc << 8 & 0xFFFFFFFF) ^ _TABLE[crc >> 24 ^ byte]
    return crc


def _shifted(byte: int) -> int:
    crc = byte << 24
    for _ in range(8):
        crc = (crc << 1 ^ _POLYNOMIAL if crc & 0x80000000 else crc << 1) & 0xFFFFFFFF
    return crc


_TABLE = [_shifted(byte) for byte in range(256)]


def read_association(section: bytes) -> dict[int, int] | None:
    """Return the PID of each programme's map, None where this is no PAT that is valid now."""
    if section[0] != 0x00 or len(section) < 12 or not section[5] & 1:
        return None
    entries = section[8:-4]
    found = {}
    for at in range(0, len(entries) - 3, 4):
        number = entries[at] << 8 | entries[at + 1]
        if number:
            found[number] = (entries[at + 2] & 0x1F) << 8 | entries[at + 3]
    return found


def read_map(section: bytes) -> ProgrammeMap | None:
    """Return the programme's map, None where this is no PMT that is valid now."""
    if section[0] != 0x02 or len(section) < 16 or not section[5] & 1:
        return None
    number = section[3] << 8 | section[4]
    pcr_pid = (section[8] & 0x1F) << 8 | section[9]
    at = 12 + ((section[10] & 0x0F) << 8 | section[11])
    streams = []
    while at + 5 <= len(section) - 4:
        pid = (section[at + 1] & 0x1F) << 8 | section[at + 2]
        length = (section[at + 3] & 0x0F) << 8 | section[at + 4]
        descriptors = section[at + 5 : at + 5 + length]
        streams.append(_stream(pid, section[at], descriptors))
        at += 5 + length
    return ProgrammeMap(number, pcr_pid, tuple(streams))


def _stream(pid: int, stream_type: int, descriptors: bytes) -> ElementaryStream:
    kind = _SOUNDS.get(stream_type, "video" if stream_type in _VIDEO else "data")
    language = ""
    at = 0
    while at + 2 <= len(descriptors):
        tag, length = descriptors[at], descriptors[at + 1]
        body = descriptors[at + 2 : at + 2 + length]
        at += 2 + length
        if stream_type in _PRIVATE and kind == "data":
            kind = _private_kind(tag, body)
        if tag in _LANGUAGE_AT:
            language = language or _language(body)
        elif tag == _EXTENSION and body[:1] == b"\x20":
            language = language or _language(body[1:])
    return ElementaryStream(pid, kind, language)


def _private_kind(tag: int, body: bytes) -> str:
    if tag == _EXTENSION and body:
        return _EXTENDED_KINDS.get(body[0], "data")
    if tag == _REGISTRATION:
        return _REGISTERED.get(body[:4], "data")
    if tag == _DATA_COMPONENT and int.from_bytes(body[:2], "big") == _ARIB_CAPTIONS:
        return "arib captions"
    return _PRIVATE_KINDS.get(tag, "data")


def _language(body: bytes) -> str:
    return body[:3].decode("latin-1").strip("\x00 ").lower()


def synchronised(data: bytes, start: int = 0) -> int:
    """Return where the next packet starts, by three sync bytes in step; the length if nowhere."""
    for at in range(start, len(data) - 2 * PACKET):
        if data[at] == data[at + PACKET] == data[at + 2 * PACKET] == SYNC:
            return at
    return len(data)


class TableReader:
    """Follows the tables of a transport stream, one programme of it.

    Parameters
    ----------
    number : int, optional
        Of the programme; the first of the table by default, or if that one is not there.

    Attributes
    ----------
    programme : ProgrammeMap or None
        As the stream states it now.
    """

    def __init__(self, number: int | None = None) -> None:
        self._wanted = number
        self._readers: dict[int, SectionReader] = {0: SectionReader()}
        self._map_pid: int | None = None
        self.programme: ProgrammeMap | None = None

    @property
    def pids(self) -> frozenset[int]:
        """PIDs whose packets it wants."""
        return frozenset(self._readers)

    def process(self, packet: bytes) -> bool:
        """Take a packet of 188 bytes; return whether the programme's map changed with it."""
        pid = (packet[1] & 0x1F) << 8 | packet[2]
        reader = self._readers.get(pid)
        if reader is None or packet[1] & 0x80 or not packet[3] & 0x10:
            return False
        changed = False
        for section in reader.process(payload_of(packet), bool(packet[1] & 0x40)):
            changed |= self._associate(section) if pid == 0 else self._describe(section)
        return changed

    def _associate(self, section: bytes) -> bool:
        programmes = read_association(section)
        if not programmes:
            return False
        number = self._wanted if self._wanted in programmes else next(iter(programmes))
        pid = programmes[number or next(iter(programmes))]
        if pid != self._map_pid:
            self._map_pid = pid
            self._readers = {0: self._readers[0], pid: SectionReader()}
        return False

    def _describe(self, section: bytes) -> bool:
        found = read_map(section)
        if found is None or found == self.programme:
            return False
        self.programme = found
        return True


def payload_of(packet: bytes) -> bytes:
    """Return the payload of a packet, nothing where it has none."""
    control = packet[3] >> 4 & 3
    if not control & 1:
        return b""
    start = 5 + packet[4] if control & 2 else 4
    return packet[start:]
