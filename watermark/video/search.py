"""Find the place of a marked picture in the picture at hand, from means over a window.

In: small frames; out: places worth a try. Projection is linear, so a place is judged on the mean of
a window, three times a superframe. The picture inside its bars is brought to 8 x 8 pixels a cell;
the pilots vote for every displacement of their own cell, the votes are added along the
displacements that each crop of the four sides implies, and the best places are refined on the
mean itself. Specification: spec/video-carrier.md, section 6.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from watermark.video import _kernels
from watermark.video.bars import content_box
from watermark.video.demodulate import BLUR, CENTRE, coarse_share
from watermark.video.grid import WHOLE, Region
from watermark.video.modes import PilotWatch
from watermark.video.profile import COLUMNS, ROWS
from watermark.video.timing import Timing

Small = NDArray[np.uint16]
FloatArray = NDArray[np.float64]

SCALE = 256.0
"""A luma level of 8 bits in the small frames."""

LOOKS = 3
"""Looks per superframe: the best one is at most a sixth of a superframe off."""

CELL = 8
"""Pixels of a cell in the picture that is searched, each way."""

STEP = 0.25
"""Distance of the places that are searched, in cells of a side."""

CROP = 0.05
"""Greatest part of the marked picture that each side may have lost."""

REACH_X, REACH_Y = 18, 12
"""Largest displacements of a cell, in steps, that the places imply, and one more."""

MEMORY = 0.6
"""Weight of the looks one superframe ago, in the sum that ranks the places."""

MODES = 8
"""Modes that are searched at unusual places, those with the finest steps: the compiled loops have
this many in a row."""

RANKED, CLIMBED = 8, 2
"""Places that are judged on the mean itself, and those of them that are refined."""

CLIMB = (0.12, 0.06, 0.03, 0.015)
"""Steps of the refinement in cells."""

HOPE = 3.0
"""Least score of a place before its refinement."""

LIKELY, FOUND = 3.8, 6.2
"""Least score, in standard deviations of noise, of a usual place and of any other to be tried.
A still picture with flat areas reaches 3.7 and 6.3 without a mark, others 3.4 and 5.8."""

NEAR = 0.002
"""Places whose sides differ by no more than this part of the picture count as one."""

MIDDLE = Region(-1 / 6, 0, 4 / 3, 1)
"""The middle of 16:9 in 4:3."""

_SINE = np.sin(2 * np.pi * (np.arange(512) + 0.5) / 512).astype(np.float32)
_COSINE = np.cos(2 * np.pi * (np.arange(512) + 0.5) / 512).astype(np.float32)


@dataclass(frozen=True, slots=True)
class PlaceCandidate:
    """A place and the score of its pilots in standard deviations of noise."""

    region: Region
    score: float


class PlaceSearch:
    """Collect small frames and look for the pilots three times a superframe.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the small frames.
    timing : Timing
        Their rate.
    key : int
        Secret seed.
    strength : float
        As the embedder's.
    whole : Region
        The picture in parts of the small one, which may have lost a line or column.
    """

    def __init__(
        self, shape: tuple[int, int], timing: Timing, *, key: int = 0, strength: float = 1.0,
        whole: Region = WHOLE,
    ) -> None:  # fmt: skip
        self._timing, self._whole = timing, whole
        self._scores = PilotScores(PilotWatch(key, strength), shape)
        self._frames: deque[Small] = deque(maxlen=timing.window)
        self._mean = np.zeros(shape, dtype=np.float32)
        self._count = self._looks = 0
        self._tables = [PlaceTable(self._scores) for _ in range(2)]

    def process(self, small: Small) -> list[PlaceCandidate]:
        """Take the next frame; return the places that look marked, usual ones first."""
        self._frames.append(small)
        self._count += 1
        due = self._count * LOOKS >= (self._looks + LOOKS * 0.75) * self._timing.span
        if not due or len(self._frames) < self._timing.window:
            return []
        self._looks += 1
        self._mean[:] = 0
        for frame in self._frames:
            self._mean += frame
        self._mean /= np.float32(SCALE * self._timing.window)
        return self._look()

    def _look(self) -> list[PlaceCandidate]:
        self._scores.look_at(self._mean)
        box = content_box(self._mean)
        bare = box == WHOLE
        if bare:
            box = self._whole
        usual = [self._whole] if bare else [self._whole, box]
        found = [PlaceCandidate(region, self._scores.best(region)) for region in usual]
        found = [candidate for candidate in found if candidate.score >= LIKELY]
        # Every third superframe belongs to the middle of a wider picture.
        middle = bare and self._looks // LOOKS % 3 == 2
        table = self._tables[int(middle)]
        others = table.look(self._mean, MIDDLE if middle else box, self._looks % LOOKS)
        # Next to a usual place it is that one: its sides are exact.
        found += [
            other
            for other in sorted(others, key=lambda candidate: -candidate.score)
            if not any(is_near(other.region, usual.region) for usual in found)
        ]
        return found


class PilotScores:
    """How well pilots agree with every usual mode at a place of a mean picture.

    Parameters
    ----------
    watch : PilotWatch
        The pilots.
    shape : tuple of int
        Rows and columns of the mean picture.
    """

    def __init__(self, watch: PilotWatch, shape: tuple[int, int]) -> None:
        self.steps = np.array(sorted({mode.step for mode in watch.modes}))
        # The widest step is for beginnings: superframes after them have one that comes before.
        modes = sorted(watch.modes, key=lambda mode: mode.step)
        self.lattice = np.array([list(self.steps).index(mode.step) for mode in modes])
        cells = watch.positions % (ROWS * COLUMNS)
        order = np.argsort(cells, kind="stable")
        template = watch.positions // (ROWS * COLUMNS)
        pilots = np.stack([template, cells // COLUMNS, cells % COLUMNS], axis=1)
        self.pilots = np.ascontiguousarray(pilots[order])
        signs = [1.0 - 2.0 * mode.layout.pilot_bits[order] for mode in modes]
        self.signs = np.array(signs, dtype=np.float32)
        self.dither = modes[0].layout.dither[watch.positions[order]]
        self._values = np.empty(len(order))
        self._mean = np.zeros(shape, dtype=np.float32)
        self._texture = np.zeros((shape[0] // 2 - 3, shape[1] // 2 - 3), dtype=np.float32)

    def look_at(self, mean: NDArray[np.float32]) -> None:
        """Take the mean picture that the next scores are of."""
        self._mean = mean
        _kernels.fine_texture_into(mean, self._texture)

    def best(self, region: Region) -> float:
        """Score of the best mode in standard deviations of noise."""
        shares = self.shares(region)
        self._project(region)
        return max(self._vote(mode, shares) for mode in range(len(self.lattice)))

    def one(self, region: Region, mode: int, shares: FloatArray) -> float:
        """Score of a mode in standard deviations of noise."""
        self._project(region)
        return self._vote(mode, shares)

    def shares(self, region: Region) -> FloatArray:
        """Probability that pilots have the coarse step if the picture is at this place."""
        rows, columns = self._mean.shape
        x = (region.left + region.width * (self.pilots[:, 2] + 0.5) / COLUMNS) * columns
        y = (region.top + region.height * (self.pilots[:, 1] + 0.5) / ROWS) * rows
        i = np.clip((y - CELL / 2) / 2 + 0.5, 0, self._texture.shape[0] - 1).astype(np.int64)
        j = np.clip((x - CELL / 2) / 2 + 0.5, 0, self._texture.shape[1] - 1).astype(np.int64)
        return coarse_share(self._texture[i, j].astype(np.float64))

    def _project(self, region: Region) -> None:
        rows, columns = self._mean.shape
        _kernels.pilot_values_into(
            self._mean, region.left * columns, region.top * rows, region.width * columns,
            region.height * rows, self.pilots, ROWS, COLUMNS, _SINE, self._values,
        )  # fmt: skip

    def _vote(self, mode: int, shares: FloatArray) -> float:
        return float(
            _kernels.vote(
                self._values, shares, self.dither, self.signs[mode],
                self.steps[self.lattice[mode]], _COSINE,
            )
        )  # fmt: skip


class PlaceTable:
    """Scores of all crops of a box, summed over looks at the same phase of the superframes.

    Parameters
    ----------
    scores : PilotScores
        The pilots.
    """

    def __init__(self, scores: PilotScores) -> None:
        self._scores = scores
        place = (np.arange(CELL) + 0.5) / CELL
        dipole, hump = np.sin(2 * np.pi * place), np.sin(np.pi * place) ** 2
        self._across = np.array([dipole, hump], dtype=np.float32)
        self._down = np.array([hump, dipole], dtype=np.float32)
        self._norm = float(np.sum(dipole**2) * np.sum(hump**2))
        limits = CENTRE * np.exp(np.array([-2.0, 2.0]) * BLUR)
        self._limits = limits
        shape = (len(scores.pilots), 2 * REACH_X + 1, 2 * REACH_Y + 1, MODES)
        self._waves = np.zeros(shape, dtype=np.float32)
        self._picture = np.zeros((CELL * ROWS, CELL * COLUMNS), dtype=np.float32)
        fine = (4 * ROWS - 3, 4 * COLUMNS - 3)
        self._amplitude = np.zeros((2, *fine), dtype=np.float32)
        self._texture = np.zeros(fine, dtype=np.float32)
        self._box: Region | None = None

    def look(self, mean: NDArray[np.float32], box: Region, phase: int) -> list[PlaceCandidate]:
        """Rank the crops of a box in a mean picture and refine the best; those that are found."""
        if self._box is None or _far(box, self._box):
            self._begin(box)
        assert self._box is not None
        rows, columns = mean.shape
        _kernels.resample_into(
            mean, self._box.left * columns, self._box.top * rows, self._box.width * columns,
            self._box.height * rows, self._picture,
        )  # fmt: skip
        _kernels.fine_amplitudes_into(
            self._picture, self._across, self._down, self._norm, self._amplitude
        )
        _kernels.fine_texture_into(self._picture, self._texture)
        scores = self._scores
        squares = _kernels.local_waves_into(
            self._amplitude, self._texture, scores.pilots, scores.dither, scores.steps,
            scores.lattice[:MODES], scores.signs[:MODES], self._limits, _COSINE,
            _extent(self._dx), _extent(self._dy), self._waves,
        )  # fmt: skip
        new = np.empty((len(self._x), len(self._y), MODES), dtype=np.float32)
        _kernels.place_scores_into(self._waves, scores.pilots, self._dx, self._dy, new)
        new **= 2
        new *= np.float32(2 / max(squares, 1e-9))
        table = self._sums[phase]
        table *= np.float32(MEMORY)
        table += new
        return self._refine(table)

    def _begin(self, box: Region) -> None:
        """Lay out the places of a box: crops where it ends with the picture, little elsewhere."""
        self._box = box
        self._waves[:] = 0
        self._x = _crops(box.left, box.width, COLUMNS)
        self._y = _crops(box.top, box.height, ROWS)
        self._dx = _displacements(self._x, COLUMNS, REACH_X)
        self._dy = _displacements(self._y, ROWS, REACH_Y)
        shape = (LOOKS, len(self._x), len(self._y), MODES)
        self._sums = np.zeros(shape, dtype=np.float32)

    def _refine(self, table: NDArray[np.float32]) -> list[PlaceCandidate]:
        """Judge the best places on the mean itself and refine the best of those."""
        assert self._box is not None
        order = np.argpartition(table.reshape(-1), -4 * RANKED)[-4 * RANKED :]
        order = order[np.argsort(-table.reshape(-1)[order])]
        taken: list[tuple[float, int, Region]] = []
        met: list[FloatArray] = []
        for index in order:
            x, y, mode = np.unravel_index(index, table.shape)
            crops = np.array([*self._x[x], *self._y[y]])
            if len(taken) == RANKED or any(np.abs(crops - m).max() <= STEP for m in met):
                continue
            met.append(crops)
            region = _inside(self._box, crops)
            score = self._scores.one(region, int(mode), self._scores.shares(region))
            taken.append((score, int(mode), region))
        taken.sort(key=lambda each: -each[0])
        found = []
        for score, mode, region in taken[:CLIMBED]:
            if score < HOPE:
                break
            shares = self._scores.shares(region)
            candidate = climb(partial(self._scores.one, mode=mode, shares=shares), region, score)
            if candidate.score >= FOUND:
                found.append(candidate)
        return found


def climb(score: Callable[[Region], float], region: Region, value: float) -> PlaceCandidate:
    """Move and stretch a place in ever smaller steps as long as its score grows."""
    for step in CLIMB:
        moves = [(a, b) for a in range(2) for b in (step, -step)]
        moves += [(a, b) for a in range(2, 4) for b in (step, -step)]
        better = True
        rounds = 0
        while better and rounds < 4:
            better = False
            rounds += 1
            for kind, size in moves:
                trial = _moved(region, kind, size)
                reached = score(trial)
                if reached > value:
                    region, value, better = trial, reached, True
    return PlaceCandidate(region, value)


def _moved(region: Region, kind: int, cells: float) -> Region:
    """Shift (0 across, 1 down) or stretch about the middle (2 across, 3 down) by some cells."""
    across, down = cells * region.width / COLUMNS, cells * region.height / ROWS
    left, top, width, height = region.left, region.top, region.width, region.height
    if kind == 0:
        left += across
    elif kind == 1:
        top += down
    elif kind == 2:
        left, width = left - across, width + 2 * across
    else:
        top, height = top - down, height + 2 * down
    return Region(left, top, width, height)


def _crops(start: float, length: float, cells: int) -> FloatArray:
    """Pairs of cells that are missing at both ends of an axis, shape (places, 2)."""
    most = np.ceil(CROP * cells / STEP) * STEP
    near = np.arange(-2 * STEP, 2.5 * STEP, STEP)
    ends = [
        np.arange(-STEP if outside else 0.0, most + STEP / 2, STEP) if free else near
        for free, outside in ((start <= 0, start < 0), (start + length >= 1, start + length > 1))
    ]
    first, second = np.meshgrid(*ends, indexing="ij")
    return np.stack([first.reshape(-1), second.reshape(-1)], axis=1)


def _displacements(crops: FloatArray, cells: int, reach: int) -> NDArray[np.int64]:
    """Displacement of each cell's middle in half-cell quarters, as an index; (places, cells)."""
    middle = np.arange(cells) + 0.5
    lost = crops.sum(axis=1, keepdims=True)
    moved = (middle - crops[:, :1]) * cells / (cells - lost) - middle
    steps = np.round(moved / STEP).astype(np.int64)
    return np.asarray(np.clip(steps, -reach, reach) + reach)


def _extent(displacements: NDArray[np.int64]) -> NDArray[np.int64]:
    """First displacement of each cell and the end, shape (2, cells)."""
    return np.stack([displacements.min(axis=0), displacements.max(axis=0) + 1])


def _inside(box: Region, crops: FloatArray) -> Region:
    """Region of a marked picture whose box lost these cells: left, right, top, bottom."""
    left, right, top, bottom = crops
    width = box.width * COLUMNS / (COLUMNS - left - right)
    height = box.height * ROWS / (ROWS - top - bottom)
    return Region(
        box.left - left * width / COLUMNS, box.top - top * height / ROWS, width, height
    )  # fmt: skip


def is_near(a: Region, b: Region) -> bool:
    """Whether two places differ by no more than `NEAR` on any side."""
    across = max(abs(a.left - b.left), abs(a.left + a.width - b.left - b.width))
    down = max(abs(a.top - b.top), abs(a.top + a.height - b.top - b.height))
    return max(across, down) < NEAR


def _far(a: Region, b: Region) -> bool:
    """Whether two boxes differ by more than a quarter of a cell or in the sides they share."""
    same = (a.left <= 0) == (b.left <= 0) and (a.top <= 0) == (b.top <= 0)
    same &= (a.left + a.width >= 1) == (b.left + b.width >= 1)
    same &= (a.top + a.height >= 1) == (b.top + b.height >= 1)
    near = max(abs(a.left - b.left), abs(a.left + a.width - b.left - b.width)) < STEP / COLUMNS
    near &= max(abs(a.top - b.top), abs(a.top + a.height - b.top - b.height)) < STEP / ROWS
    return not (same and near)
