"""Borders of superframes from single frames: noise has none, late ones are found."""

from fractions import Fraction

import numpy as np
import pytest

from tests.watermark.pictures import HEIGHT, WIDTH, mark, picture, receive, source
from watermark.video.borders import BorderClock
from watermark.video.embed import VideoEmbedder
from watermark.video.modes import PilotWatch
from watermark.video.profile import PILOTS
from watermark.video.receive import VideoReceiver
from watermark.video.timing import Timing

WATCH, TIMING = PilotWatch(), Timing(Fraction(24000, 1001))


def frames(count: int, late: float, noise: float) -> np.ndarray:
    """Amplitudes of pilots in frames of alternating superframes, `late` frames late."""
    layout, step = WATCH.modes[0].layout, WATCH.modes[0].pilot_step
    times = (np.arange(count) + 0.5 - late) / TIMING.span
    away = 0.5 * np.arcsin(np.sin(np.pi * times)) / (np.pi / 2)  # a triangle: distance from borders
    odd = np.clip(0.5 - 8 * away / 2, 0, 1)
    even, inverted = (layout.dither[WATCH.positions] + (layout.pilot_bits ^ p) / 2 for p in (0, 1))
    clean = step * (np.outer(1 - odd, even) + np.outer(odd, inverted))
    return clean + np.random.default_rng(count).normal(0, noise, clean.shape)


def test_late_borders_are_found() -> None:
    for late in (-2.6, 0.3, 1.7):
        clock = BorderClock(TIMING, WATCH)
        clock.add(0, frames(60, late, 0.9), np.zeros(PILOTS))
        # A quarter of a frame is 10 ms; the windows are looked for at `position`.
        assert abs(clock.correction(0.0, trust=0.0) - late) < 0.3
        assert abs(clock.correction(2 * TIMING.span, trust=0.0) - late) < 0.3
        # A position that is trusted gives way by parts.
        assert abs(clock.correction(0.0)) < 0.95 * abs(clock.correction(0.0, trust=0.0))
        clock.clear()
        assert clock.correction(0.0) == 0.0


def test_copies_date_nothing() -> None:
    fresh = frames(60, 0.0, 0.9)
    # A coder shows two thirds of the cells again for up to three frames.
    shown = np.where(np.arange(PILOTS) % 3, fresh[np.arange(60) // 4 * 4], fresh)
    clock = BorderClock(TIMING, WATCH)
    clock.add(0, shown, np.zeros(PILOTS))
    assert abs(clock.correction(0.0, trust=0.0)) < 0.5


def test_noise_moves_nothing() -> None:
    moved = 0
    for seed in range(20):
        clock = BorderClock(TIMING, WATCH)
        values = np.random.default_rng(seed).normal(0, 5, (60, PILOTS))
        clock.add(0, values, np.zeros(PILOTS))
        moved += clock.correction(0.0) != 0.0
    assert moved <= 2


def test_borders_move_no_window_to_where_its_pilots_do_not_agree(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(BorderClock, "correction", lambda *_, **__: -3.0)
    marked = mark([picture(n) for n in range(48)], VideoEmbedder(WIDTH, HEIGHT, 25, source()))
    found = receive(marked, VideoReceiver(WIDTH, HEIGHT, 25))
    # Three frames are .12 s; windows of this picture agree less from one and a half on.
    assert found[0].position_s == pytest.approx(0, abs=0.08)
    assert found[0].l1 is not None
