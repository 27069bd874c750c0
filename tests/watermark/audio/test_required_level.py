"""Levels by need, and the significance of what a decoder finds."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from codec.errors import CueError
from tests.watermark.cells import project
from watermark.audio.embed.design import MarkDesigner
from watermark.audio.embed.level_control import LevelControl
from watermark.audio.signal._kernels import change_cells
from watermark.audio.signal.dither import mark_change
from watermark.audio.signal.layout import make_layout
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.mdct import analyse, frames_of
from watermark.audio.signal.profile import (
    DISCREET,
    HOP,
    PROFILES,
    ROBUST,
    STANDARD,
    SUPERFRAME,
    AudioProfile,
)
from watermark.audio.signal.required_level import coder_noise
from watermark.link.link import SIGNIFICANCE, Link


def noise(power: float, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, power, SUPERFRAME + HOP)


def need(mid: np.ndarray, side: np.ndarray) -> float:
    """Level that a superframe after stillness needs."""
    designer = MarkDesigner(ROBUST, 0)
    still = np.zeros(HOP)
    spectra = designer.spectra_of(np.append(still, mid), np.append(still, side))
    return designer.need(spectra)


def test_a_dense_passage_needs_more_than_a_tone() -> None:
    quiet = np.zeros(SUPERFRAME + HOP)
    tone = 0.2 * np.sin(0.05 * np.arange(SUPERFRAME + HOP)) + noise(1e-4)
    assert need(noise(0.2), quiet) > need(tone, quiet) + 2


def test_a_wide_side_takes_bits_from_the_mid() -> None:
    mid = noise(0.1)
    assert need(mid, noise(0.1, 1)) > need(mid, np.zeros(mid.size)) + 0.5


def test_more_bits_leave_less_noise() -> None:
    spectra = analyse(frames_of(np.concatenate([np.zeros(HOP), noise(0.1)]), HOP), HOP)[1:]
    few, many = (
        coder_noise([np.abs(spectra) ** 2 / 2], make_masker(), bits).mean()
        for bits in (300.0, 600.0)
    )
    # One bit and two on each of 300 bins: ratios of 3 and 15, 7 dB apart.
    assert 6 < 10 * np.log10(few / many) < 9


def test_cells_are_changed_as_the_projection_asks() -> None:
    rng = np.random.default_rng(3)
    cells = make_layout(STANDARD, 0).cells
    x = rng.normal(size=(4, cells.last_bin)).astype(np.float32)
    unit = rng.uniform(0.5, 2.0, x.shape).astype(np.float32)
    unit[2, cells.first_bin] = 0.0  # its cell is silent
    wanted = rng.choice([-1.0, 0.0, 1.0], (4, cells.dither.size)).astype(np.float32)
    whole = np.ones(cells.dither.size, dtype=np.float32)
    change, living = mark_change(x, unit, cells, wanted, step=0.7, alpha=whole)
    assert living == 1 - 1 / wanted.size
    projected, alive = project(x + change, unit, cells)
    error = projected / 0.7 - cells.dither - (1 - wanted) / 4
    right = alive & (wanted != 0)
    assert np.abs(error - np.round(error))[right].max() < 1e-5
    assert not project(change, np.where(unit > 0, unit, 1), cells)[0][~right].any()
    plain = getattr(change_cells, "py_func", change_cells)
    again = np.zeros_like(change)
    plain(x, unit, cells.signs, cells.first_bin, cells.dither, wanted, 0.7, whole, again)
    np.testing.assert_allclose(again, change, atol=1e-6)


@pytest.mark.parametrize("profile", [ROBUST, STANDARD, DISCREET])
def test_noise_that_passes_the_check_is_refused(
    profile: AudioProfile, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = Link(profile)
    llr = np.random.default_rng(0).normal(size=profile.data_cells)
    first = type(link._first)
    monkeypatch.setattr(first, "_passes", lambda self, messages: messages[:, 0] >= 0)
    assert link.decode(llr).l0 is None
    payload = bytes(profile.l0_bytes), bytes(profile.l1_bytes)
    sent = 1.0 - 2.0 * link.encode(*payload)
    assert link.decode(llr + sent).l0 == payload[0]
    assert 0.9 < SIGNIFICANCE < 1


def test_paths_in_noise_are_seldom_significant() -> None:
    first = Link(ROBUST)._first
    code, rng = first.code, np.random.default_rng(0)
    seen: list[float] = []

    def note(message: NDArray[np.int64]) -> bool:
        largest = np.sqrt(2 * np.log(2) * code.message * (llr @ llr))
        seen.append(float(llr @ (1.0 - 2.0 * code.encode(message)) / largest))
        return False

    for _ in range(60):
        llr = rng.normal(size=code.length) * np.exp(rng.normal(size=code.length))
        assert code.decode(llr, accept=note, list_size=64) is None
    assert len(seen) == 60 * 64
    assert np.mean(np.array(seen) >= SIGNIFICANCE) < 1e-3  # 2 of 44 000 in a longer run


@pytest.mark.parametrize("profile", PROFILES.values(), ids=PROFILES)
def test_every_level_has_one_tier(profile: AudioProfile) -> None:
    of_tiers = [level for tier in range(4) for level in profile.levels_of(tier)]
    assert of_tiers == list(range(12))
    steps = [profile.pilot_step(level) for level in range(12)]
    assert steps == sorted(steps)


def test_cells_that_lie_across_pilots_are_refused() -> None:
    with pytest.raises(CueError, match=r"^cells from bin 3 on lie across pilots"):
        replace(ROBUST, first_bin=3)


def test_the_loop_s_target() -> None:
    with pytest.raises(CueError, match=r"^grade 0\.5 to aim at"):
        LevelControl(0.5, 1)
