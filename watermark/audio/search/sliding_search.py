"""The usual search: sound as it arrives, looked at once, at all places of its own pace.

In: samples at 12 kHz, 0.08 s at a time; out: the best candidate that they complete, and the sight
of the last seconds for hypotheses on the same sound. Specification: spec/audio-carrier.md, W35.
"""

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.audio.search import _soft_kernels
from watermark.audio.search.acquire import PLACES, TURNS, Candidate, make_correlator, turns_of
from watermark.audio.search.pilot_scan import DECIMATION, SEARCH_HOP, STRIDE, Sight, make_sight
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.profile import PILOT_SLOTS, PILOT_STEPS, SLOT_FRAMES

QUANTUM = SLOT_FRAMES * SEARCH_HOP
"""Samples that the search takes at once: 0.08 s."""

RECENT = 28
"""Quanta whose sight is remembered, 2.24 s, and for which there is room before the past is moved to
the front of its store."""


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
        self._sight, self._correlator = make_sight(key), make_correlator(key, exact=True)
        self._before = self._sight.silence
        self._turn = turns_of(phases)
        self._dither = make_pilots(key).cells.dither.astype(np.float32)
        self._steps = (scale * np.array(PILOT_STEPS)).astype(np.float32)
        pairs, oldest = len(self._correlator.pairs), self._correlator.oldest
        self._peaks = _Store((pairs,), oldest, np.int16)
        # Silence stands before the first sample: a superframe cut by the start is found too.
        self._soft = _Store((len(PILOT_STEPS), PILOT_SLOTS), self._correlator.kept, np.int8)
        self._sound = np.zeros(0, dtype=np.float32)
        self._count = 0
        self._recent: deque[Sight] = deque(maxlen=RECENT)

    @property
    def needed(self) -> int:
        """Samples to hand to `process` next."""
        return QUANTUM + 2 * SEARCH_HOP - STRIDE - self._sound.size

    def process(self, sound: NDArray[Any]) -> Candidate | None:
        """Take the next `needed` samples; return the best candidate that they complete."""
        self._sound = np.concatenate([self._sound, sound.astype(np.float32, copy=False)])
        projections, alive, self._before = self._sight.look(self._sound, self._before)
        self._sound = self._sound[QUANTUM:]
        row, past = self._soft.extend(), self._peaks.extend()
        _soft_kernels.pilot_soft(
            projections, alive, self._turn, self._dither, self._steps, row, self._soft.values
        )
        self._recent.append((projections, alive))
        found = self._correlator.find(self._soft.values, row, self._peaks.values, past)
        first = self._correlator.first + self._count * PLACES
        self._count += 1
        return None if found is None else self._correlator.candidate(found, first)

    def recent(self, count: int) -> tuple[float, Sight] | None:
        """Return what the last rows show, that many, and where they begin, if they are remembered.

        Places are samples at 48 kHz from the first one of the search.
        """
        quantum = PLACES // TURNS.size
        spare = len(self._recent) * quantum - count
        if spare < 0:
            return None
        needed = list(self._recent)[spare // quantum :]
        parts = (np.concatenate(part, axis=1) for part in zip(*needed, strict=True))
        # Compiled loops take contiguous arrays.
        projections, alive = (np.ascontiguousarray(part[:, spare % quantum :]) for part in parts)
        begin = self._count * quantum - count
        return DECIMATION * STRIDE * float(begin), (projections, alive)


class _Store:
    """Values of the places looked at last, with room for those of the next quantum.

    Parameters
    ----------
    shape : tuple of int
        Rows; places are the last axis.
    kept : int
        Places that are remembered, zero at first.
    kind : type
        Of the values.

    Attributes
    ----------
    values : ndarray, shape (*shape, places)
        The store.
    """

    def __init__(
        self, shape: tuple[int, ...], kept: int, kind: type[np.signedinteger[Any]]
    ) -> None:
        self.kept, self._end = kept, kept
        self.values = np.zeros((*shape, kept + RECENT * PLACES), dtype=kind)

    def extend(self) -> int:
        """Return where the next `PLACES` values are to be written, after those in memory."""
        if self._end + PLACES > self.values.shape[-1]:
            self.values[..., : self.kept] = self.values[..., self._end - self.kept : self._end]
            self._end = self.kept
        self._end += PLACES
        return self._end - PLACES
