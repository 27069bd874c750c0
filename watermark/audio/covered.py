"""Which cells of a superframe another sound covers, as far as the superframe itself tells.

In: a superframe's cells at a level, its pilots and what the decoder believes; out: weights that
turn soft values into log-likelihood ratios. A voice over the programme covers some cells wholly and
leaves others untouched, in patches of time and frequency. Untouched cells keep off the zones
between the lattice's points, whatever their bits; known pilots tell more, and so do the bits that
the decoder has come to believe. Each tells of its neighbourhood; nothing is learnt from one
superframe to the next. Source: decoding and estimation in turns as in Berrou and Glavieux, IEEE
Trans. Com. 44(10), 1996. Specification: section 7.3.
"""

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from watermark.audio.align import View
from watermark.audio.layout import Layout, Pilots
from watermark.audio.profile import Profile

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
"""Share of pilots in a window, and believed bits in it, at which half of what they tell counts."""

ALONE = np.array([4.98, 9.35, 6.25, 1.35, 0.33])
"""Logarithm of the weight for each clue of one (cells in three windows, pilots), and of no clue:
logistic regression on five clips, each under two voices and under itself backwards at -6 dB. What
was found on four of them reads as many superframes of the fifth."""

WITH_BITS = np.array([4.55, 2.21, 4.49, 0.97, 0.53, 1.58, -0.5])
"""The same with the two clues of believed bits, found on superframes near the limit."""

LIMITS = (-4.0, 3.0)
"""Logarithms of weights stay within."""

ENOUGH = 2.0
"""Weight above which a cell promises no more."""

TRUNCATED = 3.0
"""Deviations at which windows end."""

Array = NDArray[np.float64]


class Coverage:
    """Tells what covers the cells of a profile's superframes."""

    def __init__(self, profile: Profile, layout: Layout, pilots: Pilots) -> None:
        self._profile, self._layout, self._pilots = profile, layout, pilots
        self._expected = pilots.expected(profile.number)
        alphas = np.linspace(*profile.alphas, profile.groups)
        self._unknown = _evidence(alphas, 2)
        self._known = _evidence(np.full(pilots.cells.dither.size, np.mean(profile.alphas)), 1)
        first = layout.cells.first_bin + layout.cells.bins * np.arange(profile.groups)
        slot = (first - pilots.cells.first_bin) // pilots.cells.bins
        self._slot = np.clip(slot, 0, pilots.cells.dither.size - 1)
        self._inside = slot == self._slot

    def clues(self, view: View, level: float, pilot_step: float) -> Array:
        """Give the mean evidence around each cell that it is untouched, shape (4, 64, groups).

        Natural logarithms of likelihood ratios: of cells, whose bits are not known, in three
        windows; of pilots, which are.
        """
        errors, alive = view.errors(self._layout.cells, self._profile.step(level))
        own = np.where(alive, _look_up(self._unknown, errors), 0.0)
        clues = [_mean_around(own, window) for window in CELLS]
        errors, alive = view.errors(self._pilots.cells, pilot_step)
        errors = errors - (1 - self._expected) / 4
        seen = alive & (self._expected != 0)
        told = np.where(seen, _look_up(self._known, errors), 0.0)
        told, share = (
            _mean_around((values * 1.0)[:, self._slot] * self._inside, PILOTS)
            for values in (told, seen)
        )
        clues.append(told / (share + FEW_PILOTS))
        return np.stack(clues)

    def promise(self, clues: Array) -> float:
        """Tell how much cells seem to say at a level.

        Under a voice the true one of twelve is among the two largest nine times of ten.
        """
        return float((np.minimum(self.alone(clues), ENOUGH) ** 2).sum())

    def alone(self, clues: Array) -> Array:
        """Weights where nothing is known of the bits, shape (64, groups)."""
        return _weights(ALONE, clues)

    def with_bits(self, clues: Array, soft: Array, believed: Array) -> Array:
        """Weights where something is believed of the bits.

        Parameters
        ----------
        clues : ndarray of float64, shape (4, 64, groups)
            See `clues`.
        soft : ndarray of float64, shape (64, groups)
            Soft values of the cells.
        believed : ndarray of float64, shape (64, groups)
            What other cells let expect of them, -1 to 1; 0 where there is no bit.
        """
        trust = np.where(soft != 0, believed**2, 0.0)
        agreement = []
        for window in BITS:
            few = FEW_BITS / (2 * np.pi * window[0] * window[1])
            agreed, weight = (_mean_beside(x, window) for x in (soft * believed, trust))
            agreement.append(agreed / (weight + few))
        return _weights(WITH_BITS, np.concatenate([clues, agreement]))


def _weights(factors: Array, clues: Array) -> Array:
    return np.asarray(np.exp(np.clip(np.tensordot(factors[:-1], clues, 1) + factors[-1], *LIMITS)))


def _evidence(alphas: Array, first: int) -> Array:
    """Log-likelihood ratio of untouched against covered by the error on one step.

    An embedder leaves an even spread of errors, to which some noise comes. With the harmonics from
    `first` on and their multiples: 2 where the bit is not known. Shape (alphas, POINTS).
    """
    k = np.arange(first, HARMONICS + 1, first)
    left = (1 - alphas)[:, np.newaxis]
    terms = 2 * np.sinc(left * k) * np.exp(-2 * (np.pi * k * UNTOUCHED) ** 2)
    density = 1 + terms @ np.cos(2 * np.pi * np.outer(k, np.arange(POINTS) / POINTS))
    return np.asarray(np.log((1 - STRAY) * np.maximum(density, 0.0) + STRAY))


def _look_up(table: Array, errors: Array) -> Array:
    at = np.round(errors * POINTS).astype(np.int64) % POINTS
    return np.asarray(table[np.arange(len(table)), at])


def _mean_around(values: Array, window: tuple[float, float]) -> Array:
    mean = scipy.ndimage.gaussian_filter(values, window, mode="nearest", truncate=TRUNCATED)
    return np.asarray(mean)


def _mean_beside(values: Array, window: tuple[float, float]) -> Array:
    """Mean around each cell but of the cell itself."""
    own = 1.0
    for deviation in window:
        reach = int(TRUNCATED * deviation + 0.5)
        own /= np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2).sum()
    mean = scipy.ndimage.gaussian_filter(values, window, mode="constant", truncate=TRUNCATED)
    return np.asarray(mean - own * values)
