"""Acquisition: find superframes in sound that may start anywhere, by their pilots.

In: the programme's mid; out: candidates: a superframe's start, clock error, profile and tier of
levels. Pilots lie below 2.8 kHz, so a rate of 12 kHz serves; every second sample at 48 kHz is tried
as a start. Scores of up to three superframes in a row are added, for weak pilots.
Specification: spec/audio-carrier.md, W35.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from watermark.audio.search import _search_kernels
from watermark.audio.search.pilot_scan import (
    CENTRE,
    DECIMATION,
    PARTS,
    ROWS_PER_FRAME,
    SEGMENT_FRAMES,
    STRIDE,
    slot_frequencies,
)
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.profile import (
    FIRST_PILOT_BIN,
    FRAMES_PER_SUPERFRAME,
    PILOT_BINS,
    PILOT_SLOTS,
    PILOT_STEPS,
    PILOTS_PER_FRAME,
    PROFILES,
    SLOT_FRAMES,
)

TURNS = np.arange(-1.5, 2.1, 0.5)
"""Shift of each row's phases in samples at the search's rate."""

PLACE = DECIMATION * STRIDE / TURNS.size
"""Distance of the places tried: 2 samples at 48 kHz."""

FIRST_PLACE = DECIMATION * float(TURNS[0]) - CENTRE
"""Where the first of them lies, in samples at 48 kHz from the first one of the sound."""

ROW_HOP = ROWS_PER_FRAME * TURNS.size
"""Places tried per frame."""

PERIOD = FRAMES_PER_SUPERFRAME * ROW_HOP
"""Places of a superframe."""

PLACES = SLOT_FRAMES * ROW_HOP
"""Places that this completes."""

CLOCK_ERRORS_PPM = np.concatenate(
    [[0.0], *([-ppm, ppm] for ppm in np.arange(120.0, 1561.0, 120.0))]
)
"""Clock errors tried; between them the ends of a superframe are at most 0.9 samples off."""

EXACT_ERRORS_PPM = CLOCK_ERRORS_PPM[:5]
"""Those tried where the clock is thought to be right: clocks err by less than these 240 ppm."""

COARSE_ERRORS_PPM = CLOCK_ERRORS_PPM[CLOCK_ERRORS_PPM % 240 == 0]
"""Those tried about another speed: often and in less time rather than well."""

CLOCK_PENALTY, LARGEST_PENALTY = 0.05, 8.0
"""Correlation that a clock error must be worth, per ppm and at most: most programmes have none."""

DEVIATION = math.sqrt(0.5 * PILOTS_PER_FRAME * FRAMES_PER_SUPERFRAME)
"""Standard deviation of a score in unmarked sound."""

THRESHOLD = 4.8
"""Least score of a candidate in standard deviations of unmarked sound."""

FLOOR = np.float32(THRESHOLD * DEVIATION * PARTS)
"""The same as a score of the compiled loops."""

WEIGHTS = (0.66, 0.507)
"""Weights of the scores of a superframe summed with that of the one before, and of the two before:
they are as rare then in unmarked sound as a score by itself. With 2/3 and 1/2 music at another
tempo is found after 9 s instead of 3, and 8 of its superframes are lost."""


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


class PilotCorrelator:
    """Correlates soft values of pilots with those of all profiles.

    Parameters
    ----------
    key : int
        Seed of the layout.
    errors : ndarray of float64, shape (n,)
        Clock errors tried, ppm.
    speed : float
        Samples that come for one of the mark's own, if those errors are 0.

    Attributes
    ----------
    kept : int
        Places before a quantum that its superframes began at.
    oldest : int
        Places back to the oldest superframe whose score is added.
    first : int
        The first place of all, when silence stands before the first sample.
    """

    def __init__(self, key: int, errors: NDArray[np.float64], speed: float = 1.0) -> None:
        pilots, self._errors = make_pilots(key), errors
        self._slots = np.ascontiguousarray(pilots.slots.T)
        signs = np.ascontiguousarray(pilots.signs.transpose(2, 0, 1))
        self._masks = np.where(signs < 0, -1, 0).astype(np.int8)
        tiers = range(len(PILOT_STEPS))
        pairs = [(t, p.number) for t in tiers for p in PROFILES.values() if p.levels_of(t)]
        self.pairs = np.array(pairs, dtype=np.int64)
        frame = np.arange(FRAMES_PER_SUPERFRAME)
        middle = frame.reshape(-1, SEGMENT_FRAMES).mean(axis=1)
        # Another speed is heard as frames at other distances: within one it hardly counts.
        self._frames = np.round(speed * ROW_HOP * frame).astype(np.int64)
        self._lag = round(speed * PERIOD)
        drift = np.round(errors[:, np.newaxis] * 1e-6 * middle * ROW_HOP)
        slack = int(np.abs(drift).max())
        self._shift = np.ascontiguousarray(drift + slack, dtype=np.int64)
        penalty = np.minimum(CLOCK_PENALTY * np.abs(errors), LARGEST_PENALTY)
        self._penalty = np.round(PARTS * penalty).astype(np.int16)

        self._reach = 2 * np.arange(1, len(WEIGHTS) + 1)
        self.oldest = len(WEIGHTS) * self._lag + int(self._reach.max())
        span = int(self._frames[-1])
        self.kept, self.first = span + 2 * slack, -span - slack

    def find(
        self,
        soft: NDArray[np.int8],
        row: int,
        peaks: NDArray[np.int16],
        past: int,
        *,
        quanta: int = 1,
        alone: bool = False,
    ) -> tuple[int, float, int, int] | None:
        """Score the places of some quanta, one after another.

        Parameters
        ----------
        soft : ndarray of int8, shape (tiers, PILOT_SLOTS, rows)
            Soft values in `PARTS`, of which the places' own begin at `row`.
        row : int
            See there.
        peaks : ndarray of int16, shape (pairs, n)
            Scores of superframes by themselves; those of the quanta are written from `past` on.
        past : int
            See there.
        quanta : int
            How many there are.
        alone : bool
            Whether superframes count by themselves only.

        Returns
        -------
        tuple of (pair, score, place, clock error), or None
            The best one, if it is worth an attempt.
        """
        weights = np.array(() if alone else WEIGHTS, dtype=np.float32)
        score, pair, place, error = _search_kernels.correlate_pilots(
            soft, row - self.kept, quanta, PLACES, self._frames, self._slots, self._masks,
            self.pairs, self._shift, self._penalty, self._lag, weights, self._reach, peaks, past,
            FLOOR,
        )  # fmt: skip
        return None if place < 0 else (pair, float(score), place, error)

    def candidate(self, found: tuple[int, float, int, int], first: int) -> Candidate:
        """Make a candidate of a place that was found; the first one of the quanta is given."""
        n, score, place, error = found
        tier, profile = self.pairs[n]
        start = PLACE * (first + float(place)) + FIRST_PLACE
        return Candidate(
            start, float(self._errors[error]), int(profile), int(tier), score / (PARTS * DEVIATION)
        )


@lru_cache(maxsize=8)
def make_correlator(key: int, *, exact: bool = False, speed: float = 1.0) -> PilotCorrelator:
    """Return the correlator of a key, for all clocks or for such as are nearly right."""
    errors = CLOCK_ERRORS_PPM if speed == 1.0 else COARSE_ERRORS_PPM
    return PilotCorrelator(key, EXACT_ERRORS_PPM if exact else errors, speed)


def turns_of(phases: NDArray[np.float64] | None) -> NDArray[np.complex64]:
    """Factors of the slots at the places between rows, shape (TURNS.size, PILOT_SLOTS)."""
    angles = np.outer(TURNS, slot_frequencies())
    if phases is not None:
        cut = phases[FIRST_PILOT_BIN : FIRST_PILOT_BIN + PILOT_SLOTS * PILOT_BINS]
        angles = angles + cut.reshape(PILOT_SLOTS, -1).mean(axis=1)
    return np.asarray(np.exp(1j * angles), dtype=np.complex64)
