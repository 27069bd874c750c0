"""Acquisition that is blind to phase: pilots whose bands were turned each by its own angle.

In: some seconds of the search's sound and the steps that pilots may have; out: the likeliest places
with a phase for each pilot slot. Each slot is correlated at all phases, and its best one counts: of
six slots, noise gains less by that than turned pilots do. Specification: section 7.1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.acquire import CENTRE, DECIMATION, SEARCH_HOP
from watermark.audio.layout import make_pilots
from watermark.audio.masking import make_masker
from watermark.audio.mdct import analyse
from watermark.audio.profile import FRAMES_PER_SUPERFRAME, PILOT_SLOTS, PROFILES

TURNS = 12
"""Phases of a slot that are tried."""

STRIDE = 4
"""Samples at the search's rate between places: a phase makes up for what lies between."""

ROW_HOP = SEARCH_HOP // STRIDE
"""Places tried per frame."""

LEAST_SIGNIFICANCE = 5.5
"""Standard deviations above the mean of all places from which one is worth an attempt."""

PAIR = float(np.sqrt(0.5))
"""Weight of the scores of two superframes in a row: their sum is as rare then as one by itself."""


@dataclass(frozen=True, slots=True)
class TurnedCandidate:
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


class TurnedSearch:
    """Search of a stretch for pilots of any profile at any phase."""

    def __init__(self, key: int) -> None:
        pilots = make_pilots(key)
        self._slots = np.ascontiguousarray(pilots.slots.T)
        self._signs = np.ascontiguousarray(pilots.signs.transpose(2, 0, 1), dtype=np.float32)
        self._cells = pilots.cells
        self._masker = make_masker(pilots.cells.last_bin)
        bins = int(self._masker.edges[-1])
        transform = np.sqrt(DECIMATION) * analyse(np.eye(2 * SEARCH_HOP), SEARCH_HOP)[:, :bins]
        parts = np.concatenate([transform.real, transform.imag], axis=1)
        self._transform = np.ascontiguousarray(parts, dtype=np.float32)
        angle = 2 * np.pi * np.arange(TURNS) / TURNS
        self._turn = np.exp(1j * angle).astype(np.complex64)

    def find(self, sound: NDArray[np.float64], steps: tuple[float, ...]) -> TurnedCandidate | None:
        """Likeliest place in `sound`, samples at 12 kHz, of pilots that have one of `steps`."""
        from watermark.audio import _kernels

        projections, alive = self._project(sound)
        places = projections.shape[1] - (FRAMES_PER_SUPERFRAME - 1) * ROW_HOP
        if places < ROW_HOP:
            return None
        best: TurnedCandidate | None = None
        score = np.empty((len(PROFILES), places), dtype=np.float32)
        for step in steps:
            _kernels.turned_scores(
                projections, alive, self._cells.dither.astype(np.float32), np.float32(1 / step),
                self._turn, ROW_HOP, self._slots, self._signs, score,
            )  # fmt: skip
            score -= score.mean(axis=1, keepdims=True)
            score /= score.std(axis=1, keepdims=True) + 1e-9
            period = FRAMES_PER_SUPERFRAME * ROW_HOP
            if places > period:
                pairs = PAIR * (score[:, :-period] + score[:, period:])
                score[:, :-period] = np.maximum(score[:, :-period], pairs)
            profile, place = np.unravel_index(int(score.argmax()), score.shape)
            significance = float(score[profile, place])
            if significance > (LEAST_SIGNIFICANCE if best is None else best.significance):
                start = DECIMATION * STRIDE * float(place) - CENTRE
                best = TurnedCandidate(start, int(profile), float(step), significance)
        return best

    def _project(
        self, sound: NDArray[np.float64]
    ) -> tuple[NDArray[np.complex64], NDArray[np.float32]]:
        """Projection of each slot on its signs for every start of a frame, and whether it lives.

        Both have the shape (PILOT_SLOTS, rows).
        """
        frames = np.lib.stride_tricks.sliding_window_view(sound.astype(np.float32), 2 * SEARCH_HOP)
        parts = np.ascontiguousarray(frames[::STRIDE]) @ self._transform
        bins = parts.shape[1] // 2
        spectra = parts[:, :bins] + 1j * parts[:, bins:]
        threshold = self._masker.thresholds(np.abs(spectra) ** 2 / 2)
        before = np.concatenate([threshold[:ROW_HOP], threshold])[: len(threshold)]
        cells = self._cells
        cut = slice(cells.first_bin, cells.last_bin)
        unit = self._masker.amplitudes(threshold, before)[:, cut]
        dead = unit <= 0
        terms = np.where(dead, 0.0, spectra[:, cut] * cells.signs) / np.where(dead, 1.0, unit)
        shape = (len(unit), PILOT_SLOTS, cells.bins)
        projections = terms.reshape(shape).sum(axis=2) / np.sqrt(cells.bins)
        alive = ~dead.reshape(shape).any(axis=2)
        return (
            np.ascontiguousarray(projections.T, dtype=np.complex64),
            np.ascontiguousarray(alive.T, dtype=np.float32),
        )
