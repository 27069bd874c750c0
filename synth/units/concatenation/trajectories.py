"""Trajectories of recorded parameters: read at any time, warped, joined and smoothed.

Joins are calmed: none is quicker than the speaker ever moves.
"""

import itertools
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.errors import CueError


class Trajectories:
    """The motions of many recordings, to be read at any time of any of them.

    Parameters
    ----------
    motions : sequence of Motion
        All of one voice, layout and rate.
    columns : sequence of int
        The parameters wanted.

    Raises
    ------
    CueError
        If there is none, or they do not belong together.
    """

    def __init__(self, motions: Sequence[Motion], columns: Sequence[int]) -> None:
        if not motions:
            raise CueError("no recording to take motion from")
        for before, after in itertools.pairwise(motions):
            same = (before.voice, before.layout, before.rate_hz)
            if same != (after.voice, after.layout, after.rate_hz):
                raise CueError("recordings differ in voice, layout or rate")
        if min(len(m.params) for m in motions) == 0:
            raise CueError("a recording holds no motion")
        self.layout = motions[0].layout
        self.voice = motions[0].voice
        self.rate_hz = motions[0].rate_hz
        self.columns = np.asarray(columns, dtype=np.int64)
        lengths = np.array([len(m.params) for m in motions])
        self._last = lengths - 1
        self._first = np.concatenate(([0], np.cumsum(lengths)[:-1]))
        self._start_s = np.array([m.start_s for m in motions])
        self._values = np.concatenate([m.params[:, self.columns] for m in motions])
        self._values = self._values.astype(np.float64)

    @property
    def deviation(self) -> NDArray[np.float64]:
        """Standard deviation of every parameter wanted, shape (columns,)."""
        return np.asarray(self._values.std(axis=0))

    def at(self, recording: NDArray[np.int64], time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters, shape (n, columns), at `time_s` of the recordings, both (n,).

        Linear between frames, constant beyond a recording's ends.
        """
        frame = (time_s - self._start_s[recording]) * self.rate_hz
        frame = np.clip(frame, 0.0, self._last[recording])
        low = np.minimum(np.floor(frame).astype(np.int64), np.maximum(self._last[recording] - 1, 0))
        part = (frame - low)[:, None]
        row = self._first[recording] + low
        above = np.minimum(row + 1, len(self._values) - 1)
        values: NDArray[np.float64] = self._values[row] * (1 - part) + self._values[above] * part
        return values


def join_trajectories(
    source: Trajectories,
    recording: NDArray[np.int64],
    source_edges_s: Sequence[Sequence[float]],
    target_edges_s: Sequence[Sequence[float]],
    times_s: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Warp and join the trajectories of a sequence of units, and smooth the joins.

    Parameters
    ----------
    source : Trajectories
    recording : ndarray of int64, shape (U,)
        Recording of each unit.
    source_edges_s, target_edges_s : sequence of sequence of float
        Edges of each unit where it was recorded and where it goes, equally many, ascending. Time
        between two units belongs to neither: the first one's end is held.
    times_s : ndarray of float64, shape (T,)
        Ascending.

    Returns
    -------
    ndarray of float64, shape (T, columns)

    Notes
    -----
    Anticipatory smoothing (Gibert, Bailly, Elisei 2004, section 5.1): the jump from the end of a
    unit to the onset of the next one is spread linearly over the unit before the join, so that
    every unit aims at the onset of its successor.
    """
    units = len(recording)
    starts = np.array([edges[0] for edges in target_edges_s])
    ends = np.array([edges[-1] for edges in target_edges_s])
    onset = source.at(recording, np.array([edges[0] for edges in source_edges_s]))
    final = source.at(recording, np.array([edges[-1] for edges in source_edges_s]))
    jump = np.zeros_like(final)
    jump[:-1] = onset[1:] - final[:-1]
    unit = np.clip(np.searchsorted(starts, times_s, side="right") - 1, 0, units - 1)
    inside = np.clip(times_s, starts[unit], ends[unit])
    at = np.zeros(len(times_s))
    for u in np.unique(unit):
        rows = unit == u
        at[rows] = np.interp(inside[rows], target_edges_s[u], source_edges_s[u])
    length = np.maximum(ends - starts, 1e-9)
    part = ((inside - starts[unit]) / length[unit])[:, None]
    values: NDArray[np.float64] = source.at(recording[unit], at) + part * jump[unit]
    return values


SPEED_PERCENTILE = 99.9
"""Percentile of recorded speeds above which a join is too quick."""

_WIDTH_S = 0.03
"""Standard deviation in seconds of one round of smoothing."""

_REACH_S = 0.05
"""Seconds about a join that a round reaches."""

_ROUNDS = 12
"""Rounds at most; movements that are too quick after them stay."""

_EVERY = 32
"""Stride in frames of measuring how quick a speaker is."""


def quickest(motions: Iterable[Motion], voice: Voice) -> float:
    """Return the speed in mm/s that 99.9 % of all markers stay below, from one frame in 32."""
    speeds = []
    for motion in motions:
        first = np.arange(0, len(motion.params) - 1, _EVERY)
        if len(first):
            markers = voice.reconstruct(motion.params[np.ravel([first, first + 1])])
            steps = markers[len(first) :] - markers[: len(first)]
            speeds.append(_lengths(steps).ravel() * motion.rate_hz)
    return float(np.percentile(np.concatenate(speeds), SPEED_PERCENTILE)) if speeds else np.inf


def calm_joins(
    params: NDArray[np.float64],
    columns: list[int],
    joins: NDArray[np.int64],
    voice: Voice,
    *,
    limit_mm_s: float,
    rate_hz: float,
) -> NDArray[np.float64]:
    """Return the parameters with the joins that exceed a speed smoothed more widely.

    Parameters
    ----------
    params : ndarray of float64, shape (T, P)
    columns : list of int
        The parameters that may change.
    joins : ndarray of int64, shape (J,)
        Frames of the joins; those outside 1..T - 2 are left alone.
    voice : Voice
        Tells the markers of `params`.
    limit_mm_s : float
        Of every marker, as `quickest` finds it.
    rate_hz : float
    """
    joins = joins[(joins >= 1) & (joins < len(params) - 1)]
    out = np.array(params)
    frames = np.arange(len(params))
    for _ in range(_ROUNDS):
        around = out[joins[:, None] + (-1, 0, 1)].reshape(-1, out.shape[1])
        markers = voice.reconstruct(around).reshape(len(joins), 3, -1, 3)
        speed = _lengths(np.diff(markers, axis=1)).max((1, 2), initial=0.0) * rate_hz
        joins = joins[speed > limit_mm_s]
        if not len(joins):
            break
        away = np.abs(frames - joins[:, None]).min(0) / (_REACH_S * rate_hz)
        part = np.exp(-0.5 * away**2)[:, None]
        wide = gaussian_filter1d(out[:, columns], _WIDTH_S * rate_hz, axis=0, mode="nearest")
        out[:, columns] += part * (wide - out[:, columns])
    return out


def _lengths(steps: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(steps, axis=-1), dtype=np.float64)
