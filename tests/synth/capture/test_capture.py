"""From foreign takes to the voice's motion: axes, units, hands, speakers, gaps, wrong names."""

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from codec.cuer.layout import MARKERS, N_FACE, marker_indices
from codec.cuer.models import rigid
from codec.cuer.motion import Motion
from codec.cuer.voice import load_voice
from codec.cues.cueing import cue
from codec.cues.score import Score
from codec.errors import CueError
from synth.capture.capture import capture_motion
from synth.capture.options import Captured, CaptureOptions
from synth.capture.points.framing import mirrored
from synth.studio.take import StudioTake
from tests.synth import studio_files as files

pytestmark = pytest.mark.long(11)

VOICE = load_voice()
TURN = [0.4, 1.9, -1.1, 800.0, -300.0, 1500.0]


@cache
def taken(identity: str, faults: bool = False) -> StudioTake:
    return files.take(identity, swaps=1.0, ghosts=1.0) if faults else files.take(identity)


def test_the_result_does_not_depend_on_how_many_threads_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sums of linear algebra have other roundings on two threads: 3 of 64 films differed."""
    threads: list[int] = []

    def looked(*_: object) -> Captured:
        threads.extend(p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas")
        raise CueError("seen")

    monkeypatch.setattr("synth.capture.capture._capture", looked)
    (path := tmp_path / "take.trc").write_text("PathFileType\t4\t(X/Y/Z)\n", encoding="utf-8")
    with threadpool_limits(limits=2, user_api="blas"), pytest.raises(CueError, match="seen"):
        capture_motion(path, VOICE)
    assert set(threads) == {1}


def captured(
    tmp_path: Path,
    markers: np.ndarray,
    labels: tuple[str, ...] = MARKERS,
    unit: str = "mm",
    options: CaptureOptions | None = None,
) -> Captured:
    path = tmp_path / "take.trc"
    path.write_text(files.trc(markers, labels, unit=unit), encoding="utf-8")
    return capture_motion(path, VOICE, options or CaptureOptions(rate_hz=files.RATE_HZ))


@cache
def plain(identity: str) -> Captured:
    """Return what is captured of a take in our own axes."""
    with tempfile.TemporaryDirectory() as folder:
        return captured(Path(folder), taken(identity).observed)


def assert_alike(a: Motion, b: Motion) -> None:
    """Check that two motions differ by hardly more than the middle pose of the head."""
    assert distance(a, b) < 2.5
    shape = slice(0, 19)  # of face and hand
    np.testing.assert_allclose(a.params[:, shape], b.params[:, shape], atol=0.1)


def distance(a: Motion, b: Motion) -> float:
    gap = VOICE.reconstruct(a.params) - VOICE.reconstruct(b.params)
    return float(np.linalg.norm(gap, axis=-1).mean())


def keys_right(motion: Motion, identity: str) -> float:
    """Return the share of the performed keys that the motion's score has at their time."""
    assert motion.score is not None
    true = taken(identity).score.keys
    got = [(k.shape, k.placement, k.start) for k in motion.score.keys]
    right = [
        any((s, p) == (k.shape, k.placement) and abs(t - k.start) < 0.1 for s, p, t in got)
        for k in true
    ]
    return sum(right) / len(right)


def test_the_voices_own_cuer_is_captured_as_she_was() -> None:
    take, found = taken("claire"), plain("claire")
    gap = np.linalg.norm(VOICE.reconstruct(found.motion.params) - take.truth, axis=-1)
    assert gap[:, :N_FACE].mean() < 0.7  # measured 0.47
    assert gap[:, N_FACE:].mean() < 1.6  # measured 1.2
    # Measured 0.875: the first key is left before its mouth is reached, and told as throat.
    assert keys_right(found.motion, "claire") >= 0.75
    assert found.report["speaker"] == {
        "hand_size": 1.0,
        "face_offset_mm": 0.0,
        "hand_offset_mm": 0.0,
    }
    assert found.report["place"]["turned_deg"] == 0.0


def test_axes_and_units_do_not_matter(tmp_path: Path) -> None:
    """Metres that are called mm, in left-handed axes, beside millimetres in our own axes."""
    foreign = rigid.rigid_motion(taken("agathe").observed, TURN) * 0.001
    foreign[..., 1] *= -1
    own = plain("agathe")
    found = captured(tmp_path, foreign, tuple(f"Agathe:{n.lower()}" for n in MARKERS), "mm")
    assert_alike(own.motion, found.motion)
    for one, strange in ((own, False), (found, True)):
        assert one.report["place"]["left_handed_axes"] == strange
        assert one.report["place"]["unit_mm"] == (1000.0 if strange else 1.0)
        guessed = [note for note in one.report["notes"] if "by the size of the head" in note]
        assert bool(guessed) == strange


def test_another_speaker_moves_the_voice() -> None:
    found = plain("agathe")
    assert found.report["place"]["head_size"] == pytest.approx(1.03, abs=0.015)
    assert found.report["speaker"]["hand_size"] == pytest.approx(1.06, abs=0.03)
    errors = found.report["residual_mm"]
    assert max(errors[part] for part in ("head", "lips", "jaw and cheeks", "throat")) < 0.9
    assert max(errors[part] for part in ("fingers", "palm", "wrist and forearm")) < 1.9
    assert keys_right(found.motion, "agathe") >= 0.7
    # The longer hand touches where the speaker's does: pointing tips in the head's measure.
    take = taken("agathe")
    own = take.truth / found.report["place"]["head_size"]
    ours = VOICE.reconstruct(found.motion.params)
    gaps = []
    for key in take.score.keys:
        tip = marker_indices(["F2T" if key.shape in (1, 6) else "F3T"])[0]
        held = np.arange(round(key.start * files.RATE_HZ) + 1, round(key.end * files.RATE_HZ) - 3)
        stillest = held[np.linalg.norm(np.diff(own[held, tip], axis=0), axis=1).argmin()]
        gaps.append(np.linalg.norm(ours[stillest, tip] - own[stillest, tip]))
    assert np.mean(gaps) < 4.5  # measured 3.0
    assert np.max(gaps) < 8.0  # measured 5.5


def test_a_left_handed_cuer_is_mirrored(tmp_path: Path) -> None:
    left = captured(tmp_path, rigid.rigid_motion(mirrored(taken("agathe").observed), TURN))
    assert left.report["place"]["left_hand"]
    assert_alike(plain("agathe").motion, left.motion)


@pytest.mark.parametrize(
    ("who", "left", "far"),
    [
        ("claire", False, 0.05),
        pytest.param("agathe", False, 0.4, marks=pytest.mark.slow),
        ("agathe", True, 0.4),
    ],
)
def test_a_hand_alone(tmp_path: Path, who: str, left: bool, far: float) -> None:
    """The paper's first corpus: fingers as with a head; face at rest, nobody tells keys.

    Measured 0.01 of the movement for the voice's own cuer, 0.34 and 0.36 for another one, whose
    hand's turn against her head is not known without it.
    """
    observed = taken(who).observed.copy()
    if left:
        observed = mirrored(observed)
    observed[:, :N_FACE] = np.nan
    found = captured(tmp_path, 0.001 * rigid.rigid_motion(observed, TURN), unit="m")
    whole = plain(who).motion
    fingers = VOICE.hand_columns[:12]
    gap = found.motion.params[:, fingers] - whole.params[:, fingers]
    moved = whole.params[:, fingers] - whole.params[:, fingers].mean(0)
    assert np.linalg.norm(gap) < far * np.linalg.norm(moved)
    assert found.report["place"]["left_hand"] is left
    assert found.report["residual_mm"]["fingers"] < 2.0
    assert found.report["residual_mm"]["head"] is None
    assert found.motion.params[:, VOICE.face_columns].std(0).max() < 1e-6
    assert found.motion.score is None
    assert any("no head is seen" in note for note in found.report["notes"])
    assert not any("hardly seen" in note for note in found.report["notes"])


def test_which_hand_is_not_told_where_none_is_seen(tmp_path: Path) -> None:
    observed = taken("claire").observed.copy()
    observed[:, N_FACE:] = np.nan
    assert captured(tmp_path, observed).report["place"]["left_hand"] is None


def test_a_palm_that_is_hardly_seen_has_no_place(tmp_path: Path) -> None:
    observed = taken("claire").observed.copy()
    kept = marker_indices(["F1T", "F2T", "F3T", "F4T", "F5T", "F21", "F31", "F41", "K2", "K3"])
    observed[:, np.setdiff1d(np.arange(len(MARKERS)), kept)] = np.nan
    with pytest.raises(CueError, match="2 markers of the palm are seen, 4 needed"):
        captured(tmp_path, observed)


def test_swapped_and_nameless_markers_and_ghosts(tmp_path: Path) -> None:
    clean, take = taken("claire"), taken("claire", True)
    markers = take.observed.copy()
    lost = marker_indices(["F2T", "LC_R"])
    wandering = np.full((len(markers), 1, 3), np.nan)
    wandering[60:90, 0] = markers[60:90, lost[0]]
    markers[60:90, lost[0]] = np.nan
    markers[100:140, lost[1]] += [0.0, 60.0, 0.0]
    points = np.concatenate([markers, wandering, take.ghosts], axis=1)
    labels = (*MARKERS, *(f"*{n}" for n in range(points.shape[1] - len(MARKERS))))
    found = captured(tmp_path, points, labels)
    repairs = found.report["repairs"]
    assert repairs["renamed"] > 4
    assert repairs["recovered"] >= np.isfinite(wandering[..., 0]).sum()
    assert repairs["dropped"] >= 40
    gap = np.linalg.norm(VOICE.reconstruct(found.motion.params) - clean.truth, axis=-1)
    assert gap.mean() < 1.1


def test_some_of_the_markers_do(tmp_path: Path) -> None:
    names = [
        "FH0", "FH1_R", "NB", "EAR_R", "EAR_L", "LC_R", "LC_L", "UL0", "LL0", "CH0", "TH2_C",
        "A00", "A12", "A21", "W1", "W3", "K2", "K3", "K5", "P3",
        *(f"F{finger}{place}" for finger in range(1, 6) for place in "1T"),
    ]  # fmt: skip
    take = taken("claire")
    found = captured(tmp_path, take.observed[:, marker_indices(names)], tuple(names))
    assert found.report["markers"]["found"] == len(names)
    assert "S1" in found.report["markers"]["missing"]
    gap = np.linalg.norm(VOICE.reconstruct(found.motion.params) - take.truth, axis=-1)
    assert gap[:, N_FACE:].mean() < 4.0
    assert keys_right(found.motion, "claire") >= 0.8


def test_a_face_without_a_hand_rests_its_hand(tmp_path: Path) -> None:
    face = MARKERS[:N_FACE]
    found = captured(tmp_path, taken("claire").observed[:, :N_FACE], face)
    assert found.motion.score is None
    assert "0 markers of the hand, 8 needed: the hand rests" in found.report["notes"]
    hand = found.motion.params[:, VOICE.hand_columns]
    np.testing.assert_array_equal(hand, np.tile(hand[:1], (len(hand), 1)))


def test_a_hand_out_of_sight_for_longer_rests(tmp_path: Path) -> None:
    take = taken("claire")
    markers = take.observed.copy()
    markers[-80:, N_FACE:] = np.nan
    markers[40:60, N_FACE:] = np.nan
    found = captured(tmp_path, markers)
    forearm = found.motion.params[:, VOICE.hand_columns[12:]]
    np.testing.assert_allclose(forearm[-1], VOICE.gestures.placement_targets[0, 0], atol=1e-3)
    assert found.report["gaps"]["hand_unknown_s"] == pytest.approx(100 / files.RATE_HZ, abs=0.05)
    gap = np.linalg.norm(VOICE.reconstruct(found.motion.params) - take.truth, axis=-1)
    assert gap[80:-80, N_FACE:].mean() < 1.6


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("LASI", "RASI", "C7"), "0 of its 3 labels name markers of the cuer; it has LASI, RASI"),
        (("FH0", "EAR_R", "W1", "W2"), "2 markers of ears, nose, forehead"),
    ],
)
def test_too_little_is_told(tmp_path: Path, names: tuple[str, ...], message: str) -> None:
    points = taken("claire").observed[:20, : len(names)]
    if names[0] in MARKERS:
        points = taken("claire").observed[:20, marker_indices(names)]
    with pytest.raises(CueError, match=message):
        captured(tmp_path, points, names)


def test_a_take_of_four_frames(tmp_path: Path) -> None:
    """Too few to learn a face from; numpy warned of a mean of nothing."""
    found = captured(tmp_path, taken("claire").observed[:4])
    assert np.isfinite(found.motion.params).all()


def test_other_points_under_these_names_are_refused(tmp_path: Path) -> None:
    take = taken("claire")
    with pytest.raises(CueError, match="other points under these names"):
        captured(tmp_path, take.observed * 3.0)


def test_clock_rate_and_given_score(tmp_path: Path) -> None:
    take = taken("claire")
    options = CaptureOptions(rate_hz=50.0, start_s=12.345, score=take.score)
    motion = captured(tmp_path, take.observed, options=options).motion
    assert motion.rate_hz == 50.0
    assert motion.start_s == pytest.approx(12.36)
    assert motion.score == take.score.shifted(12.345)
    assert (
        captured(tmp_path, take.observed, options=CaptureOptions(keys=False)).motion.score is None
    )


def test_the_rule_gives_the_recognised_keys() -> None:
    score = plain("agathe").motion.score
    assert isinstance(score, Score)
    assert tuple(cue(score.phones)) == score.keys


def test_a_calibration_take_gives_the_faces_rest(tmp_path: Path) -> None:
    take = taken("agathe")
    still = take.observed[:15]  # before anything is said
    (tmp_path / "still.trc").write_text(files.trc(still), encoding="utf-8")
    options = CaptureOptions(rate_hz=files.RATE_HZ, calibration=tmp_path / "still.trc")
    found = captured(tmp_path, take.observed, options=options)
    face = found.motion.params[:15][:, VOICE.face_columns[:7]]
    rest = VOICE.gestures.viseme_targets[0]
    # Throat and the free parameter drift by themselves.
    np.testing.assert_allclose(face.mean(0)[:5], rest[:5], atol=0.45)
    assert np.abs(plain("agathe").motion.params[:15, :5].mean(0) - rest[:5]).max() > 0.45


def test_windows_do_not_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("synth.capture.points.solve.WINDOW", 100)
    pieces = captured(tmp_path, taken("claire").observed).motion
    assert distance(plain("claire").motion, pieces) < 0.05
