"""Design of one superframe's mark in a programme of two channels.

In: mid and side, payloads and a level; out: the mark of both. Each data cell stands in the mid, in
left or in right (`watermark.audio.signal.channel_choice`); pilots stand in the mid, and lean
towards left or right in some superframes. Where left and right are nearly alike, a cell stands in
all three, as in mono. Specification: spec/audio-carrier.md, W43 to W46.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from watermark.audio.embed.design import (
    CARRYING,
    ITERATIONS,
    HostSpectra,
    MarkDesigner,
    MarkedSuperframe,
)
from watermark.audio.embed.levels import nearest_level, share_of
from watermark.audio.signal.channel_choice import LEFT, MID, RIGHT, make_places
from watermark.audio.signal.dither import mark_change
from watermark.audio.signal.layout import Cells
from watermark.audio.signal.mdct import synthesise
from watermark.audio.signal.profile import HOP, AudioProfile
from watermark.audio.signal.stereo import channels_of

ALIKE = 1 / 16
"""Greatest difference, in steps, between the errors in its channel and in the mid of a cell that
is written in both; at twice that, it is written in its own only."""

LEANING = 0.6
"""Largest change towards left or right for a pilot, in units of the largest of a cell: a pilot that
stands in the mid and wholly in a channel of wide stereo takes four times the power of another."""

LEANING_PERIOD = 6
"""One superframe in this many has pilots that lean towards left and one towards right: who hears
one channel only finds it within 4 s, and the grade hardly falls."""

TINY = float(np.finfo(np.float32).tiny)


class StereoDesigner(MarkDesigner):
    """Designs the marks of two channels; silence beside the mid gets the mark of mono."""

    def __init__(self, profile: AudioProfile, key: int) -> None:
        super().__init__(profile, key)
        self._places = make_places(profile, key).bins[:, : self._end]
        self._own = np.arange(self._places.size) + self._places.reshape(-1) * self._places.size

    def design(
        self,
        before: NDArray[np.float64],
        host: NDArray[np.float64],
        payload: tuple[bytes, bytes],
        level: float,
        *,
        rounds: int = ITERATIONS,
        leaning: int | None = MID,
        clean: HostSpectra | None = None,
    ) -> MarkedSuperframe:
        """Design a mark of mid and side, shapes (2, HOP) and (2, SUPERFRAME + HOP)."""
        # Without a side the sound is mono: the plain design gives the same mark in mid.
        if not (before[1].any() or host[1].any()):
            plain = super().design(before[:1], host[:1], payload, level, rounds=rounds, clean=clean)
            return MarkedSuperframe(
                np.stack([plain.mark[0], np.zeros(host.shape[1])]), plain.carries
            )
        sound = np.concatenate([before, host], axis=1)
        wanted, announced = self._wanted(sound[0], payload)
        known = (None, None) if clean is None else clean
        spectra = [self._spectra(x, seen) for x, seen in zip(sound, known, strict=True)]
        coefficients = channels_of(*(spectrum[1:, : self._end].real for spectrum in spectra))
        mark = np.zeros(host.shape, dtype=np.float32)
        places = np.full_like(self._places, MID) if leaning is None else self._places
        # The masking threshold, and so the quantiser's step, depends on the marked sound: each
        # round measures the sound with the mark of the round before and designs it again.
        for left in reversed(range(rounds)):
            units = self._units(spectra[0], spectra[1])
            own = coefficients[MID], units[MID]
            # Cells lie in mid or side, as announced by the pilots; else all lie in mid.
            if leaning is not None:
                own = self._chosen(coefficients), self._chosen(units)
            change, living = self._data(coefficients, units, own, places, wanted, level)
            if living < CARRYING:
                return MarkedSuperframe(np.zeros(host.shape), carries=False)
            change += self._leaning(coefficients, units, announced, level, leaning or MID)
            mark = np.stack([synthesise(part, HOP) for part in change])
            if left:
                sound[:, HOP:] = host + mark
                spectra = [self._spectra(x) for x in sound]
        return MarkedSuperframe(mark, carries=True)

    def _chosen(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values of mid, left and right, shape (3, 64, bins), where each cell stands."""
        return np.take(values, self._own).reshape(self._places.shape)

    def _data(
        self,
        coefficients: NDArray[np.float32],
        units: NDArray[np.float32],
        own: tuple[NDArray[np.float32], NDArray[np.float32]],
        places: NDArray[np.int64],
        wanted: NDArray[np.float32],
        level: float,
    ) -> tuple[NDArray[np.float32], float]:
        """Find the changes of mid and side that write the data cells, shape (2, 64, bins).

        Return with them the share of the cells that can carry.
        """
        cells = self._layout.cells
        step, alpha = self._profile.step(nearest_level(level)), self._alpha * share_of(level)
        mid, _ = mark_change(coefficients[MID], units[MID], cells, wanted, step=step, alpha=alpha)
        mine, living = mark_change(*own, cells, wanted, step=step, alpha=alpha)
        # What the other channel would have to do for the mid to be written, too.
        others = np.where(places == LEFT, units[RIGHT], units[LEFT])
        largest = _largest(step, alpha, cells, self._end)
        alike = _alike(mine, own[1], mid, units[MID], largest)
        other = np.clip(alike * (2 * mid - mine), -largest * others, largest * others)
        hand = (places == LEFT).astype(np.float32) - (places == RIGHT)
        change = np.stack(
            [
                np.where(hand != 0, (mine + other) / 2, mid),
                np.where(hand != 0, hand * (mine - other) / 2, _across(units) * mid),
            ]
        )
        return change, living

    def _leaning(
        self,
        coefficients: NDArray[np.float32],
        units: NDArray[np.float32],
        announced: NDArray[np.float32],
        level: float,
        channel: int,
    ) -> NDArray[np.float32]:
        """Find the changes of mid and side that write the pilots, shape (2, 64, bins)."""
        cells = self._pilots.cells
        step = self._profile.pilot_step(nearest_level(level))
        alpha = self._pilot_alpha * share_of(level)

        def change(x: NDArray[np.float32], unit: NDArray[np.float32]) -> NDArray[np.float32]:
            return mark_change(x, unit, cells, announced, step=step, alpha=alpha)[0]

        mid = change(coefficients[MID], units[MID])
        if channel == MID:
            return np.stack([mid, _across(units) * mid])
        sign = 1.0 if channel == LEFT else -1.0
        x, unit = coefficients[channel], units[channel]
        here = mid * (1 + sign * _across(units))
        mine = change(x, unit)
        largest = _largest(step, alpha, cells, self._end)
        alike = _alike(mine, unit, mid, units[MID], largest)
        more = alike * (mine - here) + (1 - alike) * change(x + here, unit)
        limit = LEANING * largest * np.minimum(units[LEFT], units[RIGHT])
        return np.stack([mid, _across(units) * mid + sign * np.clip(more, -limit, limit)])


def leaning_of(number: int) -> int:
    """Towards where the pilots of a superframe lean."""
    return {0: LEFT, LEANING_PERIOD // 2: RIGHT}.get(number % LEANING_PERIOD, MID)


def _across(units: NDArray[np.float32]) -> NDArray[np.float32]:
    """Part of the mid's mark that left has more and right less: by what each masks."""
    both = np.maximum(units[LEFT] + units[RIGHT], TINY)
    return np.asarray((units[LEFT] - units[RIGHT]) / both)


def _largest(step: float, alpha: ArrayLike, cells: Cells, bins: int) -> NDArray[np.float32]:
    """Largest change of each bin in units of the mask, shape (bins,)."""
    largest = np.zeros(bins, dtype=np.float32)
    change = np.asarray(alpha) * step / 2 / math.sqrt(cells.bins)
    per_cell = np.broadcast_to(change, cells.dither.shape)
    largest[cells.first_bin : cells.last_bin] = np.repeat(per_cell, cells.bins)
    return largest


def _alike(
    mine: NDArray[np.float32],
    unit: NDArray[np.float32],
    mid: NDArray[np.float32],
    mid_unit: NDArray[np.float32],
    largest: NDArray[np.float32],
) -> NDArray[np.float32]:
    """How far a cell may be written in its channel and in the mid: 1 where errors agree, 0 else."""
    alive = (unit > 0) & (mid_unit > 0) & (largest > 0)
    one, zero = np.float32(1), np.float32(0)
    apart = np.abs(mine / np.where(alive, unit, one) - mid / np.where(alive, mid_unit, one))
    part = apart / np.where(largest > 0, 2 * largest, one)
    return np.where(alive, np.clip(2 - part / ALIKE, 0.0, 1.0), zero)
