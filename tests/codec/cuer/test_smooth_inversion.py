"""Inversion of markers that a body has made."""

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from codec.cuer import layout
from codec.cuer.models.inversion import invert_face
from codec.cuer.models.smooth_inversion import smooth_face
from codec.cuer.voice import Voice, load_voice
from codec.cues.score import Score
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.text_score import score_of_text

FRAMES = 137
TEXT = "Le petit chat noir dort sur le grand fauteuil rouge"


@pytest.fixture(scope="module")
def cuer() -> GestureSynthesiser:
    return GestureSynthesiser("claire")


@pytest.fixture(scope="module")
def score() -> Score:
    return score_of_text(TEXT)


def rms_mm(voice: Voice, params: ArrayLike, markers: ArrayLike) -> NDArray[np.float64]:
    made = voice.reconstruct(np.asarray(params, dtype=np.float64))
    return np.asarray(np.sqrt(((made - np.asarray(markers)) ** 2).sum(-1).mean(-1)))


def test_it_is_as_near_to_the_markers_as_plain_inversion(
    cuer: GestureSynthesiser, score: Score
) -> None:
    voice = load_voice()
    markers = cuer.markers(score, 0.0, FRAMES)
    plain = rms_mm(voice, voice.invert(markers, rate_hz=50.0).params, markers)
    smooth = rms_mm(voice, cuer._found(score, 0.0, FRAMES, voice), markers)
    assert smooth.mean() < 1.02 * plain.mean()


def test_a_face_is_as_near_by_the_slopes_of_other_frames(
    cuer: GestureSynthesiser, score: Score
) -> None:
    model, markers = (
        load_voice().face,
        cuer.markers(score, 0.0, FRAMES).astype(np.float64)[:, : layout.N_FACE],
    )
    seen = np.ones(markers.shape[:2], dtype=np.bool_)
    own, others = (
        np.sqrt((model.residual(found, markers) ** 2).sum(-1).mean())
        for found in (invert_face(model, markers, seen), smooth_face(model, markers))
    )
    assert others < 1.002 * own


def test_a_window_is_part_of_any_longer_one(cuer: GestureSynthesiser, score: Score) -> None:
    voice = load_voice()
    whole = cuer.motion(score, 0.0, FRAMES, voice).params
    for first, frames in ((0, 9), (5, 1), (30, 61), (134, 3)):
        part = cuer.motion(score, first / 50, frames, voice).params
        assert np.abs(part - whole[first : first + frames]).max() < 1e-5


def test_one_frame_is_inverted_by_itself() -> None:
    voice = load_voice()
    markers = voice.reconstruct(np.zeros((1, len(voice.layout))))
    assert np.abs(voice.invert_smooth(markers, np.zeros((1, 12)))).max() < 0.1
