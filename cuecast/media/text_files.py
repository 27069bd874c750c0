"""The texts of a track's packets as a file of the track's own format, with its looks.

What readers of files know of colours, voices and styles then holds for tracks inside programmes as
well. Texts of mov_text have their colours in a box of their own (3GPP TS 26.245, 5.17): they become
SubRip with tags.
"""

import re
import struct
from collections.abc import Sequence

Cue = tuple[float, float, bytes]
"""Start and end in seconds on the programme's clock, and the packet's content."""

_STYLES = b"styl"
_RECORD = struct.Struct(">HHHBB4B")
"""First character, end, font, face, size; red, green, blue, alpha."""

_WHITE = (255, 255, 255)
"""Levels of red, green, blue of text whose style states no colour."""
_EVENTS = "[Events]\n"
_DRAWN = re.compile(r"\{[^}]*\\p[1-9]")


def file_of(coding: str, cues: Sequence[Cue], header: bytes) -> bytes:
    """Return a file of subtitles with the texts of packets.

    Parameters
    ----------
    coding : str
        ``mov_text``, ``SubRip``, ``text``, ``WebVTT`` or ``ASS``.
    cues : sequence of Cue
        In order of time.
    header : bytes
        The container's header of the track: the styles of WebVTT and ASS.
    """
    kept = _plain(header)
    if coding == "WebVTT":
        styles = re.sub(r"^WEBVTT[^\n]*\n?", "", kept).strip()
        blocks = [f"{_clock(a, '.')} --> {_clock(b, '.')}\n{_block(_plain(d))}" for a, b, d in cues]
        return "\n\n".join(["WEBVTT", *([styles] if styles else []), *blocks]).encode()
    if coding == "ASS":
        styles = kept.partition("[Events]")[0] or "[Script Info]\n"
        return (styles + _EVENTS + "".join(map(_dialogue, cues))).encode()
    text = timed_text if coding == "mov_text" else _plain
    return "\n".join(
        f"{number}\n{_clock(a, ',')} --> {_clock(b, ',')}\n{_block(text(data))}\n"
        for number, (a, b, data) in enumerate(cues, 1)
    ).encode()


def timed_text(data: bytes) -> str:
    r"""Return the text of a packet of mov_text, with tags where it is coloured.

    Two bytes of length, the text, boxes of its looks.

    Examples
    --------
    >>> red = struct.pack(">HHHBB4B", 0, 3, 1, 0, 18, 255, 0, 0, 255)
    >>> box = struct.pack(">I4sH", 10 + len(red), b"styl", 1) + red
    >>> timed_text(b"\0\6Oui ou" + box)
    '<font color="#ff0000">Oui</font> ou'
    """
    length = int.from_bytes(data[:2], "big")
    raw, boxes = data[2 : 2 + length], data[2 + length :]
    wide = raw[:2] in (b"\xfe\xff", b"\xff\xfe")
    text = raw.decode("utf-16" if wide else "utf-8", "replace")
    parts, at = [], 0
    for first, end, colour in _coloured(boxes):
        if at <= first < end <= len(text) and colour != _WHITE:
            name = "#" + "".join(f"{value:02x}" for value in colour)
            parts += [text[at:first], f'<font color="{name}">{text[first:end]}</font>']
            at = end
    return "".join([*parts, text[at:]])


def _coloured(boxes: bytes) -> list[tuple[int, int, tuple[int, int, int]]]:
    """Return the first and the end character of each style of a packet, and its colour."""
    found: list[tuple[int, int, tuple[int, int, int]]] = []
    while len(boxes) >= 8:
        size, kind = struct.unpack_from(">I4s", boxes)
        if size < 8 or size > len(boxes):
            break
        if kind == _STYLES and size >= 10:
            count = int.from_bytes(boxes[8:10], "big")
            room = boxes[10:size]
            for number in range(min(count, len(room) // _RECORD.size)):
                first, end, _, _, _, *rgba = _RECORD.unpack_from(room, number * _RECORD.size)
                found.append((first, end, (rgba[0], rgba[1], rgba[2])))
        boxes = boxes[size:]
    return sorted(found)


def _dialogue(one: Cue) -> str:
    """Return a packet of ASS (its number, layer, style and so on) as a line of a file."""
    start_s, end_s, data = one
    fields = _plain(data).split(",", 8)
    if len(fields) < 9 or _DRAWN.search(fields[8]):
        return ""
    _, layer, style, *rest = fields
    text = rest.pop().replace("\r", "").replace("\n", "\\N")
    times = f"{_clock(start_s, '.')},{_clock(end_s, '.')}"
    return f"Dialogue: {layer},{times},{style},{','.join(rest)},{text}\n"


def _plain(data: bytes) -> str:
    return data.decode("utf-8", "replace").strip("\x00")


def _block(text: str) -> str:
    """Return a text that ends no block and looks like no line of times."""
    return re.sub(r"\n\s*\n", "\n", re.sub(r"-->|→", "—", text.replace("\r", ""))).strip()


def _clock(time_s: float, point: str) -> str:
    whole = round(time_s * 1000)
    minutes, ms = divmod(whole, 60_000)
    return f"{minutes // 60:02}:{minutes % 60:02}:{ms // 1000:02}{point}{ms % 1000:03}"
