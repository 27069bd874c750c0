"""Acquisition: find superframes in sound that may start anywhere, by their pilots.

In: the programme's mid; out: candidates: a superframe's start, clock error, profile and tier of
levels. Pilots lie below 2.8 kHz, so a rate of 12 kHz serves; every second sample at 48 kHz is tried
as a start. Specification: section 7.1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.layout import make_pilots
from watermark.masking import make_masker
from watermark.mdct import analyse
from watermark.profile import (
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

TURNS = 2
"""Places tried per sample at the search's rate, by turning phases: one in 2 samples at 48 kHz."""

ROW_HOP = SEARCH_HOP * TURNS
"""Places tried per frame."""

QUANTUM = SLOT_FRAMES * SEARCH_HOP
"""Samples that the search takes at once: 0.08 s."""

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
    score : float
        Correlation of the pilots in standard deviations.
    """

    start: float
    clock_ppm: float
    profile: int
    tier: int
    score: float


class PilotSearch:
    """Sliding search for pilots of any profile.

    Parameters
    ----------
    key : int
        Seed of the layout.
    """

    def __init__(self, key: int) -> None:
        self._pilots = make_pilots(key)
        self._signs = self._pilots.signs.astype(np.float32)
        self._masker = make_masker(self._pilots.cells.last_bin)
        frame = np.arange(FRAMES_PER_SUPERFRAME)
        middle = frame.reshape(-1, SEGMENT_FRAMES).mean(axis=1)
        drift = np.round(CLOCK_ERRORS_PPM[:, np.newaxis] * 1e-6 * middle * ROW_HOP)
        self._slack = int(np.abs(drift).max())
        self._shift = np.ascontiguousarray(drift + self._slack, dtype=np.int64)
        self._span = (FRAMES_PER_SUPERFRAME - 1) * ROW_HOP
        turn = np.arange(TURNS)[:, np.newaxis] / TURNS
        bins = np.arange(self._masker.edges[-1])
        turns = np.sqrt(DECIMATION) * np.exp(1j * np.pi / SEARCH_HOP * turn * (bins + 0.5))
        self._turn = turns.astype(np.complex64)
        # Silence stands before the first sample: a superframe cut by the start is found too.
        self._history = self._span + 2 * self._slack
        shape = (len(PILOT_STEPS), PILOT_SLOTS, self._history)
        self._soft = np.zeros(shape, dtype=np.float32)
        self._before = np.zeros((SEARCH_HOP, self._masker.edges.size - 1))
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
        scores = self._correlate()
        first = self._row - self._span - self._slack
        self._row += QUANTUM * TURNS
        tier, profile, error, i = np.unravel_index(int(scores.argmax()), scores.shape)
        deviation = np.sqrt(0.5 * PILOTS_PER_FRAME * FRAMES_PER_SUPERFRAME)
        score = float(scores[tier, profile, error, i] / deviation)
        if score < THRESHOLD:
            return None
        start = DECIMATION / TURNS * (first + float(i)) - CENTRE
        clock_ppm = float(CLOCK_ERRORS_PPM[error])
        return Candidate(start, clock_ppm, int(profile), int(tier), score)

    def _correlate(self) -> NDArray[np.float32]:
        """Score of each tier, profile, clock error and start."""
        errors, places = CLOCK_ERRORS_PPM.size, QUANTUM * TURNS
        penalty = np.minimum(CLOCK_PENALTY * np.abs(CLOCK_ERRORS_PPM), LARGEST_PENALTY)
        shape = (len(PILOT_STEPS), len(PROFILES), errors, places)
        scores = np.full(shape, -np.inf, dtype=np.float32)
        for tier, soft in enumerate(self._soft):
            common = np.repeat(-penalty[:, np.newaxis].astype(np.float32), places, axis=1)
            self._add(soft, 0, self._signs[0, :, 0], common)
            for profile in PROFILES.values():
                if profile.levels_of(tier):
                    scores[tier, profile.number] = common
                    announced = self._signs[profile.number, :, 1]
                    self._add(soft, 1, announced, scores[tier, profile.number])
        return scores

    def _add(
        self,
        soft: NDArray[np.float32],
        pilot: int,
        signs: NDArray[np.float32],
        scores: NDArray[np.float32],
    ) -> None:
        from watermark import _kernels

        group = np.ascontiguousarray(self._pilots.slots[:, pilot])
        segments = FRAMES_PER_SUPERFRAME // SEGMENT_FRAMES
        sums = np.zeros((segments, scores.shape[1] + 2 * self._slack), dtype=np.float32)
        sign = np.ascontiguousarray(signs)
        _kernels.pilot_sums(soft, ROW_HOP, SEGMENT_FRAMES, group, sign, sums)
        _kernels.drift_scores(sums, self._shift, scores)

    def _observe(self) -> NDArray[np.float32]:
        """Soft values of the pilots' positions, shape (tiers, PILOT_SLOTS, QUANTUM * TURNS)."""
        from watermark import _kernels

        frames = np.lib.stride_tricks.sliding_window_view(self._sound, 2 * SEARCH_HOP)
        spectra = analyse(frames, SEARCH_HOP)[:, : self._masker.edges[-1]]
        threshold = self._masker.thresholds(np.abs(spectra) ** 2 * (DECIMATION / 2))
        before = np.concatenate([self._before, threshold[:-SEARCH_HOP]])
        self._before = threshold[-SEARCH_HOP:]
        amplitudes = self._masker.amplitudes(threshold, before).astype(np.float32)
        cells = self._pilots.cells
        soft = np.empty((len(PILOT_STEPS), PILOT_SLOTS, QUANTUM * TURNS), dtype=np.float32)
        _kernels.pilot_soft(
            np.ascontiguousarray(spectra), self._turn, amplitudes, cells.first_bin,
            cells.signs.astype(np.float32), cells.dither.astype(np.float32),
            np.array(PILOT_STEPS, dtype=np.float32), soft,
        )  # fmt: skip
        return soft
