"""The avatar: Python and page give the same vertices; the picture; the asset's errors."""

import gzip
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENTS
from codec.errors import CueError
from receiver.drawing._kernels import cover_triangles, draw_triangles
from receiver.drawing.avatar import eyes_closed, has_avatar, load_avatar, vertex_normals
from receiver.drawing.portrait import LIGHT, draw_avatar
from receiver.drawing.render import write_picture
from receiver.drawing.voice_document import avatar_document, neutral_camera, voice_document
from tests.receiver.node import PAGE, run_node
from tests.receiver.standin import make_voice

SHEET = Path(__file__).resolve().parents[2] / "artefacts" / "page" / "all-keys.png"
VOICE = load_voice()
AVATAR = load_avatar(VOICE)
PARAMS = np.random.default_rng(3).normal(0, 0.7, (3, len(VOICE.layout))).astype(np.float32)


def test_page_bends_the_same_skin(tmp_path: Path) -> None:
    (tmp_path / "avatar.bin").write_bytes(avatar_document(AVATAR))
    script = """
        import { Surface, eyesClosed, parseAvatar } from "./avatar.js";
        import { VoiceModel } from "./model.js";
        const bytes = readFileSync("avatar.bin");
        const arrays = parseAvatar(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
        const model = new VoiceModel(data.voice);
        const head = new Surface(arrays, "head");
        const hand = new Surface(arrays, "hand");
        const out = new Float64Array(339);
        const found = data.params.map((params, i) => {
            model.reconstruct(params, out);
            head.bend(model.faceShape, eyesClosed(data.times[i]), arrays.blink_vertices, arrays.blink);
            hand.bend(model.handShape, 0);
            return [Array.from(head.position), Array.from(hand.position), Array.from(head.normal)];
        });
        console.log(JSON.stringify([data.times.map(eyesClosed), found]));
    """  # noqa: E501
    times = np.array([1.0, 2.13, 7.9])
    data = {"voice": voice_document(VOICE), "params": PARAMS.tolist(), "times": times.tolist()}
    closed, found = run_node(tmp_path, script, data)
    assert np.allclose(closed, eyes_closed(times), atol=1e-9)
    for row, shut, (head, hand, normals) in zip(PARAMS.astype(float), closed, found, strict=True):
        shape = VOICE.face.shape(row[None, VOICE.face_columns[:7]])
        control = AVATAR.head.control(shape)
        control[:, AVATAR.blink_vertices] += shut * AVATAR.blink
        expected = AVATAR.head.refine(control)[0]
        assert np.abs(np.reshape(head, (-1, 3)) - expected).max() < 0.02
        still = VOICE.hand.shape(row[None, VOICE.hand_columns[:12]])
        expected_hand = AVATAR.hand.refine(AVATAR.hand.control(still))[0]
        assert np.abs(np.reshape(hand, (-1, 3)) - expected_hand).max() < 0.02
        unit = np.reshape(normals, (-1, 3))
        unit /= np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-9)
        cosine = (unit * vertex_normals(expected, AVATAR.head.triangles)).sum(axis=1)
        assert np.quantile(cosine, 0.001) > 0.98


def test_page_and_avatar_stay_below_a_megabyte() -> None:
    page = sum(file.stat().st_size for file in PAGE.iterdir())
    assert page + len(gzip.compress(avatar_document(AVATAR))) < 1_000_000


def test_skin_follows_its_markers() -> None:
    """Markers lie on the skin: the nearest vertex is never far from any of them."""
    still = np.zeros((1, len(VOICE.layout)))
    vertices = AVATAR.place(still)[0]
    markers = VOICE.reconstruct(still)[0]
    distance = [np.linalg.norm(vertices - marker, axis=1).min() for marker in markers]
    assert np.mean(distance) < 4.0
    assert np.max(distance) < 20.0  # the forearm's mesh is coarse


def test_head_motion_moves_the_skull_rigidly() -> None:
    moved = np.zeros((2, len(VOICE.layout)))
    moved[1, VOICE.face_columns[7:]] = 1.0
    vertices = AVATAR.place(moved)[:, : len(AVATAR.head.sources)]
    skull = AVATAR.head_weights.min(axis=1) > 0.999
    some = vertices[:, np.flatnonzero(skull)[::97]]
    before, after = (np.linalg.norm(v[:, None] - v[None], axis=-1) for v in some)
    assert skull.sum() > 1000
    assert np.abs(before - after).max() < 1e-6
    assert np.abs(some[1] - some[0]).max() > 0.5


def test_eyes_blink_now_and_then() -> None:
    closed = eyes_closed(np.arange(0, 60, 0.01))
    blinks = np.flatnonzero(np.diff((closed > 0.5).astype(int)) == 1)
    assert len(blinks) == 15
    assert 0.02 < (closed > 0).mean() < 0.08


def test_kernel_equals_its_python() -> None:
    rng = np.random.default_rng(2)
    points = rng.uniform(0, 24, (30, 3))
    triangles = rng.integers(0, 30, (40, 3))
    values = rng.uniform(0, 1, (30, 8))
    pictures = []
    for function in (draw_triangles, draw_triangles.py_func):
        depth, picture = np.full((20, 24), -np.inf), np.zeros((20, 24, 4))
        function(points, triangles, values, LIGHT, depth, picture)
        pictures.append(picture)
    assert pictures[0].any()
    assert np.allclose(pictures[0], pictures[1], atol=1e-12)


def test_kernel_of_shadows_equals_its_python() -> None:
    rng = np.random.default_rng(4)
    points = rng.uniform(0, 24, (30, 3))
    triangles = rng.integers(0, 30, (40, 3))
    opacity = rng.uniform(0, 1, 30)
    depth = rng.uniform(0, 24, (20, 24))
    masks = []
    for function in (cover_triangles, cover_triangles.py_func):
        mask = np.zeros((20, 24))
        function(points, triangles, opacity, depth, mask)
        masks.append(mask)
    assert masks[0].any()
    assert np.allclose(masks[0], masks[1], atol=1e-12)


def test_nearer_triangle_hides_the_farther() -> None:
    corners = np.array([[0, 0], [0, 20], [20, 0]], dtype=float)
    points = np.concatenate([np.c_[corners, [5, 5, 5]], np.c_[corners, [9, 9, 9]]])
    values = np.zeros((6, 8))
    values[:, 2] = values[:, 7] = 1
    values[:3, 3] = values[3:, 4] = 1
    for order in ([[0, 1, 2], [3, 4, 5]], [[3, 4, 5], [0, 1, 2]]):
        depth, picture = np.full((20, 20), -np.inf), np.zeros((20, 20, 4))
        draw_triangles(points, np.array(order), values, LIGHT, depth, picture)
        assert picture[4, 4, 1] > 3 * picture[4, 4, 0]
        assert picture[4, 4, 3] == 1


def test_portrait_has_a_face_in_the_middle() -> None:
    picture = np.zeros((180, 155, 3), np.uint8)
    vertices = AVATAR.place(np.zeros((1, len(VOICE.layout))))[0]
    draw_avatar(picture, AVATAR, vertices, neutral_camera(VOICE))
    mirrored = np.zeros_like(picture)
    draw_avatar(mirrored, AVATAR, vertices, neutral_camera(VOICE), mirror=True)
    red, _, blue = picture[60, 85].astype(int)
    assert red > 120
    assert red > blue + 20
    # The light stays where it is when the cuer is mirrored; her outline does not.
    outline = (picture.max(axis=2) > 60) != (mirrored[:, ::-1].max(axis=2) > 60)
    assert outline.mean() < 0.06


def test_every_shape_can_be_told_at_every_placement() -> None:
    """A sheet of all keys, to be looked at; no two hands have one outline."""
    table, camera = VOICE.gestures, neutral_camera(VOICE)
    start = len(AVATAR.head.sources)
    rows = []
    for place, name in enumerate(PLACEMENTS):
        if name == "rest":
            continue
        tiles, outlines = [], []
        for shape in range(1, 9):
            params = np.concatenate([
                np.zeros(7), table.shape_targets[shape], table.neutral_head,
                table.placement_targets[shape, place],
            ])  # fmt: skip
            tile = np.full((210, 180, 3), 24, np.uint8)
            vertices = AVATAR.place(params[None])[0]
            draw_avatar(tile, AVATAR, vertices, camera)
            tiles.append(tile)
            hand = np.zeros(tile.shape[:2])
            view = camera.project(vertices[start:])
            points = np.stack([90 + 210 * view[:, 0], 105 + 210 * view[:, 1], view[:, 2]], axis=1)
            opaque = np.ones(len(points))
            nowhere = np.full(hand.shape, -np.inf)
            cover_triangles(points, AVATAR.hand.triangles, opaque, nowhere, hand)
            outlines.append(hand > 0)
        rows.append(np.concatenate(tiles, axis=1))
        for i, j in combinations(range(8), 2):
            told = int((outlines[i] != outlines[j]).sum())
            assert told > 110, (name, i + 1, j + 1)  # 151 and more; a thumb is 150 pixels
    write_picture(SHEET, np.concatenate(rows))


def test_voice_without_avatar() -> None:
    voice = make_voice()
    assert not has_avatar(voice)
    with pytest.raises(CueError, match="voice stand-in has no avatar"):
        load_avatar(voice)
