"""Pilots at every place where a frame may start: what both searches look at.

In: sound at 12 kHz; out: the complex projection of each pilot slot on its signs, for every fourth
sample. Pilots lie below 2.8 kHz, so that rate serves; what lies between two places is reached by
turning the phases of the slots. Specification: sections 4.2 and 7.1.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from watermark.audio.layout import make_pilots
from watermark.audio.masking import make_masker
from watermark.audio.mdct import analyse
from watermark.audio.profile import FIRST_PILOT_BIN, HOP, PILOT_BINS, PILOT_SLOTS

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
"""Transforms made together: what they need stays in the processor's cache."""


def slot_frequencies() -> NDArray[np.float64]:
    """Centre of each pilot slot in radians per sample at the search's rate, shape (PILOT_SLOTS,).

    A slot is so narrow (400 Hz) that a delay of 1.5 samples turns its edges by 9 degrees more or
    less than its centre: one turn serves all its bins.
    """
    centre = FIRST_PILOT_BIN + PILOT_BINS * (np.arange(PILOT_SLOTS) + 0.5)
    return np.asarray(np.pi / SEARCH_HOP * centre)


class PilotSight:
    """Transforms sound, derives the mask and projects the slots.

    Parameters
    ----------
    key : int
        Seed of the layout.
    """

    def __init__(self, key: int) -> None:
        self._cells = make_pilots(key).cells
        self._masker = make_masker(self._cells.last_bin)
        self._signs = (np.sqrt(DECIMATION) * self._cells.signs).astype(np.float32)

    @property
    def silence(self) -> NDArray[np.float32]:
        """Thresholds to start with, see `look`."""
        return np.zeros((ROWS_PER_FRAME, self._masker.edges.size - 1), dtype=np.float32)

    def look(
        self, sound: NDArray[np.float32], before: NDArray[np.float32]
    ) -> tuple[NDArray[np.complex64], NDArray[np.float32], NDArray[np.float32]]:
        """Project frames.

        Parameters
        ----------
        sound : ndarray of float32, shape (n,)
            Samples at the search's rate.
        before : ndarray of float32, shape (ROWS_PER_FRAME, bands)
            Thresholds of the frames that start up to a hop earlier.

        Returns
        -------
        projections : ndarray of complex64, shape (PILOT_SLOTS, rows)
            In units of the mask.
        alive : ndarray of float32, shape (PILOT_SLOTS, rows)
            1, or 0 where a bin of the slot is silent.
        before : ndarray of float32, shape (ROWS_PER_FRAME, bands)
            For the next frames, of which the first starts `STRIDE` samples after these.
        """
        frames = np.lib.stride_tricks.sliding_window_view(sound, 2 * SEARCH_HOP)[::STRIDE]
        shape = PILOT_SLOTS, len(frames)
        projections, alive = np.empty(shape, np.complex64), np.empty(shape, np.float32)
        for i in range(0, len(frames), ROWS_AT_ONCE):
            part = slice(i, i + ROWS_AT_ONCE)
            before = self._project(frames[part], before, projections[:, part], alive[:, part])
        return projections, alive, before

    def _project(
        self,
        frames: NDArray[np.float32],
        before: NDArray[np.float32],
        projections: NDArray[np.complex64],
        alive: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        """Fill in what some frames give; return the last thresholds."""
        from watermark.audio import _kernels

        spectra = analyse(frames, SEARCH_HOP, int(self._masker.edges[-1]))
        # The scale of the mark's own transform, which sees DECIMATION times as many samples.
        power = (DECIMATION / 2) * (spectra.real**2 + spectra.imag**2)
        threshold = self._masker.thresholds(power)
        earlier = np.concatenate([before, threshold])
        units = self._masker.amplitudes(threshold, earlier[: len(threshold)]).astype(np.float32)
        _kernels.pilot_projections(
            spectra, units, self._cells.first_bin, self._signs, projections, alive
        )
        return np.asarray(earlier[len(threshold) :])


@lru_cache(maxsize=4)
def make_sight(key: int) -> PilotSight:
    """Return the sight of a key: it has no state."""
    return PilotSight(key)
