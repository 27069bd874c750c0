"""The avatar: Python and page give the same vertices; the asset's errors."""

import gzip
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from codec.cuer.motion import Motion, sample_params
from codec.cuer.voice import load_voice
from codec.cues.phonology import PHONES
from codec.errors import CueError
from receiver.drawing.avatar import has_avatar, load_avatar, vertex_normals
from receiver.drawing.avatar_document import avatar_document
from receiver.drawing.movement import RULES, express, lean
from receiver.drawing.portrait import Portrait
from receiver.drawing.skeleton import solve
from receiver.drawing.voice_document import neutral_camera, voice_document
from receiver.foreign.build import foreign_avatar
from synth.motion.body.body import load_body
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.text_score import score_of_text
from tests.receiver.foreign.figure import figure
from tests.receiver.node import PAGE, run_node
from tests.receiver.standin import make_voice

VOICE = load_voice()
AVATAR = load_avatar(VOICE)
PARAMS = np.random.default_rng(3).normal(0, 0.7, (3, len(VOICE.layout))).astype(np.float32)


RATE_HZ = 50.0
SCORE = score_of_text("Bonsoir, et bienvenue. Merci de votre confiance.", start_s=1.0)
SECONDS = SCORE.keys[-1].end + 3.0


@pytest.fixture(scope="module")
def spoken() -> Motion:
    """A short programme of the rules' cuer: rest, two sentences, rest."""
    pose = GestureSynthesiser("claire", rate_hz=RATE_HZ).pose(SCORE, 0.0, int(SECONDS * RATE_HZ))
    return VOICE.invert(load_body("claire").markers(pose), rate_hz=RATE_HZ)


@pytest.mark.parametrize("whose", ["own", "others"])
def test_page_moves_and_bends_as_python_does(tmp_path: Path, spoken: Motion, whose: str) -> None:
    """Rules of movement, joints and skin under node and in Python, over one programme."""
    avatar = AVATAR
    if whose == "others":
        (tmp_path / "figure.glb").write_bytes(figure())
        avatar = foreign_avatar(tmp_path / "figure.glb", VOICE)[0]
    (tmp_path / "avatar.bin").write_bytes(avatar_document(avatar))
    script = """
        import { Surface, parseAvatar } from "./avatar.js";
        import { VoiceModel } from "./model.js";
        import { Movement } from "./movement.js";
        const bytes = readFileSync("avatar.bin");
        const arrays = parseAvatar(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
        const model = new VoiceModel(data.voice);
        const [head, hand] = ["head", "hand"].map((part) => new Surface(arrays, part));
        const movement = new Movement(model);
        const out = new Float64Array(339);
        const last = data.params.length - 1;
        const sample = (timeS, params) => {
            const at = Math.min(Math.max(timeS * data.rate, 0), last);
            const [below, above] = [Math.floor(at), Math.min(Math.floor(at) + 1, last)];
            params.forEach((_, i) => {
                params[i] = data.params[below][i] * (1 - at + below) + data.params[above][i] * (at - below);
            });
            return 1;
        };
        const params = new Float64Array(model.layout.length);
        const said = data.times.map((t) => movement.at(t, sample));
        const poses = data.few.map((t) => {
            sample(t, params);
            model.reconstruct(params, out);
            const pose = head.skeleton.solve(model, movement.at(t, sample));
            head.bend(model.faceShape, pose.shapes, pose.gaze, pose.joints);
            hand.bend(model.handShape);
            return [pose.head, pose.hand, Array.from(head.position), Array.from(hand.position), Array.from(head.normal)];
        });
        console.log(JSON.stringify([said, poses]));
    """  # noqa: E501
    times, few = np.arange(-1.0, SECONDS, 0.11), np.array([0.3, 1.9, 3.1, SECONDS - 1.2])
    data = {
        "voice": voice_document(VOICE),
        "params": spoken.params.tolist(),
        "rate": RATE_HZ,
        "times": times.tolist(),
        "few": few.tolist(),
    }
    said, poses = run_node(tmp_path, script, data)
    sample = partial(sample_params, spoken)
    added = express(VOICE, sample, times)
    assert set(said[0]["shapes"]) == set(added.shapes)
    for name, weights in added.shapes.items():
        assert np.allclose([row["shapes"][name] for row in said], weights, atol=1e-5), name
    for name in ("gaze", "nod", "trunk", "breath"):
        assert np.allclose([row[name] for row in said], getattr(added, name), atol=1e-4), name
    added = express(VOICE, sample, few)
    params = sample(few).astype(np.float64)
    pose = solve(avatar.skeleton, VOICE, params, added)
    skin = avatar.place_at_rest(params, pose, added)
    for t, (head, hand, bent, fingers, normals) in enumerate(poses):
        assert np.allclose(head, pose.head[t], atol=1e-4)
        assert np.allclose(hand, pose.hand[t], atol=1e-3)
        assert np.abs(np.reshape(bent, (-1, 3)) - skin[t]).max() < 0.02
        still = VOICE.hand.shape(params[t : t + 1, VOICE.hand_columns[:12]])
        expected_hand = avatar.hand.refine(avatar.hand.control(still))[0]
        assert np.abs(np.reshape(fingers, (-1, 3)) - expected_hand).max() < 0.02
        unit = np.reshape(normals, (-1, 3))
        unit /= np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-9)
        cosine = (unit * vertex_normals(skin[t], avatar.head.triangles)).sum(axis=1)
        # The page keeps the eyeballs' normals.
        seen = np.ones(len(cosine), dtype=bool)
        for first, count in avatar.eye_ranges:
            seen[first : first + count] = False
        assert np.quantile(cosine[seen], 0.001) > 0.98


def test_the_figure_leans_as_one_about_the_lower_back() -> None:
    head = np.array([0.0, 700.0, 50.0])
    points = head + np.random.default_rng(2).uniform(-200, 60, (2, 30, 3))
    points[:, 0], points[:, 1] = head, head - [0, RULES["lean_mm"], 0]
    moved, trunk = points.copy(), np.array([[6.0, 1.0, -4.0], [-3.0, 0.5, 2.0]])
    lean(moved, trunk, head)
    assert np.allclose(moved[:, 0] - points[:, 0], trunk)
    assert np.allclose(moved[:, 1] - points[:, 1], trunk * [0, 1, 0])
    before, after = (np.linalg.norm(x[:, :, None] - x[:, None], axis=-1) for x in (points, moved))
    assert np.abs(after - before).max() < 2e-4 * before.max()


def test_movement_does_not_depend_on_where_a_receiver_tuned_in(spoken: Motion) -> None:
    late = replace(spoken, params=spoken.params[50:], start_s=1.0)
    times = np.arange(1.0 + RULES["step_s"] * RULES["taps"], SECONDS, 0.04)
    whole, part = (express(VOICE, partial(sample_params, m), times) for m in (spoken, late))
    assert np.array_equal(whole.nod, part.nod)
    assert np.array_equal(whole.gaze, part.gaze)
    assert all(np.array_equal(whole.shapes[name], part.shapes[name]) for name in whole.shapes)


def test_hand_stays_on_its_target_while_the_head_nods(spoken: Motion) -> None:
    """The pointing tip against the skin there, with and without the rules' movements, mm."""
    times = np.arange(1.5, SECONDS - 2.5, 0.12)
    params = sample_params(spoken, times).astype(np.float64)
    added = express(VOICE, partial(sample_params, spoken), times)
    still, moved = AVATAR.place(params), AVATAR.place(params, added)
    n = len(AVATAR.head.sources)
    assert np.abs(moved[:, :n] - still[:, :n]).max() > 3  # the head does move
    far = []
    for t in range(len(times)):
        fingers = still[t, n:]
        skin = still[t, :n][AVATAR.head_weights[:, 0] > 0.05]
        gap = np.linalg.norm(fingers[::7, None] - skin[None, ::5], axis=-1)
        finger, place = np.unravel_index(gap.argmin(), gap.shape)
        if gap.min() > 25:
            continue
        spot = np.flatnonzero(AVATAR.head_weights[:, 0] > 0.05)[5 * place]
        before = still[t, n + 7 * finger] - still[t, spot]
        after = moved[t, n + 7 * finger] - moved[t, spot]
        far.append(np.linalg.norm(after) - np.linalg.norm(before))
    assert len(far) > 10
    assert np.abs(far).max() < 1.0, np.abs(far).max()


def test_the_arm_is_one_chain(spoken: Motion) -> None:
    """Upper arm and forearm meet at the elbow, and the shoulder stays near its place."""
    params = spoken.params.astype(np.float64)
    skeleton = AVATAR.skeleton
    pose = solve(skeleton, VOICE, params, None)
    places = [
        joint[:, :, :3] @ skeleton.elbow + joint[:, :, 3]
        for joint in (pose.joints[:, 1], pose.joints[:, 2])
    ]
    assert np.abs(places[0] - places[1]).max() < 1e-6
    shoulder = skeleton.shoulders[0]
    carried = [pose.joints[:, k, :, :3] @ shoulder + pose.joints[:, k, :, 3] for k in (0, 1)]
    assert np.abs(carried[0] - carried[1]).max() < 1e-6
    moved = np.linalg.norm(carried[0] - shoulder, axis=1)
    assert 2 < moved.max() < 30
    length = np.linalg.norm(places[0] - carried[0], axis=1)
    # The sleeve stretches where the resting hand's elbow lies far out: .80 measured.
    assert length.min() / length.max() > 0.75


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
        """Count teeth's vertices more than .3 mm before the lips' red (lips are slanted)."""
        head, some = AVATAR.head, _teeth()
        carried = mesh[:, head.sources[some]] * head.shares[some, :, None]
        tooth = carried.sum(axis=2) + head.offsets[some]
        red = mesh[:, mouth.rings[6:]].reshape(len(mesh), -1, 3)
        covering = 0
        for teeth, lips in zip(tooth, red, strict=True):
            tree = cKDTree(lips[:, :2])
            near, at = tree.query(teeth[:, :2], distance_upper_bound=1.0)
            some = np.isfinite(near)
            covering += int((teeth[some, 2] > lips[at[some], 2] + 0.3).sum())
        return covering

    control[:, mouth.rings.ravel(), 2] -= 1.0  # thinner lips than hers, nearer to the teeth
    before = overlap_mm(control), teeth_before_lips(control)
    mouth.solve(control)
    assert before[0] > 0.5  # the map alone lets them pass each other
    assert overlap_mm(control) < 0.2
    assert teeth_before_lips(control) == 0
    assert before[1] > 0


def test_lower_lip_lies_level_along_the_upper_teeth_at_f_and_v() -> None:
    """At v from corner to corner, over the tips of the teeth; open vowels stay as they are."""
    mouth, targets = AVATAR.mouth, VOICE.gestures.viseme_targets
    phones = [PHONES.index(phone) for phone in "vao"]
    control = AVATAR.head.control(VOICE.face.shape(targets[phones]))
    before = control[:, mouth.rings[6][mouth.lower]]
    mouth.solve(control)
    after = control[:, mouth.rings[6][mouth.lower]]
    corners = after[0, [0, -1], 1]
    assert np.ptp(before[0, :, 1]) > 2.0
    assert np.abs(after[0, :, 1] - corners.mean()).max() < 1.0
    middle = after[0, len(mouth.lower) // 2, 1]
    assert 0 < middle - mouth.arch[0, 3] < 2.0  # covers the tip of the upper teeth
    assert after[1:, :, 1] == pytest.approx(before[1:, :, 1])


def test_looks_are_drawn_around_the_same_markers() -> None:
    """Another age, sex and skin: lips are the same, skin lies where the markers are."""
    away = np.linalg.norm(AVATAR.head.rest[:, None] - AVATAR.head.markers[None], axis=2)
    nearest = np.argsort(away, axis=0)[:3]
    seen = set()
    for look in AVATAR.looks:
        other = load_avatar(VOICE, look)
        moved = other.head.rest - AVATAR.head.rest
        assert np.abs(moved[AVATAR.mouth.rings]).max() < 0.01
        at_markers = np.linalg.norm(moved[nearest].mean(axis=0), axis=1)
        assert at_markers.mean() < 0.5  # 0.37 mm measured
        assert at_markers.max() < 2.0
        assert np.array_equal(other.head.markers, AVATAR.head.markers)
        assert np.array_equal(other.head.coefficients, AVATAR.head.coefficients)
        seen.add(tuple(other.head.colours[:, :3].mean(axis=0).round()))
    assert len(seen) == 3
    with pytest.raises(CueError, match="woman, man, elder are known"):
        load_avatar(VOICE, "ghost")


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


def test_eyes_blink_as_people_do() -> None:
    """Over five minutes of a held pose: the mean rate, and intervals that differ."""
    held = np.zeros((1, len(VOICE.layout)), np.float32)
    times = np.arange(0, 300, 0.04)
    added = express(VOICE, lambda t: np.repeat(held, len(t), axis=0), times)
    shut = added.shapes["eyeBlinkLeft"]
    starts = times[1:][(shut[1:] > 0.5) & (shut[:-1] <= 0.5)]
    assert 8 < len(starts) / 5 < 25
    assert np.std(np.diff(starts)) > 0.35 * np.mean(np.diff(starts))


def test_closed_lids_hide_the_eyes_of_every_look() -> None:
    """The eyes painted green: no look shows much of it with the lids closed, all do half open."""
    held = np.zeros((1, len(VOICE.layout)))
    camera = neutral_camera(VOICE)
    for look in AVATAR.looks:
        avatar = load_avatar(VOICE, look)
        colours = avatar.head.colours.copy()
        for first, count in avatar.eye_ranges:
            colours[first : first + count, :3] = [0, 255, 0]
        green = replace(avatar, head=replace(avatar.head, colours=colours))
        seen = []
        for shut in (1.0, 0.5):
            added = express(VOICE, lambda t: np.repeat(held, len(t), axis=0), np.array([20.0]))
            lids = dict.fromkeys(("eyeBlinkLeft", "eyeBlinkRight"), np.array([shut]))
            added = replace(added, shapes=added.shapes | lids)
            pictures = [np.zeros((540, 464, 3), np.uint8) for _ in range(2)]
            for picture, other in zip(pictures, (avatar, green), strict=True):
                Portrait(other, camera).draw(picture, avatar.place(held, added)[0])
            seen.append((np.abs(np.subtract(*pictures, dtype=int)).max(axis=2) > 24).sum())
        assert seen[0] <= 4, look
        assert seen[1] > 30, look


def test_voice_without_avatar() -> None:
    voice = make_voice()
    assert not has_avatar(voice)
    with pytest.raises(CueError, match="voice stand-in has no avatar"):
        load_avatar(voice)
