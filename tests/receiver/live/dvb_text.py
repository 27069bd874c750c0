"""Writes pictures of text as DVB subtitles (ETSI EN 300 743), and a stream that carries them."""

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

PAGE, REGION, CLUT, OBJECT = 1, 0, 0, 0


def _segment(kind: int, body: bytes) -> bytes:
    """A segment of the page (section 7.2)."""
    return struct.pack(">BBHH", 0x0F, kind, PAGE, len(body)) + body


def _lines(rows: NDArray[np.uint8]) -> bytes:
    """Rows of indices as strings of 8 bits a pixel (section 7.2.5.2.3)."""
    out = b""
    for row in rows:
        out += b"\x12"
        at = 0
        while at < len(row):
            end = at
            while end < len(row) and row[end] == row[at] and end - at < 127:
                end += 1
            run, colour = end - at, int(row[at])
            out += bytes([0, run]) if colour == 0 else bytes([0, 0x80 | run, colour])
            at = end
        out += b"\x00\x00\xf0"
    return out


def page(
    text: NDArray[np.uint8] | None, version: int, *, at: tuple[int, int] = (100, 500)
) -> bytes:
    """Return the data of one page: a picture of indices 0 (clear) and 1 (white); None clears it."""
    version &= 15
    state = version << 4 | 2 << 2  # mode change: nothing of before is needed
    regions = b"" if text is None else struct.pack(">BBHH", REGION, 0xFF, *at)
    out = _segment(0x10, struct.pack(">BB", 8, state) + regions)
    if text is not None:
        height, width = text.shape
        out += _segment(
            0x11,
            struct.pack(">BBHH", REGION, version << 4 | 8, width, height)
            + struct.pack(">BBBB", 3 << 5 | 3 << 2, CLUT, 0, 0)
            + struct.pack(">HHH", OBJECT, 0, 0),
        )
        entry = bytes([1, 1 << 5 | 1, 235, 128, 128, 0])
        clear = bytes([0, 1 << 5 | 1, 0, 128, 128, 255])
        out += _segment(0x12, struct.pack(">BB", CLUT, version << 4) + clear + entry)
        top, bottom = _lines(text[0::2]), _lines(text[1::2])
        body = struct.pack(">HBHH", OBJECT, version << 4, len(top), len(bottom)) + top + bottom
        out += _segment(0x13, body + bytes(len(body) % 2))
    return out + _segment(0x80, b"")  # the multiplex adds what stands around segments


def write_broadcast(
    path: Path, pages: list[tuple[float, bytes]], *, seconds: float, language: str = "fra"
) -> None:
    """Write a transport stream with picture, silence and the pages at their times."""
    with av.open(str(path), "w", format="mpegts") as container:
        picture = container.add_stream("libx264", rate=25)
        picture.width, picture.height, picture.pix_fmt = 160, 96, "yuv420p"
        picture.options = {"preset": "ultrafast", "g": "25", "bf": "0"}
        sound = container.add_stream("mp2", rate=48000, layout="stereo")
        text = container.add_mux_stream("dvb_subtitle")
        text.metadata["language"] = language
        text.time_base = Fraction(1, 90_000)
        waiting = list(pages)
        for number in range(round(25 * seconds)):
            while waiting and waiting[0][0] <= number / 25:
                time_s, data = waiting.pop(0)
                packet = av.Packet(data)
                packet.stream, packet.time_base = text, Fraction(1, 90_000)
                packet.pts = packet.dts = round(90_000 * time_s)
                container.mux(packet)
            frame = av.VideoFrame.from_ndarray(np.full((96, 160, 3), 60, np.uint8), format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, 25)
            container.mux(picture.encode(frame))
            quiet = av.AudioFrame.from_ndarray(np.zeros((1, 2 * 1920), np.int16), "s16", "stereo")
            quiet.sample_rate, quiet.pts = 48000, 1920 * number
            container.mux(sound.encode(quiet))
        container.mux(picture.encode(None))
        container.mux(sound.encode(None))
