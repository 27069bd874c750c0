"""A superframe in sound at a hypothesised place: spectra, units of the mark, soft values.

In: sound, a place and a pace; out: what each cell holds there. Specification:
spec/audio-carrier.md, W36.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from watermark.audio.follow import _clue_kernels, _kernels
from watermark.audio.signal.channel_choice import ChannelChoice
from watermark.audio.signal.dither import soft_values
from watermark.audio.signal.layout import Cells
from watermark.audio.signal.masking import Masker
from watermark.audio.signal.mdct import lapping
from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, HOP, PROFILES, SUPERFRAME
from watermark.audio.signal.required_level import band_noise
from watermark.audio.signal.sample_buffer import SampleBuffer, StereoBuffer

CLUES = 3
"""Clues to how far a cell can be trusted: its strength, its frame's, and a coder's noise."""

CLUE_LIMIT = 5.0
"""Largest deviation of a clue from its mean that counts, natural logarithm of power."""

CODER_BITS = 200.0
"""Bits per frame of the coder that is thought to have pressed the sound; 150 to 350 do as well."""

UNTURNED = 1e-4
"""Deviation from the mark's own pace up to which frames are not resampled: over a frame they drift
by a tenth of a sample."""

TURNED_BINS = max(profile.last_bin for profile in PROFILES.values())
"""Bins whose phases matter."""


@dataclass(frozen=True, slots=True)
class SuperframeView:
    """A superframe as read from a hypothesised place.

    Attributes
    ----------
    spectra : ndarray of complex64 or complex128, shape (64, HOP)
        See `watermark.audio.signal.mdct.analyse`.
    amplitudes : ndarray of float32 or float64, shape (64, bins)
        The mark's unit, see `Masker.amplitudes`.
    paired : bool
        Whether bins come from left and right, too.
    """

    spectra: NDArray[Any]
    amplitudes: NDArray[Any]
    paired: bool = False
    _soft: dict[tuple[int, float], NDArray[np.float64]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    _projected: dict[int, tuple[Cells, NDArray[np.float64], NDArray[np.bool_]]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def turned(self, phases: NDArray[np.float64]) -> "SuperframeView":
        """Return the view with the phases, shape (HOP,), added to its bins."""
        turn = np.exp(1j * phases).astype(np.complex64)
        return SuperframeView(self.spectra * turn, self.amplitudes, self.paired)

    def clues(self, cells: Cells, masker: Masker) -> NDArray[np.float64]:
        """Logarithms of the power of each cell's unit, of its frame and of a coder's noise.

        Returns
        -------
        ndarray of float64, shape (CLUES, 64, groups)
            The noise in units of the cell's; all less the mean over the frames at each cell
            position, and no farther than `CLUE_LIMIT` from it.
        """
        spectra = np.asarray(self.spectra, dtype=np.complex64)
        amplitudes = np.asarray(self.amplitudes, dtype=np.float32)
        power = np.empty(spectra.shape, dtype=np.float32)
        energy, total = np.empty((len(power), masker.edges.size - 1)), np.empty(len(power))
        _clue_kernels.bin_powers(spectra, masker.edges, power, energy, total)
        noise = band_noise([power], [energy], masker, CODER_BITS)
        clues = np.empty((CLUES, len(power), cells.dither.size))
        _clue_kernels.cell_means(
            amplitudes, noise, masker.edges, cells.first_bin, cells.bins, clues
        )
        np.log(clues[::2], out=clues[::2])
        clues[0] *= 2
        clues[1] = np.log(2 * total + 1e-12)[:, np.newaxis]
        clues[2] -= clues[0]
        _clue_kernels.centre_clues(clues, CLUE_LIMIT)
        return clues

    def errors(self, cells: Cells, step: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Places of cells on the lattice of bit 0 in steps, and whether they carry.

        Both have the shape (64, groups); whole steps are the lattice's points.
        """
        projections, alive = self._project(cells)
        return projections / step - cells.dither, alive

    def soft(self, cells: Cells, step: float) -> NDArray[np.float64]:
        """Soft values of cells at a step, shape (64, groups); 0 where a cell cannot carry."""
        key = id(cells), step
        if key not in self._soft:
            # Each level is asked for by several steps of a reading.
            self._soft[key] = soft_values(*self._project(cells), cells, step)
        return self._soft[key]

    def agreements(
        self, cells: Cells, steps: list[float], expected: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return sums of soft values at some steps, each times its expectation, shape (steps,)."""
        sums = np.empty(len(steps))
        scales = 1.0 / np.array(steps)
        _kernels.agreements(*self._project(cells), cells.dither, scales, expected, sums)
        return sums

    def _project(self, cells: Cells) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        if id(cells) not in self._projected:
            shape = len(self.spectra), cells.dither.size
            projections, alive = np.empty(shape), np.empty(shape, dtype=np.bool_)
            _kernels.project_cells(
                np.asarray(self.spectra, dtype=np.complex64),
                np.asarray(self.amplitudes, dtype=np.float32),
                cells.signs,
                cells.first_bin,
                projections,
                alive,
            )
            self._projected[id(cells)] = cells, projections, alive
        _, projections, alive = self._projected[id(cells)]
        return projections, alive


def read_view(
    tape: SampleBuffer,
    position: float,
    ratio: float,
    masker: Masker,
    places: ChannelChoice | None = None,
    *,
    bend: float = 0.0,
) -> SuperframeView:
    """Read the superframe at `position` of the tape; `ratio` is tape samples per 48 kHz sample.

    Where `places` are given and the tape has a side that is not silent, bins are read from left or
    right that stand there, else all from the mid. `bend` is by how much the ratio, relative to
    itself, grows per superframe; `ratio` is its mean.
    """
    mid = _spectra(tape, position, ratio, bend)
    side, bins = np.zeros((0, 0), dtype=np.complex64), np.zeros((len(mid) - 1, HOP), dtype=np.int64)
    if places is not None and isinstance(tape, StereoBuffer):
        beside = _spectra(tape.side, position, ratio, bend)
        if beside.any():
            side, bins = beside, places.bins
    thresholds = thresholds_of(mid, side, masker)
    units = masker.units(thresholds[:, 1:], thresholds[:, :-1])
    spectra, amplitudes = choose(mid[1:], side[1:], units, masker, bins)
    return SuperframeView(spectra, amplitudes, paired=side.size > 0)


def thresholds_of(
    mid: NDArray[np.complex64], side: NDArray[np.complex64], masker: Masker
) -> NDArray[np.float64]:
    """Masking thresholds of mid, left and right, shape (3, T, bands); of the mid without a side."""
    energies = np.zeros((3 if side.size else 1, len(mid), masker.edges.size - 1))
    _kernels.band_energies(mid, side, masker.edges, energies)
    return masker.shaped(energies)


def choose(
    mid: NDArray[np.complex64],
    side: NDArray[np.complex64],
    units: NDArray[np.float64],
    masker: Masker,
    bins: NDArray[np.int64],
) -> tuple[NDArray[np.complex64], NDArray[np.float32]]:
    """Spectra and amplitudes of the mark's unit, each bin of the channel where it stands.

    `units` are those of the bands of each channel, `bins` numbers of channels, shape (T, HOP).
    """
    spectra, amplitudes = np.empty_like(mid), np.empty(mid.shape, dtype=np.float32)
    _kernels.choose_bins(mid, side, units, masker.edges, bins, spectra, amplitudes)
    return spectra, amplitudes


def _spectra(
    tape: SampleBuffer, position: float, ratio: float, bend: float
) -> NDArray[np.complex64]:
    """Spectra of the frames of a superframe and of the one before, shape (65, HOP).

    At nearly the mark's own pace frames begin at whole samples, and the rest turns their phases:
    no frame is shifted by more than half a sample.
    """
    first, number = position - HOP * ratio, np.arange(FRAMES_PER_SUPERFRAME + 1)
    delays = np.zeros(number.size)
    if bend:
        place = (number - 0.5) / FRAMES_PER_SUPERFRAME - 0.5
        delays = 0.5 * bend * SUPERFRAME * (place**2 - 0.25)
    if abs(ratio - 1) < UNTURNED:
        begin = first + number * HOP * ratio
        whole = np.round(begin).astype(np.int64)
        delays += begin - whole
        starts = whole - whole[0]
        sound = tape.part(int(whole[0]), int(starts[-1]) + 2 * HOP)
    else:
        starts = number * HOP
        sound = tape.read(first, ratio, SUPERFRAME + 2 * HOP)
    frames = np.empty((number.size, 2 * HOP), dtype=np.float32)
    if not _kernels.cut_frames(sound, starts, frames):
        return np.zeros((number.size, HOP), dtype=np.complex64)
    own, following = lapping(HOP, "complex64")
    spectra = np.empty((number.size, HOP), dtype=np.complex64)
    _kernels.lap_bins(scipy.fft.rfft(frames, axis=1), own, following, spectra)
    if delays.any():
        _kernels.turn_bins(spectra, delays, np.pi / HOP, TURNED_BINS)
    return spectra
