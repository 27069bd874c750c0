"""Landmarks of image trackers: tables, pictures, and what is made of them."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.cuer.layout import N_FACE, RIGID_FACE, marker_indices
from codec.cuer.models import rigid
from codec.cuer.models.inversion import invert
from codec.cuer.voice import load_voice
from codec.errors import CueError
from synth.capture.capture import capture_motion
from synth.capture.options import Captured, CaptureOptions
from synth.capture.points.solve import likely_postures
from synth.capture.sources.landmark_maps import FACE_LANDMARKS, face_map, hand_map, lesson
from synth.capture.sources.landmark_table import LandmarkTable, read_landmarks
from synth.capture.sources.sniff import kind_of
from synth.capture.tracker.aspect import ASPECTS, find_aspect
from synth.capture.tracker.landmark_model import HAND_TRUST, LandmarkModel
from synth.capture.tracker.landmarks import started
from synth.capture.tracker.picture import _MIRROR
from tests.synth import landmark_files as tables
from tests.synth import studio_files as files

pytestmark = pytest.mark.long(8)

VOICE = load_voice()
SECONDS = 4.0
FEW = (17, 314, 405, 321, 375, 291, 84, 181, 91, 146, 0, 267, 269, 270, 409, 37, 39, 40, 185, 61,
       454, 234, 200, 214, 50)  # fmt: skip
"""Lips and five points of the face."""

Arrays = tuple[np.ndarray, np.ndarray, np.ndarray]


@cache
def filmed() -> Arrays:
    return tables.project("claire", files.score(), seconds=SECONDS, noise_mm=2.0, seed=1)


def captured(tmp_path: Path, text: str, options: CaptureOptions | None = None) -> Captured:
    path = tmp_path / "landmarks.csv"
    path.write_text(text, encoding="utf-8")
    assert kind_of(path) == "landmarks"
    return capture_motion(path, VOICE, options or CaptureOptions(rate_hz=tables.RATE_HZ))


def plane_mm(found: Captured, markers: np.ndarray) -> tuple[float, float]:
    """Return the error of face and hand in the picture's plane, both seen in the head's frame.

    The middle pose of a take's head is not the voice's, and no picture tells where it was.
    """
    ours = VOICE.reconstruct(found.motion.params)[: len(markers)].astype(np.float64)
    true = markers[: len(ours)].astype(np.float64)
    skull = marker_indices(RIGID_FACE)
    ours, true = (
        rigid.inverse_rigid_motion(x, rigid.estimate_motion(true[0, skull], x[:, skull])[0])
        for x in (ours, true)
    )
    gap = np.linalg.norm((ours - true)[..., :2], axis=-1)
    return float(gap[:, :N_FACE].mean()), float(gap[:, N_FACE:].mean())


def keys_right(found: Captured) -> float:
    assert found.motion.score is not None
    got = found.motion.score.keys
    true = files.score().keys
    right = [
        any(
            (s.shape, s.placement) == (k.shape, k.placement) and abs(s.start - k.start) < 0.12
            for s in got
        )
        for k in true
    ]
    return sum(right) / len(right)


def test_joints_lie_among_markers() -> None:
    joints, markers = lesson()
    gap = np.einsum("lk,tkc->tlc", hand_map().weights, markers) - joints
    assert np.linalg.norm(gap, axis=-1).mean() < 1.2  # measured 0.8
    for mapped in (hand_map(), face_map()):
        np.testing.assert_allclose(mapped.weights.sum(1), 1.0, atol=1e-5)


def test_slopes_are_those_of_the_landmarks() -> None:
    model = LandmarkModel(VOICE.hand, hand_map(), np.zeros((21, 3)), HAND_TRUST)
    at = np.random.default_rng(0).normal(scale=0.5, size=(2, model.n_parameters))
    slopes = model.slopes(at)
    still = model.landmarks(at)
    for number in range(model.n_parameters):
        step = np.zeros(model.n_parameters)
        step[number] = 1e-4
        moved = model.residual(at, still) - model.residual(at + step, still)
        np.testing.assert_allclose(slopes[:, number], moved / 1e-4, atol=0.02)


def test_hand_parameters_come_back_from_exact_landmarks() -> None:
    """Of hands on the way between any two keys, from where capture starts."""
    model = LandmarkModel(VOICE.hand, hand_map(), np.zeros((21, 3)), np.ones(3))
    likely = likely_postures(VOICE)
    one, other = likely[np.random.default_rng(0).integers(len(likely), size=(2, 300))]
    x = model.landmarks(0.7 * one + 0.3 * other)
    found = invert(model, x, np.ones(x.shape[:2], dtype=bool), started(model, x, likely))
    worst = np.linalg.norm(model.landmarks(found) - x, axis=-1).max(1)
    assert np.quantile(worst, 0.9) < 0.8  # measured 0.6
    assert worst.max() < 2.0  # measured 1.2


@pytest.mark.parametrize("layout", ["wide", "few", "long"])
def test_a_film_of_the_voices_own_cuer(tmp_path: Path, layout: str) -> None:
    face, hand, markers = filmed()
    text = {
        "wide": lambda: tables.wide(face, hand),
        "few": lambda: tables.wide(face, hand, FEW),
        "long": lambda: tables.long(face, hand),
    }[layout]()
    found = captured(tmp_path, text)
    of_face, of_hand = plane_mm(found, markers)
    assert of_face < 0.9  # measured 0.5 to 0.7
    assert of_hand < 7.0  # measured 4 to 5
    assert keys_right(found) >= 0.7  # measured 0.75 of twelve quick keys
    assert found.report["place"]["aspect"] == pytest.approx(16 / 9, abs=1e-3)
    numbered = any("numbered, not timed" in note for note in found.report["notes"])
    assert numbered == (layout != "long")


def test_pixels_other_rates_and_mirror_images(tmp_path: Path) -> None:
    face, hand, _ = filmed()
    plain = captured(tmp_path, tables.wide(face, hand))
    size = np.array([1280.0, 720.0, 1280.0])
    mirror = np.array([-1.0, 1.0, 1.0])
    across = np.array([1280.0, 0.0, 0.0])
    turned = tables.wide((face * size * mirror + across)[:, _MIRROR], hand * size * mirror + across)
    found = captured(tmp_path, turned, CaptureOptions(rate_hz=25.0, frame_rate_hz=25.0))
    assert found.report["place"]["left_hand"]
    assert found.motion.duration_s == pytest.approx(plain.motion.duration_s * 30 / 25, abs=0.08)
    n = min(len(found.motion.params), len(plain.motion.params))
    gap = VOICE.reconstruct(found.motion.params[:n]) - VOICE.reconstruct(plain.motion.params[:n])
    assert np.linalg.norm(gap[..., :2], axis=-1).mean() < 2.5


def test_a_hand_out_of_the_picture_rests(tmp_path: Path) -> None:
    face, hand, markers = filmed()
    gone = hand.copy()
    gone[:20] = np.nan
    gone[50] = np.nan
    gone[70:, :12] = np.nan
    found = captured(tmp_path, tables.wide(face, gone))
    assert found.report["seen"]["hand"] == pytest.approx(1 - 71 / len(hand), abs=0.02)
    forearm = found.motion.params[:, 25:]
    resting = VOICE.gestures.placement_targets[0, 0]
    np.testing.assert_allclose(forearm[2], resting, atol=1e-2)
    np.testing.assert_allclose(forearm[-1], resting, atol=1e-2)
    assert np.abs(np.diff(forearm, axis=0)).max() < 2.0
    ours = VOICE.reconstruct(found.motion.params)[45:60, N_FACE:, :2]
    assert np.linalg.norm(ours - markers[45:60, N_FACE:, :2], axis=-1).mean() < 8.0


def test_a_face_that_is_lost_for_a_while_is_bridged(tmp_path: Path) -> None:
    face, hand, markers = filmed()
    gone = face.copy()
    gone[30:36] = np.nan
    gone[60:90, ::3] = np.nan
    of_face, of_hand = plane_mm(captured(tmp_path, tables.wide(gone, hand)), markers)
    assert of_face < 1.5
    assert of_hand < 7.0


@settings(max_examples=8)
@given(data=st.data())
def test_nonsense_is_one_error_or_a_motion(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    face, hand, _ = (part[:12] for part in filmed())
    seed = data.draw(st.integers(0, 1000))
    rng = np.random.default_rng(seed)
    size = data.draw(st.sampled_from([0.0, 1e-3, 1.0, 1e3, 1e30]))
    face = np.where(rng.random(face.shape[:2])[..., None] < 0.3, np.nan, face)
    path = tmp_path_factory.mktemp("odd") / "a.csv"
    path.write_text(tables.wide(face + size * rng.normal(size=face.shape), size * hand))
    try:
        found = capture_motion(path, VOICE)
    except CueError:
        return
    assert np.isfinite(found.motion.params).all()


def test_nothing_is_claimed_of_a_hand_that_is_hardly_seen(tmp_path: Path) -> None:
    """A tracker that takes something for a hand in 2 % of the frames has not seen her cue."""
    face, hand, _ = filmed()
    rarely = np.full_like(hand, np.nan)
    rarely[40:42] = hand[40:42]
    found = captured(tmp_path, tables.wide(face, rarely))
    assert len(hand) * 0.03 > 2
    assert found.report["seen"]["hand"] == 0.0
    assert "keys" not in found.report
    assert found.motion.score is None
    assert "no hand is seen in 3 % of the frames or more: it rests" in found.report["notes"]


def test_keys_are_reported_by_time_with_their_confidence(tmp_path: Path) -> None:
    face, hand, _ = filmed()
    keys = captured(tmp_path, tables.wide(face, hand)).report["keys"]
    assert len(keys["held"]) == keys["recognised"] > 0
    starts = [key["start_s"] for key in keys["held"]]
    assert starts == sorted(starts)
    assert all(key["start_s"] <= key["end_s"] for key in keys["held"])
    mean = np.mean([key["confidence"] for key in keys["held"]])
    assert keys["confidence"] == pytest.approx(mean, abs=2e-3)


def test_a_face_alone_and_a_hand_alone(tmp_path: Path) -> None:
    face, hand, _ = filmed()
    found = captured(tmp_path, tables.wide(face, np.full_like(hand, np.nan)))
    assert "no hand is seen: it rests" in found.report["notes"]
    with pytest.raises(CueError, match="0 landmarks of the face are known, 4 needed"):
        captured(tmp_path, tables.wide(np.full_like(face, np.nan), hand))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hand_x0,hand_y0\n1,2\n", "without a column frame or time"),
        ("frame,hand_x0,hand_y0\n", "0 frames of landmarks"),
        ("frame,hand_x0,hand_y0\n1,2,3\n1,2,3\n", "1 frames of landmarks"),
        ("frame,hand_x0,hand_y0\n1,,\n2,,\n", "no landmarks of face or hand"),
        ("frame,part,index,x,y\n1,foot,0,1,2\n2,foot,0,1,2\n", "no landmarks of face or hand"),
    ],
)
def test_what_is_wrong_is_told(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(CueError, match=message):
        read_landmarks(tmp_path / "a.csv")


@pytest.mark.parametrize("layout", ["wide", "long"])
@settings(max_examples=60)
@given(data=st.data())
def test_damage_is_one_error_or_a_table(
    layout: str, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    face, hand, _ = filmed()
    write = tables.wide if layout == "wide" else tables.long
    content = bytearray(write(face[:3], hand[:3]).encode())
    edits = st.tuples(st.integers(0, len(content) - 1), st.integers(0, 255))
    for at, value in data.draw(st.lists(edits, max_size=12)):
        content[at] = value
    path = tmp_path_factory.mktemp("marks") / "a.csv"
    path.write_bytes(bytes(content))
    try:
        found = read_landmarks(path)
    except CueError:
        return
    assert found.face.shape == (len(found.times), len(FACE_LANDMARKS), 3)
    assert (np.diff(found.times) > 0).all()


def test_the_aspect_is_found_from_face_and_keys() -> None:
    face, hand, _ = filmed()
    table = LandmarkTable(np.arange(len(face)) / 30, face, {"hand": hand}, True)
    assert find_aspect(table, VOICE).value == pytest.approx(16 / 9)
    assert not find_aspect(table, VOICE, told=16 / 9).notes
    wrong = find_aspect(table, VOICE, told=1.0)
    assert wrong.value == 1.0
    assert "the hand looks as if" in wrong.notes[0]
    no_hand = LandmarkTable(table.times, face, {}, True)
    assert find_aspect(no_hand, VOICE).value in ASPECTS
