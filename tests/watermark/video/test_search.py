"""The place of a marked picture is found on the mean of a window."""

from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from tests.watermark.pictures import HEIGHT, WIDTH, mark, picture, source
from watermark.video import _place_kernels, search
from watermark.video.bars import content_box
from watermark.video.embed import VideoEmbedder
from watermark.video.grid import WHOLE, Grid, Region
from watermark.video.painting import Painter
from watermark.video.places import PlaceTable, source_taps
from watermark.video.search import SCALE, PlaceSearch
from watermark.video.timing import Timing


@cache
def marked_frames() -> list[np.ndarray]:
    frames = [picture(n) for n in range(32)]
    return mark(frames, VideoEmbedder(WIDTH, HEIGHT, 25, source()))[16:32]


def found_places(frames: list[np.ndarray], *, crops: bool = True) -> list[Region]:
    seeker = PlaceSearch(frames[0].shape, Timing(Fraction(25)), crops=crops)
    small = [np.asarray(frame * SCALE, dtype=np.uint16) for frame in frames]
    return [candidate.region for frame in small for candidate in seeker.process(frame)]


@pytest.mark.parametrize(
    "sides", [(0, 0, 0, 0), (20, 0, 0, 0), (0, 31, 5, 0), (13, 27, 17, 3)], ids=str
)
def test_crop_of_each_side(sides: tuple[int, int, int, int]) -> None:
    left, right, top, bottom = sides
    width, height = WIDTH - left - right, HEIGHT - top - bottom
    place = found_places(
        [
            np.ascontiguousarray(f[top : HEIGHT - bottom, left : WIDTH - right])
            for f in marked_frames()
        ]
    )[0]
    assert place.left * width == pytest.approx(-left, abs=1)  # an eighth of a cell
    assert place.top * height == pytest.approx(-top, abs=1)
    assert place.width * width == pytest.approx(WIDTH, abs=2)
    assert place.height * height == pytest.approx(HEIGHT, abs=2)


@pytest.mark.parametrize(("deviation", "blur"), [(15, 1.5), (25, 1.0), (35, 2.5)])
def test_crop_of_a_sharp_picture(deviation: float, blur: float) -> None:
    """A step beside the right place, a look at it shows nothing."""
    detail = gaussian_filter(np.random.default_rng(3).normal(size=(HEIGHT, WIDTH)), blur)
    still = 110 + deviation / detail.std() * detail
    frames = [
        np.clip(still + 0.2 * (picture(n) - 110.0), 20, 230).astype(np.uint8) for n in range(48)
    ]
    marked = mark(frames, VideoEmbedder(WIDTH, HEIGHT, 25, source()))[16:48]
    place = found_places([np.ascontiguousarray(frame[18:, 32:]) for frame in marked])[0]
    assert place.left * (WIDTH - 32) == pytest.approx(-32, abs=1)
    assert place.top * (HEIGHT - 18) == pytest.approx(-18, abs=1)


def test_without_crops_the_usual_place_is_found() -> None:
    assert found_places(marked_frames(), crops=False)[0] == WHOLE
    cut = [np.ascontiguousarray(frame[:, 20:]) for frame in marked_frames()]
    assert not found_places(cut, crops=False)


def test_bars_on_all_sides() -> None:
    shown = [np.full((600, 1000), 16, dtype=np.uint8) for _ in marked_frames()]
    for frame, content in zip(shown, marked_frames(), strict=True):
        frame[100 : 100 + HEIGHT, 300 : 300 + WIDTH] = content
    place = found_places(shown)[0]
    assert (place.left * 1000, place.top * 600) == pytest.approx((300, 100), abs=1)
    assert (place.width * 1000, place.height * 600) == pytest.approx((WIDTH, HEIGHT), abs=2)


@pytest.mark.parametrize("axis", [0, 1], ids=["above and below", "at the sides"])
def test_film_with_bars_of_its_own_in_a_letterbox(axis: int) -> None:
    """They are a part of the marked picture, those of the letterbox are not."""
    frames = [picture(n).copy() for n in range(32)]
    for frame in frames:
        lines = np.moveaxis(frame, axis, 0)
        lines[:45] = lines[-45:] = 16
    marked = mark(frames, VideoEmbedder(WIDTH, HEIGHT, 25, source()))[16:32]
    shown = [np.full((HEIGHT * 4 // 3, WIDTH), 16, dtype=np.uint8) for _ in marked]
    for frame, content in zip(shown, marked, strict=True):
        frame[HEIGHT // 6 :][:HEIGHT] = content
    assert Region(0, 1 / 8, 1, 3 / 4) in found_places(shown)


def globe(n: int) -> np.ndarray:
    """A striped globe in a black sky."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    inside = (x - WIDTH / 2) ** 2 + (y - HEIGHT / 2) ** 2 < (0.35 * HEIGHT) ** 2
    stripes = 110 + 60 * np.sin(0.08 * x + 0.05 * y) + 20 * np.sin(0.5 * x + 0.1 * n)
    return np.where(inside, stripes, 16).astype(np.uint8)


def street(n: int) -> np.ndarray:
    """Fine texture that moves by two thirds of a pixel a frame."""
    noise = np.random.default_rng(7).normal(size=(HEIGHT, 2 * WIDTH))
    spectrum = np.fft.rfft2(noise)
    down, across = np.fft.fftfreq(HEIGHT)[:, None], np.fft.rfftfreq(2 * WIDTH)[None]
    spectrum /= 0.02 + np.hypot(down, across) ** 1.5
    spectrum *= np.exp(2j * np.pi * across * (0.67 * n))
    texture = np.fft.irfft2(spectrum)[:, :WIDTH]
    return np.asarray(np.clip(120 + 25 * texture / texture.std(), 16, 235).astype(np.uint8))


@pytest.mark.parametrize("scene", [globe, street])
def test_crop_of_a_scene_that_hides_it(scene: Any) -> None:
    """What looks like bars is a part of the picture; the picture moves under the mark."""
    frames = mark([scene(n) for n in range(32)], VideoEmbedder(WIDTH, HEIGHT, 25, source()))
    width, height = WIDTH - 22, HEIGHT - 9
    place = found_places([np.ascontiguousarray(f[9:, 22:]) for f in frames])[0]
    assert (place.left * width, place.top * height) == pytest.approx((-22, -9), abs=1)
    assert (place.width * width, place.height * height) == pytest.approx((WIDTH, HEIGHT), abs=2)


def test_unmarked_picture_has_no_place() -> None:
    assert found_places([picture(n) for n in range(16, 32)]) == []


def test_black_picture_has_no_bars() -> None:
    assert content_box(np.full((360, 640), 16, dtype=np.float32)) == WHOLE
    rng = np.random.default_rng(7)
    picture = rng.normal(16, 0.5, (90, 160)).astype(np.float32)
    picture[20:70, 10:150] += rng.normal(60, 20, (50, 140))
    for shown in (picture, picture[::-1], picture[:, ::-1].copy()):
        for axis in (0, 1):
            for back in (False, True):
                lines = np.moveaxis(shown, axis, 0)[:: -1 if back else 1]
                even = (lines.std(axis=1) < 1.5) & (abs(lines.mean(axis=1) - lines[0].mean()) < 3)
                arguments = (np.ascontiguousarray(shown), axis, back, 1.5, 3.0)
                assert _place_kernels.even_lines(*arguments) == int(even.argmin())


def test_title_on_an_even_ground_has_the_bars_above_and_below_alone() -> None:
    shown = np.full((360, 640), 16, dtype=np.float32)
    shown[45:315] = 70
    shown[150:200, 290:350] += 40 * (np.add.outer(np.arange(50), np.arange(60)) % 2)
    assert content_box(shown) == Region(0, 1 / 8, 1, 3 / 4)


def test_reduced_picture_has_the_amplitudes_of_the_whole_one() -> None:
    rng = np.random.default_rng(3)
    amplitude = rng.normal(0, 20, (2, 45, 80))
    large = 128 + Painter(1440, 810).paint(amplitude, np.zeros((45, 80), dtype=bool))
    small = large.reshape(270, 3, 480, 3).mean(axis=(1, 3))
    assert Grid(480, 270, reduced=3).project(small) == pytest.approx(amplitude, abs=0.2)


def test_votes_of_all_places_are_added() -> None:
    rng = np.random.default_rng(5)
    pilots = np.array([[0, 0, 1], [1, 1, 0], [0, 1, 2], [1, 3, 2]])
    votes = rng.integers(0, 49, (4, 6, 8)).astype(np.int16)
    across, down = rng.integers(0, 6, (21, 3)), rng.integers(0, 8, (9, 4))
    table, best, choice = np.ones((21, 9), np.float32), np.empty(21, np.float32), np.zeros(21, int)
    indices = across.astype(np.uint64), down.astype(np.uint64)
    _place_kernels.place_scores_into(votes, pilots, *indices, 96, 0.5, 0.6, table, best, choice)
    for x, y in np.ndindex(table.shape):
        total = sum(votes[p, across[x, c], down[y, r]] for p, (_, r, c) in enumerate(pilots)) - 96
        looked_at = (x + y) % 2 == 0
        assert table[x, y] == pytest.approx(0.6 + 0.5 * total**2 if looked_at else 1.0)
        assert best[x] >= table[x, y] or not looked_at
    assert np.array_equal(best, table[np.arange(21), choice])


def test_crops_are_sought_less_often_after_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    """But the look whose best crop stands out is never left out."""
    looks: list[int] = []
    real = PlaceTable.look

    def look(self: PlaceTable, *arguments: Any) -> list[Region]:
        looks.append(arguments[-1])
        return real(self, *arguments)

    monkeypatch.setattr(PlaceTable, "look", look)
    monkeypatch.setattr(PlaceTable, "leads", lambda self, phase: phase == 4)
    monkeypatch.setattr(search, "EAGER", 2)
    found_places([picture(0)] * 98)
    assert len(looks) == 17  # of 27 without a rest
    assert looks.count(4) == 6  # one a superframe


def test_the_look_with_the_best_crop_leads() -> None:
    rng = np.random.default_rng(5)
    pilots = np.array([[0, r, c] for r in range(0, 45, 5) for c in range(0, 80, 8)])
    signs = rng.choice([-1, 1], len(pilots)).astype(np.float32)
    table = PlaceTable(pilots, rng.random(len(pilots)), 2.8, signs, 4)
    assert table.leads(3)  # none has been taken yet
    sums = []
    for phase in range(4):
        still = gaussian_filter(rng.normal(100, 9, (360, 640)), 3).astype(np.float32)
        table.look(still, still, np.ascontiguousarray(still[::2, ::2]), WHOLE, phase)
        sums.append(table._best.max())
    assert [table.leads(phase) for phase in range(4)] == [s == max(sums) for s in sums]
    assert len(set(sums)) == 4


def test_kernels_agree_with_their_python() -> None:
    rng = np.random.default_rng(4)
    picture = rng.normal(100, 20, (30, 40)).astype(np.float32)
    larger = np.zeros((36, 46), dtype=np.float32)
    pilots = np.array([[0, 0, 1], [1, 1, 0], [0, 1, 2]])
    first = np.array([2, 7, 12]), np.array([3, 9])
    factors = rng.normal(size=(2, 8)).astype(np.float32)
    fields = np.empty((3, 7, 8), dtype=np.float32)
    texture = np.abs(rng.normal(2, 1, (15, 20))).astype(np.float32)
    dither, signs = rng.random(3).astype(np.float32), np.array([1, -1, 1], dtype=np.float32)
    limits = np.array([[1.4, 2.5], [2.2, 3.0]], dtype=np.float32)
    bounds = np.array([12, 18, 4])
    votes = np.zeros((3, 6, 8), dtype=np.int16)
    across = rng.integers(0, 6, (7, 3)).astype(np.uint64)
    down = rng.integers(0, 5, (5, 2)).astype(np.uint64)
    table, best = np.ones((7, 5), dtype=np.float32), np.empty(7, dtype=np.float32)
    size = np.array([32, 22, 4, 3, 2], dtype=np.float32)
    start = np.stack([a[pilots[:, 2 - n]] for n, a in enumerate(first)], axis=1)
    taps = *source_taps(30, 30, 1.0, 25.0), *source_taps(40, 40, -1.0, 35.0)
    calls: dict[str, tuple[Any, ...]] = {
        "resample_into": (picture, *taps, 3, larger),
        "halve_into": (picture, np.empty((15, 20), dtype=np.float32)),
        "fine_texture_into": (picture[:15, :20], np.empty((12, 17), dtype=np.float32)),
        "pilot_fields_into": (picture, pilots, *first, factors, fields),
        "pilot_votes_into": (
            fields, texture, pilots, *first, bounds, dither, 2.8, signs, limits, 0.6, 24.0, votes,
        ),
        "place_scores_into": (
            votes, pilots, across, down, 72, 0.5, 0.6, table, best, np.zeros(7, dtype=np.int64),
        ),
        "climb_into": (
            fields, texture, pilots, start.astype(np.float32), size, dither, 2.8, signs, limits,
            0.25, rng.normal(0, 0.05, (4, 4)), 2, rng.normal(0, 0.1, (2, 4)), np.zeros(2),
        ),
    }  # fmt: skip
    for name, arguments in calls.items():
        kernel = getattr(_place_kernels, name)
        own = [a.copy() if isinstance(a, np.ndarray) else a for a in arguments]
        kernel(*arguments)
        kernel.py_func(*own)
        for compiled, plain in zip(arguments, own, strict=True):
            np.testing.assert_allclose(compiled, plain, rtol=1e-4, atol=1e-4, err_msg=name)
