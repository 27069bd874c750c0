"""Trajectories of recorded parameters: read at any time, warped, joined and smoothed."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
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
