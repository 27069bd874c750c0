"""Acquisition: find superframes in sound that may start anywhere, by their pilots.

In: the programme's mid; out: candidates: a superframe's start, clock error and score. Pilots lie
below 3 kHz, so a rate of 12 kHz serves; every second sample at 48 kHz is tried as a start.
Specification: section 7.1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.dither import Cells
from watermark.layout import make_layout
from watermark.masking import make_masker
from watermark.mdct import analyse
from watermark.profile import FRAMES_PER_SUPERFRAME, HOP, SLOT_FRAMES, Profile

DECIMATION = 4
"""The search works at 48 kHz / 4."""

SEARCH_HOP = HOP // DECIMATION
"""Samples between frames at the search's rate."""

TURNS = 2
"""Places tried per sample at the search's rate, by turning phases: one in 2 samples at 48 kHz."""

QUANTUM = SLOT_FRAMES * SEARCH_HOP
"""Samples that the search takes at once: 0.08 s."""

CLOCK_ERRORS_PPM = np.array([0.0, -80.0, 80.0, -160.0, 160.0])
"""Clock errors tried; between them the ends of a superframe are at most 0.6 samples off."""

CLOCK_PENALTY = 0.05
"""Correlation that a clock error must be worth per ppm: most programmes have none."""

THRESHOLD = 4.6
"""Least score of a candidate in standard deviations of unmarked sound."""

CENTRE = (DECIMATION - 1) / 2
"""A search frame's samples lie this much later than the mark's frame begins (in 48 kHz samples)."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A place where a superframe may start.

    Attributes
    ----------
    start : float
        Start relative to the first sample of the search, in samples at 48 kHz.
    clock_ppm : float
        How much longer than nominal the superframe lasts on this clock.
    score : float
        Correlation of the pilots in standard deviations.
    """

    start: float
    clock_ppm: float
    score: float


class PilotSearch:
    """Sliding search for one profile's pilots.

    Parameters
    ----------
    profile : Profile
        Whose pilots to look for.
    key : int
        Seed of the layout.
    """

    def __init__(self, profile: Profile, key: int) -> None:
        self._layout = make_layout(profile, key)
        self._cells = Cells(profile, self._layout)
        self._groups = profile.pilot_groups
        self._masker = make_masker(profile.first_bin + self._groups * profile.cell_bins)
        frame = np.arange(FRAMES_PER_SUPERFRAME)
        self._hop = SEARCH_HOP * TURNS
        drift = CLOCK_ERRORS_PPM[:, np.newaxis] * 1e-6 * frame * self._hop
        self._drift = np.round(drift).astype(np.int64)
        self._span = (FRAMES_PER_SUPERFRAME - 1) * self._hop
        self._slack = int(np.abs(self._drift).max())
        turn = np.arange(TURNS)[:, np.newaxis] / TURNS
        bins = np.arange(self._masker.edges[-1])
        self._turn = np.sqrt(DECIMATION) * np.exp(1j * np.pi / SEARCH_HOP * turn * (bins + 0.5))
        # Silence stands before the first sample: a superframe cut by the start is found too.
        self._history = self._span + 2 * self._slack
        self._soft = np.zeros((self._history, self._groups), dtype=np.float32)
        self._before = np.zeros((SEARCH_HOP, self._masker.edges.size - 1))
        self._sound = np.zeros(0)
        self._row = 0

    @property
    def needed(self) -> int:
        """Samples to hand to `process` next."""
        return QUANTUM + 2 * SEARCH_HOP - 1 - self._sound.size

    def process(self, sound: NDArray[np.float64]) -> Candidate | None:
        """Take the next `needed` samples; return the best candidate that they complete."""
        from watermark import _kernels

        self._sound = np.concatenate([self._sound, sound])
        self._soft = np.concatenate([self._soft[-self._history :], self._observe()])
        self._sound = self._sound[QUANTUM:]
        scores = np.empty((CLOCK_ERRORS_PPM.size, QUANTUM * TURNS))
        layout = self._layout
        _kernels.pilot_scores(
            self._soft,
            self._slack,
            self._hop,
            self._drift,
            layout.pilot_group,
            layout.pilot_sign,
            scores,
        )
        first = self._row - self._span - self._slack
        self._row += QUANTUM * TURNS
        scores -= CLOCK_PENALTY * np.abs(CLOCK_ERRORS_PPM)[:, np.newaxis]
        error, i = np.unravel_index(int(scores.argmax()), scores.shape)
        score = float(scores[error, i]) / np.sqrt(0.5 * layout.pilot_sign.size)
        if score < THRESHOLD:
            return None
        start = DECIMATION / TURNS * (first + float(i)) - CENTRE
        return Candidate(start, float(CLOCK_ERRORS_PPM[error]), score)

    def _observe(self) -> NDArray[np.float32]:
        """Soft values of the pilot positions for each start, shape (QUANTUM * TURNS, groups)."""
        frames = np.lib.stride_tricks.sliding_window_view(self._sound, 2 * SEARCH_HOP)
        spectra = analyse(frames, SEARCH_HOP)[:, : self._masker.edges[-1]]
        threshold = self._masker.thresholds(np.abs(spectra) ** 2 * (DECIMATION / 2))
        before = np.concatenate([self._before, threshold[:-SEARCH_HOP]])
        self._before = threshold[-SEARCH_HOP:]
        amplitudes = self._masker.amplitudes(threshold, before)
        soft = np.empty((QUANTUM, TURNS, self._groups), dtype=np.float32)
        for turn in range(TURNS):
            coefficients = (spectra * self._turn[turn]).real
            projections, alive = self._cells.project(coefficients, amplitudes, self._groups)
            soft[:, turn] = self._cells.soft(projections) * alive
        return soft.reshape(-1, self._groups)
