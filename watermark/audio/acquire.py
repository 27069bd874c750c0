"""Acquisition: find superframes in sound that may start anywhere, by their pilots.

In: the programme's mid; out: candidates: a superframe's start, clock error, profile and tier of
levels. Pilots lie below 2.8 kHz, so a rate of 12 kHz serves; every second sample at 48 kHz is tried
as a start. Scores of up to three superframes in a row are added, for weak pilots.
Specification: section 7.1.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.layout import make_pilots
from watermark.audio.masking import make_masker
from watermark.audio.mdct import analyse
from watermark.audio.profile import (
    FRAMES_PER_SUPERFRAME,
    HOP,
    PILOT_SLOTS,
    PILOT_STEPS,
    PILOTS_PER_FRAME,
    PROFILES,
    SLOT_FRAMES,
)

DECIMATION = 4
"""The search works at 48 kHz / 4."""

SEARCH_HOP = HOP // DECIMATION
"""Samples between frames at the search's rate."""

STRIDE = 2
"""Samples at the search's rate between transforms; the places between are reached by turning."""

TURNS = np.array([-0.5, 0.0, 0.5, 1.0])
"""Samples at the search's rate by which each transform's phases are turned on."""

PLACE = DECIMATION * STRIDE / TURNS.size
"""Distance of the places tried: 2 samples at 48 kHz."""

ROW_HOP = SEARCH_HOP // STRIDE * TURNS.size
"""Places tried per frame."""

PERIOD = FRAMES_PER_SUPERFRAME * ROW_HOP
"""Places of a superframe."""

QUANTUM = SLOT_FRAMES * SEARCH_HOP
"""Samples that the search takes at once: 0.08 s."""

PLACES = SLOT_FRAMES * ROW_HOP
"""Places that this completes."""

CLOCK_ERRORS_PPM = np.concatenate(
    [[0.0], *([-ppm, ppm] for ppm in np.arange(120.0, 1561.0, 120.0))]
)
"""Clock errors tried; between them the ends of a superframe are at most 0.9 samples off."""

SEGMENT_FRAMES = 8
"""Frames whose pilots are summed as if the clock were right: 3 samples off at the largest error."""

CLOCK_PENALTY, LARGEST_PENALTY = 0.05, 8.0
"""Correlation that a clock error must be worth, per ppm and at most: most programmes have none."""

THRESHOLD = 4.8
"""Least score of a candidate in standard deviations of unmarked sound."""

WEIGHTS = (0.66, 0.507)
"""Weights of the scores of a superframe summed with that of the one before, and of the two before:
they are as rare then in unmarked sound as a score by itself."""

CENTRE = (DECIMATION - 1) / 2
"""A search frame's samples lie this much later than the mark's frame begins (48 kHz samples)."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A place where a superframe may start.

    Attributes
    ----------
    start : float
        Start relative to the first sample of the search, in samples at 48 kHz.
    clock_ppm : float
        How much longer than nominal the superframe lasts on this clock.
    profile : int
        Number of the profile that the pilots announce.
    tier : int
        Tier of levels of the pilots.
    significance : float
        Score in standard deviations of unmarked sound.
    """

    start: float
    clock_ppm: float
    profile: int
    tier: int
    significance: float


class PilotSearch:
    """Sliding search for pilots of any profile.

    Parameters
    ----------
    key : int
        Seed of the layout.
    scale : float
        Factor of all steps of pilots.
    phases : ndarray of float64, shape (HOP,), optional
        To be added to those of the bins.
    """

    def __init__(
        self, key: int, *, scale: float = 1.0, phases: NDArray[np.float64] | None = None
    ) -> None:
        self._pilots = make_pilots(key)
        slots = np.ascontiguousarray(self._pilots.slots.T)
        signs = np.ascontiguousarray(self._pilots.signs.transpose(2, 0, 1), dtype=np.float32)
        self._common = slots[0], signs[0, 0]
        self._announced = [
            [(p.number, slots[1], signs[1, p.number]) for p in PROFILES.values() if p.levels_of(t)]
            for t in range(len(PILOT_STEPS))
        ]
        cells = self._pilots.cells
        self._masker = make_masker(cells.last_bin)
        frame = np.arange(FRAMES_PER_SUPERFRAME)
        middle = frame.reshape(-1, SEGMENT_FRAMES).mean(axis=1)
        drift = np.round(CLOCK_ERRORS_PPM[:, np.newaxis] * 1e-6 * middle * ROW_HOP)
        self._slack = int(np.abs(drift).max())
        self._shift = np.ascontiguousarray(drift + self._slack, dtype=np.int64)
        self._span = (FRAMES_PER_SUPERFRAME - 1) * ROW_HOP
        self._penalty = np.minimum(
            CLOCK_PENALTY * np.abs(CLOCK_ERRORS_PPM), LARGEST_PENALTY
        ).astype(np.float32)
        bins = int(self._masker.edges[-1])
        identity = np.eye(2 * SEARCH_HOP)
        transform = np.sqrt(DECIMATION) * analyse(identity, SEARCH_HOP)[:, :bins]
        parts = np.concatenate([transform.real, transform.imag], axis=1)
        self._transform = np.ascontiguousarray(parts.T, dtype=np.float32)
        frequency = np.pi / SEARCH_HOP * (np.arange(bins) + 0.5)
        angles = np.outer(TURNS, frequency) + (0.0 if phases is None else phases[:bins])
        self._turn = np.exp(1j * angles).astype(np.complex64)
        self._signs, self._dither = cells.signs.astype(np.float32), cells.dither.astype(np.float32)
        self._steps = (scale * np.array(PILOT_STEPS)).astype(np.float32)
        self._lag = PERIOD + np.round(CLOCK_ERRORS_PPM * 1e-6 * PERIOD).astype(np.int64)
        self._weights = np.array(WEIGHTS, dtype=np.float32)
        oldest = len(WEIGHTS) * (int(self._lag.max()) + 1)
        self._past = np.zeros((len(PILOT_STEPS), len(PROFILES), oldest), dtype=np.float32)
        # Silence stands before the first sample: a superframe cut by the start is found too.
        self._history = self._span + 2 * self._slack
        shape = (len(PILOT_STEPS), PILOT_SLOTS, self._history)
        self._soft = np.zeros(shape, dtype=np.float32)
        self._before = np.zeros((SEARCH_HOP // STRIDE, self._masker.edges.size - 1))
        self._sound = np.zeros(0, dtype=np.float32)
        self._row = 0

    @property
    def needed(self) -> int:
        """Samples to hand to `process` next."""
        return QUANTUM + 2 * SEARCH_HOP - 1 - self._sound.size

    def process(self, sound: NDArray[np.float64]) -> Candidate | None:
        """Take the next `needed` samples; return the best candidate that they complete."""
        self._sound = np.concatenate([self._sound, sound.astype(np.float32)])
        recent = self._soft[:, :, -self._history :]
        self._soft = np.concatenate([recent, self._observe()], axis=2)
        self._sound = self._sound[QUANTUM:]
        first = self._row - self._span - self._slack
        self._row += PLACES
        best, tier, profile, error, i = max(self._correlate(), key=lambda found: found[0])
        significance = best / math.sqrt(0.5 * PILOTS_PER_FRAME * FRAMES_PER_SUPERFRAME)
        if significance < THRESHOLD:
            return None
        start = PLACE * (first + float(i)) + DECIMATION * TURNS[0] - CENTRE
        return Candidate(start, float(CLOCK_ERRORS_PPM[error]), profile, tier, significance)

    def _correlate(self) -> Iterator[tuple[float, int, int, int, int]]:
        """Best score of each tier and profile, with tier, profile, clock error and start."""
        from watermark.audio import _kernels

        shape = FRAMES_PER_SUPERFRAME // SEGMENT_FRAMES, PLACES + 2 * self._slack
        peak, score = np.empty((2, PLACES), dtype=np.float32)
        error = np.empty(PLACES, dtype=np.int32)
        for tier, soft in enumerate(self._soft):
            common = np.zeros(shape, dtype=np.float32)
            _kernels.pilot_sums(soft, ROW_HOP, SEGMENT_FRAMES, *self._common, common)
            for profile, slots, signs in self._announced[tier]:
                sums = common.copy()
                _kernels.pilot_sums(soft, ROW_HOP, SEGMENT_FRAMES, slots, signs, sums)
                _kernels.drift_peaks(sums, self._shift, self._penalty, peak, error)
                past = self._past[tier, profile]
                _kernels.add_priors(peak, self._lag[error], past, self._weights, score)
                past[:-PLACES] = past[PLACES:]
                past[-PLACES:] = peak
                i = int(score.argmax())
                yield float(score[i]), tier, profile, int(error[i]), i

    def _observe(self) -> NDArray[np.float32]:
        """Soft values of the pilots' positions, shape (tiers, PILOT_SLOTS, PLACES)."""
        from watermark.audio import _kernels

        frames = np.lib.stride_tricks.sliding_window_view(self._sound, 2 * SEARCH_HOP)[::STRIDE]
        spectra = self._transform @ np.ascontiguousarray(frames.T)
        bins = spectra.shape[0] // 2
        power = (spectra[:bins] ** 2 + spectra[bins:] ** 2) / 2
        threshold = self._masker.thresholds(power.T)
        before = np.concatenate([self._before, threshold])[: len(threshold)]
        self._before = threshold[-SEARCH_HOP // STRIDE :]
        units = self._masker.amplitudes(threshold, before).T
        soft = np.empty((len(PILOT_STEPS), PILOT_SLOTS, PLACES), dtype=np.float32)
        _kernels.pilot_soft(
            spectra, np.ascontiguousarray(units, dtype=np.float32), self._turn,
            self._pilots.cells.first_bin, self._signs, self._dither, self._steps, soft,
        )  # fmt: skip
        return soft
