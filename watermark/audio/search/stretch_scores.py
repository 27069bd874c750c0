"""What some seconds of sound say of all places where a superframe may begin, at any step and clock.

In: the sight of a stretch; out: soft values of pilots at all places, and the scores of the
superframes that lie whole in it. Cost: `hypotheses.COST_GAIN` for 1.45 s.
Specification: spec/audio-carrier.md, W35.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.search import _soft_kernels
from watermark.audio.search.acquire import (
    DEVIATION,
    PERIOD,
    PLACES,
    TURNS,
    Candidate,
    PilotCorrelator,
    make_correlator,
    turns_of,
)
from watermark.audio.search.pilot_scan import PARTS, Sight
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.profile import PILOT_SLOTS, PILOT_STEPS, SLOT_FRAMES


@dataclass(frozen=True, slots=True)
class StretchScores:
    """A stretch's scores of all places.

    Attributes
    ----------
    best : Candidate or None
        The likeliest place, if it is worth an attempt.
    peaks : ndarray of int16, shape (pairs, n)
        Scores of superframes by themselves.
    first : int
        Number of the first place of them, from the stretch's first sample on.
    correlator : PilotCorrelator
        That made them.
    """

    best: Candidate | None
    peaks: NDArray[np.int16]
    first: int
    correlator: PilotCorrelator

    def candidate(self, pair: int, place: int, significance: float) -> Candidate:
        """Make a candidate of a place, or the one after it, that evidence points to."""
        peaks = self.peaks[pair]
        near = [i for beside in (0, 1) for i in range(place + beside, peaks.size, PERIOD)]
        best = max(near, key=lambda i: int(peaks[i]))
        score = significance * PARTS * DEVIATION
        return self.correlator.candidate((pair, score, best, 0), self.first)


def higher_of_two(peaks: NDArray[np.int16]) -> NDArray[np.int16]:
    """Return the higher of each two neighbours, shape (pairs, n // 2): a peak is wider than one."""
    even = peaks[:, : peaks.shape[1] // 2 * 2]
    return np.asarray(np.maximum(even[:, ::2], even[:, 1::2]))


def pilot_places(key: int, seen: Sight, *, gain: float = 0.0) -> NDArray[np.int8]:
    """Soft values of pilots at all places of a stretch, in `PARTS`.

    Parameters
    ----------
    key : int
        Seed of the layout.
    seen : tuple of ndarray
        Projections of the stretch, see `see_stretch`.
    gain : float
        Gain over all steps, in doublings.

    Returns
    -------
    ndarray of int8, shape (tiers, PILOT_SLOTS, places)
        Places are `PLACE` samples apart, the first one is at `FIRST_PLACE`.
    """
    projections, alive = seen
    rows = alive.shape[1] * TURNS.size
    soft = np.empty((len(PILOT_STEPS), PILOT_SLOTS, rows), dtype=np.int8)
    dither = make_pilots(key).cells.dither.astype(np.float32)
    steps = (2.0**gain * np.array(PILOT_STEPS)).astype(np.float32)
    _soft_kernels.pilot_soft(projections, alive, turns_of(None), dither, steps, 0, soft)
    return soft


def search_stretch(
    key: int, seen: Sight, *, gain: float = 0.0, exact: bool = False, speed: float = 1.0
) -> StretchScores:
    """Score the superframes that lie whole in a stretch.

    Parameters
    ----------
    key : int
        Seed of the layout.
    seen : tuple of ndarray
        Projections, see `see_stretch`. Where the stretch is longer than two superframes, scores are
        summed as usual.
    gain : float
        Gain over all steps, in doublings.
    exact : bool
        Whether only clocks that are nearly right are tried.
    speed : float
        Samples that come for one of the mark's own where a clock is right: near 1, or looked at so.
    """
    correlator = make_correlator(key, exact=exact, speed=speed)
    soft = pilot_places(key, seen, gain=gain)
    rows, first = soft.shape[2], correlator.kept + correlator.first
    quanta = max((rows - correlator.kept) // PLACES, 0)
    # A stretch of one superframe has none before it.
    alone = rows - correlator.kept <= PERIOD + PLACES * SLOT_FRAMES // 2
    past = 0 if alone else correlator.oldest
    peaks = np.empty((len(correlator.pairs), past + quanta * PLACES), dtype=np.int16)
    peaks[:, :past] = 0
    found = correlator.find(soft, correlator.kept, peaks, past, quanta=quanta, alone=alone)
    best = None if found is None else correlator.candidate(found, first)
    return StretchScores(best, peaks[:, past:], first, correlator)
