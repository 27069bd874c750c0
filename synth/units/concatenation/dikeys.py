"""The dictionary of dikeys: the motion of hand, forearm and head from key to key.

In: keys with the times of their targets. Out: chosen dikeys of recordings. The cost of a dikey is
the distance between its wanted and recorded durations, the cost of a join the RMS distance of the
parameters across it, each weighted by the variance that it explains (Gibert, Bailly, Elisei 2004,
section 5.1).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from synth.units.concatenation.selection import select_units
from synth.units.concatenation.sounds import PlacedUnit
from synth.units.concatenation.trajectories import Trajectories
from synth.units.concatenation.units import Unit, cut_dikeys
from synth.units.recordings.recording import UnitRecording

_DURATION_WEIGHT = 4.0
"""Cost of one second of duration error, against one standard deviation of a join."""

_OTHER_FIRST_PLACEMENT = 3.0
"""Weight, against a second placement that is off, of a first one that is off: the motion starts
from elsewhere."""

_OTHER_SHAPE = 100.0
"""Cost in mm of another shape: more than any distance between placements, so that shapes are right
first."""


class DikeyDictionary:
    """All dikeys of some recordings.

    Parameters
    ----------
    recordings : sequence of UnitRecording
    trajectories : Trajectories
        Their hand, forearm and head parameters.
    weights : ndarray of float64, shape (columns,)
        Variance of the markers that one standard deviation of each parameter explains.

    Raises
    ------
    CueError
        If the recordings hold no gesture.
    """

    def __init__(
        self,
        recordings: Sequence[UnitRecording],
        trajectories: Trajectories,
        weights: NDArray[np.float64],
    ) -> None:
        self._units: list[Unit] = []
        recording: list[int] = []
        self._named: dict[tuple[str, ...], list[int]] = {}
        for number, item in enumerate(recordings):
            for unit in cut_dikeys(item.gestures):
                if unit.edges_s[-1] > unit.edges_s[0]:
                    self._named.setdefault(unit.label, []).append(len(self._units))
                    self._units.append(unit)
                    recording.append(number)
        if not self._units:
            raise CueError("the recordings hold no gesture of the hand")
        self._recording = np.array(recording)
        scale = np.sqrt(weights / weights.sum()) / np.maximum(trajectories.deviation, 1e-9)
        starts = np.array([u.edges_s[0] for u in self._units])
        ends = np.array([u.edges_s[-1] for u in self._units])
        self._duration = ends - starts
        self._onset = trajectories.at(self._recording, starts) * scale
        self._final = trajectories.at(self._recording, ends) * scale
        self._placement_distance = self._measure_placements()

    def __len__(self) -> int:
        """Return the number of dikeys."""
        return len(self._units)

    @property
    def names(self) -> frozenset[tuple[str, ...]]:
        """Labels with at least one dikey."""
        return frozenset(self._named)

    def select(self, targets: Sequence[Unit]) -> list[PlacedUnit]:
        """Choose a dikey for each target.

        A dikey that is missing is replaced by one whose second placement is the closest to the
        wanted one; failing that, the first placement is replaced as well, at last the shapes.
        """
        candidates, costs = [], []
        for target in targets:
            units, penalty = self._candidates(target.label)
            error = np.abs(self._duration[units] - target.parts_s[0])
            candidates.append(units)
            costs.append(_DURATION_WEIGHT * error + penalty)
        chosen = select_units(candidates, costs, self._join_cost)
        return [
            PlacedUnit(int(self._recording[u]), self._units[u], target)
            for u, target in zip(chosen.tolist(), targets, strict=True)
        ]

    def _candidates(self, label: tuple[str, ...]) -> tuple[NDArray[np.int64], float]:
        """Return the dikeys of `label`, or of the closest there is, and the cost of that."""
        if label in self._named:
            return np.array(self._named[label]), 0.0
        best, name = min((self._replacement_cost(name, label), name) for name in self._named)
        return np.array(self._named[name]), best

    def _replacement_cost(self, name: tuple[str, ...], label: tuple[str, ...]) -> float:
        cost = self._distance(name[1][0], label[1][0])
        cost += _OTHER_FIRST_PLACEMENT * self._distance(name[0][0], label[0][0])
        other_shapes = sum(a[1] != b[1] for a, b in zip(name, label, strict=True))
        return cost + _OTHER_SHAPE * other_shapes

    def _distance(self, a: str, b: str) -> float:
        if a == b:
            return 0.0
        return self._placement_distance.get((a, b), float(_OTHER_SHAPE))

    def _measure_placements(self) -> dict[tuple[str, str], float]:
        """Return the distance of every two placements' mean target frames."""
        rows: dict[str, list[int]] = {}
        for number, unit in enumerate(self._units):
            rows.setdefault(unit.label[1][0], []).append(number)
        means = {placement: self._final[r].mean(axis=0) for placement, r in rows.items()}
        return {(a, b): float(np.linalg.norm(means[a] - means[b])) for a in means for b in means}

    def _join_cost(
        self, before: NDArray[np.int64], after: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        difference = self._final[before][:, None] - self._onset[after][None]
        return np.asarray(np.sqrt((difference**2).sum(axis=2)))
