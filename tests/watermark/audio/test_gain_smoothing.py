"""Relief of the moments at which a mark is noticed most: found, tried, kept only where it helps."""

from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from watermark.audio.embed.gain_smoothing import MOST_SOFTENED, SOFTENED, GainSmoothing, Moments
from watermark.audio.embed.level_control import TOLERATED, LevelControl
from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, HOP, SUPERFRAME

FRAMES = 4 * FRAMES_PER_SUPERFRAME


def detections(burst: slice) -> NDArray[np.float64]:
    """Small probabilities in the meter's frames of a stretch, a large one in some."""
    found = np.full(119, 0.1)
    found[burst] = 0.95
    return found


def test_a_moment_is_relieved_where_it_is() -> None:
    gains = Moments().gains(detections(slice(60, 75)), FRAMES)
    assert gains is not None
    soft = np.flatnonzero(gains < 1) * HOP / 1024
    assert gains.min() == SOFTENED
    assert 58 < soft.min() < 68  # the smoothed probability must have risen first
    assert 73 < soft.max() < 77
    assert Moments().gains(detections(slice(0)), FRAMES) is None


def test_a_superframe_is_not_softened_as_a_whole() -> None:
    gains = Moments().gains(detections(slice(0, 75)), FRAMES)
    assert gains is not None
    softened = (GainSmoothing(gains).parts() < 1).mean(axis=1)
    assert softened.max() <= MOST_SOFTENED
    assert softened[0] == softened[1] == 0
    assert softened[2] > 0


def test_what_is_usual_in_its_passage_is_no_moment() -> None:
    moments = Moments()
    for _ in range(15):
        moments.add(np.full(120, 0.97), 4 * SUPERFRAME)
    assert moments.gains(detections(slice(60, 75)), FRAMES) is None


def test_places_go_on_from_stretch_to_stretch() -> None:
    moments, first = Moments(), Moments().gains(detections(slice(60, 70)), FRAMES)
    moments.add(detections(slice(0)), 1024 * 119)
    later = moments.gains(detections(slice(60, 70)), FRAMES)
    assert first is not None
    assert later is not None
    assert np.flatnonzero(first < 1)[-1] == np.flatnonzero(later < 1)[-1]


def test_levels_make_up_for_what_is_taken() -> None:
    gains = np.ones(2 * FRAMES_PER_SUPERFRAME)
    gains[FRAMES_PER_SUPERFRAME:] = np.sqrt(0.5)
    np.testing.assert_allclose(GainSmoothing(gains).levels(), [0.0, 2.0], atol=1e-12)
    assert GainSmoothing(gains).parts().shape == (2, FRAMES_PER_SUPERFRAME)


class Heard:
    """A stretch whose mark is heard everywhere, with relief half as much unless that is deaf."""

    def __init__(self, deaf: bool, base: float | None, relief: GainSmoothing | None) -> None:
        rng = np.random.default_rng(3)
        self.clean = 0.05 * rng.standard_normal((4 * SUPERFRAME, 1))
        self.relief = relief
        mark = 0.005 * rng.standard_normal(self.clean.shape)
        if relief is not None and not deaf:
            mark *= np.repeat(relief.gains, HOP)[:, np.newaxis]
        self.marked = self.clean + mark


@pytest.mark.parametrize("deaf", [False, True])
def test_relief_is_kept_only_where_it_helps(deaf: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Moments, "gains", lambda _, __, frames: np.full(frames, 0.5))
    assert (LevelControl(-0.42, 1, quiet=True).settle(partial(Heard, deaf)).relief is None) == deaf


@pytest.mark.parametrize(("wanted", "rehearsed"), [(-2.0, True), (-0.42, False)])
def test_relief_is_for_rehearsed_passages_without_grade(
    wanted: float, rehearsed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Moments, "gains", lambda _, __, frames: np.full(frames, 0.5))
    control = LevelControl(wanted, 1, quiet=rehearsed)
    assert control.settle(partial(Heard, False)).relief is None


def test_a_grade_far_too_low_takes_levels_back() -> None:
    """At a small deficit superframes keep their levels; beyond it the grade counts."""
    control = LevelControl(-0.42, 1, quiet=True)
    passage = control._passage
    passage.maturity = 1.0
    passage.last = -0.42 - TOLERATED
    assert 0 < control.overdrawn < 0.6
    passage.last -= 0.1
    assert control.overdrawn > 5
