"""The likeliest places of a superframe's frames in sound that was stretched at its pitch.

In: sound around a superframe; out: where each of its frames lies, and the view of them. Frames lie
`HOP` samples apart within a piece, and anywhere near from piece to piece. What their cells and
pilots say of a place is the log-likelihood ratio of `watermark.audio.follow.interference`; a jump
costs. Specification: spec/audio-carrier.md, W48.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow.align import SuperframeView
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.signal.dither import project
from watermark.audio.signal.layout import Pilots
from watermark.audio.signal.masking import Masker
from watermark.audio.signal.mdct import analyse
from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, HOP
from watermark.audio.signal.sample_buffer import SampleBuffer, StereoBuffer
from watermark.audio.signal.stereo import channels_of

GRID = 2
"""Distance in samples of the places at which a frame is looked for at first."""

REACH = 1200
"""Samples before and after the even pace within which a frame is looked for."""

MASKED = 48
"""Samples for which one mask serves."""

FINE = np.arange(-2.0, 2.1, 0.5)
"""Samples by which each piece is then moved."""

BESIDE = 1
"""Places on either side of the expected one at which a piece counts as going on."""

MARGIN = 2 * HOP + MASKED
"""Samples that are read before and after all that is looked at."""

Array = NDArray[np.float64]


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
    """

    def __init__(
        self, tape: SampleBuffer, centre: Array, nominal: float, demodulator: Demodulator,
        pilots: Pilots, masker: Masker,
    ) -> None:  # fmt: skip
        self._demodulator, self._masker, self._nominal = demodulator, masker, nominal
        self._begin = np.floor(centre[0]) - (REACH + MARGIN) * nominal
        around = np.round((centre - self._begin) / nominal).astype(np.int64)
        count = int(around.max()) + REACH + HOP + MARGIN
        self._sound = tape.read(self._begin, nominal, count)
        self._side = np.zeros(0)
        if isinstance(tape, StereoBuffer):
            self._side = tape.side.read(self._begin, nominal, count)
        self._first = around - REACH
        frames = np.lib.stride_tricks.sliding_window_view(self._sound, 2 * HOP)
        rows = np.arange(self._first.min(), self._first.max() + 2 * REACH + GRID, GRID)
        self._rows = rows
        cells = demodulator.layout.cells, pilots.cells
        bins = max(cell.last_bin for cell in cells)
        spectra = analyse(frames[rows].astype(np.float32), HOP, bins).real.astype(np.float64)
        unit = self._units(frames, rows, bins)
        self._cells, self._alive = project(spectra, unit, cells[0])
        self._slots, self._slots_alive = project(spectra, unit, cells[1])
        self._pilots = pilots

    def _units(self, frames: Array, rows: NDArray[np.int64], bins: int) -> Array:
        """Amplitudes of the mark's unit in frames that begin at `rows`."""
        looked_at = np.arange(rows[0] - HOP, rows[-1] + MASKED, MASKED)
        power = np.abs(analyse(frames[looked_at], HOP)) ** 2 / 2
        threshold = self._masker.thresholds(power)
        back = HOP // MASKED
        amplitudes = self._masker.amplitudes(threshold[back:], threshold[:-back])[:, :bins]
        nearest = np.round((rows - rows[0]) / MASKED).astype(np.int64)
        return np.asarray(amplitudes[np.minimum(nearest, len(amplitudes) - 1)])

    def find(
        self, level: float, *, jump: float, first: float | None = None,
        expected: Array | None = None,
    ) -> tuple[float, Array]:  # fmt: skip
        """Likeliest path at a level.

        Parameters
        ----------
        level : float
            Of the superframe.
        jump : float
            Natural logarithm of the likelihood ratio that a jump must be worth.
        first : float, optional
            Where the superframe begins unless there is a jump: samples of the tape.
        expected : ndarray of float64, shape (64, groups), optional
            Soft values that decoded bits ask for, 0 where unknown.

        Returns
        -------
        score : float
            Log-likelihood ratio of the path, jumps paid.
        places : ndarray of float64, shape (64,)
            Where frames begin, in samples of the sound that was read.
        """
        told = self._told(level, expected)
        offsets = (self._first - self._rows[0]) // GRID
        count = 2 * REACH // GRID + 1
        place = np.arange(count)
        score = told(0, offsets[0])
        if first is not None:
            at = round(((first - self._begin) / self._nominal - self._first[0]) / GRID)
            begins = np.abs(place - at) <= BESIDE
            score = score - np.where(begins, 0.0, jump)
        back = np.empty((FRAMES_PER_SUPERFRAME, count), dtype=np.int64)
        for frame in range(1, FRAMES_PER_SUPERFRAME):
            source = place - (HOP // GRID - (offsets[frame] - offsets[frame - 1]))
            inside = (source >= 0) & (source < count)
            stay = np.where(inside, score[np.clip(source, 0, count - 1)], -np.inf)
            best = int(score.argmax())
            goes_on = stay >= score[best] - jump
            back[frame] = np.where(goes_on, source, best)
            score = np.where(goes_on, stay, score[best] - jump)
            score += told(frame, offsets[frame])
        at = int(score.argmax())
        total, path = float(score[at]), [at]
        for frame in range(FRAMES_PER_SUPERFRAME - 1, 0, -1):
            path.append(int(back[frame, path[-1]]))
        return total, self._rows[offsets + np.array(path[::-1])].astype(np.float64)

    def view(
        self, places: Array, level: float, expected: Array | None = None
    ) -> tuple[SuperframeView, Array]:
        """View of frames at places, each piece moved to where it fits best; and those places."""
        view, places = self._view(places), places.copy()
        frequency = np.pi / HOP * (np.arange(HOP) + 0.5)
        cells, step = self._demodulator.layout.cells, self._demodulator.profile.step(level)
        fits = []
        for delay in FINE:
            moved = view.turned(frequency * delay)
            if expected is None:
                fits.append(self._demodulator.coverage.of_cells(*moved.errors(cells, step)))
            else:
                fits.append(moved.soft(cells, step) * expected)
        fit = np.sum(fits, axis=2)
        cuts = np.flatnonzero(np.diff(places) != HOP) + 1
        for piece in np.split(np.arange(places.size), cuts):
            places[piece] += FINE[fit[:, piece].sum(axis=1).argmax()]
        whole = np.floor(places)
        turn = np.exp(1j * np.outer(places - whole, frequency))
        view = self._view(whole)
        return SuperframeView(view.spectra * turn, view.amplitudes, view.paired), places

    def on_tape(self, places: Array) -> Array:
        """Places as samples of the tape."""
        return np.asarray(self._begin + places * self._nominal)

    def _view(self, places: Array) -> SuperframeView:
        at = places.astype(np.int64)
        own, before = self._spectra(self._sound, at), self._spectra(self._sound, at - HOP)
        if not self._side.any():
            units = self._unit(own, before)
            return SuperframeView(own, units)
        beside = self._spectra(self._side, at), self._spectra(self._side, at - HOP)
        channels, earlier = channels_of(own, beside[0]), channels_of(before, beside[1])
        units = np.stack([self._unit(x, y) for x, y in zip(channels, earlier, strict=True)])
        bins = self._demodulator.places.bins
        return SuperframeView(np.choose(bins, channels), np.choose(bins, units), paired=True)

    @staticmethod
    def _spectra(sound: Array, at: NDArray[np.int64]) -> NDArray[np.complex128]:
        frames = np.lib.stride_tricks.sliding_window_view(sound, 2 * HOP)
        return np.asarray(analyse(frames[at], HOP))

    def _unit(self, own: NDArray[np.complex128], before: NDArray[np.complex128]) -> Array:
        thresholds = (self._masker.thresholds(np.abs(x) ** 2 / 2) for x in (own, before))
        return self._masker.amplitudes(*thresholds)

    def _told(self, level: float, expected: Array | None) -> Callable[[int, int], Array]:
        profile, coverage = self._demodulator.profile, self._demodulator.coverage
        cells, slots = self._demodulator.layout.cells, self._pilots.cells
        errors = self._cells / profile.step(level) - cells.dither
        soft = None
        if expected is None:
            own = coverage.of_cells(errors, self._alive).sum(axis=1)
        else:
            own = np.zeros(len(errors))
            soft = np.where(self._alive, np.cos(2 * np.pi * errors), 0.0)
        tier_step = profile.pilot_step(int(np.clip(np.floor(level), 0, None)))
        errors = self._slots / tier_step - slots.dither
        signs = [coverage.of_pilots(errors - shift, self._slots_alive) for shift in (0.0, 0.5)]
        announced = self._pilots.expected(profile.number)

        def told(frame: int, first: int) -> Array:
            cut = slice(first, first + 2 * REACH // GRID + 1)
            total = own[cut] if soft is None or expected is None else soft[cut] @ expected[frame]
            for sign, values in zip((1, -1), signs, strict=True):
                total = total + values[cut] @ (announced[frame] == sign)
            return np.asarray(total)

        return told
