"""The three corpora: scores, choice of sentences, studio, files."""

import itertools
import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.cuer.layout import MARKER_NUMBER, N_FACE
from codec.cues.phonology import CONSONANTS, PAUSE, VOWELS
from codec.cues.score import PLACEMENT_NUMBER
from codec.errors import CueError
from lab.corpora import main
from lab.voice import perform
from synth.language.text.sentences import read_sentences
from synth.motion.body.body import BodyPose, load_body
from synth.motion.body.skeleton import HAND_ANGLES
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.drills import drill, isolated_sounds, shape_transitions
from synth.studio import _kernels
from synth.studio.corpora import plan_corpora, read_utterance
from synth.studio.studio import Studio, surround
from synth.studio.take import StudioTake, record
from synth.units.recordings.choice import KINDS, choose, coverage, units_of

SYMBOLS = st.lists(st.sampled_from(["p", "a", "j", "i", "s", "ɥ", PAUSE]), min_size=1, max_size=12)


@pytest.fixture(scope="module")
def recording() -> StudioTake:
    # Half as many lines show the hand at the mouth or cheek for five frames: strokes fill the time.
    return record(GestureSynthesiser(rate_hz=60.0), drill(8, seed=2), seed=5)


def test_every_succession_of_shapes_occurs() -> None:
    keys = shape_transitions(rounds=2).keys
    pairs = Counter((a.shape, b.shape) for a, b in itertools.pairwise(keys))
    assert {pair for pair in pairs if pair[0] != pair[1]} == set(
        itertools.permutations(range(9), 2)
    )


def test_isolated_sounds_are_all_vowels_and_all_vcv() -> None:
    phones = [p.symbol for p in isolated_sounds().phones]
    assert phones[: len(VOWELS)] == list(VOWELS)
    words = {tuple(phones[i : i + 3]) for i in range(len(VOWELS), len(phones), 3)}
    assert words == {(v, c, v) for v in "aiu" for c in CONSONANTS}
    assert isolated_sounds().keys == ()


def test_drill_is_repeatable_and_covers_shapes_and_placements() -> None:
    score = drill(20, seed=3)
    assert score == drill(20, seed=3)
    assert {k.shape for k in score.keys} == set(range(1, 9))
    assert {k.placement for k in score.keys} == {"side", "mouth", "chin", "cheek", "throat"}


def test_training_frames_are_labelled_where_targets_are_held() -> None:
    frames = perform(GestureSynthesiser(), drill(3, seed=1))
    assert frames.shape is not None
    assert frames.placement is not None
    assert set(np.unique(frames.shape)) >= {-1, 0}
    rest = frames.placement == PLACEMENT_NUMBER["rest"]
    assert (frames.shape[rest] <= 0).mean() > 0.9


def test_units_of_a_line() -> None:
    units = units_of(["m", "a", "j", "i"])
    assert ("a", "j", "i") in units["polysounds"]
    assert ("a", "j") in units["diphones"]
    assert units["dikeys"][("15", "28")] == 1
    assert units["shapes"] == Counter({("0", "5"): 1, ("5", "8"): 1, ("8", "0"): 1})


@given(SYMBOLS)
def test_units_count_every_phone_once(line: list[str]) -> None:
    units = units_of(line)
    spoken = [s for s in line if s != PAUSE]
    starts = Counter(a for a, _ in units["diphones"].elements())
    starts.pop(PAUSE, None)
    assert starts == Counter(spoken)


@given(st.lists(SYMBOLS, min_size=1, max_size=8), st.integers(1, 8))
def test_chosen_lines_cover_all_when_all_may_be_chosen(lines: list[list[str]], count: int) -> None:
    everything = choose(lines, len(lines))
    assert len(set(everything)) == len(everything)
    for part in coverage(lines, everything):
        assert part.covered == part.offered
        assert part.short == 0
    assert len(choose(lines, count)) <= count


def test_choice_beats_the_first_lines_of_the_list() -> None:
    lines = [[p.symbol for p in drill(1, seed=i).phones] for i in range(60)]
    chosen = {part.kind: part for part in coverage(lines, choose(lines, 15))}
    first = {part.kind: part for part in coverage(lines, range(15))}
    for kind in KINDS[:3]:
        assert chosen[kind].covered > 1.1 * first[kind].covered


def test_no_sentence_cannot_be_chosen() -> None:
    with pytest.raises(CueError, match="0 sentences cannot be chosen"):
        choose([["a"]], 0)


def test_gaps_of_the_face_come_with_the_hand(recording: StudioTake) -> None:
    face = recording.visible[:, :N_FACE]
    resting = recording.labels.placement == PLACEMENT_NUMBER["rest"]
    at_face = np.isin(recording.labels.placement, [PLACEMENT_NUMBER[p] for p in ("mouth", "cheek")])
    assert at_face.sum() >= 50
    assert face[resting].mean() > 0.995
    assert face[at_face].mean() < face[resting].mean() - 0.002


def test_folded_fingers_are_hidden_and_the_back_of_the_hand_is_not(recording: StudioTake) -> None:
    fist = recording.visible[recording.labels.shape == 0]
    assert fist[:, MARKER_NUMBER["F3T"]].mean() < 0.2
    back = recording.visible[recording.labels.shape == 4]
    assert back[:, MARKER_NUMBER["P3"]].mean() > 0.9


def test_what_is_seen_is_near_the_truth(recording: StudioTake) -> None:
    error = (recording.observed - recording.truth)[recording.visible]
    assert 0.25 < error.std() < 0.5
    assert np.abs(error).max() < 2.5
    assert np.isnan(recording.observed[~recording.visible]).all()


def test_recordings_are_repeatable() -> None:
    cuer = GestureSynthesiser()
    first, second = (record(cuer, drill(1), seed=3) for _ in range(2))
    np.testing.assert_array_equal(first.observed, second.observed)
    other = record(cuer, drill(1), seed=4)
    assert not np.array_equal(first.observed, other.observed, equal_nan=True)


def test_swaps_and_ghosts_come_when_asked_for(recording: StudioTake) -> None:
    studio = Studio(swaps_per_s=2.0, ghosts_per_s=1.0, dropouts_per_s=0.0)
    faulty = record(GestureSynthesiser(), drill(2), studio=studio)
    away = np.linalg.norm(faulty.observed - faulty.truth, axis=2)
    assert (away[faulty.visible] > 4.0).any()
    assert faulty.ghosts.shape[1] > 3
    assert recording.ghosts.shape[1] == 0


def test_cameras_all_around_see_the_hand_better() -> None:
    cuer = GestureSynthesiser(free_space=True)
    score = shape_transitions()
    front, around = (
        record(cuer, score, studio=Studio(cameras)).visible[:, N_FACE:].mean()
        for cameras in (Studio().cameras, surround())
    )
    assert around > front + 0.05


def test_unusable_studios_are_refused() -> None:
    with pytest.raises(CueError, match=r"cameras have shape \(2, 2\)"):
        Studio(np.zeros((2, 2)))
    with pytest.raises(CueError, match="3 cameras have to see a marker, there are 2"):
        Studio(np.zeros((2, 3)), least_cameras=3)


def test_kernel_agrees_with_its_plain_function() -> None:
    rng = np.random.default_rng(8)
    normals = rng.normal(size=(2, 6, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    arguments = (
        rng.normal(scale=50.0, size=(2, 6, 3)), normals, Studio().cameras, 0.3, 12,
        rng.normal(scale=80.0, size=(2, 4, 3)), rng.normal(scale=80.0, size=(2, 4, 3)),
        np.full(4, 20.0), rng.normal(scale=60.0, size=(2, 2, 3)),
        np.tile(np.eye(3) / 30.0, (2, 2, 1, 1)),
    )  # fmt: skip
    compiled, plain = np.zeros((2, 2, 6), dtype=np.int64)
    _kernels.count_cameras(*arguments, compiled)
    _kernels.count_cameras.py_func(*arguments, plain)
    np.testing.assert_array_equal(compiled, plain)
    assert 0 < plain.sum() < plain.size * 12


@pytest.mark.parametrize(
    ("offset", "count"), [((0.0, 0.0, 60.0), 0), ((0.0, 60.0, 0.0), 1), ((0.0, 0.0, -60.0), 1)]
)
def test_a_rod_hides_what_lies_behind_it_only(
    offset: tuple[float, float, float], count: int
) -> None:
    point, normal = np.zeros((1, 1, 3)), np.array([[[0.0, 0.0, 1.0]]])
    camera = np.array([[0.0, 0.0, 1000.0]])
    middle, half = np.array([[offset]]), np.array([50.0, 0.0, 0.0])
    out = np.zeros((1, 1), dtype=np.int64)
    _kernels.count_cameras(
        point, normal, camera, 0.2, 1, middle - half, middle + half,
        np.array([15.0]), np.zeros((1, 0, 3)), np.zeros((1, 0, 3, 3)), out,
    )  # fmt: skip
    assert out[0, 0] == count


def test_the_back_of_the_head_hides_the_ear_behind_it() -> None:
    body = load_body()
    still = BodyPose(
        np.zeros((1, len(body.unit_names))),
        np.zeros((1, 6)),
        np.zeros((1, len(HAND_ANGLES))),
        np.array([[0.0] * 3 + [-900.0, -900.0, 0.0]]),
    )
    left_camera = Studio(np.array([[2000.0, 0.0, 600.0]]), least_cameras=1)
    seen = left_camera.seen(body, still, body.markers(still))[0]
    assert seen[MARKER_NUMBER["EAR_L"]]
    assert not seen[MARKER_NUMBER["EAR_R"]]


def test_sentences_come_without_comments(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("# title\n\nUn.\n Deux. \n", encoding="utf-8")
    assert read_sentences(tmp_path / "a.txt") == ["Un.", "Deux."]
    assert len(read_sentences()) > 238
    (tmp_path / "b.txt").write_text("# nothing\n", encoding="utf-8")
    with pytest.raises(CueError, match="no sentence in the list"):
        read_sentences(tmp_path / "b.txt")
    with pytest.raises(CueError, match="not a list of sentences"):
        read_sentences(tmp_path / "none.txt")


def test_corpora_are_planned_with_a_report() -> None:
    utterances, report = plan_corpora(["Bonjour.", "Au revoir.", "Merci."], count=2)
    assert [u.name for u in utterances[:2]] == ["corpus1/shapes", "corpus2/vowels"]
    assert len([u.text for u in utterances if u.text]) == 2
    assert [part.kind for part in report] == list(KINDS)


@pytest.mark.slow
def test_the_built_in_list_covers_french() -> None:
    utterances, report = plan_corpora(read_sentences())
    assert len([u for u in utterances if u.text]) == 238
    for part in report:
        assert part.running > 0.99, part  # 99.6 % or more, all kinds, 2026-11
    found = {part.kind: part for part in report}
    assert found["shapes"].offered == 80  # all but rest to rest
    assert found["shapes"].covered == 80
    assert found["placements"].covered == 35


@pytest.mark.slow
def test_the_command_makes_corpora_that_can_be_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("ezc3d", reason="needs the extra c3d")
    (tmp_path / "a.txt").write_text("Bonjour.\nMerci.\n", encoding="utf-8")
    arguments = ["--out", str(tmp_path), "--sentences", str(tmp_path / "a.txt"), "--quiet"]
    assert main([*arguments, "--jobs", "2", "--rate", "60"]) == 0
    assert "shapes: " in capsys.readouterr().out
    manifest = json.loads((tmp_path / "corpus.json").read_text(encoding="utf-8"))
    for utterance in manifest["utterances"]:
        markers, rate, score = read_utterance(tmp_path / f"{utterance['name']}.c3d")
        assert rate == 60.0
        assert np.isfinite(markers).any(axis=(1, 2)).all()
        assert [p.symbol for p in score.phones] == [
            s for s in utterance["phones"].split() if s != PAUSE
        ]
        assert bool(score.keys) == (not utterance["name"].startswith("corpus2"))


def test_the_command_refuses_what_it_cannot_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--out", str(tmp_path / "o"), "--identity", "nobody"]) == 3
    assert "unknown cuer 'nobody'" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()
