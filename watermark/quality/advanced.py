"""Objective difference grade of ITU-R BS.1387 (PEAQ), advanced version, file or stream.

Beside the basic version's spectra the ear is modelled by a filter bank, which hears what happens
within a spectrum's frame: noise before an attack. Readings of the Recommendation as in `peaq`.
"""

import copy
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError
from watermark.quality import _bank_kernels, bank, ear
from watermark.quality.advanced_movs import (
    AUDIBLE_DELAY_FRAMES,
    DELAY_FRAMES,
    AdvancedMovs,
    BankAverages,
    SpectralAverages,
    advanced_index,
)
from watermark.quality.movs import AUDIBLE_SONE, difference_grade, harmonic_structure
from watermark.quality.stream import Bounded, Frames, Intake, active_frames

FloatArray = NDArray[np.float64]

_BATCH, _BANK_BATCH = 32, 32
"""Frames analysed at once by spectra and by the filter bank; they bound the memory."""

WHOLE = "whole"
"""Name of the averages that the meter keeps by itself."""


@dataclass(frozen=True, slots=True)
class AdvancedResult:
    """A grade with its model output variables.

    Attributes
    ----------
    odg : float
        Objective difference grade: 0.2 to -0.1 imperceptible, -1 perceptible, -4 very annoying.
    di : float
        Distortion index, finer than the grade at its ends.
    movs : AdvancedMovs
        The five model output variables.
    start_s, end_s : float
        Stretch of the programme that was graded.
    """

    odg: float
    di: float
    movs: AdvancedMovs
    start_s: float
    end_s: float


class AdvancedMeter:
    """Grade a stream in constant memory; the basic version is `PeaqMeter`.

    Parameters
    ----------
    fs : int
        Sampling rate in Hz; other rates than 48000 are resampled.
    channels : int
        1 or 2.

    Raises
    ------
    CueError
        If the number of channels or the sampling rate is out of range.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal((48000, 1)) * 0.1
    >>> meter = AdvancedMeter(48000, 1)
    >>> meter.process(noise, noise)
    >>> meter.result().odg > 0.1
    True
    """

    def __init__(self, fs: int, channels: int) -> None:
        self._intake = Intake(fs, channels)
        self._channels = channels
        self._spectral = _Spectral(channels)
        self._bank = _Bank(channels)
        self._averages: dict[str, tuple[Bounded[SpectralAverages], Bounded[BankAverages]]] = {}
        self.begin(WHOLE)

    def process(self, reference: ArrayLike, test: ArrayLike) -> None:
        """Take the next samples of both signals.

        Parameters
        ----------
        reference, test : array_like of float, shape (n, channels)
            Next samples, full scale 1; both of the same length.

        Raises
        ------
        CueError
            If the two blocks differ in shape.
        """
        self._analyse(self._intake.take(reference, test))

    def begin(self, name: str) -> None:
        """Average from here on under a name of the caller's, see `grade`; from scratch if known."""
        self._averages[name] = (
            Bounded(SpectralAverages(self._channels)),
            Bounded(BankAverages(self._channels)),
        )

    def end(self, name: str = WHOLE) -> None:
        """Average no longer under a name; by default, no longer for `result`."""
        del self._averages[name]

    def grade(self, name: str) -> AdvancedResult | None:
        """Grade of the whole frames since `begin`, None for silence."""
        spectral, filtered = self._averages[name]
        if spectral.start is None:
            return None
        modulation, noise, linear = filtered.kept.values()
        movs = AdvancedMovs(modulation, noise, *spectral.kept.values(), linear)
        index = advanced_index(movs)
        start_s, end_s = spectral.start / ear.FRAME_RATE, (spectral.end + 1) / ear.FRAME_RATE
        return AdvancedResult(difference_grade(index), index, movs, start_s, end_s)

    def result(self) -> AdvancedResult:
        """Grade everything so far, as if the programme ended here; more may follow.

        Raises
        ------
        CueError
            If nothing above the level of silence has been seen.
        """
        rest = copy.deepcopy(self)
        rest._analyse(rest._intake.flush())
        left = rest._spectral.frames.left
        if left >= ear.HOP or (left > 0 and rest._spectral.count == 0):
            rest._analyse(np.zeros((2, ear.FRAME - left, rest._channels)))
        grade = rest.grade(WHOLE)
        if grade is None:
            raise CueError("nothing to grade: the reference is silent")
        return grade

    def _analyse(self, pair: FloatArray) -> None:
        both = list(self._averages.values())
        self._spectral.analyse(pair, [spectral for spectral, _ in both])
        self._bank.analyse(pair, [filtered for _, filtered in both])


class _Spectral:
    """Measurements in spectra of 2048 samples, in 55 bands."""

    def __init__(self, channels: int) -> None:
        self.frames = Frames(channels, ear.FRAME, ear.HOP, _BATCH)
        self.count = 0
        self._smeared = np.zeros((channels, ear.WIDE_BANDS))

    def analyse(self, pair: FloatArray, averages: list[Bounded[SpectralAverages]]) -> None:
        for batch in self.frames.batches(pair):
            active = active_frames(batch[0], ear.FRAME, ear.HOP)
            features = np.empty((active.size, batch.shape[2], 2))
            for c in range(batch.shape[2]):
                features[:, c] = self._channel(batch[:, :, c], self._smeared[c])
            for frame, sounding in zip(features, active, strict=True):
                for bounded in averages:
                    bounded.add(
                        frame, self.count, active=bool(sounding), settled=True, audible=True
                    )
                self.count += 1

    def _channel(self, pair: FloatArray, smeared: FloatArray) -> FloatArray:
        """Features of one channel's frames, shape (T, 2)."""
        tables = ear.ear_tables(ear.WIDE_BANDS)
        frames = sliding_window_view(pair, ear.FRAME, axis=1)[:, :: ear.HOP]
        power = np.abs(np.fft.rfft(frames * tables.window, axis=2)) ** 2
        ratio = np.empty(power.shape[1])
        _bank_kernels.noise_to_mask_into(
            power, tables.outer_ear, tables.first, tables.last, tables.first_share,
            tables.last_share, tables.bands, smeared, ratio,
        )  # fmt: skip
        energy = np.square(frames[:, :, ear.HOP :]).sum(axis=2)
        return np.stack([ratio, harmonic_structure(power, energy)], axis=1)


class _Bank:
    """Measurements behind the filter bank, in frames of 192 samples."""

    def __init__(self, channels: int) -> None:
        self._frames = Frames(channels, bank.FRAME, bank.FRAME, _BANK_BATCH)
        self._filters = bank.FilterBank(channels)
        self._slopes = np.zeros((channels, 2, bank.BANDS))
        self._history = np.zeros((channels, 2, bank.bank_tables().backward.size, bank.BANDS))
        self._state = np.zeros((channels, 14, bank.BANDS))
        self._count = 0
        self._audible_from: int | None = None

    def analyse(self, pair: FloatArray, averages: list[Bounded[BankAverages]]) -> None:
        for batch in self._frames.batches(pair):
            active = active_frames(batch[0], bank.FRAME, bank.FRAME)
            features = self._features(self._filters.process(batch))
            for frame, sounding in zip(features, active, strict=True):
                self._add(frame, averages, active=bool(sounding))

    def _features(self, filtered: NDArray[np.complex128]) -> FloatArray:
        """Features of frames, shape (T, channels, 7)."""
        tables = bank.bank_tables()
        channels, count = filtered.shape[1], filtered.shape[2] // bank.STEPS
        features = np.empty((channels, count, _bank_kernels.COLUMNS))
        for c in range(channels):
            _bank_kernels.bank_frames_into(
                np.ascontiguousarray(filtered[:, c]), tables.rows, tables.backward, tables.step_db,
                tables.new_slope, bank.FRAME_RATE, self._slopes[c], self._history[c],
                self._state[c], features[c],
            )  # fmt: skip
        return np.ascontiguousarray(features.transpose(1, 0, 2))

    def _add(
        self, frame: FloatArray, averages: list[Bounded[BankAverages]], *, active: bool
    ) -> None:
        loud = frame[:, [_bank_kernels.LOUDNESS_REF, _bank_kernels.LOUDNESS_TEST]] > AUDIBLE_SONE
        if self._audible_from is None and loud.all(axis=1).any():
            self._audible_from = self._count
        settled = self._count >= DELAY_FRAMES
        audible = (
            self._audible_from is not None
            and self._count >= self._audible_from + AUDIBLE_DELAY_FRAMES
        )
        for bounded in averages:
            bounded.add(frame, self._count, active=active, settled=settled, audible=audible)
        self._count += 1


def peaq_advanced(reference: ArrayLike, test: ArrayLike, fs: int) -> AdvancedResult:
    """Grade a test signal against its reference, both whole and aligned in time.

    Parameters and errors as of `watermark.quality.peaq.grade`.

    Examples
    --------
    >>> noise, other = np.random.default_rng(1).standard_normal((2, 48000)) * 0.1
    >>> peaq_advanced(noise, noise + 0.5 * other, 48000).odg < -1
    True
    """
    ref = np.asarray(reference, dtype=np.float64)
    meter = AdvancedMeter(fs, 1 if ref.ndim == 1 else ref.shape[1])
    meter.process(ref, test)
    return meter.result()
