"""Frames that an outline calls the same are the same."""

from dataclasses import replace

import numpy as np
import pytest

from codec.cues.cueing import cue
from codec.cues.score import Score
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.prosody.simulation import PerformerChoice, mirror_of
from synth.planning.scoring.text_score import score_of_text

TEXT = "Le petit chat dort au soleil du matin et le grand chien le regarde longtemps"
FRAMES = 250


def moved(score: Score, first: int, last: int, by_s: float) -> Score:
    """Return a score some of whose phones sound later."""
    phones = [
        replace(
            p, start=p.start + by_s * (first < n <= last), end=p.end + by_s * (first <= n < last)
        )
        for n, p in enumerate(score.phones)
    ]
    return Score(tuple(phones), tuple(cue(phones)))


@pytest.mark.parametrize(("first", "last"), [(8, 9), (20, 24)])
def test_only_frames_that_differ_differ(first: int, last: int) -> None:
    score = score_of_text(TEXT, start_s=1.0)
    other = moved(score, first, last, 0.02)
    cuer = GestureSynthesiser(seed=3)
    outline = cuer.outline(score)
    markers = cuer.markers(score, 0.0, FRAMES).astype(np.float64)
    differs = outline.differs(cuer.outline(other), cuer.times_s(0.0, FRAMES))
    apart = np.abs(markers - cuer.markers(other, 0.0, FRAMES)).max(axis=(1, 2))
    assert apart[~differs].max() < 1e-4
    assert apart[differs].max() > 0.5
    assert 0.05 < differs.mean() < 0.8


def test_a_performance_like_another_is_that_of_the_score() -> None:
    score = score_of_text(TEXT, start_s=1.0)
    other = moved(score, 12, 15, 0.02)
    mirror = mirror_of(PerformerChoice("agathe"))
    like = mirror.performed(score.phones, score.keys)
    whole = mirror.performed(other.phones, other.keys)
    assert (mirror.performed(other.phones, other.keys, like).held_s == whole.held_s).all()
    assert (like.held_s != whole.held_s).any()
