"""The place of a marked picture is found on the mean of a window."""

from fractions import Fraction
from functools import cache

import numpy as np
import pytest

from tests.watermark.pictures import HEIGHT, WIDTH, mark, picture, source
from watermark.video.bars import content_box
from watermark.video.embed import VideoEmbedder
from watermark.video.grid import WHOLE, Region
from watermark.video.search import SCALE, PlaceSearch
from watermark.video.timing import Timing


@cache
def marked_frames() -> list[np.ndarray]:
    frames = [picture(n) for n in range(32)]
    return mark(frames, VideoEmbedder(WIDTH, HEIGHT, 25, source()))[16:32]


def found_places(frames: list[np.ndarray]) -> list[Region]:
    search = PlaceSearch(frames[0].shape, Timing(Fraction(25)))
    small = [np.asarray(frame * SCALE, dtype=np.uint16) for frame in frames]
    return [candidate.region for frame in small for candidate in search.process(frame)]


@pytest.mark.parametrize(
    "sides", [(0, 0, 0, 0), (20, 0, 0, 0), (0, 31, 5, 0), (13, 27, 17, 3)], ids=str
)
def test_crop_of_each_side(sides: tuple[int, int, int, int]) -> None:
    left, right, top, bottom = sides
    width, height = WIDTH - left - right, HEIGHT - top - bottom
    place = found_places([
        np.ascontiguousarray(f[top : HEIGHT - bottom, left : WIDTH - right])
        for f in marked_frames()
    ])[0]  # fmt: skip
    assert place.left * width == pytest.approx(-left, abs=1)  # an eighth of a cell
    assert place.top * height == pytest.approx(-top, abs=1)
    assert place.width * width == pytest.approx(WIDTH, abs=2)
    assert place.height * height == pytest.approx(HEIGHT, abs=2)


def test_bars_on_all_sides() -> None:
    shown = [np.full((600, 1000), 16, dtype=np.uint8) for _ in marked_frames()]
    for frame, content in zip(shown, marked_frames(), strict=True):
        frame[100 : 100 + HEIGHT, 300 : 300 + WIDTH] = content
    place = found_places(shown)[0]
    assert (place.left * 1000, place.top * 600) == pytest.approx((300, 100), abs=1)
    assert (place.width * 1000, place.height * 600) == pytest.approx((WIDTH, HEIGHT), abs=2)


def test_unmarked_picture_has_no_place() -> None:
    assert found_places([picture(n) for n in range(16, 32)]) == []


def test_black_picture_has_no_bars() -> None:
    assert content_box(np.full((360, 640), 16, dtype=np.float32)) == WHOLE
