"""DVB subtitles of a broadcast: packets in, pictures of the text out (ETSI EN 300 743).

FFmpeg decodes the pixels; its Python binding passes no palette on, which is read here from the
packets' own segments.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

CODEC = "dvbsub"
"""FFmpeg's name of the codec."""

_FRENCH = ("fra", "fre")
"""Codes of French in broadcasts (ISO 639-2)."""

_PAGE, _REGION, _CLUT, _DISPLAY = 0x10, 0x11, 0x12, 0x14
"""Types of segments (table 7)."""

_DEPTHS = (1, 2, 3)
"""Codes of 2, 4 and 8 bits a pixel."""

_DEEPEST = _DEPTHS[-1]
"""Code of the depth that is taken for an unknown region."""

_MOST_PIXELS = 1920 * 1080
"""Pixels of the pictures of one page at most."""


@dataclass(frozen=True, slots=True)
class CaptionsShown:
    """Text that is shown from a time on, in place of what was shown before.

    Attributes
    ----------
    start_s, end_s : float
        Seconds on the steady clock; the next text ends it earlier.
    png : bytes
        Picture with a transparent ground; empty where nothing is shown any more.
    """

    start_s: float
    end_s: float
    png: bytes


def caption_stream(container: Any) -> Any:
    """Return the stream of DVB subtitles of a container, the French one first, or None."""
    found = [
        stream
        for stream in container.streams
        if stream.type == "subtitle" and stream.codec_context.name == CODEC
    ]
    return min(found, key=lambda stream: stream.language not in _FRENCH, default=None)


class CaptionDecoder:
    """Decodes one stream of DVB subtitles."""

    def __init__(self) -> None:
        self._codec: Any = av.CodecContext.create(CODEC, "r")
        self._palettes = _Palettes()

    def take(self, packet: Any, time_s: float) -> CaptionsShown | None:
        """Return the text that a packet shows from a time on; None if it changes nothing.

        Raises
        ------
        FFmpegError, ValueError
            If the packet is damaged.
        """
        data = bytes(packet)
        found = self._codec.decode2(av.Packet(data))
        self._palettes.read(data)
        if found is None:
            return None
        parts = [
            (rect.x, rect.y, self._palettes.coloured(rect.x, rect.y, _indices(rect)))
            for rect in found
            if rect.width and rect.height
        ]
        end_s = time_s + found.end_display_time / 1000
        return CaptionsShown(time_s, end_s, _png(_joined(parts)) if parts else b"")


def _indices(rect: Any) -> NDArray[np.uint8]:
    if rect.width * rect.height > _MOST_PIXELS:
        raise ValueError(f"a caption of {rect.width}x{rect.height} pixels")
    flat = np.frombuffer(bytes(rect.planes[0]), np.uint8)
    return flat.reshape(rect.height, rect.width)


class _Palettes:
    """The palettes of a stream's regions, by the regions' places; one for each number and depth."""

    def __init__(self) -> None:
        self._palettes: dict[tuple[int, int], NDArray[np.uint8]] = {}
        self._of_region: dict[int, tuple[int, int]] = {}
        self._places: dict[tuple[int, int], int] = {}
        self._origin = (0, 0)

    def read(self, data: bytes) -> None:
        """Note what a packet's segments say."""
        for kind, body in _segments(data):
            if kind == _PAGE:
                self._places = {
                    struct.unpack_from(">HH", body, at + 2): body[at]
                    for at in range(2, len(body) - 5, 6)
                }
            elif kind == _REGION and len(body) > 7:
                self._of_region[body[0]] = (body[7], body[6] >> 2 & 7)
            elif kind == _DISPLAY and len(body) > 4:
                windowed = body[0] & 8 and len(body) >= 13
                left, _, top = struct.unpack_from(">HHH", body, 5) if windowed else (0, 0, 0)
                self._origin = (left, top)
            elif kind == _CLUT and len(body) > 2:
                for depth, number, colour in _entries(body):
                    palette = self._palettes.setdefault((body[0], depth), _usual(depth))
                    if number < len(palette):
                        palette[number] = colour

    def coloured(self, x: int, y: int, indices: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the pixels (height, width, 4) of a region at a place."""
        left, top = self._origin
        region = self._places.get((x - left, y - top), -1)
        name = self._of_region.get(region, (-1, _DEEPEST))
        palette = self._palettes.get(name, _usual(name[1]))
        return np.asarray(palette[np.minimum(indices, len(palette) - 1)])


def _segments(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield type and body of the segments of a packet."""
    at = 0
    while at + 6 <= len(data) and data[at] == 0x0F:
        kind, _, size = struct.unpack_from(">BHH", data, at + 1)
        yield kind, data[at + 6 : at + 6 + size]
        at += 6 + size


def _entries(body: bytes) -> Iterator[tuple[int, int, tuple[int, int, int, int]]]:
    """Yield depth, number and red, green, blue, opacity of a palette's entries (section 7.2.4)."""
    at = 2
    while at + 4 <= len(body):
        number, flags = body[at], body[at + 1]
        full = flags & 1
        if full and at + 6 > len(body):
            return
        if full:
            luma, red, blue, clear = body[at + 2 : at + 6]
        else:
            packed = struct.unpack_from(">H", body, at + 2)[0]
            luma, red = packed >> 10 << 2, (packed >> 6 & 15) << 4
            blue, clear = (packed >> 2 & 15) << 4, (packed & 3) << 6
        at += 6 if full else 4
        colour = (0, 0, 0, 0) if luma == 0 else (*_rgb(luma, red, blue), 255 - clear)
        for depth in _DEPTHS:
            if flags & 0x100 >> depth:
                yield depth, number, colour


def _rgb(luma: int, red: int, blue: int) -> tuple[int, int, int]:
    """Return red, green and blue of luma and its differences (ITU-R BT.601)."""
    y, v, u = 1.164 * (luma - 16), red - 128, blue - 128
    r, g, b = y + 1.596 * v, y - 0.813 * v - 0.391 * u, y + 2.018 * u
    return tuple(int(min(max(round(c), 0), 255)) for c in (r, g, b))  # type: ignore[return-value]


def _usual(depth: int) -> NDArray[np.uint8]:
    """Return the palette of a region without one (section 10): 4, 16 or 256 colours."""
    if depth == 1:
        grey = np.array([0, 255, 0, 127])
        return np.stack([grey, grey, grey, [0, 255, 255, 255]], axis=1).astype(np.uint8)
    if depth == 2:
        numbers = np.arange(16)
        bits = numbers[:, None] >> np.arange(3) & 1
        colours = np.where(numbers[:, None] < 8, 255, 127) * bits
        opacity = np.full(16, 255)
    else:
        numbers = np.arange(256)
        low, high = (numbers[:, None] >> at + np.arange(3) & 1 for at in (0, 4))
        bright, clear = numbers >> 7, numbers >> 3 & 1
        half = (bright & ~clear & 1)[:, None] * 127
        colours = (low * 85 + high * 170) // (1 + bright[:, None]) + half
        opacity = np.where(bright | ~clear & 1, 255, 127)
        colours[:8], opacity[:8] = 255 * low[:8], 63
    opacity[0] = 0
    return np.concatenate([colours, opacity[:, None]], axis=1).astype(np.uint8)


def _joined(parts: list[tuple[int, int, NDArray[np.uint8]]]) -> NDArray[np.uint8]:
    """Return regions (x, y, pixels) as one picture."""
    left, top = min(x for x, _, _ in parts), min(y for _, y, _ in parts)
    right = max(x + pixels.shape[1] for x, _, pixels in parts)
    bottom = max(y + pixels.shape[0] for _, y, pixels in parts)
    if (right - left) * (bottom - top) > _MOST_PIXELS:
        raise ValueError(f"captions of {right - left}x{bottom - top} pixels")
    out = np.zeros((bottom - top, right - left, 4), np.uint8)
    for x, y, pixels in parts:
        height, width = pixels.shape[:2]
        out[y - top : y - top + height, x - left : x - left + width] = pixels
    return out


def _png(pixels: NDArray[np.uint8]) -> bytes:
    codec = av.CodecContext.create("png", "w")
    codec.height, codec.width = pixels.shape[:2]
    codec.pix_fmt, codec.time_base = "rgba", Fraction(1, 25)
    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format="rgba")
    return b"".join(map(bytes, [*codec.encode(frame), *codec.encode(None)]))
