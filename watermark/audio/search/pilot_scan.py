"""Pilots at every place where a frame may start: what both searches look at.

In: sound at 12 kHz; out: the complex projection of each pilot slot on its signs, for every fourth
sample. Pilots lie below 2.8 kHz, so that rate serves; what lies between two places is reached by
turning the phases of the slots. Specification: spec/audio-carrier.md, W13 to W15 and W35.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.audio.search import _pilot_kernels
from watermark.audio.signal.layout import Cells, make_pilots
from watermark.audio.signal.masking import CAP, COMPRESSION, GROWTH, REFERENCE, make_masker
from watermark.audio.signal.mdct import sliding_tables
from watermark.audio.signal.profile import FIRST_PILOT_BIN, FS, HOP, PILOT_BINS, PILOT_SLOTS

DECIMATION = 4
"""A search works at 48 kHz / 4."""

SEARCH_HOP = HOP // DECIMATION
"""Samples between frames at the search's rate."""

STRIDE = 4
"""Samples at the search's rate between transforms."""

ROWS_PER_FRAME = SEARCH_HOP // STRIDE
"""Transforms per frame."""

CENTRE = (DECIMATION - 1) / 2
"""A search frame's samples lie this much later than the mark's frame begins (48 kHz samples)."""

ROWS_AT_ONCE = 240
"""Transforms that slide on from one that is made anew: rounding errors do not grow beyond them."""

WIDTH = 32
"""Bins that a processor's vectors hold between them: tables go on with zeros to so many."""

PARTS = 7
"""Parts of a soft value of 1 in a search: the sum of a segment's 16 pilots fits 8 bits. Rounding
adds a three hundredth to the noise."""

SEGMENT_FRAMES = 8
"""Frames whose pilots are summed as if the clock were right: 3 samples off at the largest error."""

LOW_REACH = 6
"""Half the length of the impulse response that reads a search's sound, samples at its rate:
its band below 2.9 kHz is free of the sound above."""

DIGITS = 12
"""Binary digits of the mask's exponent: wrong by 5e-5, the mask by 1e-3 at full scale."""


def slot_frequencies() -> NDArray[np.float64]:
    """Centre of each pilot slot in radians per sample at the search's rate, shape (PILOT_SLOTS,).

    A slot is so narrow (400 Hz) that a delay of 1.5 samples turns its edges by 9 degrees more or
    less than its centre: one turn serves all its bins.
    """
    centre = FIRST_PILOT_BIN + PILOT_BINS * (np.arange(PILOT_SLOTS) + 0.5)
    return np.asarray(np.pi / SEARCH_HOP * centre)


class PilotScan:
    """Transforms sound, derives the mask and projects the slots.

    Parameters
    ----------
    key : int
        Seed of the layout.
    """

    def __init__(self, key: int) -> None:
        cells = make_pilots(key).cells
        masker = make_masker(cells.last_bin)
        self._edges = masker.edges
        bins = int(masker.edges[-1])
        width = -(-(bins + 1) // WIDTH) * WIDTH
        self._wave, self._turn = (
            np.pad(table, [*[(0, 0)] * (table.ndim - 1), (0, width - bins - 1)])
            for table in sliding_tables(SEARCH_HOP, bins, STRIDE)
        )
        # The scale of the mark's own transform, which sees DECIMATION times as many samples.
        self._signs = np.zeros(width, dtype=np.float32)
        self._signs[cells.first_bin : cells.last_bin] = (
            np.sqrt(DECIMATION / cells.bins) * cells.signs
        )
        self._scale = (DECIMATION / 2 / np.diff(masker.edges)).astype(np.float32)
        self._spread = masker.matrix.astype(np.float32)
        limits = CAP, masker.floor, REFERENCE, GROWTH, masker.floor * CAP
        self._limits = np.array(limits, dtype=np.float32)
        self._digits = np.array([int(COMPRESSION * 2**n) & 1 for n in range(1, DIGITS + 1)])
        self._parts = _parts(masker.edges, cells)

    @property
    def silence(self) -> NDArray[np.float32]:
        """Thresholds to start with, see `look`."""
        return np.zeros((self._edges.size - 1, ROWS_PER_FRAME), dtype=np.float32)

    def look(
        self, sound: NDArray[np.float32], before: NDArray[np.float32]
    ) -> tuple[NDArray[np.complex64], NDArray[np.float32], NDArray[np.float32]]:
        """Project frames.

        Parameters
        ----------
        sound : ndarray of float32, shape (n,)
            Samples at the search's rate.
        before : ndarray of float32, shape (bands, ROWS_PER_FRAME)
            Thresholds of the frames that start up to a hop earlier.

        Returns
        -------
        projections : ndarray of complex64, shape (PILOT_SLOTS, rows)
            In units of the mask.
        alive : ndarray of float32, shape (PILOT_SLOTS, rows)
            1, or 0 where a bin of the slot is silent.
        before : ndarray of float32, shape (bands, ROWS_PER_FRAME)
            For the next frames, of which the first starts `STRIDE` samples after these.
        """
        shape = PILOT_SLOTS, max((sound.size - 2 * SEARCH_HOP) // STRIDE + 1, 0)
        projections, alive = np.empty(shape, np.complex64), np.empty(shape, np.float32)
        last = before.copy()
        _pilot_kernels.look(
            sound, self._wave, self._turn, self._signs, self._edges, self._scale, self._parts,
            self._spread, self._digits, self._limits, last, projections, alive, ROWS_AT_ONCE,
        )  # fmt: skip
        return projections, alive, last


def _parts(edges: NDArray[np.int64], cells: Cells) -> NDArray[np.int64]:
    """Slot, band, first bin and end of each stretch that lies in one slot and one band."""
    parts = []
    for slot in range(cells.dither.size):
        first = cells.first_bin + slot * cells.bins
        for band in range(edges.size - 1):
            low, high = max(first, edges[band]), min(first + cells.bins, edges[band + 1])
            if low < high:
                parts.append((slot, band, low, high))
    return np.array(parts, dtype=np.int64)


@lru_cache(maxsize=4)
def make_sight(key: int) -> PilotScan:
    """Return the sight of a key: it has no state."""
    return PilotScan(key)


Sight = tuple[NDArray[np.complex64], NDArray[np.float32]]
"""Projections of pilot slots, (PILOT_SLOTS, rows), and which of them are alive."""


def see_stretch(key: int, sound: NDArray[Any]) -> Sight:
    """Project the slots of a sound at 12 kHz by itself, samples of shape (n,)."""
    sight = make_sight(key)
    return sight.look(sound.astype(np.float32, copy=False), sight.silence)[:2]


def rows_of(seconds: float) -> int:
    """Return the number of rows that lie whole in some sound."""
    return (int(seconds * FS / DECIMATION) - 2 * SEARCH_HOP) // STRIDE + 1
