"""Files whose superframes vary in size: common data once, then a record for each.

Bytes go in and out; no model of motion. Specification: spec/bitstream.md, section 8.1.
"""

import zlib
from collections.abc import Iterator, Sequence

from codec.errors import BitstreamError

_END_BYTES = 4
"""Bytes of the check of a whole file."""

_LONG = 255
"""Length from which a field of three bytes behind a record's first one tells it."""

_LONG_BYTES = 3
"""Bytes of that field."""

OVERHEAD_BYTES = _END_BYTES
"""Bytes of such a file beside its head and its records, of which the first is what it says once."""


def record_bytes(payload: bytes) -> int:
    """Return the bytes of a record."""
    return 1 + (_LONG_BYTES if len(payload) >= _LONG else 0) + len(payload)


def _record(payload: bytes) -> bytes:
    short = bytes([min(len(payload), _LONG)])
    more = len(payload).to_bytes(_LONG_BYTES, "big") if len(payload) >= _LONG else b""
    return short + more + payload


def write_records(head: bytes, told: bytes, payloads: Sequence[bytes]) -> bytes:
    """Return a whole file (F7)."""
    data = head + _record(told) + b"".join(map(_record, payloads))
    return data + zlib.crc32(data).to_bytes(_END_BYTES, "big")


def read_records(data: bytes, place: int, count: int) -> tuple[bytes, Iterator[bytes]]:
    """Return a file's common data, and its superframes.

    Parameters
    ----------
    data : bytes
        A whole file.
    place : int
        Where its head ends.
    count : int
        How many superframes there are.

    Raises
    ------
    BitstreamError
        If the check is wrong (F7), or the file ends early (F6); the iterator, if it ends within
        a record or goes on after the last one (F6).
    """
    data, check = data[:-_END_BYTES], data[-_END_BYTES:]
    if zlib.crc32(data).to_bytes(_END_BYTES, "big") != check:
        raise BitstreamError("checksum of the file", section="F7", bit=8 * len(data))
    rest = _payloads(data, place, 1 + count)
    return next(rest), rest


def _payloads(data: bytes, place: int, count: int) -> Iterator[bytes]:
    for number in range(count):
        if place >= len(data):
            raise BitstreamError(f"no record {number}", section="F6", bit=8 * place)
        begin, length = place + 1, data[place]
        if length == _LONG:
            length = int.from_bytes(data[begin : begin + _LONG_BYTES], "big")
            begin += _LONG_BYTES
        if begin + length > len(data):
            raise BitstreamError(f"record {number} is cut off", section="F6", bit=8 * place)
        place = begin + length
        yield data[begin:place]
    if place != len(data):
        raise BitstreamError(f"{len(data) - place} bytes too many", section="F6", bit=8 * place)
