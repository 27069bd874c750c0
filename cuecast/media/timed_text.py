"""TTML in the packets of a programme: whole documents, DVB segments, or paragraphs alone.

A packet's bytes in, its subtitles on the programme's clock out. Sources: ISO/IEC 14496-30 for
documents in MP4, ETSI EN 303 560 for segments in a transport stream.
"""

import re
import zlib
from collections.abc import Iterator
from dataclasses import replace

from codec.errors import CueError
from synth.language.subtitles import Subtitle
from synth.language.subtitles.read import Terms, parse_subtitles

_MEDIATIME_HZ = 10_000
"""Unit of a segment's media time: 100 microseconds (EN 303 560, 5.2.2.2.1)."""

_PLAIN, _PACKED = 0x01, 0x02
"""Types of segments that hold a document."""

_LARGEST_DOCUMENT = 8 << 20
"""Bytes of a document, unpacked, at most."""

_EARLY_S = 0.5
"""How far before its packet a text may begin whose times count from the track's beginning."""


_AS_IT_STANDS = Terms(offset_s=0.0, everything=True)
"""All texts of one document: terms are applied to the whole track later."""


def placed(start_s: float, end_s: float, one: Subtitle) -> Iterator[Subtitle]:
    """Yield a subtitle at other times, cut to the programme; nothing where nothing is in there."""
    start_s, end_s = round(max(0.0, start_s), 3), round(end_s, 3)
    if one.text and end_s > start_s:
        yield replace(one, start_s=start_s, end_s=end_s)


def subtitles_of_packet(data: bytes, start_s: float, zero_s: float) -> Iterator[Subtitle]:
    """Yield the subtitles of a packet at their place on the programme's clock.

    The media time of a DVB segment names the time of the packet. Without one, times count from
    the track's beginning, or from the packet's own time where they lie before it.

    Parameters
    ----------
    data : bytes
        Of the packet.
    start_s : float
        Its time on the programme's clock, seconds.
    zero_s : float
        The beginning of the track's own times on that clock, seconds.
    """
    document = document_of(data)
    if not document:
        return
    try:
        subtitles = parse_subtitles(document, terms=_AS_IT_STANDS)
    except CueError:  # an empty document clears the screen
        return
    anchor = _mediatime_s(data)
    if anchor is not None:
        moved_s = start_s - anchor
    elif min(s.start_s for s in subtitles) + zero_s < start_s - _EARLY_S:
        moved_s = start_s
    else:
        moved_s = zero_s
    for one in subtitles:
        yield from placed(one.start_s + moved_s, one.end_s + moved_s, one)


def document_of(data: bytes) -> bytes:
    """Return the document that a packet holds, nothing where it holds none."""
    return data if _is_document(data) else _unpacked(data) or _segments(data)


def paragraph_of(data: bytes) -> str:
    r"""Return the text of a packet with the content of a paragraph, or nothing.

    Examples
    --------
    >>> paragraph_of(b"<span>Bonjour</span><br/>Anne")
    '<span>Bonjour</span>\nAnne'
    """
    text = data.decode("utf-8", "replace").strip()
    if not re.match(r"<(?:\w+:)?(?:p|span|br)\b", text):
        return ""
    return re.sub(r"<(?:\w+:)?br\s*/?>", "\n", text)


def _segments(data: bytes) -> bytes:
    """Document in the data field of a PES packet by EN 303 560, nothing where there is none."""
    count, at = data[6] if len(data) > 10 else 0, 7
    for _ in range(count):
        kind, length = data[at : at + 1], int.from_bytes(data[at + 1 : at + 3], "big")
        body = data[at + 3 : at + 3 + length]
        at += 3 + length
        if kind == bytes([_PLAIN]) and _is_document(body):
            return body
        if kind == bytes([_PACKED]):
            return _unpacked(body)
    return b""


def _mediatime_s(data: bytes) -> float | None:
    return int.from_bytes(data[:6], "big") / _MEDIATIME_HZ if _segments(data) else None


def _unpacked(data: bytes) -> bytes:
    if data[:2] != b"\x1f\x8b":
        return b""
    try:
        plain = zlib.decompressobj(16 + zlib.MAX_WBITS).decompress(data, _LARGEST_DOCUMENT)
    except zlib.error:
        return b""
    return plain if _is_document(plain) else b""


def _is_document(data: bytes) -> bool:
    head = data[:4096].lstrip(b"\xef\xbb\xbf \r\n\t")
    return head.startswith(b"<") and re.search(rb"<(?:\w+:)?tt[\s>]", head) is not None
