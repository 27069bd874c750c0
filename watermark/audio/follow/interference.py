"""Interference mask: the cells of a superframe that another sound covers.

In: a superframe's cells at a level, its pilots and the decoder's beliefs; out: weights that
turn soft values into log-likelihood ratios. A voice over the programme covers some cells wholly and
leaves others untouched, in patches of time and frequency. Untouched cells keep off the zones
between the lattice's points, whatever their bits; known pilots show more, and so do the bits that
the decoder has come to believe. Each informs on its neighbourhood; nothing is learnt from one
superframe to the next. Source: decoding and estimation in turns as in Berrou and Glavieux, IEEE
Trans. Com. 44(10), 1996. Specification: spec/audio-carrier.md, W38.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow import _clue_kernels
from watermark.audio.follow.align import SuperframeView
from watermark.audio.follow.smoothing import smooth, weighted_sum, weights_around
from watermark.audio.signal.layout import AudioLayout, Pilots
from watermark.audio.signal.profile import AudioProfile

UNTOUCHED, STRAY = 0.07, 0.03
"""Noise of an untouched cell in steps of the lattice, and share of such cells that lie anywhere."""

POINTS, HARMONICS = 512, 16
"""Points of the tabulated density on one step, and its Fourier terms."""

CELLS = ((2.0, 2.0), (6.0, 2.0), (16.0, 16.0))
"""Deviations in frames and cells of the windows over the cells' own evidence."""

PILOTS = (6.0, 1.0)
"""The same over the evidence of pilots."""

BITS = ((1.5, 1.0), (6.0, 2.0))
"""The same over the agreement with believed bits."""

FEW_PILOTS, FEW_BITS = 0.05, 0.3
"""Share of pilots in a window, and believed bits in it, at which half of their evidence counts."""

ALONE = np.array([8.0, 10.0, 2.0, 2.0, 0.0])
"""Logarithm of the odds that a cell is untouched, for each clue of one (cells in three windows,
pilots) and of no clue: the most superframes read of twelve clips under an announcer and another
voice, by their information, rounded to one digit. Eleven clips teach weights that serve the twelfth
as well, within 1 of 72 superframes (`tests/bench/interference_weights.py`)."""

WITH_BITS = np.array([7.0, 4.0, 4.0, 1.0, 0.6, 4.0, -1.0])
"""The same with the two clues of believed bits."""

LARGEST_ODDS = 6.0
"""Logarithms of odds stay within."""

Array = NDArray[np.float64]


class InterferenceEstimator:
    """Tells what covers the cells of a profile's superframes."""

    def __init__(self, profile: AudioProfile, layout: AudioLayout, pilots: Pilots) -> None:
        self._profile, self._layout, self._pilots = profile, layout, pilots
        self._expected = pilots.expected(profile.number)
        alphas = np.linspace(*profile.alphas, profile.groups)
        self._untouched = _density(alphas, 1)
        self.unknown = np.log(_density(alphas, 2))
        of_pilots = np.full(pilots.cells.dither.size, np.mean(profile.alphas))
        self.known = np.log(_density(of_pilots, 1))
        first = layout.cells.first_bin + layout.cells.bins * np.arange(profile.groups)
        slot = (first - pilots.cells.first_bin) // pilots.cells.bins
        self._slot = np.clip(slot, 0, pilots.cells.dither.size - 1)
        self._inside = slot == self._slot

    def look(self, view: SuperframeView, level: float, pilot_step: float) -> "InterferenceMask":
        """Look at a superframe at a level."""
        errors, alive = view.errors(self._layout.cells, self._profile.step(level))
        own, zero, one = np.empty((3, *errors.shape))
        _clue_kernels.look_up_cells(errors, alive, self.unknown, self._untouched, own, zero, one)
        clues = [_mean_around(own, window) for window in CELLS]
        of_pilots, living = view.errors(self._pilots.cells, pilot_step)
        of_pilots = of_pilots - (1 - self._expected) / 4
        seen = living & (self._expected != 0)
        told = self.of_pilots(of_pilots, seen)
        told, share = (
            _mean_around((values * 1.0)[:, self._slot] * self._inside, PILOTS)
            for values in (told, seen)
        )
        clues.append(told / (share + FEW_PILOTS))
        soft = view.soft(self._layout.cells, self._profile.step(level))
        return InterferenceMask(np.stack(clues), soft, zero, one)

    def of_pilots(self, errors: Array, alive: NDArray[np.bool_]) -> Array:
        """Evidence of pilots, shape (n, PILOT_SLOTS), by their errors from where they should be."""
        return np.where(alive, _look_up(self.known, errors), 0.0)


@dataclass(frozen=True, slots=True)
class InterferenceMask:
    """A superframe at a level, partly covered by another sound.

    Attributes
    ----------
    clues : ndarray of float64, shape (4, 64, groups)
        Mean evidence around each cell that it is untouched, natural logarithms of likelihood
        ratios: of cells, whose bits are not known, in three windows; of pilots, which are.
    soft : ndarray of float64, shape (64, groups)
        Soft values.
    zero, one : ndarray of float64, shape (64, groups)
        Densities of an untouched cell of either bit; that of a covered one is 1.
    """

    clues: Array
    soft: Array
    zero: Array
    one: Array

    @property
    def promise(self) -> float:
        """Number of cells that seem untouched.

        Under a voice the true one of twelve levels is among the two largest nine times of ten.
        """
        return float(_share(ALONE, self.clues).sum())

    def ratios(self, believed: Array | None = None) -> Array:
        """Log-likelihood ratios of the cells, shape (64, groups).

        Parameters
        ----------
        believed : ndarray of float64, shape (64, groups), optional
            What other cells let expect of each, -1 to 1; 0 where there is no bit.
        """
        if believed is None:
            share = _share(ALONE, self.clues)
        else:
            share = _share(WITH_BITS, np.concatenate([self.clues, self._agreement(believed)]))
        return np.asarray(np.log1p(share * (self.zero - 1)) - np.log1p(share * (self.one - 1)))

    def _agreement(self, believed: Array) -> Array:
        """Return how well soft values around each cell agree with the beliefs."""
        trust = np.where(self.soft != 0, believed**2, 0.0)
        agreement = []
        for window in BITS:
            few = FEW_BITS / (2 * np.pi * window[0] * window[1])
            agreed, weight = (_mean_beside(x, window) for x in (self.soft * believed, trust))
            agreement.append(agreed / (weight + few))
        return np.stack(agreement)


def _share(factors: Array, clues: Array) -> Array:
    """Probability that cells are untouched."""
    odds = factors[-1] + weighted_sum(factors, clues)
    return np.asarray(1 / (1 + np.exp(-np.clip(odds, -LARGEST_ODDS, LARGEST_ODDS))))


def _density(alphas: Array, first: int) -> Array:
    """Density of an untouched cell's error on one step, that of a covered one being 1.

    An embedder leaves an even spread of errors, to which some noise comes. With the harmonics from
    `first` on and their multiples: 2 where the bit is not known. Shape (alphas, POINTS).
    """
    k = np.arange(first, HARMONICS + 1, first)
    left = (1 - alphas)[:, np.newaxis]
    terms = 2 * np.sinc(left * k) * np.exp(-2 * (np.pi * k * UNTOUCHED) ** 2)
    density = 1 + terms @ np.cos(2 * np.pi * np.outer(k, np.arange(POINTS) / POINTS))
    return np.asarray((1 - STRAY) * np.maximum(density, 0.0) + STRAY)


def _look_up(table: Array, errors: Array) -> Array:
    at = np.round(errors * POINTS).astype(np.int64) % POINTS
    return np.asarray(table[np.arange(len(table)), at])


def _mean_around(values: Array, window: tuple[float, float]) -> Array:
    return smooth(values, window, around=True)


def _mean_beside(values: Array, window: tuple[float, float]) -> Array:
    """Mean around each cell but of the cell itself."""
    own = np.prod([weights_around(1, deviation)[0, 0] for deviation in window])
    return np.asarray(smooth(values, window) - own * values)
