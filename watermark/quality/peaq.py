"""Objective difference grade of ITU-R BS.1387 (PEAQ), basic version, file or stream.

Reference and test come in as full-scale floats, already aligned in time; out comes a grade from
0 (no difference to be heard) to -4 (very annoying). Where the Recommendation leaves a choice, the
reading of P. Kabal (2002) is followed: internal states start at zero, model output variables are
not clipped, leading and trailing silence does not count.
"""

import copy
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError
from watermark.quality import _kernels
from watermark.quality.ear import BANDS, FRAME, FRAME_RATE, HOP, ear_tables
from watermark.quality.movs import (
    AUDIBLE_DELAY_FRAMES,
    AUDIBLE_SONE,
    DELAY_FRAMES,
    FrameFeatures,
    MovAverages,
    Movs,
    difference_grade,
    distortion_index,
    harmonic_structure,
)
from watermark.quality.stream import Bounded, Frames, Intake, active_frames

FloatArray = NDArray[np.float64]

_BATCH = 32  # frames analysed at once; bounds the memory


@dataclass(frozen=True, slots=True)
class PeaqResult:
    """A grade with its model output variables.

    Attributes
    ----------
    odg : float
        Objective difference grade: 0.2 to -0.1 imperceptible, -1 perceptible, -4 very annoying.
    di : float
        Distortion index, finer than the grade at its ends.
    movs : Movs
        The eleven model output variables.
    start_s, end_s : float
        Stretch of the programme that was graded.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal((48_000, 1)) * 0.1
    >>> result = grade(noise, noise, 48_000)
    >>> round(result.odg, 2), result.start_s
    (0.18, 0.0)
    """

    odg: float
    di: float
    movs: Movs
    start_s: float
    end_s: float


WHOLE, SEGMENT = "whole", "segment"
"""Names of the averages that the meter keeps by itself."""


class PeaqMeter:
    """Grade a stream in constant memory.

    Parameters
    ----------
    fs : int
        Sampling rate in Hz; other rates than 48000 are resampled.
    channels : int
        1 or 2.
    segment_s : float, optional
        Also grade every stretch of this length by itself (`process` returns those grades).

    Raises
    ------
    CueError
        If the number of channels or the sampling rate is out of range.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal((48000, 1)) * 0.1
    >>> meter = PeaqMeter(48000, 1)
    >>> _ = meter.process(noise, noise)
    >>> round(meter.result().odg, 2)
    0.18
    """

    def __init__(self, fs: int, channels: int, *, segment_s: float | None = None) -> None:
        self._intake = Intake(fs, channels)
        if segment_s is not None and segment_s <= 0:
            raise CueError(f"segment of {segment_s} s: must be longer than 0 s")
        self._channels = channels
        self._segment_frames = 0 if segment_s is None else max(1, round(segment_s * FRAME_RATE))
        self._frames = Frames(channels, FRAME, HOP, _BATCH)
        self._state = np.zeros((channels, 14, BANDS))
        self._frame = 0
        self._audible_from: int | None = None
        self._averages = {WHOLE: self._fresh()}
        if self._segment_frames:
            self.begin(SEGMENT)

    def process(self, reference: ArrayLike, test: ArrayLike) -> list[PeaqResult]:
        """Take the next samples of both signals.

        Parameters
        ----------
        reference, test : array_like of float, shape (n, channels)
            Next samples, full scale 1; both of the same length.

        Returns
        -------
        list of PeaqResult
            Grades of the segments that were completed; silent segments are left out.

        Raises
        ------
        CueError
            If the two blocks differ in shape.
        """
        return self._analyse_all(self._intake.take(reference, test))

    def begin(self, name: str) -> None:
        """Average from here on under a name of the caller's, see `grade`; from scratch if known."""
        self._averages[name] = self._fresh()

    def end(self, name: str = WHOLE) -> None:
        """Average no longer under a name; by default, no longer for `result`."""
        del self._averages[name]

    def grade(self, name: str) -> PeaqResult | None:
        """Grade of the whole frames since `begin`, None for silence."""
        bounded = self._averages[name]
        if bounded.start is None:
            return None
        movs = bounded.kept.movs()
        index = distortion_index(movs)
        start_s, end_s = bounded.start / FRAME_RATE, (bounded.end + 1) / FRAME_RATE
        return PeaqResult(difference_grade(index), index, movs, start_s, end_s)

    def result(self) -> PeaqResult:
        """Grade everything so far, as if the programme ended here; more may follow.

        Raises
        ------
        CueError
            If nothing above the level of silence has been seen.
        """
        rest = copy.deepcopy(self)
        rest._analyse_all(rest._intake.flush())
        left = rest._frames.left
        if left >= HOP or (left > 0 and rest._frame == 0):
            rest._analyse_all(np.zeros((2, FRAME - left, rest._channels)))
        grade = rest.grade(WHOLE)
        if grade is None:
            raise CueError("nothing to grade: the reference is silent")
        return grade

    def _fresh(self) -> Bounded[MovAverages]:
        return Bounded(MovAverages(self._channels))

    def _analyse_all(self, pair: FloatArray) -> list[PeaqResult]:
        return [grade for batch in self._frames.batches(pair) for grade in self._analyse(batch)]

    def _analyse(self, pair: FloatArray) -> list[PeaqResult]:
        """Run (2, n, channels) samples that make whole frames through the model."""
        active = active_frames(pair[0], FRAME, HOP)
        count = active.size
        features = np.empty((self._channels, count, 10))
        ehs = np.empty((self._channels, count))
        probability, steps = np.zeros((count, BANDS)), np.zeros((count, BANDS))
        for c in range(self._channels):
            # The second half of a frame decides whether it is loud enough for the harmonic
            # structure.
            frames = sliding_window_view(pair[:, :, c], FRAME, axis=1)[:, ::HOP]
            spectra = np.fft.rfft(frames * ear_tables().window, axis=2)
            power = np.square(spectra.real)
            power += np.square(spectra.imag)
            energy = np.square(frames[:, :, HOP:]).sum(axis=2)
            ehs[c] = harmonic_structure(power, energy)
            _run_model(power, self._state[c], features[c], probability, steps)
        # Bands detect independently: a difference is missed only if all of them miss it.
        detection = 1 - np.prod(1 - probability, axis=1)
        by_frame, ehs = (
            np.ascontiguousarray(features.transpose(1, 0, 2)),
            np.ascontiguousarray(ehs.T),
        )
        found = FrameFeatures(by_frame, ehs, detection, steps.sum(axis=1))
        # Silence may be the end, and counts otherwise; a segment ends between two frames.
        cuts = {0, count, *(1 + np.flatnonzero(active[1:] != active[:-1])).tolist()}
        if self._segment_frames:
            cuts |= set(range(-self._frame % self._segment_frames, count, self._segment_frames))
        grades = []
        for first, last in pairwise(sorted(cuts)):
            grades += self._count(found[first:last], active=bool(active[first]))
        return grades

    def _count(self, frames: FrameFeatures, *, active: bool) -> list[PeaqResult]:
        """Add frames to the averages; grade the segment that ends with them."""
        x, count = frames.features, len(frames.steps)
        loud = (x[..., _kernels.LOUDNESS_REF] > AUDIBLE_SONE) & (
            x[..., _kernels.LOUDNESS_TEST] > AUDIBLE_SONE
        )
        if self._audible_from is None and loud.any():
            self._audible_from = self._frame + int(loud.any(axis=1).argmax())
        number = self._frame + np.arange(count)
        settled = number >= DELAY_FRAMES
        audible = np.zeros(count, dtype=np.bool_)
        if self._audible_from is not None:
            audible = number >= self._audible_from + AUDIBLE_DELAY_FRAMES
        for averages in self._averages.values():
            averages.add(
                frames, self._frame, active=active, settled=settled, audible=audible, count=count
            )
        self._frame += count
        if not self._segment_frames or self._frame % self._segment_frames:
            return []
        grade = self.grade(SEGMENT)
        self.begin(SEGMENT)
        return [] if grade is None else [grade]


def _run_model(
    power: FloatArray,
    state: FloatArray,
    features: FloatArray,
    probability: FloatArray,
    steps: FloatArray,
) -> None:
    ear = ear_tables()
    _kernels.frames_into(
        power,
        ear.outer_ear,
        ear.first,
        ear.last,
        ear.first_share,
        ear.last_share,
        ear.bands,
        FRAME_RATE,
        state,
        features,
        probability,
        steps,
    )


def grade(reference: ArrayLike, test: ArrayLike, fs: int) -> PeaqResult:
    """Grade a test signal against its reference, both whole and aligned in time.

    Parameters
    ----------
    reference, test : array_like of float, shape (n,) or (n, channels)
        Full scale 1; one or two channels, the same length.
    fs : int
        Sampling rate in Hz.

    Returns
    -------
    PeaqResult
        Grade, distortion index and model output variables.

    Raises
    ------
    CueError
        If the shapes differ, there are more than two channels, or the reference is silent.

    References
    ----------
    ITU-R BS.1387-1 (2001), Annex 2. P. Kabal (2002), "An Examination and Interpretation of
    ITU-R BS.1387: Perceptual Evaluation of Audio Quality", McGill University.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(48000) * 0.1
    >>> grade(noise, noise + np.roll(noise, 7) * 0.5, 48000).odg < -1
    True
    """
    ref = np.asarray(reference, dtype=np.float64)
    meter = PeaqMeter(fs, 1 if ref.ndim == 1 else ref.shape[1])
    meter.process(ref, test)
    return meter.result()
