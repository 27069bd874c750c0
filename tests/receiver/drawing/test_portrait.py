"""The picture of the avatar: visible triangles, light, shadow, and all keys apart."""

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENTS
from receiver.drawing._kernels import draw_triangles
from receiver.drawing._light_kernels import add_normals
from receiver.drawing._shadow_kernels import blur_shadow, cast
from receiver.drawing._visibility_kernels import BLENDED
from receiver.drawing.avatar import load_avatar
from receiver.drawing.camera import Camera
from receiver.drawing.portrait import FROM_LIGHT, LIGHT, SHADOW_WEIGHTS, Portrait
from receiver.drawing.render import write_picture
from receiver.drawing.voice_document import neutral_camera

SHEET = Path(__file__).resolve().parents[3] / "artefacts" / "page" / "all-keys.png"

VOICE = load_voice()
AVATAR = load_avatar(VOICE)

NO_SHADOW = np.zeros((4, 4, 2), np.float32)
AWAY = np.zeros((3, 4), np.float32)


def scene(triangles: int, seed: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Corners on the grid of 1/256 pixel, and triangles between them."""
    rng = np.random.default_rng(seed)
    points = (rng.integers(0, 24 * 256, (30, 3)) / 256).astype(np.float32)
    points[:, 2] = rng.uniform(0.9, 1.1, 30)
    found = rng.integers(0, 30, (triangles, 3)).astype(np.int32)
    return points, found


def drawn(
    points: NDArray[np.float32],
    triangles: NDArray[np.int32],
    values: NDArray[np.float32],
    kinds: NDArray[np.uint8] | None = None,
    ground: int = 0,
    *,
    as_python: bool = False,
) -> NDArray[np.uint8]:
    picture = np.full((40, 24, 3), ground, np.uint8)
    function = draw_triangles.py_func if as_python else draw_triangles
    kinds = np.zeros(len(triangles), np.uint8) if kinds is None else kinds
    function(points, triangles, values, kinds, LIGHT, NO_SHADOW, AWAY, picture)
    return picture


def plain(count: int, colour: Sequence[float], opacity: float = 1.0) -> NDArray[np.float32]:
    """Values of vertices that face the viewer."""
    return np.tile(np.array([0, 0, 1, *colour, 0, opacity], np.float32), (count, 1))


def test_samples_are_those_inside_the_nearest_triangle() -> None:
    """Compare with a test of every sample by exact fractions of the same corners."""
    points, triangles = scene(40, 2)
    colours = np.random.default_rng(1).uniform(0.2, 0.9, (40, 3))
    own = points[triangles].reshape(-1, 3)  # no shared corners: each triangle has one colour
    values = np.concatenate([plain(3, colour) for colour in colours])
    picture = drawn(own, np.arange(120, dtype=np.int32).reshape(-1, 3), values)
    alone = [
        drawn(own, np.arange(3 * f, 3 * f + 3, dtype=np.int32)[None], values) for f in range(40)
    ]
    x, y = np.meshgrid(np.arange(24) + 0.5, np.arange(40) + 0.5)
    best = np.full((4, 40, 24), -np.inf)
    owner = np.full((4, 40, 24), -1)
    offsets = [(-0.125, -0.375), (0.375, -0.125), (-0.375, 0.125), (0.125, 0.375)]
    for f, corners in enumerate(own.reshape(-1, 3, 3).astype(float)):
        a, b, c = corners
        area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        if area >= 0:
            assert not alone[f].any()
            continue
        for s, (dx, dy) in enumerate(offsets):
            wb = ((x + dx - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y + dy - a[1])) / area
            wc = ((b[0] - a[0]) * (y + dy - a[1]) - (x + dx - a[0]) * (b[1] - a[1])) / area
            near = a[2] + wb * (b[2] - a[2]) + wc * (c[2] - a[2])
            inside = (wb > 0) & (wc > 0) & (wb + wc < 1) & (near > best[s])
            best[s][inside] = near[inside]
            owner[s][inside] = f
    expected = np.zeros((40, 24, 3))
    for s in range(4):
        for f in np.unique(owner[s][owner[s] >= 0]):
            shown = alone[f].reshape(-1, 3).max(axis=0)  # a pixel wholly inside, if there is one
            expected[owner[s] == f] += shown / 4
    assert picture.any()
    whole = (owner == owner[0]).all(axis=0)
    assert whole.mean() > 0.5
    assert np.abs(expected - picture)[whole].max() <= 1
    assert np.abs(expected - picture).mean() < 0.5


def test_neighbours_leave_no_gap_and_do_not_overlap() -> None:
    """A fan of thin triangles covers each sample once, also half transparent ones."""
    points, _ = scene(0, 5)
    points[0], points[1:, 2] = (12.25, 20.5, 1.0), 1.0
    angles = np.arange(1, 30)
    points[1:, 0], points[1:, 1] = 12 + 40 * np.cos(angles), 20 + 40 * np.sin(angles)
    order = np.argsort(np.arctan2(points[1:, 1] - 20.5, points[1:, 0] - 12.25))[::-1] + 1
    fan = np.stack([np.zeros_like(order), order, np.roll(order, -1)], axis=1).astype(np.int32)
    points[:, :2] = np.rint(points[:, :2] * 256) / 256
    for opacity in (1.0, 0.5):
        kinds = np.full(len(fan), BLENDED * (opacity < 1), np.uint8)
        picture = drawn(points, fan, plain(30, (0.5, 0.5, 0.5), opacity), kinds)
        assert np.ptp(picture.reshape(-1, 3), axis=0).max() <= 1
        assert picture.min() > 50


def test_compiled_drawing_equals_its_python() -> None:
    points, triangles = scene(12, 2)
    values = np.random.default_rng(3).uniform(0, 1, (30, 8)).astype(np.float32)
    add_normals(points, triangles, values)
    kinds = (np.arange(12) % 3 == 0).astype(np.uint8) * np.uint8(BLENDED)
    fast, slow = (drawn(points, triangles, values, kinds, 90, as_python=p) for p in (False, True))
    assert (fast != 90).any()
    assert np.abs(fast.astype(int) - slow).max() <= 1


@pytest.mark.parametrize("order", [[[0, 1, 2], [3, 4, 5]], [[3, 4, 5], [0, 1, 2]]])
def test_nearer_triangle_hides_the_farther(order: list[list[int]]) -> None:
    corners = np.array([[0, 0], [0, 20], [20, 0]])
    points = np.concatenate([np.c_[corners, [0.9] * 3], np.c_[corners, [1.1] * 3]])
    values = np.concatenate([plain(3, (1, 0, 0)), plain(3, (0, 1, 0))])
    picture = drawn(points.astype(np.float32), np.array(order, np.int32), values)
    assert picture[4, 4, 1] > 3 * picture[4, 4, 0]


def test_transparent_triangle_shows_what_is_behind() -> None:
    points = np.array([[0, 0, 1], [0, 40, 1], [24, 0, 1]], np.float32)
    values = plain(3, (0.4, 0.4, 0.4), 0.25)
    picture = drawn(
        points, np.array([[0, 1, 2]], np.int32), values, np.array([BLENDED], np.uint8), ground=200
    )
    solid = drawn(points, np.array([[0, 1, 2]], np.int32), plain(3, (0.4, 0.4, 0.4)))
    assert np.abs(0.25 * solid[4, 4].astype(float) + 0.75 * 200 - picture[4, 4]).max() <= 1


def outline(
    points: NDArray[np.float64], camera: Camera, height: int, width: int
) -> NDArray[np.bool_]:
    """Pixels that the avatar's hand covers."""
    view = camera.project(points)
    columns, rows = width / 2 + height * view[:, 0], height / 2 + height * view[:, 1]
    seen = np.stack([columns, rows, view[:, 2]], axis=1).astype(np.float32)
    found = np.zeros((height, width, 2), np.float32)
    opaque = np.ones(len(points), np.float32)
    cast(seen, AVATAR.hand.triangles.astype(np.int32), opaque, found)
    return np.asarray(found[..., 0] > 0)


def test_map_of_the_shadow_is_soft() -> None:
    """The map of a square keeps its sum and depth and loses its edge."""
    cover = np.zeros((64, 64, 2), np.float32)
    square = np.array([[20, 20, 40], [20, 40, 40], [40, 40, 40], [40, 20, 40]], np.float32)
    cast(square, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.ones(4, np.float32), cover)
    assert (cover[..., 0] == 1).sum() == 400
    blurred = blur_shadow(cover, SHADOW_WEIGHTS)
    assert blurred[..., 0].sum() == pytest.approx(400, rel=1e-4)
    assert np.allclose(blurred[30, 30], [1, 40], atol=1e-3)
    assert np.abs(np.diff(blurred[30, :, 0])).max() < 0.25
    assert np.allclose(FROM_LIGHT @ FROM_LIGHT.T, np.eye(3), atol=1e-6)


@pytest.mark.parametrize("shape", [4, 5])
def test_the_shadow_on_the_throat_is_no_finger(shape: int) -> None:
    """It darkens what is beside the hand, and has no edge."""
    table = VOICE.gestures
    params = np.concatenate(
        [
            np.zeros(7),
            table.shape_targets[shape],
            table.neutral_head,
            table.placement_targets[shape, PLACEMENTS.index("throat")],
        ]
    )
    camera, start = neutral_camera(VOICE), len(AVATAR.head.sources)
    portrait, vertices = Portrait(AVATAR, camera), AVATAR.place(params[None])[0]
    hand = maximum_filter(outline(vertices[start:], camera, 360, 310), 3)
    pictures = np.zeros((2, 360, 310, 3), np.uint8)
    portrait.draw(pictures[0], vertices)
    vertices[start:, 0] -= 5000
    portrait.draw(pictures[1], vertices)
    with_hand, without = pictures.astype(float).sum(axis=3) + 3
    darker = 1 - with_hand / without
    assert 0.003 < (darker[~hand] > 0.08).mean() < 0.1
    assert darker[~hand].min() > -0.02
    steps = np.abs(np.diff(darker, axis=1))[~hand[:, 1:] & ~hand[:, :-1]]
    assert np.quantile(steps, 0.995) < 0.04


def test_portrait_has_a_face_in_the_middle() -> None:
    picture = np.zeros((180, 155, 3), np.uint8)
    vertices = AVATAR.place(np.zeros((1, len(VOICE.layout))))[0]
    Portrait(AVATAR, neutral_camera(VOICE)).draw(picture, vertices)
    mirrored = np.zeros_like(picture)
    Portrait(AVATAR, neutral_camera(VOICE), mirror=True).draw(mirrored, vertices)
    red, _, blue = picture[60, 85].astype(int)
    assert red > 120
    assert red > blue + 20
    # The light stays where it is when the cuer is mirrored; her outline does not.
    outline = (picture.max(axis=2) > 60) != (mirrored[:, ::-1].max(axis=2) > 60)
    assert outline.mean() < 0.06


def test_every_shape_is_distinct_at_every_placement() -> None:
    """A sheet of all keys, to look at; no two hands have one outline."""
    table, camera = VOICE.gestures, neutral_camera(VOICE)
    portrait = Portrait(AVATAR, camera)
    start = len(AVATAR.head.sources)
    rows = []
    for place, name in enumerate(PLACEMENTS):
        if name == "rest":
            continue
        tiles, outlines = [], []
        for shape in range(1, 9):
            params = np.concatenate(
                [
                    np.zeros(7),
                    table.shape_targets[shape],
                    table.neutral_head,
                    table.placement_targets[shape, place],
                ]
            )
            tile = np.full((210, 180, 3), 24, np.uint8)
            vertices = AVATAR.place(params[None])[0]
            portrait.draw(tile, vertices)
            tiles.append(tile)
            outlines.append(outline(vertices[start:], camera, 210, 180))
        rows.append(np.concatenate(tiles, axis=1))
        for i, j in combinations(range(8), 2):
            told = int((outlines[i] != outlines[j]).sum())
            assert told > 110, (name, i + 1, j + 1)  # 151 and more; a thumb is 150 pixels
    write_picture(SHEET, np.concatenate(rows))
