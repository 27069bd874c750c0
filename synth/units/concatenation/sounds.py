"""The dictionary of polysounds and diphones: the sound of speech and the motion of the face.

In: phones with times, and a melody. Out: chosen units of recordings. Selection by dynamic
programming: the cost of a unit is the RMS distance between wanted and recorded durations of its
parts, of its pitch from the melody's, and how badly its label fits its sound; that of a join the
RMS distance of the line spectrum pairs across it (Gibert, Bailly, Elisei 2004, section 5.1), and
the steps of pitch and level. Units that follow each other in a recording join at no cost. Where a
diphone was never recorded, its two halves come from different diphones if that sounds better than
one of other phones.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONE_NUMBER, VOWELS
from codec.cues.score import Phone
from codec.errors import CueError
from synth.planning.prosody.melody import Melody
from synth.units.concatenation.phone_distance import (
    phone_distance,
    phone_distances,
    same_but_voiced,
)
from synth.units.concatenation.selection import select_units
from synth.units.concatenation.units import Unit, cut_sounds, split_polysound, with_pauses
from synth.units.recordings.recording import LSP_ORDER, UnitRecording

_DURATION_WEIGHT = 2.0
"""Cost of one second of duration error, against one radian of spectral distance: little, as units
keep their own proportions."""

_SUBSTITUTE_COST = 0.5
"""Weight of a substitute's phonetic distance against the error of duration."""

_PITCH_WEIGHT, _PITCH_STEP_WEIGHT = 0.02, 0.02
"""Cost of a semitone between a unit and the melody, and of one between units."""

_LEVEL_STEP_WEIGHT = 0.01
"""Cost of a decibel between units."""

_OTHER_NEIGHBOUR = 0.05
"""Cost of a neighbour other than the wanted one, before or after a unit: its own neighbour
reaches into its halves."""

_JOIN = 0.05
"""Cost of any join."""

_UNLIKE, _MOST_UNLIKE = 0.03, 6
"""Cost of one step of phonetic distance between wanted and recorded neighbour behind the cut of a
half, and the steps that count at most."""

_HALF_JOIN = 0.1
"""Cost of a join where two phones meet."""

_UNFIT = 0.15
"""Cost of a phone at either end of a unit, by the logarithm of its likelihood in its sound."""

_LEAST_FIT = -4.0
"""Phones that fit worse count as this: nobody hears them."""

_MOST_CANDIDATES = 100
"""Units of a label that are compared: those that suit their place best."""

_CLOSE_S = 1e-6
"""Seconds between units that are one after the other: rounding."""

_CUT = -2
"""Ends of units that are no row of a phone: -1 is a pause, -2 and less are cuts between phones."""

_REFERENCE_HZ = 100.0
"""Pitch is in semitones above this."""


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

    def follows(self, before: "PlacedUnit") -> bool:
        """Return whether the unit begins in the recording where another one ends."""
        gap_s = self.source.edges_s[0] - before.source.edges_s[-1]
        return self.recording == before.recording and abs(gap_s) <= _CLOSE_S


@dataclass(frozen=True, slots=True)
class _Place:
    """A target and its neighbours' numbers; `cut` says on which side a half ends, "" if on none."""

    target: Unit
    before: int
    after: int
    cut: str = ""


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
        named: dict[tuple[str, ...], list[int]] = {}
        halves: dict[tuple[str, bool], list[int]] = {}
        ends: list[tuple[int, int]] = []
        around: list[tuple[int, int]] = []
        bases = np.cumsum([0, *(len(recording.middles) for recording in recordings)])
        for number, recording in enumerate(recordings):
            line = with_pauses(recording.score.phones, 0.0, recording.duration_s)
            place = _rows_of(line, int(bases[number]))
            for unit, first, last in _units_of(line):
                if unit.edges_s[-1] <= unit.edges_s[0]:
                    continue
                named.setdefault(unit.label, []).append(len(self._units))
                self._units.append(unit)
                self._recording.append(number)
                ends.append((place[first], place[last]))
                around.append((_number(line, first - 1), _number(line, last + 1)))
            for half, at, leaves in _halves_of(line):
                halves.setdefault((line[at].symbol, leaves), []).append(len(self._units))
                self._units.append(half)
                self._recording.append(number)
                cut = _CUT - place[at] - leaves
                ends.append((place[at], cut) if leaves else (cut, place[at]))
                around.append((_number(line, at - 1), _number(line, at + 1)))
        if not named:
            raise CueError("the recordings hold no phone")
        self._n_whole = sum(map(len, named.values()))
        self._named = {label: np.array(units) for label, units in named.items()}
        self._halves = {key: np.array(units) for key, units in halves.items()}
        self._ends = np.array(ends)
        self._around = np.array(around)
        self._middles = np.concatenate([r.middles for r in recordings]).astype(np.float64)
        fits = np.concatenate([r.fits for r in recordings]).astype(np.float64)
        # Row -1, a pause, fits.
        self._unfit = np.append(-np.maximum(fits, _LEAST_FIT), 0.0)
        self._pitch = np.concatenate([_pitch_of(r) for r in recordings])
        heard = self._pitch[np.isfinite(self._pitch)]
        middle = float(np.median(heard)) if len(heard) else 0.0
        self.median_hz = _REFERENCE_HZ * 2 ** (middle / 12)

    def __len__(self) -> int:
        """Return the number of polysounds and diphones."""
        return self._n_whole

    @property
    def names(self) -> frozenset[tuple[str, ...]]:
        """Labels with at least one unit."""
        return frozenset(self._named)

    def select(self, targets: Sequence[Unit], melody: Melody | None = None) -> list[PlacedUnit]:
        """Choose a unit for each target; a polysound that is missing becomes diphones.

        Parameters
        ----------
        targets : sequence of Unit
            Of one line, in order, as `synth.units.concatenation.units.cut_sounds` gives them.
        melody : Melody, optional
            By default any pitch suits.

        Returns
        -------
        list of PlacedUnit
            At least as many as there are targets.
        """
        places = list(self._places(targets))
        candidates, costs = [], []
        for place in places:
            units, cost = self._suited(place)
            target = place.target
            parts = np.array([self._units[u].parts_s for u in units.tolist()])
            error = np.sqrt(np.mean((parts - np.array(target.parts_s)) ** 2, axis=1))
            cost = cost + _DURATION_WEIGHT * error
            cost += _UNFIT * self._unfit[np.maximum(self._ends[units], -1)].sum(1)
            if melody is not None:
                cost += _PITCH_WEIGHT * self._off_melody(units, target, melody)
            best = np.argsort(cost, kind="stable")[:_MOST_CANDIDATES]
            candidates.append(units[best])
            costs.append(cost[best])
        chosen = select_units(candidates, costs, self._join_cost)
        return [
            PlacedUnit(self._recording[u], self._units[u], place.target)
            for u, place in zip(chosen.tolist(), places, strict=True)
        ]

    def _places(self, targets: Sequence[Unit]) -> Iterator[_Place]:
        """Yield the places of targets: polysounds, diphones, and halves of missing diphones."""
        wanted: list[Unit] = []
        for target in targets:
            known = target.label in self._named
            wanted += [target] if known or len(target.label) == 2 else split_polysound(target)
        for number, target in enumerate(wanted):
            before, after = _neighbours(wanted, number)
            if target.label in self._named or not self._halved(target.label):
                yield _Place(target, before, after)
                continue
            first, second = target.label
            start, cut, end = target.edges_s
            if first != PAUSE:
                yield _Place(Unit((first,), (start, cut)), before, PHONE_NUMBER[second], "after")
            if second != PAUSE:
                yield _Place(Unit((second,), (cut, end)), PHONE_NUMBER[first], after, "before")

    def _halved(self, label: tuple[str, ...]) -> bool:
        """Return whether the halves of a missing diphone suit it better than another diphone.

        A cut between two vowels is heard as a consonant; a change of voicing beside
        another consonant is usual in French.
        """
        vowels = sum(symbol in VOWELS for symbol in label)
        voicing = all(map(same_but_voiced, label, self._nearest(label)[0]))
        if vowels == 2 or (not vowels and voicing):
            return False
        keys = zip(label, (True, False), strict=True)
        return all(key[0] == PAUSE or key in self._halves for key in keys)

    def _suited(self, place: _Place) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the units that may stand at a place, and how badly their neighbours suit."""
        wanted = np.array([place.before, place.after])
        if not place.cut:
            label, penalty = place.target.label, 0
            if label not in self._named:
                label, penalty = self._nearest(label)
            units = self._named[label]
            other = (self._around[units] != wanted).sum(1)
            return units, _SUBSTITUTE_COST * penalty + _OTHER_NEIGHBOUR * other
        leaves = place.cut == "after"
        units = self._halves[place.target.label[0], leaves]
        around = self._around[units]
        unlike = phone_distances()[around[:, int(leaves)], wanted[int(leaves)]]
        other = around[:, int(not leaves)] != wanted[int(not leaves)]
        return units, _UNLIKE * np.minimum(unlike, _MOST_UNLIKE) + _OTHER_NEIGHBOUR * other

    def _nearest(self, label: tuple[str, ...]) -> tuple[tuple[str, ...], int]:
        """Return the recorded diphone closest to a label, and how far away that is."""
        diphones = [name for name in self._named if len(name) == 2]
        distances = [sum(map(phone_distance, name, label)) for name in diphones]
        nearest = int(np.argmin(distances))
        return diphones[nearest], distances[nearest]

    def _off_melody(
        self, units: NDArray[np.int64], target: Unit, melody: Melody
    ) -> NDArray[np.float64]:
        """Return by how many semitones the ends of units lie off a melody, in the mean."""
        at = melody.at(np.array([target.edges_s[0], target.edges_s[-1]]))
        away = np.abs(self._of_ends(self._pitch, units) - _semitones(at))
        known = np.isfinite(away)
        return np.asarray(np.where(known, away, 0.0).sum(1) / np.maximum(known.sum(1), 1))

    def _of_ends(
        self, values: NDArray[np.float64], units: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Return a value of the phones at units' ends, shape (n, 2), NaN at pauses and cuts."""
        rows = self._ends[units]
        return np.where(rows >= 0, values[np.maximum(rows, -1)], np.nan)

    def _join_cost(
        self, before: NDArray[np.int64], after: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        end, start = self._ends[before, 1][:, None], self._ends[after, 0][None]
        # A cut of number c lies before the phone of row _CUT - c.
        last = np.where(end <= _CUT, _CUT - end - 1, end)
        first = np.where(start <= _CUT, _CUT - start, start)
        step = self._middles[last] - self._middles[first]
        pitch = np.nan_to_num(np.abs(self._pitch[last] - self._pitch[first]))
        cost = np.sqrt(np.mean(step[..., :LSP_ORDER] ** 2, axis=2))
        cost += _LEVEL_STEP_WEIGHT * np.abs(step[..., LSP_ORDER]) + _JOIN
        cost = np.where(end <= _CUT, _HALF_JOIN, cost) + _PITCH_STEP_WEIGHT * pitch
        return np.where((end == start) | (end == -1) | (start == -1), 0.0, cost)


def _halves_of(line: Sequence[Phone]) -> Iterator[tuple[Unit, int, bool]]:
    """Yield both halves of each phone, its place, and whether the half is the second."""
    for at, phone in enumerate(line):
        middle_s = (phone.start + phone.end) / 2
        if phone.symbol != PAUSE and phone.end > phone.start:
            yield Unit((phone.symbol,), (phone.start, middle_s)), at, False
            yield Unit((phone.symbol,), (middle_s, phone.end)), at, True


def _units_of(line: Sequence[Phone]) -> Iterator[tuple[Unit, int, int]]:
    """Yield polysounds and diphones of a line, each once, with their first and last phone."""
    seen: set[tuple[int, int]] = set()
    for polysounds in (True, False):
        last = 0
        for unit in cut_sounds(line, polysounds=polysounds):
            first, last = last, last + len(unit.label) - 1
            if (first, last) not in seen:
                seen.add((first, last))
                yield unit, first, last


def _rows_of(line: Sequence[Phone], base: int) -> list[int]:
    """Return the row of each phone of a line among all, -1 for pauses."""
    rows, row = [], base
    for phone in line:
        silent = phone.symbol == PAUSE
        rows.append(-1 if silent else row)
        row += not silent
    return rows


def _number(line: Sequence[Phone], at: int) -> int:
    return PHONE_NUMBER[line[at].symbol if 0 <= at < len(line) else PAUSE]


def _neighbours(units: Sequence[Unit], place: int) -> tuple[int, int]:
    """Return the numbers of the phones before and after a unit of a row."""
    before = units[place - 1].label[-2] if place else PAUSE
    after = units[place + 1].label[1] if place + 1 < len(units) else PAUSE
    return PHONE_NUMBER[before], PHONE_NUMBER[after]


def _semitones(hz: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(12 * np.log2(hz / _REFERENCE_HZ))


def _pitch_of(recording: UnitRecording) -> NDArray[np.float64]:
    """Return the pitch in the middle of each phone in semitones, NaN where there is none."""
    f0 = recording.track.f0
    if not len(f0):
        return np.full(len(recording.score.phones), np.nan)
    middle = np.array([(p.start + p.end) / 2 for p in recording.score.phones])
    frame = np.clip(np.rint(middle / recording.track.hop_s).astype(np.int64), 0, len(f0) - 1)
    return np.where(f0[frame] > 0, _semitones(np.maximum(f0[frame], 1.0)), np.nan)
