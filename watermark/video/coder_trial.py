"""A trial of the mark on a coder: how much information each step leaves in the decoded picture.

In: designs of superframes, the random strengths that their values had, frames that came through the
coder; out: bits per value for each strength and kind of cell.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from watermark.video.demodulate import (
    LAG_MOTION,
    LAGS,
    MOTION_LIMIT,
    MOTION_WEIGHT,
    NOISES,
    without_lag,
)
from watermark.video.design import Design, Way
from watermark.video.grid import Grid
from watermark.video.lattices import lattice_shares, likelihood
from watermark.video.modes import Mode
from watermark.video.profile import TEMPLATES, TEXTURE, TEXTURE_EVERY
from watermark.video.recent_frames import LAG_FRAMES
from watermark.video.timing import Timing

SHARES = ((0.5, 0.6, 0.7, 0.85, 1.0), (0.6, 0.8, 1.0), (0.6, 0.8, 1.0))
"""Parts of the way to the lattice point that are tried with each step."""

TRIED = tuple((rung, share) for rung, shares in enumerate(SHARES) for share in shares)
"""Steps and parts of the way that the values of a trial have."""

ODDS = tuple((0.6, 0.25, 0.15)[rung] / len(SHARES[rung]) for rung, _ in TRIED)
"""Part of the values that each of them has: few are strong, for they cost the coder bits."""

TRIED_NUMBERS = range(len(TRIED))

BEGINS = 0.0, 0.5, 0.75
"""Parts of a window after which a pattern may begin to be seen: receivers read from there where
more is lost before."""

Luma = NDArray[Any]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class PictureCoder(Protocol):
    """A coder and its decoder as one stream of luma.

    Examples
    --------
    >>> class Wire:
    ...     def process(self, luma):
    ...         return [luma]
    ...
    ...     def flush(self):
    ...         return []
    >>> coder: PictureCoder = Wire()
    >>> len(coder.process(np.zeros((180, 320), np.uint8)))
    1
    """

    def process(self, luma: Luma) -> list[Luma]:
        """Take a frame; return frames decoded by now, in order, in luma of 8 bits."""

    def flush(self) -> list[Luma]:
        """Return the frames still inside."""


@dataclass(frozen=True, slots=True)
class TrialFinding:
    """What a coder left of a superframe.

    Attributes
    ----------
    parts : ndarray of float64, shape (2,)
        Part of the values in cells with the fine and with the coarse step.
    information : ndarray of float64, shape (2, len(TRIED))
        Bits per value for both kinds of cells.
    """

    parts: FloatArray
    information: FloatArray

    def at(self, rung: int, way: Way) -> float:
        """Mean bits per value with a step and a way, between those tried if need be."""
        shares = SHARES[rung]
        first = TRIED.index((rung, shares[0]))
        tried = slice(first, first + len(shares))
        fine, coarse = self.information[:, tried]
        return float(
            self.parts[0] * np.interp(way.fine, shares, fine)
            + self.parts[1] * np.interp(way.coarse, shares, coarse)
        )


class CoderTrial:
    """One coder and what its decoded pictures show.

    Parameters
    ----------
    coder : PictureCoder
    modes : sequence of Mode
        The profile's, one for each step.
    timing : Timing
        Frame rate.

    Attributes
    ----------
    findings : deque of TrialFinding or None
        Of the next superframes; None where the coder gave no picture back.
    """

    def __init__(self, coder: PictureCoder, modes: Sequence[Mode], timing: Timing) -> None:
        self._coder, self._modes, self._timing = coder, modes, timing
        self._grid: Grid | None = None  # known with the first decoded frame: a coder may shrink
        self._received = 0
        self._values: list[FloatArray] = []  # of a window, and of `LAG_FRAMES` frames before it
        self._textures: list[FloatArray] = []
        self._waiting: deque[tuple[Design, IntArray]] = deque()
        self.findings: deque[TrialFinding | None] = deque()

    def expect(self, design: Design, choice: IntArray) -> None:
        """Note a superframe that is on its way; `choice`: indices of `TRIED` of its values."""
        self._waiting.append((design, choice))

    def process(self, frame: Luma) -> None:
        """Send a marked frame through the coder."""
        self._take(self._coder.process(frame))

    def flush(self) -> None:
        """Read the rest in the coder."""
        self._take(self._coder.flush())
        self.findings.extend([None] * len(self._waiting))
        self._waiting.clear()

    def _take(self, decoded: list[Luma]) -> None:
        for luma in decoded:
            grid = self._grid = self._grid or Grid(luma.shape[1], luma.shape[0])
            if self._waiting:
                start = self._timing.window_start(self._waiting[0][0].place)
                if start - LAG_FRAMES <= self._received < start + self._timing.window:
                    self._values.append(grid.project(luma).reshape(-1))
                    if self._received >= start and self._received % TEXTURE_EVERY == 0:
                        self._textures.append(grid.texture(luma).reshape(-1))
                if self._received == start + self._timing.window - 1:
                    self.findings.append(self._measured(*self._waiting.popleft()))
                    self._values.clear()
                    self._textures.clear()
            self._received += 1

    def _measured(self, design: Design, choice: IntArray) -> TrialFinding:
        """Compare the window at hand with the bits that were sent."""
        values = np.array(self._values)
        texture = np.mean(self._textures, axis=0) if self._textures else design.texture.reshape(-1)
        share = np.tile(lattice_shares(texture, [TEXTURE]), TEMPLATES)
        textured = np.tile(design.textured.reshape(-1), TEMPLATES)
        bits, dither = design.bits(self._modes[0]), self._modes[0].layout.dither
        data = np.ones(choice.size, dtype=bool)
        data[self._modes[0].layout.pilots] = False
        groups = [
            [
                np.flatnonzero(data & (choice == index) & (textured == kind))
                for index in TRIED_NUMBERS
            ]
            for kind in (False, True)
        ]
        counts = np.array([[group.size for group in kind] for kind in groups], dtype=np.float64)
        # Information per cell that arrives of each strength, apart for smooth (0) and textured (1)
        # cells, from the part of the window that shows most, or with the lag that does taken back,
        # as receivers look for it.
        tables = []
        for mean, variance in self._readings(values, texture):
            table = np.zeros((2, len(TRIED)))
            for kind, index in product((0, 1), TRIED_NUMBERS):
                mine, step = groups[kind][index], self._modes[TRIED[index][0]].step
                if mine.size:
                    # In steps: the mean over the trial's frames is the value sent, their variance
                    # the noise.
                    place = mean[mine] / step - dither[mine]
                    motion = variance[mine] / step**2
                    table[kind, index] = _information(place, motion, bits[mine], share[:, mine])
            tables.append(table)
        found = max(tables, key=lambda table: float(np.sum(table * counts)))
        parts = np.array([1 - textured.mean(), textured.mean()])
        return TrialFinding(parts, _smooth(found, counts))

    def _readings(
        self, values: FloatArray, texture: FloatArray
    ) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Mean and variance of each amplitude in a window, in all ways that receivers try."""
        before, seen = values[: -self._timing.window], values[-self._timing.window :]
        for begin in BEGINS:
            late = seen[round(begin * len(seen)) :]
            yield late.mean(axis=0), late.var(axis=0)
        if len(before):
            mean, variance = seen.mean(axis=0), seen.var(axis=0)
            rise = seen[-LAG_FRAMES:].mean(axis=0) - before.mean(axis=0)
            textures = np.tile(texture, TEMPLATES)
            for lag in LAGS:
                yield without_lag(mean, rise, textures, lag), LAG_MOTION * variance


def _information(
    place: FloatArray, variance: FloatArray, known: IntArray, share: FloatArray
) -> float:
    """Bits per value of values whose bits are known, by the receiver's own rules."""
    spread = np.sqrt(1 + MOTION_WEIGHT * np.minimum(variance, MOTION_LIMIT))
    right = np.stack([likelihood(place, known, sigma * spread, share) for sigma in NOISES])
    best = int(right.sum(axis=1).argmax())
    ratio = right[best] - likelihood(place, 1 - known, NOISES[best] * spread, share)
    return float(np.mean(1 - np.logaddexp(0, -ratio) / np.log(2)))


def _smooth(table: FloatArray, counts: FloatArray) -> FloatArray:
    """Let no value fall as the part of the way grows, in the order of `TRIED`."""
    out = np.zeros_like(table)
    first = 0
    for shares in SHARES:
        group = slice(first, first + len(shares))
        for kind in (0, 1):
            weights = counts[kind, group] + 1e-3
            out[kind, group] = isotonic_regression(table[kind, group], weights=weights).x
        first += len(shares)
    return out
