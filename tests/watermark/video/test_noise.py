"""Noise that the surroundings of a value tell: calibrated, and never much worse than one for all.

Values are drawn here, on lattice points plus noise whose amount the test chooses; the receiver
reads them.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from tests.watermark.pictures import HEIGHT, WIDTH, mark, picture, receive, source
from watermark.video import track
from watermark.video.demodulate import Soft, soft_bits
from watermark.video.embed import VideoEmbedder
from watermark.video.lattices import densities
from watermark.video.modes import make_modes
from watermark.video.noise import NOISES, noise_shares, surroundings
from watermark.video.profile import COLUMNS, POSITIONS, ROWS, find_profile
from watermark.video.receive import VideoReceiver

MODE = make_modes(find_profile("standard"), 0, 1.0)[0]
FIRST = MODE.profile.l0_coded
CELLS = ROWS * COLUMNS


@dataclass(frozen=True)
class Window:
    """A window with known noise.

    Attributes
    ----------
    mean, variance, texture : ndarray
        As a receiver has them.
    bits : ndarray
        Of every value.
    sigma : ndarray
        Noise of every value in steps.
    """

    mean: np.ndarray
    variance: np.ndarray
    texture: np.ndarray
    bits: np.ndarray
    sigma: np.ndarray

    def read(self, *, known: bool = False) -> np.ndarray:
        """Ratios of the data, L0 known or not."""
        first = self.bits[MODE.layout.data[:FIRST]] if known else None
        return soft_bits(self.mean, self.variance, MODE, self.texture, first=first).ratios

    def information(self, ratios: np.ndarray, part: slice = slice(None)) -> float:
        """Bits per value that ratios give."""
        sign = 1 - 2 * self.bits[MODE.layout.data]
        return float(np.mean((1 - np.logaddexp(0, -ratios * sign) / np.log(2))[part]))

    def ideal(self) -> np.ndarray:
        """Ratios of a receiver that is told each value's noise."""
        data, step = MODE.layout.data, MODE.step
        place = self.mean[data] / step - MODE.layout.dither[data]
        shares = np.array([np.ones(data.size), np.zeros(data.size)])
        one, other = (
            np.concatenate(
                [
                    densities(place[n : n + 1], bit, shares[:, n : n + 1], (sigma,))[0]
                    for n, sigma in enumerate(self.sigma[data])
                ]
            )
            for bit in (0, 1)
        )
        return np.asarray(np.log(one / other))


def window(seed: int, *, still: float, moving: float, part: float = 0.5) -> Window:
    """Make a flat picture's window in which a part moves; noise of both kinds in steps."""
    rng = np.random.default_rng(seed)
    moves = rng.uniform(size=POSITIONS) < part
    sigma = np.where(moves, moving, still)
    bits = rng.integers(0, 2, POSITIONS)
    bits[MODE.layout.pilots] = MODE.layout.pilot_bits
    width = np.full(POSITIONS, MODE.step)
    width[MODE.layout.pilots] = MODE.pilot_step
    points = width * (MODE.layout.dither + bits / 2 + rng.integers(-3, 3, POSITIONS))
    variance = np.where(moves, 20.0, 0.01) * rng.chisquare(8, POSITIONS) / 8
    mean = points + MODE.step * sigma * rng.normal(size=POSITIONS)
    return Window(mean, variance, np.full(CELLS, 0.2), bits, sigma)


@pytest.mark.parametrize("seed", range(3))
def test_moving_values_have_their_own_noise(seed: int) -> None:
    """Nearly all that a receiver would read who is told each value's noise."""
    window_ = window(seed, still=0.12, moving=0.8)
    ideal = window_.information(window_.ideal())
    assert window_.information(window_.read()) > 0.97 * ideal
    alike = replace(window_, variance=np.ones(POSITIONS))
    assert window_.information(alike.read()) < 0.9 * ideal  # one noise for all


@pytest.mark.parametrize("sigma", [0.08, 0.12, 0.16, 0.2, 0.25, 0.3])
@pytest.mark.parametrize("seed", range(6))
def test_it_costs_little_where_all_noise_is_alike(seed: int, sigma: float) -> None:
    """Adapting to surroundings that say nothing, against one noise for all."""
    window_ = window(seed, still=sigma, moving=sigma)
    alike = replace(window_, variance=np.ones(POSITIONS))
    for known in (False, True):
        plain = alike.information(alike.read(known=known))
        assert window_.information(window_.read(known=known)) > plain - 0.01


@pytest.mark.parametrize("seed", range(3))
def test_few_values_of_a_kind_are_told_by_those_of_l0(seed: int) -> None:
    """Of 3 % that stand still some ten are pilots; eighty are of L0."""
    window_ = window(seed, still=0.1, moving=0.6, part=0.97)
    rest = slice(FIRST, None)
    alone, helped = (window_.information(window_.read(known=k), rest) for k in (False, True))
    assert helped > 1.25 * alone  # measured 1.42, 1.79, 2.15
    assert helped > 0.9 * window_.information(window_.ideal(), rest)


def test_none_speaks_for_itself() -> None:
    """A value that no noise but its own would explain is not believed for that."""
    where = surroundings(np.full(30, 0.2), np.zeros(30))
    scores = np.zeros((len(NOISES), 30))
    scores[0, 1:], scores[-1, 0] = 1.0, 100.0
    told = noise_shares(scores, where, where, themselves=True)
    assert told[:, 0].argmax() == 0
    assert noise_shares(scores, where, where)[:, 0].argmax() == len(NOISES) - 1


def test_an_odd_one_among_many_is_told_by_the_others() -> None:
    where = surroundings(np.full(300, 0.2), np.zeros(300))
    scores = np.zeros((len(NOISES), 300))
    scores[0, 1:], scores[0, 0] = 0.1, -50.0
    told = noise_shares(scores, where, where, themselves=True)[:, :1]
    others = noise_shares(scores[:, 1:], where[1:], where[:1])
    np.testing.assert_allclose(told, others, atol=0.03)
    assert 0.8 < told[0, 0] < 0.95


def test_extreme_surroundings_are_numbered() -> None:
    texture, variance = np.array([0.0, 1e6]), np.array([1e12, 0.0])
    shares = noise_shares(np.zeros((len(NOISES), 1)), surroundings(texture, variance)[:1],
                          surroundings(texture, variance))  # fmt: skip
    np.testing.assert_allclose(shares, 1 / len(NOISES))


def test_l1_is_read_with_the_help_of_l0(monkeypatch: pytest.MonkeyPatch) -> None:
    """A receiver reads L1 again with L0 known, where the pilots alone did not do."""

    def poor(*args: Any, first: np.ndarray | None = None) -> Soft:
        soft = soft_bits(*args, first=first)
        if first is None:
            soft.ratios[FIRST:] = 0.0
        return soft

    monkeypatch.setattr(track, "soft_bits", poor)
    give = source()
    marked = mark([picture(n) for n in range(48)], VideoEmbedder(WIDTH, HEIGHT, 25, give))
    found = receive(marked, VideoReceiver(WIDTH, HEIGHT, 25))
    assert [(s.l0, s.l1) for s in found] == [give(k) for k in range(3)]
