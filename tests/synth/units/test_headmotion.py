"""The suprasegmental motion of the head: local, seeded, within what was recorded."""

import numpy as np
import pytest

from codec.cuer.layout import HAND_MARKERS, MARKER_NUMBER, RIGID_FACE, marker_indices
from codec.cuer.models import rigid
from codec.cuer.voice import Voice, load_voice
from codec.cues.cueing import cue
from codec.cues.score import Phone, Score
from synth.motion.rules.gesture import GestureSynthesiser
from synth.motion.rules.movement import plan_gestures
from synth.units.concatenation.headmotion import HeadMotion
from synth.units.recordings.recording import UnitRecording
from synth.units.recordings.rendered import record

TEXTS = ("Le petit chat mange une souris grise, sous la table.", "Bonjour, madame !")


@pytest.fixture(scope="module")
def voice() -> Voice:
    return load_voice("claire")


@pytest.fixture(scope="module")
def recordings(voice: Voice) -> list[UnitRecording]:
    return list(record(TEXTS, GestureSynthesiser(alignment="paper"), voice))


@pytest.fixture(scope="module")
def head(voice: Voice, recordings: list[UnitRecording]) -> HeadMotion:
    return HeadMotion(voice, recordings, seed=3)


def line(*groups: tuple[float, int]) -> list[Phone]:
    phones = []
    for start_s, syllables in groups:
        for k in range(syllables):
            at = start_s + 0.3 * k
            phones += [Phone("m", at, at + 0.1), Phone("a", at + 0.1, at + 0.3)]
    return phones


def test_the_head_rises_where_speech_goes_on_and_nods_where_it_ends(head: HeadMotion) -> None:
    phones = line((1.0, 3), (2.1, 3), (9.0, 1))
    times = np.arange(0.0, 6.0, 0.02)
    marked = (head.at(times, phones) - head.at(times, []))[:, 0]
    turning = marked / np.abs(marked).max()
    comma, stop = np.searchsorted(times, [1.9, 3.0])
    assert turning[comma] < -0.3
    assert turning[stop] > 0.5
    # Back after the accent, and nothing before it.
    assert np.abs(turning[times < 1.5]).max() < 1e-9
    assert np.abs(turning[times > 3.8]).max() < 1e-9


def test_it_depends_on_time_and_what_is_near_alone(head: HeadMotion) -> None:
    phones = line((1.0, 3), (2.1, 3), (9.0, 1))
    times = np.arange(0.0, 6.0, 0.02)
    whole = head.at(times, phones)
    np.testing.assert_array_equal(whole[100:150], head.at(times[100:150], phones))
    np.testing.assert_array_equal(whole, head.at(times, line((1.0, 3), (2.1, 3))))


def test_the_seed_decides(head: HeadMotion, voice: Voice, recordings: list[UnitRecording]) -> None:
    times, phones = np.arange(0.0, 6.0, 0.02), line((1.0, 3))
    again = HeadMotion(voice, recordings, seed=3).at(times, phones)
    np.testing.assert_array_equal(head.at(times, phones), again)
    other = HeadMotion(voice, recordings, seed=4).at(times, phones)
    assert np.abs(other - again).max() > 1e-3


def test_a_hand_at_the_face_goes_with_the_head(
    head: HeadMotion, voice: Voice, recordings: list[UnitRecording]
) -> None:
    phones = tuple(line((1.0, 4)))
    score = Score(phones, tuple(cue(phones)))
    gestures = plan_gestures(Score(phones, tuple(cue([Phone("i", 1.0, 2.2)]))))
    # The key of /i/: hand at the mouth.
    held = recordings[0].motion.params[:1].astype(np.float64).repeat(50, axis=0)
    times = np.linspace(1.4, 2.2, 50)
    moved = head.added(held, times, score.phones, gestures)
    before, after = (voice.reconstruct(p).astype(np.float64) for p in (held, moved))
    skull, tip = marker_indices(RIGID_FACE), MARKER_NUMBER["F2T"]
    assert tip - len(HAND_MARKERS) > 0
    away = np.linalg.norm(after[:, skull] - before[:, skull], axis=2).max()
    assert away > 1.0
    motion, _ = rigid.estimate_motion(before[0, skull], after[:, skull])
    back = rigid.inverse_rigid_motion(after, motion)
    # Left behind, the hand would be away by as much as the head moves.
    assert np.linalg.norm(back[:, tip] - before[:, tip], axis=1).max() < 0.4 * away


def test_taking_out_the_slow_part_leaves_face_and_fingers(
    head: HeadMotion, recordings: list[UnitRecording], voice: Voice
) -> None:
    taken = head.without_slow_part(recordings)[0].params
    own = recordings[0].motion.params
    kept = [i for i, name in enumerate(voice.layout) if name.startswith(("face.", "hand."))]
    np.testing.assert_allclose(taken[:, kept], own[:, kept], atol=1e-6)
    heads = [i for i, name in enumerate(voice.layout) if name.startswith("head.")]
    assert taken[:, heads].std(axis=0).sum() < own[:, heads].std(axis=0).sum()
