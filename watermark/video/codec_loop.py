"""Codec in the loop: each superframe is tried on the broadcaster's own coder before it is marked.

In: the picture and the designs of its superframes; out: the least strength at which each arrives.
One run of the coder tries all strengths at once: a trial copy of the picture has a random strength
in every value, and the decoded copy shows how much information each strength leaves. The coder runs
on as one stream, for its rate control has a long memory. Sources: the copy of the receiver inside
the emitter of Baras, Moreau and Dymarski, IEEE TASLP 14(5), 2006; that less than the whole way to a
lattice point may suffice: Eggers, Bäuml, Tzschoppe and Girod, "Scalar Costa scheme for information
embedding", IEEE TSP 51(4), 2003. Specification: spec/video-carrier.md, V2 and V12.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from watermark.link.link import L0_CHECK, L1_CHECK
from watermark.video.demodulate import (
    MOTION_LIMIT,
    MOTION_WEIGHT,
    NOISES,
    coarse_share,
    likelihood,
    pilot_waves,
)
from watermark.video.design import Design, Strength, fixed_strength
from watermark.video.fading import PatternWriter
from watermark.video.grid import Grid
from watermark.video.modes import Mode
from watermark.video.profile import POSITIONS, TEMPLATES, TEXTURE_EVERY, VideoProfile
from watermark.video.timing import Timing

STRENGTHS = (*(Strength(0, share) for share in (0.6, 0.7, 0.8, 0.9, 1.0)), Strength(1), Strength(2))
"""Strengths that are tried, the least visible first. With a wider step a share below 1 gains
nothing: the step before, with all of its way, leaves more information at the same visibility."""

MARGIN = 1.75
"""Information that is enough, in units of the message's and its checks' bits. Classes decode from
about 1.2 on; what arrives differs from the trial by 14 % (standard deviation)."""

OPENING_MARGIN = 2.0
"""The same for a programme's first superframe: how poor coders start is different for each."""

CEILING = 0.65
"""Bits per value that are enough for any rate: none holds more than one."""

HOPELESS = 1.1
"""Most information, in the same units, with which a class is given up: it rarely decodes."""

AGREEMENT, L0_AGREEMENT = 0.4, 0.25
"""Least agreement of the pilots, by which superframes are found: as a rule, and behind channels
from which L0 alone is asked."""

Luma = NDArray[Any]
FloatArray = NDArray[np.float64]


class PictureCoder(Protocol):
    """A coder and its decoder as one stream of luma."""

    def process(self, luma: Luma) -> list[Luma]:
        """Take a frame; return frames decoded by now, in order, in luma of 8 bits."""

    def flush(self) -> list[Luma]:
        """Return the frames still inside."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One way to the viewers.

    Attributes
    ----------
    coder : PictureCoder
    whole : bool
        Whether both classes have to arrive, or L0 alone.
    """

    coder: PictureCoder
    whole: bool = True


class PictureLoop:
    """Choose the strength of each superframe.

    Parameters
    ----------
    profile : VideoProfile
        Of the mark.
    modes : sequence of Mode
        The profile's, one for each step.
    grid : Grid
        Of the picture.
    depth : int
        Bits per sample.
    timing : Timing
        Frame rate.
    channels : sequence of Channel
        All have to be survived.
    """

    def __init__(
        self, profile: VideoProfile, modes: Sequence[Mode], grid: Grid, depth: int, timing: Timing,
        channels: Sequence[Channel],
    ) -> None:  # fmt: skip
        self._modes, self._grid = modes, grid
        self._writer = PatternWriter(grid.shape, depth, timing)
        l0_bits, l1_bits = 8 * profile.l0_bytes + L0_CHECK, 8 * profile.l1_bytes + L1_CHECK
        l0_rate = l0_bits / profile.l0_coded
        self._trials = []
        for channel in channels:
            rate = max(l0_rate, l1_bits / profile.l1_coded) if channel.whole else l0_rate
            trial = _Trial(channel.coder, rate, l0_rate, modes, grid.shape, timing)
            self._trials.append(trial)

    def process(self, luma: Luma, design: Design | None) -> list[Strength]:
        """Take the next frame, and the design that it completed, if any.

        Returns
        -------
        list of Strength
            Those of the next superframes.
        """
        self._writer.add_frame(luma)
        if design is not None:
            choice = np.random.default_rng(design.place).integers(0, len(STRENGTHS), POSITIONS)
            self._writer.add_pattern(self._grid.paint(design.mixed(self._modes, STRENGTHS, choice)))
            for trial in self._trials:
                trial.waiting.append((design, choice))
        self._send(self._writer.ready())
        return self._decisions()

    def flush(self) -> list[Strength]:
        """Return the strengths of the superframes still on trial."""
        self._send(self._writer.end())
        for trial in self._trials:
            trial.flush()
        return self._decisions()

    def _send(self, frames: list[Luma]) -> None:
        for frame in frames:
            for trial in self._trials:
                trial.process(frame)

    def _decisions(self) -> list[Strength]:
        count = min(len(trial.levels) for trial in self._trials)
        levels = [max(trial.levels.popleft() for trial in self._trials) for _ in range(count)]
        return [STRENGTHS[level] for level in levels]


class _Trial:
    """One coder and what its decoded pictures showed."""

    def __init__(
        self, coder: PictureCoder, rate: float, l0_rate: float, modes: Sequence[Mode],
        shape: tuple[int, int], timing: Timing,
    ) -> None:  # fmt: skip
        self._coder, self._rate, self._l0_rate = coder, rate, l0_rate
        self._modes, self._timing = modes, timing
        self._grid = Grid(shape[1], shape[0])
        self._received = 0
        self._values: list[FloatArray] = []
        self._textures: list[FloatArray] = []
        self.waiting: deque[tuple[Design, NDArray[np.int64]]] = deque()
        self.levels: deque[int] = deque()

    def process(self, frame: Luma) -> None:
        self._take(self._coder.process(frame))

    def flush(self) -> None:
        self._take(self._coder.flush())
        # A coder that swallowed frames says nothing on the last superframes.
        self.levels.extend(self._usual(design.place) for design, _ in self.waiting)
        self.waiting.clear()

    def _take(self, decoded: list[Luma]) -> None:
        for luma in decoded:
            if self.waiting:
                start = self._timing.window_start(self.waiting[0][0].place)
                if start <= self._received < start + self._timing.window:
                    self._values.append(self._grid.project(luma).reshape(-1))
                    if self._received % TEXTURE_EVERY == 0:
                        self._textures.append(self._grid.texture(luma).reshape(-1))
                if self._received == start + self._timing.window - 1:
                    self.levels.append(self._level(*self.waiting.popleft()))
                    self._values.clear()
                    self._textures.clear()
            self._received += 1

    def _level(self, design: Design, choice: NDArray[np.int64]) -> int:
        """Return the index of the least strength that suffices."""
        found = self.information(design, choice)
        margin = OPENING_MARGIN if design.place == 0 else MARGIN
        agreement = AGREEMENT if self._rate > self._l0_rate else L0_AGREEMENT
        enough = (found[:, 0] >= min(CEILING, margin * self._rate)) & (found[:, 1] >= agreement)
        if enough.any():
            return int(enough.argmax())
        if found[-1, 0] >= HOPELESS * self._rate:
            return len(STRENGTHS) - 1
        # One class is lost at any strength: the other one counts.
        first = (found[:, 0] >= margin * self._l0_rate) & (found[:, 1] >= L0_AGREEMENT)
        usual = self._usual(design.place)
        return max(usual, int(first.argmax())) if first.any() else len(STRENGTHS) - 1

    def _usual(self, place: int) -> int:
        """Return the index of the strength without a trial."""
        return STRENGTHS.index(fixed_strength(place, self._grid.shape))

    def information(self, design: Design, choice: NDArray[np.int64]) -> FloatArray:
        """Bits per value and agreement of pilots at each strength, shape (strengths, 2).

        Neither falls with the strength: that smooths the estimates.
        """
        mean, variance = np.mean(self._values, axis=0), np.var(self._values, axis=0)
        texture = np.mean(self._textures, axis=0) if self._textures else design.texture.reshape(-1)
        coarse = np.tile(coarse_share(texture), TEMPLATES)
        bits = design.bits(self._modes[0])
        out = np.empty((len(STRENGTHS), 2))
        for level, strength in enumerate(STRENGTHS):
            mine = np.flatnonzero(choice == level)
            step = self._modes[strength.rung].step
            place = mean[mine] / step - self._modes[0].layout.dither[mine]
            moved = variance[mine] / step**2
            spread = np.sqrt(1 + MOTION_WEIGHT * np.minimum(moved, MOTION_LIMIT))
            known, share = bits[mine], coarse[mine]
            scores = np.stack([
                likelihood(place, known, sigma * spread, share) for sigma in NOISES
            ])  # fmt: skip
            total = 0.0
            for alike in (share < 0.5, share >= 0.5):
                if alike.any():
                    best = int(scores[:, alike].sum(axis=1).argmax())
                    other = likelihood(
                        place[alike], 1 - known[alike], NOISES[best] * spread[alike], share[alike]
                    )
                    ratio = scores[best, alike] - other
                    total += float(np.sum(1 - np.logaddexp(0, -ratio) / np.log(2)))
            waves = (1 - 2 * known) * pilot_waves(place, share)
            out[level] = total / max(1, mine.size), waves.mean()
        return np.stack([isotonic_regression(column).x for column in out.T], axis=1)
