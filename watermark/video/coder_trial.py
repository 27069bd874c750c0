"""A trial of the mark on a coder: how much information each strength leaves in the picture.

In: the decoded window of a superframe, whose values had random strengths or the chosen one; out:
bits per value.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from watermark.video.coder_windows import CoderWindow
from watermark.video.demodulate import soft_bits
from watermark.video.design import Design, Way
from watermark.video.lattices import densities, lattice_shares
from watermark.video.modes import Mode
from watermark.video.noise import NOISES, noise_shares, surroundings
from watermark.video.profile import TEMPLATES, TEXTURE

SHARES = ((0.3, 0.5, 0.6, 0.7, 0.85, 1.0), (0.3, 0.6, 0.8, 1.0), (0.3, 0.6, 0.8, 1.0))
"""Parts of the way to the lattice point that are tried with each step, the first one for textured
cells alone."""

TRIED = tuple((rung, share) for rung, shares in enumerate(SHARES) for share in shares)
"""Steps and parts of the way that the values of a trial have."""

ODDS = tuple((0.6, 0.25, 0.15)[rung] / len(SHARES[rung]) for rung, _ in TRIED)
"""Part of the values that each of them has: few are strong, for they cost the coder bits."""

TRIED_NUMBERS = range(len(TRIED))

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class TrialFinding:
    """Information that a coder left of a superframe at each strength.

    Attributes
    ----------
    parts : ndarray of float64, shape (2,)
        Part of the values in cells with the fine and with the coarse step.
    information : ndarray of float64, shape (2, 2, len(TRIED))
        Bits per value of L0 and of L1 for both kinds of cells. Of L0 receivers have nothing but
        the pilots to tell its noise: it is promised what one noise for all such cells leaves.
    """

    parts: FloatArray
    information: FloatArray

    def at(self, rung: int, way: Way) -> tuple[float, float]:
        """Mean bits per value of L0 and L1 with a step and a way, maybe between those tried."""
        shares = SHARES[rung]
        first = TRIED.index((rung, shares[0]))
        tried = slice(first, first + len(shares))
        one, other = (
            float(
                self.parts[0] * np.interp(way.fine, shares, fine)
                + self.parts[1] * np.interp(way.coarse, shares, coarse)
            )
            for fine, coarse in self.information[..., tried]
        )
        return one, other


def find_left(
    window: CoderWindow, design: Design, choice: IntArray, modes: Sequence[Mode]
) -> TrialFinding:
    """Measure the information at each strength where every value had one of `TRIED`.

    Parameters
    ----------
    window : CoderWindow
    design : Design
        Of the superframe.
    choice : ndarray of int64, shape (POSITIONS,)
        Indices of `TRIED`.
    modes : sequence of Mode
        The profile's, one for each step.
    """
    textures = np.tile(window.texture, TEMPLATES)
    share = lattice_shares(textures, [TEXTURE])
    textured = np.tile(design.textured.reshape(-1), TEMPLATES)
    bits, layout = design.bits(modes[0]), modes[0].layout
    data = np.ones(choice.size, dtype=bool)
    data[layout.pilots] = False
    groups = [
        [np.flatnonzero(data & (choice == index) & (textured == kind)) for index in TRIED_NUMBERS]
        for kind in (False, True)
    ]
    counts = np.array([[group.size for group in kind] for kind in groups], dtype=np.float64)
    # Apart for smooth (0) and textured (1) cells, from the reading that shows most.
    tables = []
    for mean, variance in window.readings():
        table, where = np.zeros((2, 2, len(TRIED))), surroundings(textures, variance)
        for kind, index in product((0, 1), TRIED_NUMBERS):
            mine, step = groups[kind][index], modes[TRIED[index][0]].step
            if mine.size:
                place = mean[mine] / step - layout.dither[mine]
                table[:, kind, index] = [
                    _information(place, told, bits[mine], share[:, mine])
                    for told in (np.zeros(mine.size, dtype=np.int64), where[mine])
                ]
        tables.append(table)
    found = max(tables, key=lambda table: float(np.sum(table * counts)))
    parts = np.array([1 - textured.mean(), textured.mean()])
    return TrialFinding(parts, np.stack([_smooth(each, counts) for each in found]))


def measure_left(window: CoderWindow, design: Design, mode: Mode) -> tuple[float, float]:
    """Measure the information in a mark as receivers read it: bits per value of L0 and of L1.

    Parameters
    ----------
    window : CoderWindow
    design : Design
        Of the superframe.
    mode : Mode
        That it was marked in; where it has no L1, that of L0 is given twice.
    """
    coded, size = design.bits(mode)[mode.layout.data], mode.profile.l0_coded
    readings = []
    for mean, variance in window.readings():
        # Receivers know L0 when they read L1.
        alone, helped = (
            soft_bits(mean, variance, mode, window.texture, design.place & 1, first=first).ratios
            for first in (None, coded[:size])
        )
        ratios = np.concatenate([alone[:size], helped[size:]])
        readings.append(1 - np.logaddexp(0, -ratios * (1 - 2 * coded)) / np.log(2))
    best = max(readings, key=lambda each: float(each.sum()))
    rest = best[size:] if mode.profile.l1_coded else best
    return float(best[:size].mean()), float(rest.mean())


def _information(place: FloatArray, where: IntArray, known: IntArray, share: FloatArray) -> float:
    """Bits per value of values whose bits are known, by the receiver's own rules."""
    right, wrong = (densities(place, bit, share, NOISES) for bit in (known, 1 - known))
    likely = noise_shares(np.log(right), where, where, themselves=True)
    ratio = np.log(np.sum(likely * right, axis=0) / np.sum(likely * wrong, axis=0))
    return float(np.mean(1 - np.logaddexp(0, -ratio) / np.log(2)))


def _smooth(table: FloatArray, counts: FloatArray) -> FloatArray:
    """Let no value fall as the part of the way grows, in the order of `TRIED`."""
    out = np.zeros_like(table)
    first = 0
    for shares in SHARES:
        group = slice(first, first + len(shares))
        for kind in (0, 1):
            weights = counts[kind, group] + 1e-3
            out[kind, group] = isotonic_regression(table[kind, group], weights=weights).x
        first += len(shares)
    return out
