"""The likeliest places of a superframe's frames in sound that was stretched at its pitch.

In: sound around a superframe; out: where each of its frames lies, and the view of them. Frames lie
`HOP` samples apart within a piece, and anywhere near from piece to piece. What their cells and
pilots say of a place is the log-likelihood ratio of `watermark.audio.follow.interference`; a jump
costs. Specification: spec/audio-carrier.md, W48.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow import _kernels, _path_kernels
from watermark.audio.follow.align import TURNED_BINS, SuperframeView, choose, thresholds_of
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.follow.interference import POINTS
from watermark.audio.follow.place_projections import PlaceProjections
from watermark.audio.search.pilot_scan import ROWS_AT_ONCE
from watermark.audio.signal.layout import Pilots
from watermark.audio.signal.masking import Masker
from watermark.audio.signal.mdct import analyse, sliding_tables
from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, HOP
from watermark.audio.signal.sample_buffer import SampleBuffer, StereoBuffer

GRID = 2
"""Distance in samples of the places at which a frame is looked for at first."""

TURNS = 8
"""Such places to a transform."""

BETWEEN = GRID * np.arange(float(TURNS))
"""Samples from a transform to those."""

REACH = 1200
"""Samples before and after the even pace within which a frame is looked for."""

MASKED = 48
"""Samples for which one mask serves."""

FINE_REACH, FINE = 2, np.arange(0.0, 2.0, 0.5)
"""Samples before and after within which each piece is then moved, and delays within as many."""

BITS = (0.0, 0.5)
"""Shifts of the lattices of both bits, in steps."""

BESIDE = 1
"""Places on either side of the expected one at which a piece counts as going on."""

MARGIN = 2 * HOP + MASKED
"""Samples that are read before and after all that is looked at."""

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Spectra = NDArray[np.complex64]


class Paths:
    """The sound around a superframe, and what its cells and pilots say at each place.

    Parameters
    ----------
    tape : SampleBuffer
        The sound.
    centre : ndarray of float64, shape (64,)
        Where frames begin, about: samples of the tape.
    nominal : float
        Samples of the tape that come for one of the mark's own.
    demodulator : Demodulator
        Of the profile.
    pilots : Pilots
        Of the key.
    masker : Masker
        The mask.

    Attributes
    ----------
    demodulator : Demodulator
        See there.
    """

    def __init__(
        self,
        tape: SampleBuffer,
        centre: Array,
        nominal: float,
        demodulator: Demodulator,
        pilots: Pilots,
        masker: Masker,
    ) -> None:
        self.demodulator, self._masker, self._nominal = demodulator, masker, nominal
        self._begin = np.floor(centre[0]) - (REACH + MARGIN) * nominal
        # Everything below is in samples of the mark, from `_begin`.
        around = np.round((centre - self._begin) / nominal).astype(np.int64)
        count = int(around.max()) + REACH + HOP + MARGIN
        self._sound = tape.read(self._begin, nominal, count).astype(np.float32, copy=False)
        self._side = np.zeros(0, dtype=np.float32)
        if isinstance(tape, StereoBuffer):
            beside = tape.side.read(self._begin, nominal, count)
            self._side = beside.astype(np.float32, copy=False)
        self._paired = bool(self._side.any())
        self._first = around - REACH
        # A coarse grid of places; a place between two rows is the sum of both, turned.
        rows = np.arange(self._first.min(), self._first.max() + 2 * REACH + GRID, GRID * TURNS)
        rows = np.append(rows, rows[-1] + GRID * TURNS)
        self._row = int(rows[0])
        frames = np.lib.stride_tricks.sliding_window_view(self._sound, 2 * HOP)
        cells, slots = demodulator.layout.cells, pilots.cells
        bins = max(cells.last_bin, slots.last_bin)
        spectra = _slide(self._sound[rows[0] :], rows.size, bins)
        units = self._units(frames, rows, bins)
        # Masking thresholds change slowly: one set serves MASKED samples.
        nearest = np.minimum(np.round((rows - rows[0]) / MASKED).astype(np.int64), len(units) - 1)
        apart = float(GRID * TURNS)
        self._cells = PlaceProjections.of(spectra, units, nearest, apart, cells)
        self._slots = PlaceProjections.of(spectra, units, nearest, apart, slots)
        self._pilots = pilots
        self._levels: dict[float, Floats] = {}
        self._tiers: dict[float, Floats] = {}

    def _units(self, frames: Floats, rows: NDArray[np.int64], bins: int) -> Array:
        """Amplitudes of the mark's unit in frames `MASKED` samples apart, from the first row on."""
        spectra = analyse(frames[rows[0] - HOP : rows[-1] + MASKED : MASKED], HOP)
        threshold = thresholds_of(spectra, spectra[:0], self._masker)[0]
        back = HOP // MASKED
        return self._masker.amplitudes(threshold[back:], threshold[:-back])[:, :bins]

    def find(
        self, levels: list[float], *, jump: float, first: float | None = None
    ) -> tuple[float, Array]:
        """Likeliest path at the likeliest of some levels.

        Parameters
        ----------
        levels : list of float
            Of the superframe.
        jump : float
            Natural logarithm of the likelihood ratio that a jump must be worth.
        first : float, optional
            Where the superframe begins unless there is a jump: samples of the tape.

        Returns
        -------
        level : float
            The likeliest.
        places : ndarray of float64, shape (64,)
            Where frames begin, in samples of the sound that was read.
        """
        self._look_at(levels)
        none: Floats = np.zeros((0, 0), dtype=np.float32)
        found = [
            self._follow(self._levels[level], self._pilots_at(level), (none, none), jump, first)
            for level in levels
        ]
        best = int(np.argmax([score for score, _ in found]))
        return levels[best], found[best][1]

    def find_known(
        self, level: float, expected: Array, *, jump: float, first: float | None = None
    ) -> Array:
        """Likeliest path of a superframe with known bits, see `find`.

        `expected` are the soft values that they ask for, shape (64, groups), 0 where unknown.
        """
        profile = self.demodulator.profile
        soft = self._cells.look_up(profile.step(level), _cosines(profile.groups), BETWEEN)[0]
        own: Floats = np.zeros(len(soft), dtype=np.float32)
        known = soft, expected.astype(np.float32)
        return self._follow(own, self._pilots_at(level), known, jump, first)[1]

    def _follow(
        self,
        own: Floats,
        pilots: Floats,
        known: tuple[Floats, Floats],
        jump: float,
        first: float | None,
    ) -> tuple[float, Array]:
        """Likeliest path by evidence of cells, of pilots and of known bits; its score, places."""
        offsets = (self._first - self._row) // GRID
        start = np.zeros(2 * REACH // GRID + 1)
        if first is not None:
            at = round(((first - self._begin) / self._nominal - self._first[0]) / GRID)
            begins = np.abs(np.arange(start.size) - at) <= BESIDE
            start[~begins] = -jump
        path = np.empty(FRAMES_PER_SUPERFRAME, dtype=np.int64)
        kinds = (self._pilots.signs[self.demodulator.profile.number] < 0).astype(np.int64)
        score = _path_kernels.follow_frames(
            own, pilots, self._pilots.slots, kinds, *known, offsets, HOP // GRID, jump, start, path
        )
        return score, (self._row + GRID * path).astype(np.float64)

    def view(
        self, places: Array, level: float, expected: Array | None = None
    ) -> tuple[SuperframeView, Array]:
        """View of frames at places, each piece moved to where it fits best; and those places."""
        at = places.astype(np.int64)
        profile, frames = self.demodulator.profile, places.size
        own, earlier = (thresholds_of(*self._both(x), self._masker) for x in (at, at - HOP))
        bands = self._masker.units(own, earlier)
        # Three exact spectra per frame, FINE_REACH apart; delays between them are blended.
        looked_at = (self._chosen(at + far, bands) for far in (-FINE_REACH, 0, FINE_REACH))
        spectra, amplitudes = zip(*looked_at, strict=True)
        units = amplitudes[1]
        cells, step = self.demodulator.layout.cells, profile.step(level)
        found = PlaceProjections.of(
            np.concatenate(spectra),
            units,
            np.tile(np.arange(frames), 3),
            float(FINE_REACH),
            cells,
            step=frames,
        )
        shape = 2, frames, FINE.size
        # Unknown bits: how sharply cells lie on the lattice. Known bits: how well their signs
        # agree.
        if expected is None:
            sums = found.sums([step], self.demodulator.coverage.unknown, FINE)
            fit = sums.reshape(shape).astype(np.float64)
        else:
            soft = found.look_up(step, _cosines(profile.groups), FINE).reshape(*shape, -1)
            fit = np.einsum("ptdg,tg->ptd", soft, expected)
        places, delays = places.copy(), np.concatenate([FINE - FINE_REACH, FINE])
        # A piece is a run of frames one hop apart: time stretching moves it as a whole.
        cuts = np.flatnonzero(np.diff(places) != HOP) + 1
        for piece in np.split(np.arange(frames), cuts):
            places[piece] += delays[fit[:, piece].sum(axis=1).argmax()]
        # Read at whole samples; the fraction is a linear phase.
        whole = np.floor(places)
        best, _ = self._chosen(whole.astype(np.int64), bands)
        _kernels.turn_bins(best, places - whole, np.pi / HOP, TURNED_BINS)
        return SuperframeView(best, units, self._paired), places

    def on_tape(self, places: Array) -> Array:
        """Places as samples of the tape."""
        return np.asarray(self._begin + places * self._nominal)

    def _chosen(self, at: NDArray[np.int64], units: Array) -> tuple[Spectra, NDArray[np.float32]]:
        """Spectra of frames and amplitudes of the mark's unit, see `align.choose`."""
        mid, side = self._both(at)
        bins = self.demodulator.places.bins
        return choose(mid, side, units, self._masker, bins if self._paired else np.zeros_like(bins))

    def _both(self, at: NDArray[np.int64]) -> tuple[Spectra, Spectra]:
        """Spectra of frames of the mid and, unless it is silent, of the side."""
        mid = self._spectra(self._sound, at)
        return mid, self._spectra(self._side, at) if self._paired else mid[:0]

    @staticmethod
    def _spectra(sound: Floats, at: NDArray[np.int64]) -> Spectra:
        frames = np.lib.stride_tricks.sliding_window_view(sound, 2 * HOP)
        return np.asarray(analyse(frames[at], HOP))

    def _look_at(self, levels: list[float]) -> None:
        """Note the evidence of cells with unknown bits at each place, at levels that are new."""
        new = [level for level in levels if level not in self._levels]
        if new:
            steps = [self.demodulator.profile.step(level) for level in new]
            sums = self._cells.sums(steps, self.demodulator.coverage.unknown, BETWEEN)
            self._levels.update(zip(new, sums, strict=True))

    def _pilots_at(self, level: float) -> Floats:
        """Evidence of pilots of either bit at each place, shape (2, n, PILOT_SLOTS)."""
        step = self.demodulator.profile.pilot_step(int(np.clip(np.floor(level), 0, None)))
        if step not in self._tiers:
            known = self.demodulator.coverage.known
            self._tiers[step] = self._slots.look_up(step, known, BETWEEN, shifts=BITS)
        return self._tiers[step]


def _slide(sound: Floats, count: int, bins: int) -> Spectra:
    """Spectra of frames `GRID` times `TURNS` samples apart."""
    spectra = np.empty((count, bins), dtype=np.complex64)
    _path_kernels.slide_frames(sound, *_waves(bins), GRID * TURNS, ROWS_AT_ONCE, spectra)
    return spectra


@lru_cache(maxsize=4)
def _waves(bins: int) -> tuple[Floats, Floats]:
    return sliding_tables(HOP, bins, GRID * TURNS)


def _cosines(groups: int) -> Array:
    """Soft values by errors, for `PlaceProjections.look_up`."""
    return np.tile(np.cos(2 * np.pi * np.arange(POINTS) / POINTS), (groups, 1))
