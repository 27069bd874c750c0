import numpy as np
import pytest

from codec.analysis.phases import extents, hand_speed, key_kind, profiles, strokes
from codec.cuer import layout
from codec.cues.score import PLACEMENT_NUMBER, Key, Score

RATE_HZ = 120.0
KEYS = (
    Key(1.0, 1.4, ("b", "i"), 4, "mouth"),
    Key(1.4, 1.8, ("b", "e"), 4, "throat"),
    Key(1.8, 2.2, ("ʁ",), 3, "side"),
    Key(2.2, 2.6, ("ɔ",), 5, "chin"),
)
SCORE = Score((), KEYS)
LEAD_S, LAG_S = 0.15, 0.05


def posteriors(of_placement: bool) -> np.ndarray:
    """Each key dominates from LEAD_S before its onset until the next one does."""
    classes = 6 if of_placement else 9
    table = np.full((int(4 * RATE_HZ), classes), 0.01)
    times = np.arange(len(table)) / RATE_HZ
    best = np.zeros(len(table), int)
    for key in KEYS:
        label = PLACEMENT_NUMBER[key.placement] if of_placement else key.shape
        best[times >= key.start - LEAD_S] = label
    best[times >= KEYS[-1].end] = 0
    table[np.arange(len(table)), best] = 1
    return np.asarray(table / table.sum(1, keepdims=True))


def test_extents_of_placements() -> None:
    found = extents(posteriors(True), SCORE, rate_hz=RATE_HZ)
    assert [phase.key for phase in found] == list(KEYS)
    for phase in found:
        assert phase.lead_s == pytest.approx(LEAD_S, abs=1.5 / RATE_HZ)
    assert found[0].lag_s == pytest.approx(0.4 - LEAD_S, abs=1.5 / RATE_HZ)


def test_repeated_shapes_are_left_out() -> None:
    found = extents(posteriors(False), SCORE, rate_hz=RATE_HZ)
    assert [phase.key.shape for phase in found] == [3, 5]


def test_start_of_the_recording_shifts_everything() -> None:
    plain = extents(posteriors(True), SCORE, rate_hz=RATE_HZ)
    moved = extents(posteriors(True), SCORE.shifted(10.0), rate_hz=RATE_HZ, start_s=10.0)
    for a, b in zip(plain, moved, strict=True):
        assert b.start_s == pytest.approx(a.start_s + 10)


def test_unrecognised_keys_are_missing() -> None:
    table = np.full((480, 6), 0.1)
    table[:, 0] = 0.5
    assert extents(table, SCORE, rate_hz=RATE_HZ) == []


def still_markers(seconds: float) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.repeat(50 * rng.normal(size=(1, 113, 3)), int(seconds * RATE_HZ), axis=0)


def test_stroke_of_a_minimum_jerk_movement() -> None:
    markers = still_markers(3.0)
    part = np.clip((np.arange(len(markers)) / RATE_HZ - 0.8) / 0.25, 0, 1)
    path = part**3 * (10 - 15 * part + 6 * part**2)
    markers[:, layout.N_FACE :] += path[:, None, None] * np.array([60.0, -80.0, 0.0])
    found = strokes(markers, Score((), (KEYS[0],)), rate_hz=RATE_HZ)
    assert len(found) == 1
    # A tenth of the peak speed is reached 6.6 % into the movement; smoothing widens it a little.
    assert found[0].start_s == pytest.approx(0.8 + 0.0165, abs=0.02)
    assert found[0].end_s == pytest.approx(1.05 - 0.0165, abs=0.02)


def test_hand_speed_does_not_see_the_head_move() -> None:
    markers = still_markers(1.0)
    markers += np.linspace(0, 100, len(markers))[:, None, None]
    assert hand_speed(markers, RATE_HZ).max() < 1e-6


def test_a_still_hand_has_no_strokes() -> None:
    assert strokes(still_markers(3.0), SCORE, rate_hz=RATE_HZ) == []
    assert strokes(still_markers(0.01), SCORE, rate_hz=RATE_HZ) == []


def test_kinds_and_profiles() -> None:
    assert [key_kind(key) for key in KEYS] == ["CV", "CV", "C", "V"]
    found = profiles(extents(posteriors(True), SCORE, rate_hz=RATE_HZ))
    assert [(p.kind, p.count) for p in found] == [("C", 1), ("CV", 2), ("V", 1)]
    assert found[1].lead_s == pytest.approx(LEAD_S, abs=1.5 / RATE_HZ)
    assert profiles([]) == []
