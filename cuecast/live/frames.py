"""Coded sound in frames: cut out of an elementary stream, and put into one.

Bytes in, whole frames out, each with its header's values; and the other way the framing that an
encoder leaves to the container. Sources: ISO/IEC 11172-3 and 13818-3 (MPEG audio), 14496-3 (ADTS,
LATM), ETSI TS 102 366 (AC-3 and Enhanced AC-3).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

_HEADER = 8
"""Bytes that hold the length of any frame."""

_MPEG_RATES = (44100, 48000, 32000)
"""Rates in Hz by index (ISO/IEC 11172-3)."""

_LAYER2_KBPS = (0, 32, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320, 384)
"""Rates of layer II in kbit/s by index (ISO/IEC 11172-3)."""

_LAYER2_KBPS_LOW = (0, 8, 16, 24, 32, 40, 48, 56, 64, 80, 96, 112, 128, 144, 160)
"""The same at half the sampling rate (ISO/IEC 13818-3)."""

_AAC_RATES = (
    96000, 88200, 64000, 48000, 44100, 32000, 24000, 22050, 16000, 12000, 11025, 8000, 7350,
)  # fmt: skip
"""Rates in Hz by index (ISO/IEC 14496-3)."""

_AC3_KBPS = (32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320, 384, 448, 512, 576, 640)
"""Rates in kbit/s by half the index (ETSI TS 102 366)."""

_AC3_RATES = (48000, 44100, 32000)
"""Rates in Hz by index (ETSI TS 102 366)."""


@dataclass(frozen=True, slots=True)
class CodedFrame:
    """A frame of coded sound: its bytes, and how long it sounds in seconds."""

    data: bytes
    length_s: float


def _mp2(head: bytes) -> tuple[int, float] | None:
    if head[0] != 0xFF or head[1] & 0xE6 != 0xE4:
        return None
    low = not head[1] & 0x08
    index, rate = head[2] >> 4, head[2] >> 2 & 3
    if not 0 < index < 15 or rate == 3:
        return None
    kbps = (_LAYER2_KBPS_LOW if low else _LAYER2_KBPS)[index]
    fs = _MPEG_RATES[rate] // (2 if low else 1)
    return 144_000 * kbps // fs + (head[2] >> 1 & 1), 1152 / fs


def _aac(head: bytes) -> tuple[int, float] | None:
    index = head[2] >> 2 & 15
    if head[0] != 0xFF or head[1] & 0xF6 != 0xF0 or index >= len(_AAC_RATES):
        return None
    size = (head[3] & 3) << 11 | head[4] << 3 | head[5] >> 5
    return (size, 1024 * ((head[6] & 3) + 1) / _AAC_RATES[index]) if size > 7 else None


def _latm(head: bytes) -> tuple[int, float] | None:
    if head[0] != 0x56 or head[1] & 0xE0 != 0xE0:
        return None
    return 3 + ((head[1] & 0x1F) << 8 | head[2]), 0.0


def _ac3(head: bytes) -> tuple[int, float] | None:
    code, rate = head[4] & 0x3F, head[4] >> 6
    if head[:2] != b"\x0b\x77" or rate == 3 or code >= 2 * len(_AC3_KBPS):
        return None
    fs = _AC3_RATES[rate]
    words = _AC3_KBPS[code // 2] * 1000 * 96 // fs
    return 2 * (words + (code & 1 if fs == 44100 else 0)), 1536 / fs


def _eac3(head: bytes) -> tuple[int, float] | None:
    if head[:2] != b"\x0b\x77" or head[5] >> 3 <= 10:
        return _ac3(head)
    size = 2 * (((head[2] & 7) << 8 | head[3]) + 1)
    rate = head[4] >> 6
    if rate == 3:
        reduced = head[4] >> 4 & 3
        return (size, 1536 * 2 / _AC3_RATES[reduced]) if reduced < 3 else None
    return size, (256, 512, 768, 1536)[head[4] >> 4 & 3] / _AC3_RATES[rate]


_READERS: dict[str, Callable[[bytes], tuple[int, float] | None]] = {
    "mp2": _mp2,
    "aac": _aac,
    "latm": _latm,
    "ac3": _ac3,
    "eac3": _eac3,
}

KINDS = tuple(_READERS)
"""Codings of sound that can be framed."""


class FrameCutter:
    """Cuts frames out of a stream of bytes that may have holes.

    Parameters
    ----------
    kind : str
        Of `KINDS`.
    """

    def __init__(self, kind: str) -> None:
        self._read = _READERS[kind]
        self._held = b""

    def process(self, data: bytes) -> Iterator[tuple[CodedFrame, bool]]:
        """Take bytes that follow; yield whole frames, and whether each begins in these bytes."""
        before, held = len(self._held), self._held + data
        at = 0
        while at + _HEADER <= len(held):
            found = self._read(held[at : at + _HEADER])
            if found is None:
                at += 1
                continue
            size, length_s = found
            if at + size > len(held):
                break
            if at + size + 2 <= len(held) and not self._follows(held, at + size):
                at += 1
                continue
            yield CodedFrame(held[at : at + size], length_s), at >= before
            at += size
        self._held = held[at:]

    def _follows(self, held: bytes, at: int) -> bool:
        """Whether a frame may begin there, as far as the bytes so far show."""
        head = held[at : at + _HEADER]
        return len(head) < _HEADER or self._read(head) is not None

    def restart(self) -> None:
        """Drop the bytes before a hole."""
        self._held = b""


def framed(kind: str, data: bytes, fs: int, channels: int) -> bytes:
    """Return an encoder's packet as the frame of an elementary stream.

    Parameters
    ----------
    kind : str
        Of `KINDS`.
    data : bytes
        Of the packet.
    fs, channels : int
        Of the sound.
    """
    if kind == "aac":
        return _adts(data, fs, channels)
    return _loas(data, fs, channels) if kind == "latm" else data


def _adts(data: bytes, fs: int, channels: int) -> bytes:
    size, index, layout = len(data) + 7, _AAC_RATES.index(fs), _aac_layout(channels)
    return bytes([
        0xFF, 0xF1, 1 << 6 | index << 2 | layout >> 2, (layout & 3) << 6 | size >> 11,
        size >> 3 & 0xFF, (size & 7) << 5 | 0x1F, 0xFC,
    ]) + data  # fmt: skip


def _loas(data: bytes, fs: int, channels: int) -> bytes:
    """One access unit of AAC-LC with its configuration, as an audio sync stream."""
    fields = [
        (0, 1), (0, 1), (1, 1), (0, 6), (0, 4), (0, 3),  # its own configuration: one of each
        (2, 5), (_AAC_RATES.index(fs), 4), (_aac_layout(channels), 4), (0, 3),  # AAC-LC
        (0, 3), (0xFF, 8), (0, 1), (0, 1),  # frames of any length, no other data, no CRC
    ]  # fmt: skip
    fields += [(255, 8)] * (len(data) // 255) + [(len(data) % 255, 8)]
    bits = "".join(f"{value:0{width}b}" for value, width in fields)
    bits += "".join(f"{byte:08b}" for byte in data)
    bits += "0" * (-len(bits) % 8)
    body = int(bits, 2).to_bytes(len(bits) // 8, "big")
    return (0x2B7 << 13 | len(body)).to_bytes(3, "big") + body


def _aac_layout(channels: int) -> int:
    return 7 if channels == 8 else channels
