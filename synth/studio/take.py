"""Take a performance: the truth, the studio's measurements, and the intended score."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import Score
from synth.motion.measured.cuer import Performer
from synth.motion.rules.labels import Labels
from synth.studio.studio import Studio

_TAIL_S = 1.2
"""Seconds after the last key: the hand comes to rest."""

_FRAMES_AT_ONCE = 2000
"""Frames that are taken at once, for constant memory."""


@dataclass(frozen=True, slots=True)
class StudioTake:
    """One performance in the studio.

    Attributes
    ----------
    score : Score
        The performed score; time zero is the first frame.
    rate_hz : float
    truth : ndarray of float32, shape (T, 113, 3)
        Where the markers were, mm.
    observed : ndarray of float32, shape (T, 113, 3)
        Where the studio saw them; NaN where hidden.
    ghosts : ndarray of float32, shape (T, G, 3)
        Points that are no marker.
    labels : Labels
        The held key of each frame.
    """

    score: Score
    rate_hz: float
    truth: NDArray[np.float32]
    observed: NDArray[np.float32]
    ghosts: NDArray[np.float32]
    labels: Labels

    @property
    def visible(self) -> NDArray[np.bool_]:
        """Which markers were seen, shape (T, 113)."""
        return np.asarray(np.isfinite(self.observed[..., 0]))


def record(
    cuer: Performer, score: Score, *, studio: Studio | None = None, seed: int = 0
) -> StudioTake:
    """Return the take of `score` performed by `cuer`, with a moment of rest at the end.

    Parameters
    ----------
    cuer : Performer
        Her rate is the studio's.
    score : Score
    studio : Studio, optional
        Default: twelve cameras, noise, calibration error and short drop-outs.
    seed : int
        Of the studio's faults.
    """
    studio = studio or Studio()
    ends = [0.0, *(p.end for p in score.phones[-1:]), *(k.end for k in score.keys[-1:])]
    n_frames = int(np.ceil((max(ends) + _TAIL_S) * cuer.rate_hz))
    truth, seen = [], []
    # In pieces, for memory; the studio's faults depend on the whole take.
    for first in range(0, n_frames, _FRAMES_AT_ONCE):
        n = min(_FRAMES_AT_ONCE, n_frames - first)
        pose = cuer.pose(score, first / cuer.rate_hz, n)
        markers = cuer.body.markers(pose)
        truth.append(markers)
        seen.append(studio.seen(cuer.body, pose, markers))
    positions = np.concatenate(truth)
    rng = np.random.default_rng([seed, 71])
    observed, ghosts = studio.observe(positions, np.concatenate(seen), cuer.rate_hz, rng)
    return StudioTake(
        score,
        cuer.rate_hz,
        positions.astype(np.float32),
        observed,
        ghosts,
        cuer.labels(score, 0.0, n_frames),
    )
