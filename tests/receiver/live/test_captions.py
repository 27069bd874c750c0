"""DVB subtitles of a broadcast become pictures at their times."""

import io
import struct
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from receiver.live.broadcast import Broadcast, Happening
from receiver.live.captions import CaptionDecoder, CaptionsShown, _segments
from receiver.live.continuity import ORIGIN_S, STAMP_PERIOD_S, SteadyClock
from tests.receiver.live.dvb_text import page, write_broadcast
from tests.receiver.live.ffmpeg_text import FfmpegText

LINE = np.zeros((40, 200), np.uint8)
LINE[10:30, 20:180] = 1
LINE[14:26, 50:60] = 0


def pixels(png: bytes) -> NDArray[np.uint8]:
    """Red, green, blue and opacity (height, width, 4) of a picture."""
    with av.open(io.BytesIO(png), "r") as container:
        frame = next(container.decode(video=0))
        return np.asarray(frame.to_ndarray(format="rgba"), dtype=np.uint8)


def test_a_broadcast_s_text_comes_as_pictures_in_step(tmp_path: Path) -> None:
    path = tmp_path / "text.ts"
    pages = [(1.0, page(LINE, 0)), (3.0, page(None, 1)), (4.0, page(LINE[:, ::-1].copy(), 2))]
    write_broadcast(path, pages, seconds=5.0)
    found: list[Happening] = []
    broadcast = Broadcast(str(path), load_voice(), found.append, once=True)
    broadcast.run()
    shown = [one for one in found if isinstance(one, CaptionsShown)]
    starts = np.array([one.start_s for one in shown])
    assert starts == pytest.approx(starts[0] + np.array([0.0, 2.0, 3.0]), abs=0.001)
    assert [one.end_s - one.start_s for one in shown] == pytest.approx([8.0] * 3)
    assert shown[1].png == b""
    for one, line in ((shown[0], LINE), (shown[2], LINE[:, ::-1])):
        picture = pixels(one.png)
        assert np.array_equal(picture[..., 3] == 255, line == 1)
        assert np.all(picture[line == 1, :3] > 250)
    assert starts[0] == pytest.approx(ORIGIN_S + 1.0, abs=0.05)  # first stamp: picture or sound


def test_damaged_text_ends_nothing() -> None:
    rng, whole = np.random.default_rng(1), page(LINE, 0)
    decoder, came = CaptionDecoder(), 0
    for _ in range(300):
        data = np.frombuffer(whole, np.uint8).copy()
        data[rng.integers(0, len(data), 3)] = rng.integers(0, 256, 3)
        packet = av.Packet(data.tobytes()[: rng.integers(7, len(data) + 1)])
        try:
            came += decoder.take(packet, 0.0) is not None
        except (av.error.FFmpegError, ValueError):
            continue
    assert came


def test_a_stamp_is_found_without_moving_the_clock() -> None:
    clock = SteadyClock()
    assert clock.find(5.0) is None
    clock.place("picture", STAMP_PERIOD_S - 1.0)
    assert clock.find(1.0) == pytest.approx(3.0)  # behind the wrap
    assert clock.find(500.0) is None
    assert not clock.place("picture", STAMP_PERIOD_S - 0.96).spliced


COLOURS = np.array([0, 0xFFFFFFFF, 0xFFFFFF00, 0xFF000000], np.uint32)
ABOVE, BELOW = np.full((20, 100), 1, np.uint8), np.full((20, 100), 2, np.uint8)


def shown(decoder: CaptionDecoder, data: bytes) -> NDArray[np.uint8]:
    """Return the picture that a packet shows; without pixels where it clears the page."""
    found = decoder.take(av.Packet(data), 0.0)
    assert found is not None
    return pixels(found.png) if found.png else np.empty((0, 0, 4), np.uint8)


def joined(segments: list[tuple[int, bytes]]) -> bytes:
    return b"".join(
        struct.pack(">BBHH", 0x0F, kind, 1, len(body)) + body for kind, body in segments
    )


@pytest.mark.parametrize("depth", [16, 256])  # FFmpeg writes no 2 bits
def test_both_depths_of_ffmpeg_s_writer_keep_their_colours(depth: int) -> None:
    rng = np.random.default_rng(depth)
    colours = rng.integers(0, 1 << 24, depth).astype(np.uint32) | np.uint32(0xFF000000)
    colours[0] = 0
    line = np.repeat(rng.integers(0, depth, (24, 50)).astype(np.uint8), 8, axis=1)
    decoder, writer = CaptionDecoder(), FfmpegText()
    got = shown(
        decoder, writer.page([(100, 400, line, colours), (60, 460, line[:, ::-1], colours)])
    )
    assert got.shape == (84, 440, 4)
    for left, top, indices in ((40, 0, line), (0, 60, line[:, ::-1])):
        want = np.stack([colours[indices] >> at & 255 for at in (16, 8, 0, 24)], axis=-1)
        part = got[top : top + 24, left : left + 400]
        assert np.array_equal(part[..., 3], want[..., 3])
        assert np.abs(part.astype(int) - want)[want[..., 3] == 255].max() <= 2  # 8 bits of YCbCr
    assert shown(decoder, writer.page([])).size == 0


def changed(data: bytes, version: int, *, region: int | None = None, regions: int = 2) -> bytes:
    """Return a page of FFmpeg's as an update: `regions` listed, only the content of `region`."""
    out = []
    for kind, body in _segments(data):
        if kind == 0x10:
            out.append((kind, bytes([body[0], version << 4]) + body[2 : 2 + 6 * regions]))
        elif kind == 0x80 or (kind != 0x14 and region == body[kind == 0x13]):
            out.append((kind, body))
    return joined(out)


def test_pages_that_change_in_part_keep_the_rest() -> None:
    decoder, writer = CaptionDecoder(), FfmpegText()
    first = writer.page([(100, 400, ABOVE, COLOURS), (100, 460, BELOW, COLOURS)])
    got = shown(decoder, first)
    assert [list(got[y, 5]) for y in (5, 40, 75)] == [[255] * 4, [0] * 4, [255, 255, 0, 255]]
    second = writer.page([(100, 400, ABOVE, COLOURS), (100, 460, BELOW + 1, COLOURS)])
    got = shown(decoder, changed(second, 1, region=1))
    assert [list(got[y, 5]) for y in (5, 75)] == [[255] * 4, [0, 0, 0, 255]]
    got = shown(decoder, changed(second, 2, regions=1))
    assert got.shape == (20, 100, 4)
    assert np.all(got == 255)


def test_colours_alone_may_change_and_may_be_missing() -> None:
    decoder, writer = CaptionDecoder(), FfmpegText()
    data = writer.page([(100, 400, ABOVE, COLOURS)])
    shown(decoder, data)
    state = next(body for kind, body in _segments(data) if kind == 0x10)
    red = bytes([0, 0x10, 1, 0x5F, 81, 240, 90, 0])  # entry 1 of 4 bits
    other = bytes([0, 0x20, 1, 0x3F, 81, 90, 240, 0])  # entry 1 of 8 bits: of no region here
    state = bytes([state[0], 0x10]) + state[2:]
    update = joined([(0x10, state), (0x12, red), (0x12, other), (0x80, b"")])
    assert np.abs(shown(decoder, update)[0, 0].astype(int) - [255, 0, 0, 255]).max() <= 2
    bare = joined([(kind, body) for kind, body in _segments(data) if kind != 0x12])
    assert list(shown(CaptionDecoder(), bare)[0, 0]) == [255, 0, 0, 255]  # section 10.2


def two_bits(row: list[int]) -> bytes:
    """Return a row as a string of 2 bits a pixel, without runs (section 7.2.5.2.1)."""
    bits = "".join("0001" if pixel == 0 else f"{pixel:02b}" for pixel in row) + "000000"
    bits += "0" * (-len(bits) % 8)
    return b"\x10" + int(bits, 2).to_bytes(len(bits) // 8, "big") + b"\xf0"


@pytest.mark.parametrize("coloured", [True, False])
def test_two_bits_a_pixel(coloured: bool) -> None:
    found = []
    for kind, body in _segments(FfmpegText().page([(9, 9, ABOVE[:2, :8], COLOURS)])):
        if kind == 0x11:
            body = body[:6] + bytes([1 << 5 | 1 << 2 | 3]) + body[7:]
        elif kind == 0x12:
            body = body[:2] + bytes([2, 0x9F, 81, 240, 90, 0])
        elif kind == 0x13:
            rows = two_bits([0, 1, 2, 3, 0, 3, 2, 1]), two_bits([1] * 8)
            body = body[:3] + struct.pack(">HH", *map(len, rows)) + b"".join(rows)
        if coloured or kind != 0x12:
            found.append((kind, body))
    got = shown(CaptionDecoder(), joined(found)).astype(int)
    clear, white, black, grey = [0] * 4, [255] * 4, [0, 0, 0, 255], [127, 127, 127, 255]
    second = [255, 0, 0, 255] if coloured else black
    assert np.abs(got[0] - [clear, white, second, grey, clear, grey, second, white]).max() <= 2
    assert np.all(got[1] == 255)
