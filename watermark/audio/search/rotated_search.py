"""Acquisition that is blind to phase: pilots whose bands were turned each by its own angle.

In: the sight of some seconds of sound and the steps that pilots may have; out: the likeliest places
with a phase for each pilot slot. Each slot is correlated at all phases, and its best one counts: of
six slots, noise gains less by that than turned pilots do.
Specification: spec/audio-carrier.md, W41.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.search import _search_kernels
from watermark.audio.search.evidence import Evidence
from watermark.audio.search.pilot_scan import CENTRE, DECIMATION, ROWS_PER_FRAME, STRIDE, Sight
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, PROFILES

TURNS = 8
"""Phases of a slot that are tried."""

LEAST_SIGNIFICANCE = 5.5
"""Least standard deviations above the mean of all places that are worth an attempt: with 6 a voice
behind a crossover is found after 18 s instead of 7."""

ROW = DECIMATION * STRIDE
"""Samples at 48 kHz between two places."""

PERIOD = FRAMES_PER_SUPERFRAME * ROWS_PER_FRAME
"""Places of a superframe."""

PAIR = float(np.sqrt(0.5))
"""Weight of the scores of two superframes in a row: their sum is as rare then as one by itself."""


@dataclass(frozen=True, slots=True)
class RotatedCandidate:
    """A place where a superframe may start, with its bands turned.

    Attributes
    ----------
    start : float
        Relative to the first sample searched, in samples at 48 kHz.
    profile : int
        Number of the profile that the pilots announce.
    step : float
        Quantiser step that the pilots have.
    significance : float
        Standard deviations above the mean of all places.
    """

    start: float
    profile: int
    step: float
    significance: float


class RotatedSearch:
    """Search of a stretch for pilots of any profile at any phase."""

    def __init__(self, key: int) -> None:
        pilots = make_pilots(key)
        self._slots = np.ascontiguousarray(pilots.slots.T)
        self._signs = np.ascontiguousarray(pilots.signs.transpose(2, 0, 1), dtype=np.int16)
        self._dither = pilots.cells.dither.astype(np.float32)
        angle = 2 * np.pi * np.arange(TURNS) / TURNS
        self._turn = np.exp(1j * angle).astype(np.complex64)

    def find(
        self, seen: Sight, steps: tuple[float, ...], evidence: Evidence, first: float
    ) -> list[RotatedCandidate]:
        """Likeliest places of pilots of some steps: in a stretch, and by all stretches so far.

        Parameters
        ----------
        seen : tuple of ndarray
            The sight of two superframes at least.
        steps : tuple of float
            Tried.
        evidence : Evidence
            Of the stretches before, of the same steps; this one is added.
        first : float
            Samples of the mark before this stretch.
        """
        projections, alive = seen
        places = projections.shape[1] - (FRAMES_PER_SUPERFRAME - 1) * ROWS_PER_FRAME
        if places < PERIOD:
            return []
        scores = np.concatenate([self._scores(projections, alive, step) for step in steps])
        # Pilots repeat after a period: the mean of both is compared with a single one on one scale.
        paired = scores.copy()
        pairs = PAIR * (scores[:, :-PERIOD] + scores[:, PERIOD:])
        paired[:, :-PERIOD] = np.maximum(scores[:, :-PERIOD], pairs)
        row, place = divmod(int(paired.argmax()), places)
        likely = [(row, place, float(paired[row, place]))]
        # Evidence of earlier stretches is kept by place modulo the period; the best repetition in
        # this stretch is where reading begins.
        row, place, significance = evidence.add(scores, round(first / ROW), PERIOD)
        place = max(range(place, places, PERIOD), key=lambda i: float(scores[row, i]))
        if (row, place) != likely[0][:2]:
            likely.append((row, place, significance))
        return [
            RotatedCandidate(
                ROW * float(place) - CENTRE, row % len(PROFILES), steps[row // len(PROFILES)], found
            )
            for row, place, found in likely
            if found > LEAST_SIGNIFICANCE
        ]

    def _scores(
        self, projections: NDArray[np.complex64], alive: NDArray[np.float32], step: float
    ) -> NDArray[np.float32]:
        """Deviations of all places from their mean for pilots of one step, by profile."""
        places = projections.shape[1] - (FRAMES_PER_SUPERFRAME - 1) * ROWS_PER_FRAME
        sums = np.empty((len(PROFILES), places), dtype=np.int16)
        _search_kernels.turned_scores(
            projections, alive, self._dither, np.float32(1 / step),
            self._turn, ROWS_PER_FRAME, self._slots, self._signs, sums,
        )  # fmt: skip
        score = sums.astype(np.float32)
        score -= score.mean(axis=1, keepdims=True)
        score /= score.std(axis=1, keepdims=True) + np.float32(1e-9)
        return score
