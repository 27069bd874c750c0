"""Avatars of others: files of several kinds end up as one figure that cues."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from codec.cuer.layout import FACE_MARKERS, HAND_MARKERS
from codec.cuer.motion import sample_params
from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENTS
from codec.errors import CueError
from receiver.drawing.avatar import Avatar, load_avatar
from receiver.drawing.avatar_document import avatar_document, read_avatar
from receiver.drawing.movement import express
from receiver.drawing.render import write_picture
from receiver.drawing.skeleton import key_poses
from receiver.foreign.build import Fit, foreign_avatar
from receiver.foreign.container import read_container
from receiver.foreign.face import READABLE, mouth_shapes
from receiver.foreign.hand import ForeignHand, joint_map, lesson
from receiver.foreign.names import FINGER_BONES, FINGERS
from receiver.foreign.scene import read_scene
from tests.receiver.foreign.figure import figure
from tests.receiver.standin import make_motion, make_voice

VOICE = load_voice()
PARAMS, _, TIPS = key_poses(VOICE)
CUEING = np.flatnonzero(np.arange(len(PARAMS)) % len(PLACEMENTS) > 0)[5:]

Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
BACK = np.diag([-1.0, 1, -1])


def made(folder: Path, *arguments: object, **options: object) -> tuple[Avatar, Fit]:
    path = folder / "figure.vrm"
    path.write_bytes(figure(*arguments, **options))  # type: ignore[arg-type]
    return foreign_avatar(path, VOICE)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> tuple[Avatar, Fit]:
    return made(tmp_path_factory.mktemp("figure"))


def finger_tips(avatar: Avatar) -> NDArray[np.float64]:
    """Middle of the figure's index and middle finger's caps for all keys, (K, 2, 3)."""
    hand = avatar.place(PARAMS)[:, len(avatar.head.sources) :]
    # The middle of a cap has six neighbours and lies farthest out on its finger.
    count = np.bincount(avatar.hand.triangles.ravel())
    still = VOICE.hand.shape(np.zeros((1, VOICE.hand.n_shape)))
    rest = avatar.hand.refine(avatar.hand.control(still))[0]
    found = []
    for name in ("F2T", "F3T"):
        marker = still[0, HAND_MARKERS.index(name)]
        near = np.flatnonzero((count == 6) & (np.linalg.norm(rest - marker, axis=1) < 25))
        found.append(near[np.linalg.norm(rest[near] - marker, axis=1).argmin()])
    return hand[:, found]


def test_finger_is_on_its_place_for_all_keys(plain: tuple[Avatar, Fit]) -> None:
    """The tip is as far from the foreign face's place as the cuer's own nail from hers."""
    avatar, fit = plain
    reach = avatar.skeleton.reach
    shift = np.tile(np.vstack([np.zeros(3), reach.shift(reach.places)]), (9, 1))
    tips = finger_tips(avatar)
    own = VOICE.reconstruct(PARAMS)[:, len(FACE_MARKERS) :]
    nails = own[:, [HAND_MARKERS.index(name) for name in ("F2T", "F3T")]]
    gap = np.linalg.norm(tips - nails - shift[:, None], axis=2).min(axis=1)[CUEING]
    assert gap.max() < 16  # measured 11: half a finger lies between nail and cap
    assert np.ptp(gap) < 8
    assert max(fit.moves_mm.values()) < 45
    assert fit.hand_mm < 0.5
    assert np.allclose(reach.shift(reach.places[:1] + 1e4), 0, atol=0.05)


def test_finger_touches_the_neck_that_the_figure_has(plain: tuple[Avatar, Fit]) -> None:
    """Pointing at the throat: distance of the nearer tip from a tube whose place the test knows."""
    avatar, _ = plain
    scale = np.linalg.norm(avatar.eye_middles[1] - avatar.eye_middles[0]) / 62
    throat = np.flatnonzero(np.arange(len(PARAMS)) % len(PLACEMENTS) == PLACEMENTS.index("throat"))
    tips = finger_tips(avatar)[throat[1:]]
    figure_tips = (tips - avatar.eye_middles.mean(axis=0)) / scale + [0, 1580, 62]
    x, y, z = figure_tips.transpose(2, 0, 1)
    middle = np.interp(y, [1380, 1440, 1490], [0, 5, 10])
    far = (np.hypot(x, z - middle) - 45).min(axis=1)
    print("tips from the neck, mm:", far.round(1))
    assert -3 < far.min() < far.max() < 22  # 14 to 17 with the built-in collar; -19 without a shift


def test_bones_bring_every_joint_of_the_hand_to_hers() -> None:
    rng = np.random.default_rng(5)
    joints = joint_map(VOICE)
    poses = joints.vertices(VOICE.hand.shape(lesson(VOICE, rng)[::9]))
    hers = poses[:, 2:].reshape(len(poses), 5, 4, 3)
    own = hers[0] * [1.4, 0.8, 1.1] + rng.normal(0, 2, (5, 4, 3))
    maps = ForeignHand(poses[0, 1] * [1.4, 0.8, 1.1], own).bones(poses)
    for f, finger in enumerate(FINGERS):
        for k, part in enumerate(FINGER_BONES[finger]):
            found = maps[f"right{finger}{part}"]
            for j in (k, k + 1):
                there = found[:, :, :3] @ own[f, j] + found[:, :, 3]
                assert np.allclose(there, hers[:, f, j], atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "options"),
    [("vrm0", {"turn": BACK}), ("vrm1", {"unit": 0.1, "turn": Z_UP}), ("arkit", {"down": 0.9})],
)
def test_files_of_one_figure_give_one_figure(
    plain: tuple[Avatar, Fit], tmp_path: Path, kind: str, options: dict[str, object]
) -> None:
    """VRM 0, 1 and Mixamo's names, metres and centimetres, other axes, arms spread or lowered."""
    other, fit = made(tmp_path, kind, **options)
    assert fit.readable_lips
    tips = finger_tips(other) - finger_tips(plain[0])
    assert np.abs(tips).max() < 1.0
    follows = [a.head_weights[:, 0] > 0.99 for a in (plain[0], other)]
    heads = [
        a.place(PARAMS[:12])[:, : len(a.head.sources)][:, own]
        for a, own in zip((plain[0], other), follows, strict=True)
    ]
    lists = [np.sort(head.reshape(12, -1), axis=1) for head in heads]
    assert np.abs(lists[0] - lists[1]).max() < 0.5


def test_mouth_opens_and_rounds_as_the_markers_do(plain: tuple[Avatar, Fit]) -> None:
    avatar, _ = plain
    own = load_avatar(VOICE)

    def gap(name: str, weight: float) -> tuple[float, float]:
        unit = weight * own.units[own.unit_names.index(name)]
        control = avatar.head.control((own.unit_rest + unit)[None])[0]
        move = control - avatar.head.control(own.unit_rest[None])[0]
        lips = move[np.linalg.norm(avatar.head.rest - [0, -60, 95], axis=1) < 30]
        return float(-lips[:, 1].min()), float(lips[:, 2].max())

    down, _ = gap("jawOpen", 0.6)
    ahead, forward = gap("mouthPucker", 0.7)
    lower = FACE_MARKERS.index("LL0")
    wanted = -0.6 * own.units[own.unit_names.index("jawOpen"), lower, 1]
    assert down == pytest.approx(wanted, rel=0.35)
    assert forward > 2 > ahead


def test_expressions_move_it(plain: tuple[Avatar, Fit]) -> None:
    avatar, _ = plain
    motion = make_motion(VOICE, duration_s=1.0, start_s=2.0)
    times = np.array([2.2, 2.6])
    params = sample_params(motion, times)
    added = express(VOICE, partial(sample_params, motion), times)
    still, moved = avatar.place(params), avatar.place(params, added)
    assert np.isfinite(moved).all()
    assert np.abs(moved - still).max() > 0.5
    assert avatar.shapes.keys() >= added.shapes.keys()
    assert len(avatar.shapes["browInnerUp"][0])
    assert (avatar.eye_ranges[:, 1] > 0).all()


def test_visemes_alone_are_reported(tmp_path: Path) -> None:
    (tmp_path / "f.vrm").write_bytes(figure("visemes"))
    shapes = mouth_shapes(read_scene(read_container(tmp_path / "f.vrm")))
    assert shapes.keys() == {"aa", "ou"}
    assert not shapes.keys() >= READABLE


def test_document_gives_the_avatar_back(plain: tuple[Avatar, Fit]) -> None:
    data = avatar_document(plain[0])
    again = read_avatar(data, VOICE)
    assert np.abs(again.place(PARAMS) - plain[0].place(PARAMS)).max() < 0.02
    assert np.array_equal(again.colours, plain[0].colours)
    with pytest.raises(CueError, match="made for voice"):
        read_avatar(data, make_voice())
    for cut in (0, 3, 40, len(data) // 2, len(data) - 4):
        with pytest.raises(CueError):
            read_avatar(data[:cut], VOICE)
    rng = np.random.default_rng(1)
    for _ in range(60):
        damaged = bytearray(data)
        damaged[rng.integers(0, 6000)] = rng.integers(256)
        try:
            read_avatar(bytes(damaged), VOICE)
        except CueError:
            continue


@pytest.mark.parametrize(
    ("without", "message"),
    [
        (("rightRing1",), "has no bone rightRingIntermediate: a cuer needs arms and fingers"),
        (tuple(f"right{f}{n}" for f in ("Index", "Ring") for n in range(3)), "and 1 more"),
        (("head",), "has no bone head"),
    ],
)
def test_missing_bones_are_named(tmp_path: Path, without: tuple[str, ...], message: str) -> None:
    with pytest.raises(CueError, match=message):
        made(tmp_path, without=without)


def test_pictures_become_colours_of_a_finer_surface(
    plain: tuple[Avatar, Fit], tmp_path: Path
) -> None:
    """Stripes across the face, and backs of a material that is seen from both sides."""
    stripes = np.zeros((4, 64, 3), np.uint8)
    stripes[:, 32:48] = 255
    write_picture(tmp_path / "stripes.png", stripes)
    picture = (tmp_path / "stripes.png").read_bytes()
    white = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    avatar, _ = made(tmp_path, material=white, picture=picture)
    bare, _ = plain
    assert len(bare.head.triangles) < len(avatar.head.triangles) < 8 * len(bare.head.triangles)
    points = avatar.head.refine(avatar.head.rest[None])[0]
    face = points[(avatar.head_weights[:, 0] > 0.99) & (points[:, 2] > 60)]
    colours = avatar.head.colours[(avatar.head_weights[:, 0] > 0.99) & (points[:, 2] > 60)]
    middle, scale = face[:, 0].mean(), np.ptp(face[:, 0])
    place = (face[:, 0] - middle) / scale
    assert (colours[(place > 0.1) & (place < 0.2), 0] > 200).mean() > 0.8
    assert (colours[place < -0.1, 0] < 60).mean() > 0.9
    both, _ = made(tmp_path, material={"doubleSided": True})
    assert len(both.head.triangles) == 2 * len(bare.head.triangles)
    faces = np.sort(both.head.refine(both.head.rest[None])[0][both.head.triangles], axis=1)
    assert len(np.unique(faces.reshape(len(faces), -1).round(3), axis=0)) == len(faces) // 2
