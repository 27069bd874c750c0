"""The dictionary of polysounds and diphones: the sound of speech and the motion of the face.

In: phones with times. Out: chosen units of recordings. Selection by dynamic programming: the cost
of a unit is the RMS distance between wanted and recorded durations of its parts, the cost of a
join the RMS distance of the line spectrum pairs across it (Gibert, Bailly, Elisei 2004,
section 5.1).
"""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, VOWELS
from codec.errors import CueError
from synth.units.concatenation.selection import select_units
from synth.units.concatenation.units import Unit, cut_sounds, split_polysound, with_pauses
from synth.units.recordings.recording import UnitRecording
from synth.units.speech.lsp import line_spectrum_pairs, linear_prediction

_LSP_ORDER = 16
"""Line spectrum pairs of a frame: enough for the formants up to 8 kHz."""

_LSP_FRAME_S = 0.025
"""Length of a frame in seconds: two periods of a low voice."""

_DURATION_WEIGHT = 10.0
"""Cost of one second of duration error, against one radian of spectral distance."""

_SUBSTITUTE_COST = 0.5
"""Weight of a substitute's phonetic distance against the error of duration."""

_FEATURES = {
    # height, backness, rounding, nasality of vowels
    "i": (0, 0, 0, 0), "e": (1, 0, 0, 0), "ɛ": (2, 0, 0, 0), "a": (3, 1, 0, 0), "ɑ": (3, 2, 0, 0),
    "y": (0, 0, 1, 0), "ø": (1, 0, 1, 0), "œ": (2, 0, 1, 0), "ə": (2, 1, 1, 0), "u": (0, 2, 1, 0),
    "o": (1, 2, 1, 0), "ɔ": (2, 2, 1, 0), "ɛ̃": (2, 0, 0, 2), "ɑ̃": (3, 2, 0, 2),
    "ɔ̃": (1, 2, 1, 2), "œ̃": (2, 0, 1, 2),
    # place from the lips backwards, manner, voicing, nasality of consonants
    "p": (0, 0, 0, 0), "b": (0, 0, 1, 0), "m": (0, 0, 1, 2), "f": (1, 1, 0, 0), "v": (1, 1, 1, 0),
    "t": (2, 0, 0, 0), "d": (2, 0, 1, 0), "n": (2, 0, 1, 2), "s": (2, 1, 0, 0), "z": (2, 1, 1, 0),
    "l": (2, 2, 1, 0), "ʃ": (3, 1, 0, 0), "ʒ": (3, 1, 1, 0), "ɲ": (4, 0, 1, 2), "j": (4, 3, 1, 0),
    "ɥ": (4, 3, 1, 1), "k": (5, 0, 0, 0), "g": (5, 0, 1, 0), "ŋ": (5, 0, 1, 2), "w": (5, 3, 1, 1),
    "ʁ": (6, 2, 1, 0),
}  # fmt: skip

_OTHER_CLASS = 20
"""Distance of phones of different classes: more than any within one."""


@dataclass(frozen=True, slots=True)
class PlacedUnit:
    """A unit of a recording and the place where it goes.

    Attributes
    ----------
    recording : int
        Number of the recording.
    source, target : Unit
        As recorded, as wanted; equally many edges.
    """

    recording: int
    source: Unit
    target: Unit


@functools.cache
def phone_distance(a: str, b: str) -> int:
    """Return how different two phones are: 0 for the same, 20 for another class.

    Examples
    --------
    >>> phone_distance("p", "b"), phone_distance("i", "u"), phone_distance("a", "t")
    (1, 3, 20)
    """
    if a == b:
        return 0
    if PAUSE in (a, b) or (a in VOWELS) != (b in VOWELS):
        return _OTHER_CLASS
    pairs = zip(_FEATURES[a], _FEATURES[b], strict=True)
    return max(1, sum(abs(x - y) for x, y in pairs))


class SoundDictionary:
    """All polysounds and diphones of some recordings.

    Parameters
    ----------
    recordings : sequence of UnitRecording

    Raises
    ------
    CueError
        If there is no recording with a phone.
    """

    def __init__(self, recordings: Sequence[UnitRecording]) -> None:
        self._units: list[Unit] = []
        self._recording: list[int] = []
        self._named: dict[tuple[str, ...], list[int]] = {}
        start, end = [], []
        for number, recording in enumerate(recordings):
            line = with_pauses(recording.score.phones, 0.0, recording.duration_s)
            units = dict.fromkeys(cut_sounds(line) + cut_sounds(line, polysounds=False))
            for unit in units:
                if unit.edges_s[-1] <= unit.edges_s[0]:
                    continue
                self._named.setdefault(unit.label, []).append(len(self._units))
                self._units.append(unit)
                self._recording.append(number)
                start.append((number, unit.edges_s[0]))
                end.append((number, unit.edges_s[-1]))
        if not self._units:
            raise CueError("the recordings hold no phone")
        self._lsp_start = _spectra(recordings, start)
        self._lsp_end = _spectra(recordings, end)

    def __len__(self) -> int:
        """Return the number of units."""
        return len(self._units)

    @property
    def names(self) -> frozenset[tuple[str, ...]]:
        """Labels with at least one unit."""
        return frozenset(self._named)

    def select(self, targets: Sequence[Unit]) -> list[PlacedUnit]:
        """Choose a unit for each target; a polysound that is missing becomes diphones.

        Parameters
        ----------
        targets : sequence of Unit
            Of one line, in order, as `synth.units.concatenation.units.cut_sounds` gives them.

        Returns
        -------
        list of PlacedUnit
            At least as many as there are targets.
        """
        wanted: list[Unit] = []
        for target in targets:
            known = target.label in self._named
            wanted += [target] if known or len(target.label) == 2 else split_polysound(target)
        candidates, costs = [], []
        for target in wanted:
            units, penalty = self._candidates(target.label)
            parts = np.array([self._units[u].parts_s for u in units])
            error = np.sqrt(np.mean((parts - np.array(target.parts_s)) ** 2, axis=1))
            candidates.append(units)
            costs.append(_DURATION_WEIGHT * error + _SUBSTITUTE_COST * penalty)
        chosen = select_units(candidates, costs, self._join_cost)
        return [
            PlacedUnit(self._recording[u], self._units[u], target)
            for u, target in zip(chosen.tolist(), wanted, strict=True)
        ]

    def _candidates(self, label: tuple[str, ...]) -> tuple[NDArray[np.int64], int]:
        """Return the units of `label`, or of the closest diphone, and how far away that is."""
        if label in self._named:
            return np.array(self._named[label]), 0
        diphones = [name for name in self._named if len(name) == 2]
        distances = [sum(map(phone_distance, name, label)) for name in diphones]
        nearest = int(np.argmin(distances))
        return np.array(self._named[diphones[nearest]]), distances[nearest]

    def _join_cost(
        self, before: NDArray[np.int64], after: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        difference = self._lsp_end[before][:, None] - self._lsp_start[after][None]
        return np.asarray(np.sqrt(np.mean(difference**2, axis=2)))


def _spectra(
    recordings: Sequence[UnitRecording], instants: Sequence[tuple[int, float]]
) -> NDArray[np.float64]:
    """Return line spectrum pairs around (recording, seconds), shape (n, order)."""
    result = np.zeros((len(instants), _LSP_ORDER))
    rows = sorted(range(len(instants)), key=lambda i: instants[i][0])
    for number, group in itertools.groupby(rows, key=lambda i: instants[i][0]):
        members = list(group)
        recording = recordings[number]
        width = round(_LSP_FRAME_S * recording.fs)
        sound = np.pad(recording.sound.astype(np.float64), width)
        first = np.array([round(instants[i][1] * recording.fs) for i in members])
        first = np.clip(first + width - width // 2, 0, len(sound) - width)
        frames = sound[first[:, None] + np.arange(width)] * np.hanning(width)
        result[members] = line_spectrum_pairs(linear_prediction(frames, _LSP_ORDER))
    return result
