"""Phases that the way of the sound has turned, band by band, and how to turn them back.

In: a superframe's spectra and its known cells; out: one phase per band. A crossover, a
phase rotator or an inverted polarity leaves magnitudes as they are, and with them the mask, but
turns the projections. Known cells (pilots, decoded bits) give the phase of a band by the soft
values that they should have; unknown ones by the second harmonic, in which both bits agree. A path
through the bands joins both. Sources: blind phase recovery by the M-th power, Viterbi and Viterbi,
IEEE Trans. IT 29(4), 1983; the path by the algorithm of Viterbi, IEEE Trans. IT 13(2), 1967.
Specification: spec/audio-carrier.md, W41.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow import _kernels
from watermark.audio.follow.align import SuperframeView
from watermark.audio.signal.layout import Cells
from watermark.audio.signal.profile import FIRST_PILOT_BIN, HOP, PILOT_BINS

PHASES = 12
"""Phases tried of each band."""

BEND = 6.0
"""Score that a turn by one step from a band to the next must be worth; four for two steps."""

BLIND_TRUST = 0.5
"""Weight of the second harmonic's score beside that of known cells."""

LARGEST_BEND = 3
"""Steps of phase between neighbours beyond which a turn costs no more."""

DELAYS = np.arange(-24.0, 24.1, 1.5)
"""Delays in samples tried beneath a path of phases, which then may bend less."""

DELAY_COST = 0.2
"""Score that a sample of delay must be worth."""

MEMORY = 0.8
"""Weight of the past when a decoded superframe is learnt."""

GAIN = 1.1
"""Agreement that turned phases must bring, in units of that of plain ones, to be used first."""

Table = NDArray[np.float64]
"""Scores of each band and phase, shape (bands, PHASES)."""


@dataclass(frozen=True, slots=True)
class KnownCells:
    """Cells of one kind in a superframe.

    Attributes
    ----------
    cells : Cells
        Where they lie.
    step : float
        Their quantiser step.
    expected : ndarray of float64, shape (64, groups), or None
        Soft values that they should have, 0 where unknown; None if nothing is known of any.
    """

    cells: Cells
    step: float
    expected: NDArray[np.float64] | None


def band_of(cells: Cells) -> NDArray[np.int64]:
    """Band of each cell, shape (groups,): pilot slots are the first bands."""
    first = cells.first_bin + cells.bins * np.arange(cells.dither.size)
    return np.asarray(np.maximum((first - FIRST_PILOT_BIN) // PILOT_BINS, 0))


def score_phases(view: SuperframeView, known: KnownCells, bands: int) -> Table:
    """Score every phase of every band by the cells that lie in it."""
    cells = known.cells
    # Where bits are unknown, the doubled phase counts: it is the same for both values.
    harmonic = 2 if known.expected is None else 1
    shape = len(view.spectra), cells.dither.size
    weight = np.full(shape, BLIND_TRUST) if known.expected is None else known.expected
    projections = np.empty(shape, dtype=np.complex128)
    _kernels.project_phases(
        np.asarray(view.spectra, dtype=np.complex64),
        np.asarray(view.amplitudes, dtype=np.float32),
        cells.signs,
        cells.first_bin,
        1 / (known.step * np.sqrt(cells.bins)),
        projections,
    )
    table, turns = np.zeros((bands, PHASES)), np.exp(2j * np.pi * np.arange(PHASES) / PHASES)
    _kernels.phase_scores(
        projections,
        np.asarray(weight, dtype=np.float64),
        cells.dither,
        band_of(cells),
        harmonic,
        turns,
        table,
    )
    return table


def path_of(
    table: Table, delays: NDArray[np.float64] = DELAYS
) -> tuple[float, float, NDArray[np.float64]]:
    """Best path of phases through the bands, beneath it one of some delays.

    Returns
    -------
    score : float
    delay : float
        Samples at 48 kHz by which all bands come later.
    phases : ndarray of float64, shape (bands,)
        What each band was turned by beside that, radians.
    """
    steps, bands = np.arange(PHASES), len(table)
    distance = (steps[:, np.newaxis] - steps + PHASES // 2) % PHASES - PHASES // 2
    cost = BEND * np.minimum(distance.astype(np.float64) ** 2, LARGEST_BEND**2)
    turn = np.outer(delays, lean(1.0, bands)) * PHASES / (2 * np.pi)
    at = (steps + np.round(turn).astype(np.int64)[:, :, np.newaxis]) % PHASES
    leant = np.take_along_axis(table[np.newaxis], at, axis=2)
    totals = [leant[:, 0]]
    for band in range(1, bands):
        totals.append(leant[:, band] + (totals[-1][:, np.newaxis, :] - cost).max(axis=2))
    score = totals[-1].max(axis=1) - DELAY_COST * np.abs(delays)
    i = int(score.argmax())
    path = [int(totals[-1][i].argmax())]
    # Where the best path came from is looked for along it only.
    for total in reversed(totals[:-1]):
        path.append(int((total[i] - cost[path[-1]]).argmax()))
    return float(score[i]), float(delays[i]), 2 * np.pi / PHASES * np.array(path[::-1])


def lean(delay: float, bands: int) -> NDArray[np.float64]:
    """Phases of the bands for a delay in samples at 48 kHz, shape (bands,)."""
    centre = FIRST_PILOT_BIN + PILOT_BINS * (np.arange(bands) + 0.5)
    return np.asarray(delay * np.pi / HOP * centre)


def to_bins(phases: NDArray[np.float64]) -> NDArray[np.float64]:
    """Phase of each bin, shape (HOP,), between those of the bands, shape (bands,)."""
    centre = FIRST_PILOT_BIN + PILOT_BINS * (np.arange(phases.size) + 0.5) - 0.5
    return np.interp(np.arange(HOP), centre, np.unwrap(phases))


class Equaliser:
    """Follows the phases of a programme by its decoded superframes.

    Parameters
    ----------
    bands : int
        Bands of the profile, see `band_of`.
    phases : ndarray of float64, shape (bands,), optional
        Phases at the start; without, they are taken to be right.

    Attributes
    ----------
    used : bool
        Whether turning back serves better than leaving phases alone.
    """

    def __init__(self, bands: int, phases: NDArray[np.float64] | None = None) -> None:
        self._table = np.zeros((bands, PHASES))
        self._phases = np.zeros(bands) if phases is None else phases
        self.used = phases is not None

    @property
    def bins(self) -> NDArray[np.float64]:
        """Phase to add to each bin, shape (HOP,)."""
        return to_bins(self._phases)

    @property
    def turned(self) -> bool:
        """Whether any band is turned by more than one step."""
        return bool((np.cos(self._phases) < np.cos(2 * np.pi / PHASES)).any())

    def learn(self, view: SuperframeView, known: KnownCells) -> None:
        """Take a decoded superframe, read with its phases as they came."""
        table = score_phases(view, known, len(self._table))
        if table.max(axis=1).sum() < GAIN * table[:, 0].sum() and not self.used:
            self._table, self._phases = MEMORY * self._table + table, np.zeros(len(table))
            return
        # Phases are tried on the very superframe that gave them only where there were none before.
        old = self._phases if self._phases.any() else None
        self._table = MEMORY * self._table + table
        path = path_of(self._table, np.zeros(1))[2]
        self._phases = path + 2 * np.pi / PHASES * _between(self._table, path)
        self.used = _along(table, path if old is None else old) > GAIN * table[:, 0].sum()


def _along(table: Table, phases: NDArray[np.float64]) -> float:
    """Sum the scores of the bands at their nearest phases."""
    at = np.round(phases * PHASES / (2 * np.pi)).astype(np.int64) % PHASES
    return float(np.take_along_axis(table, at[:, np.newaxis], axis=1).sum())


def _between(table: Table, path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Find the distance of each maximum from its phase in steps, by a parabola; -0.5 to 0.5."""
    at = np.round(path * PHASES / (2 * np.pi)).astype(np.int64)
    row = np.arange(len(table))
    below, top, above = (table[row, (at + d) % PHASES] for d in (-1, 0, 1))
    curvature = below - 2 * top + above
    bent = np.where(curvature < 0, curvature, -np.inf)
    return np.asarray(np.clip(0.5 * (below - above) / bent, -0.5, 0.5))
