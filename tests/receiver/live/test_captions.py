"""DVB subtitles of a broadcast become pictures at their times."""

import io
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from receiver.live.broadcast import Broadcast, Happening
from receiver.live.captions import CaptionDecoder, CaptionsShown
from receiver.live.continuity import ORIGIN_S, STAMP_PERIOD_S, SteadyClock
from tests.receiver.live.dvb_text import page, write_broadcast

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
