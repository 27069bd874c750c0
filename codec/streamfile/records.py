"""Files whose superframes vary in size: common data once, then a record for each.

Bytes go in and out; no model of motion. Specification: spec/bitstream.md, section 8.1.
"""

import zlib
from collections.abc import Sequence

from codec.errors import BitstreamError

_END_BYTES = 4
"""Bytes of the check of a whole file."""

_LONG = 255
"""Least length that is stated by three bytes behind a record's first one."""

_LONG_BYTES = 3
"""Bytes of that field."""

OVERHEAD_BYTES = _END_BYTES
"""Bytes of such a file beside its head and its records, the first of them being its common data."""


def record_bytes(payload: bytes) -> int:
    """Return the bytes of a record."""
    return 1 + (_LONG_BYTES if len(payload) >= _LONG else 0) + len(payload)


def _record(payload: bytes) -> bytes:
    short = bytes([min(len(payload), _LONG)])
    more = len(payload).to_bytes(_LONG_BYTES, "big") if len(payload) >= _LONG else b""
    return short + more + payload


def write_records(head: bytes, common: bytes, payloads: Sequence[bytes]) -> bytes:
    """Return a whole file (F7)."""
    data = head + _record(common) + b"".join(map(_record, payloads))
    return data + zlib.crc32(data).to_bytes(_END_BYTES, "big")


def read_records(data: bytes, place: int, count: int) -> tuple[list[bytes], BitstreamError | None]:
    """Return a file's common data and its superframes, as far as they are whole, and the fault.

    Parameters
    ----------
    data : bytes
        A whole file.
    place : int
        Where its head ends.
    count : int
        How many superframes there are.

    Returns
    -------
    records : list of bytes
        The common data first; fewer than ``1 + count`` of a file that ends early.
    fault : BitstreamError or None
        A wrong check (F7), with its likely cause; else a file that ends within a record or goes on
        after the last one (F6). Records of a file with a wrong check may be wrong.
    """
    body, check = data[:-_END_BYTES], data[-_END_BYTES:]
    own = zlib.crc32(body).to_bytes(_END_BYTES, "big")
    if own == check:
        records, end, fault = _records(body, place, 1 + count)
        if fault is None and end != len(body):
            fault = BitstreamError(f"{len(body) - end} bytes too many", section="F6", bit=8 * end)
        return records, fault
    records, end, early = _records(data, place, 1 + count)
    behind = len(data) - end - _END_BYTES
    if early is not None or behind < 0:
        cause = f"the file is cut off: {len(records)} of {1 + count} records are whole"
    elif zlib.crc32(data[:end]).to_bytes(_END_BYTES, "big") == data[end : end + _END_BYTES]:
        cause = f"{behind} bytes were appended to a file that is whole without them"
    else:
        cause = "bytes of the file were changed; it cannot be known which"
    rule = f"checksum of the file: {own.hex()} expected, {check.hex()} found"
    return records, BitstreamError(rule, section="F7", bit=8 * len(body), cause=cause)


def _records(data: bytes, place: int, count: int) -> tuple[list[bytes], int, BitstreamError | None]:
    """Return whole records, where the last one ends, and what stops before `count` of them."""
    records = list[bytes]()
    for number in range(count):
        bit = 8 * place
        if place >= len(data):
            return records, place, BitstreamError(f"no record {number}", section="F6", bit=bit)
        begin, length = place + 1, data[place]
        if length == _LONG:
            length = int.from_bytes(data[begin : begin + _LONG_BYTES], "big")
            begin += _LONG_BYTES
        if begin + length > len(data):
            fault = BitstreamError(f"record {number} is cut off", section="F6", bit=bit)
            return records, place, fault
        place = begin + length
        records.append(data[begin:place])
    return records, place, None
