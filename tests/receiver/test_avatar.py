"""The avatar: Python and page give the same vertices; the picture; the asset's errors."""

import gzip
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENTS
from codec.errors import CueError
from receiver.drawing._kernels import cover_triangles, draw_triangles
from receiver.drawing.avatar import eyes_closed, has_avatar, load_avatar, vertex_normals
from receiver.drawing.portrait import LIGHT, draw_avatar
from receiver.drawing.render import write_picture
from receiver.drawing.voice_document import avatar_document, neutral_camera, voice_document
from synth.motion.body.body import load_body
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.text_score import score_of_text
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
            const closed = eyesClosed(data.times[i]);
            head.bend(model.faceShape, { eyeBlinkLeft: closed, eyeBlinkRight: closed }, data.gaze);
            hand.bend(model.handShape);
            return [Array.from(head.position), Array.from(hand.position), Array.from(head.normal)];
        });
        console.log(JSON.stringify([data.times.map(eyesClosed), found]));
    """  # noqa: E501
    times = np.array([1.0, 2.13, 7.9])
    gaze = [0.3, -0.2]
    data = {"voice": voice_document(VOICE), "params": PARAMS.tolist(), "times": times.tolist()}
    data["gaze"] = gaze
    closed, found = run_node(tmp_path, script, data)
    assert np.allclose(closed, eyes_closed(times), atol=1e-9)
    for row, shut, (head, hand, normals) in zip(PARAMS.astype(float), closed, found, strict=True):
        shape = VOICE.face.shape(row[None, VOICE.face_columns[:7]])
        control = AVATAR.head.control(shape)
        for name in ("eyeBlinkLeft", "eyeBlinkRight"):
            vertices, moved = AVATAR.shapes[name]
            control[:, vertices] += shut * moved
        AVATAR.mouth.solve(control)
        expected = AVATAR.head.refine(control)
        AVATAR.turn_eyes(expected, np.array([gaze]))
        expected = expected[0]
        assert np.abs(np.reshape(head, (-1, 3)) - expected).max() < 0.02
        still = VOICE.hand.shape(row[None, VOICE.hand_columns[:12]])
        expected_hand = AVATAR.hand.refine(AVATAR.hand.control(still))[0]
        assert np.abs(np.reshape(hand, (-1, 3)) - expected_hand).max() < 0.02
        unit = np.reshape(normals, (-1, 3))
        unit /= np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-9)
        cosine = (unit * vertex_normals(expected, AVATAR.head.triangles)).sum(axis=1)
        # The page keeps the eyeballs' normals.
        skin = np.ones(len(cosine), dtype=bool)
        for first, count in AVATAR.eye_ranges:
            skin[first : first + count] = False
        assert np.quantile(cosine[skin], 0.001) > 0.98


def test_eyes_look_where_they_are_sent() -> None:
    points = AVATAR.head.refine(AVATAR.head.rest[None])
    middle, (first, count) = AVATAR.eye_middles[0], AVATAR.eye_ranges[0]
    pupil = first + points[0, first : first + count, 2].argmax()
    for gaze, axis in (([0.2, 0.0], 0), ([0.0, 0.2], 1)):
        turned = points.copy()
        AVATAR.turn_eyes(turned, np.array([gaze]))
        moved = turned[0, pupil] - points[0, pupil]
        assert 1.0 < moved[axis] < 4.0
        before, after = (np.linalg.norm(p[0, pupil] - middle) for p in (points, turned))
        assert np.isclose(before, after)


def _spoken(text: str) -> np.ndarray:
    score = score_of_text(text, start_s=0.5)
    pose = GestureSynthesiser("claire", rate_hz=25).pose(
        score, 0.0, int(25 * (score.keys[-1].end + 0.5))
    )
    return VOICE.invert(load_body("claire").markers(pose), rate_hz=25).params


def _teeth() -> np.ndarray:
    """Return the vertices of the teeth: ivory ones along the arches."""
    x, y, z = AVATAR.head.refine(AVATAR.head.rest[None])[0].T
    near = np.zeros(len(x), dtype=bool)
    for front, bend, steep, tip, middle in AVATAR.mouth.arch:
        across = (x - middle) ** 2
        near |= (np.abs(front - across * (bend + steep * across) - z) < 4) & (np.abs(y - tip) < 14)
    red, _, blue = AVATAR.head.colours[:, :3].T.astype(float)
    return np.flatnonzero(near & (blue > 0.78 * red) & (red > 60))


def test_lips_neither_cut_each_other_nor_the_teeth() -> None:
    """Labials and rounded vowels: the edges of the lips meet, the teeth stay behind them."""
    params = _spoken("Vive fauve, beau papa même, chaud jus du veau.")
    assert len(params) > 80
    shape = VOICE.face.shape(params[:, VOICE.face_columns[:7]])
    control = AVATAR.head.control(shape)
    mouth = AVATAR.mouth

    def overlap_mm(mesh: np.ndarray) -> float:
        edge = mesh[:, mouth.rings[6]]
        upper, lower = edge[:, mouth.upper], edge[:, mouth.lower]
        found = [
            np.interp(u[:, 0], w[:, 0], w[:, 1]) - u[:, 1]
            for u, w in zip(upper, lower, strict=True)
        ]
        return float(np.max(found))

    def teeth_before_lips(mesh: np.ndarray) -> int:
        """Count teeth's vertices of each frame that cover the lips' red, seen from the front."""
        head, some = AVATAR.head, _teeth()
        carried = mesh[:, head.sources[some]] * head.shares[some, :, None]
        tooth = carried.sum(axis=2) + head.offsets[some]
        red = mesh[:, mouth.rings[6:]].reshape(len(mesh), -1, 3)
        covering = 0
        for teeth, lips in zip(tooth, red, strict=True):
            tree = cKDTree(lips[:, :2])
            near, at = tree.query(teeth[:, :2], distance_upper_bound=1.0)
            some = np.isfinite(near)
            covering += int((teeth[some, 2] > lips[at[some], 2]).sum())
        return covering

    before = overlap_mm(control), teeth_before_lips(control)
    mouth.solve(control)
    assert before[0] > 0.5  # the map alone lets them pass each other
    assert overlap_mm(control) < 0.2
    assert teeth_before_lips(control) == 0
    assert before[1] > 0


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
