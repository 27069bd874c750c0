"""No rainbows: which placements a hand passes on its way to others."""

import itertools

import numpy as np
import pytest

from codec.analysis.passing import PassedPlacement, limits_mm, passed_by
from codec.analysis.readability import Classes
from codec.cues.cueing import cue
from codec.cues.score import PLACEMENTS, Phone, Score
from synth.motion.rules.gesture import GestureSynthesiser

VOWEL_AT = {"side": "a", "mouth": "i", "chin": "u", "cheek": "ɛ̃", "throat": "y"}
CONSONANTS = ("p", "m")
"""Of shapes 1 and 5: both pointing fingers."""


def every_way() -> Score:
    """A short programme at five keys a second: every placement after every other one."""
    phones: list[Phone] = []
    clock = 1.0
    for consonant, *pair in (
        (consonant, *pair)
        for consonant in CONSONANTS
        for pair in itertools.permutations(VOWEL_AT, 2)
    ):
        for placement in pair:
            for symbol in (consonant, VOWEL_AT[placement]):
                phones.append(Phone(symbol, clock, clock + 0.1))
                clock += 0.1
    return Score(tuple(phones), tuple(cue(phones)))


def passed(cuer: GestureSynthesiser, score: Score) -> list[PassedPlacement]:
    frames = int(cuer.rate_hz * (score.phones[-1].end + 1.0))
    plan = cuer.gestures(score)
    return list(
        passed_by(
            cuer.markers(score, 0.0, frames),
            cuer.times_s(0.0, frames),
            Classes(cuer.targets()[0]),
            placement=plan.placement,
            leave=plan.leave,
            reach=plan.reach,
        )
    )


def test_nothing_is_passed_in_a_programme_of_all_ways() -> None:
    assert passed(GestureSynthesiser(), every_way()) == []


def test_straight_ways_and_the_usual_arc_pass_placements() -> None:
    for arc in ((0.0, 0.0, 0.1), (-0.24, -0.13, 0.1)):
        cuer = GestureSynthesiser()
        cuer.arcs = np.broadcast_to(arc, cuer.arcs.shape)
        found = passed(cuer, every_way())
        assert len(found) > 2
        for one in found:
            assert one.away_mm < one.limit_mm
            assert one.placement not in (one.before, one.after)


def test_limits_end_before_the_middle_between_neighbours() -> None:
    tips = Classes(GestureSynthesiser().targets()[0]).tips
    limits = limits_mm(tips)
    assert limits.shape == (9, 6)
    assert not limits[:, 0].any()
    for one, other in itertools.combinations(range(1, len(PLACEMENTS)), 2):
        apart = np.linalg.norm(tips[:, one, :2] - tips[:, other, :2], axis=1)
        assert (limits[:, one] + limits[:, other] <= apart - 8.0 + 1e-9).all()


def test_a_hand_between_is_passed_unless_it_was_meant() -> None:
    cuer = GestureSynthesiser()
    still = cuer.targets()[0][5, [2] * 20]
    strokes = {
        "placement": np.array([1, 3]),
        "leave": np.array([-9.0, 0.0]),
        "reach": np.array([-9.0, 0.4]),
    }
    times, classes = np.arange(20) / 50.0, Classes(cuer.targets()[0])
    (found,) = passed_by(still, times, classes, **strokes)
    assert (found.before, found.after, found.placement) == ("side", "chin", "mouth")
    assert found.away_mm == pytest.approx(0.0, abs=0.01)
    strokes["placement"] = np.array([1, 2])
    assert list(passed_by(still, times, classes, **strokes)) == []
