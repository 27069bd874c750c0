"""A voice without a body performs with its own targets."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.cuer.layout import N_FACE
from codec.cuer.models.face import N_FACE_PARAMETERS
from codec.cuer.motion import load_motion
from codec.cuer.voice import Voice, load_voice, save_voice
from codec.cues.phonology import PHONE_NUMBER
from codec.cues.score import Score
from codec.errors import CueError
from codec.superframe.lips import LipContract
from cuecast.command.cli import main
from synth.motion.rules.bodiless import Bodiless, ruled_cuer
from synth.motion.rules.gesture import GestureSynthesiser
from synth.motion.rules.movement import plan_gestures
from synth.planning.scoring.text_score import score_of_text

SCORE = score_of_text("Le bon vin blanc. Elle code.", start_s=1.0)


@pytest.fixture(scope="module")
def voice() -> Voice:
    """Somebody whose targets are known, and who has no body."""
    return replace(load_voice(), name="anna")


@pytest.fixture(scope="module")
def cuer(voice: Voice) -> Bodiless:
    made = ruled_cuer(voice)
    assert isinstance(made, Bodiless)
    return made


def test_who_performs(voice: Voice) -> None:
    assert isinstance(ruled_cuer(load_voice()), GestureSynthesiser)
    with pytest.raises(CueError, match="rate 0 Hz"):
        ruled_cuer(voice, rate_hz=0)
    with pytest.raises(CueError, match="alignment"):
        ruled_cuer(voice, alignment="x")


@settings(max_examples=15)
@given(first=st.integers(0, 200), length=st.integers(0, 90))
def test_any_window_gives_the_same_frames(
    cuer: Bodiless, voice: Voice, first: int, length: int
) -> None:
    whole = cuer.motion(SCORE, 0.0, 300, voice).params
    window = cuer.motion(SCORE, first / 50.0, length, voice).params
    np.testing.assert_allclose(window, whole[first : first + length], atol=1e-4)


def test_slow_keys_reach_their_targets(cuer: Bodiless, voice: Voice) -> None:
    slow = 3.0
    score = Score(
        tuple(replace(p, start=slow * p.start, end=slow * p.end) for p in SCORE.phones),
        tuple(replace(k, start=slow * k.start, end=slow * k.end) for k in SCORE.keys),
    )
    motion = cuer.motion(score, 0.0, 900, voice)
    gestures = plan_gestures(score, way=cuer._way)
    table = voice.gestures
    checked = 0
    for number in range(1, len(gestures.leave) - 1):
        if gestures.leave[number + 1] - gestures.reach[number] < 0.1:
            continue
        row = motion.params[int(50 * gestures.leave[number + 1]) - 1, voice.hand_columns]
        shape, place = gestures.shape[number], gestures.placement[number]
        wanted = np.concatenate([table.shape_targets[shape], table.placement_targets[shape, place]])
        rows = np.zeros((2, len(voice.layout)))
        rows[:, voice.hand_columns] = row, wanted
        markers = voice.reconstruct(rows)[:, N_FACE:]
        assert np.linalg.norm(markers[1] - markers[0], axis=1).max() < 2.0
        checked += 1
    assert checked >= len(score.keys) // 2


def test_she_is_in_step_with_a_body_of_the_same_targets(cuer: Bodiless, voice: Voice) -> None:
    """The hand of the virtual cuer, whose voice this is, goes the same ways at the same times."""
    ours = voice.reconstruct(cuer.motion(SCORE, 0.0, 250, voice).params)[:, N_FACE:]
    body = GestureSynthesiser().motion(SCORE, 0.0, 250, load_voice()).params
    theirs = load_voice().reconstruct(body)[:, N_FACE:]
    away = {
        shift: np.linalg.norm(np.roll(ours, shift, axis=0) - theirs, axis=2)[20:-20].mean()
        for shift in (-4, -2, 0, 2, 4)
    }
    assert min(away, key=lambda shift: away[shift]) == 0
    assert away[0] < 20.0  # measured 14: she is still, and does not scatter


def test_lips_keep_their_contract(cuer: Bodiless, voice: Voice) -> None:
    """At a bilabial the lips are as near as those of the viseme."""
    motion = cuer.motion(SCORE, 0.0, 300, voice)
    contract = LipContract(voice)
    for phone in SCORE.phones:
        if phone.symbol not in "pbm":
            continue
        frame = round(50 * 0.5 * (phone.start + phone.end))
        face = motion.params[frame : frame + 1, :N_FACE_PARAMETERS].astype(np.float64)
        viseme = voice.gestures.viseme_targets[PHONE_NUMBER[phone.symbol]].astype(np.float64)
        gap = contract.features(face) - contract.features(viseme[None])
        assert abs(gap[0, 0]) < 1.0


def test_nothing_said_is_a_still_cuer(cuer: Bodiless, voice: Voice) -> None:
    params = cuer.motion(Score((), ()), 0.0, 40, voice).params
    np.testing.assert_allclose(params, np.tile(params[0], (40, 1)), atol=1e-6)


def test_another_voice_is_refused(cuer: Bodiless, voice: Voice) -> None:
    hands = voice.gestures.shape_targets + np.float32(0.1)
    other = replace(voice, gestures=replace(voice.gestures, shape_targets=hands))
    with pytest.raises(CueError, match="another one"):
        cuer.motion(SCORE, 0.0, 10, other)


def test_synth_takes_such_a_voice(voice: Voice, tmp_path: Path) -> None:
    """What `voice build --corpora` writes performs a text and is coded."""
    path, out = tmp_path / "anna.npz", tmp_path / "m.npz"
    save_voice(voice, path)
    assert main(["synth", "Le bon vin.", "--voice", str(path), "-o", str(out)]) == 0
    motion = load_motion(out)
    assert motion.score is not None
    assert len(motion.score.keys) == 3
    assert motion.params.std(axis=0).max() > 1.0
    coded = tmp_path / "m.cue"
    assert main(["encode", str(out), "-o", str(coded), "--voice", str(path)]) == 0
