"""Find the place of a marked picture in the picture at hand, from means over a window.

In: small frames; out: places worth a try. Projection is linear, so a place is judged on the mean of
a window, five or ten times a superframe: the whole picture, the box inside what looks like bars,
and the best crops of both (`watermark.video.places`), after a while less often.
Specification: spec/video-carrier.md, section 6.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from watermark.video import _kernels
from watermark.video._place_kernels import halve_into
from watermark.video.bars import content_box, places_around
from watermark.video.grid import WHOLE, Region
from watermark.video.modes import PilotWatch
from watermark.video.pilot_scores import PilotScores
from watermark.video.places import SIDES, PlaceTable
from watermark.video.profile import COLUMNS, ROWS
from watermark.video.timing import Timing

Small = NDArray[np.uint16]
FloatArray = NDArray[np.float64]

SCALE = 256.0
"""A luma level of 8 bits in the small frames."""

LOOKS = 10
"""Looks per superframe where the picture moves: the best one is at most a twentieth of a superframe
off, for the mean over another window is another picture. Elsewhere every second one is left out.
Eight take less time, but of 36 receivers of random cuts of a street in rain 26 find it
within 2 s, with ten 31."""

EAGER, REST = 3, 3
"""Superframes that are all searched for crops, the time within which a place has to be found; then,
of so many one is, and in the others the look whose best crop has the greatest sum so far. A street
in rain shows its mark in few superframes, and always in the same looks. With every second
superframe searched and no look of the others, 31 of those receivers found it within 3 s; with this
all did, and a superframe takes no more time."""

MOVING = 3.0
"""Least mean difference between a frame of a moving picture and the mean of its window."""

SPARSE = 4
"""Every such line and column is looked at for motion."""

CLIMB = (0.03, 0.015, 0.0075)
"""Steps of the last refinement in cells."""

SHIFT = 1 / 16
"""Distance in superframes of the three windows that judge the best places."""

PROMISING, JUDGED = 4.6, 3
"""Least score of a crop on the mean of the middle window to be judged on all, and how many are. In
fourteen films without a mark 0 to 58 of 100 looks reach it, 16 in the median."""

HOPE, TRIED = 5.0, 2
"""Least score of a place before its last refinement, and the number of those refined. In those
films at most 20 of 100 looks reach 4.8 and 12 reach 5.1, but for a talk on a stage: 49 and 28."""

LIKELY, FOUND = 3.8, 6.2
"""Least score, in standard deviations of noise, of a usual place and of any other to be tried.
A still picture with flat areas reaches 3.7 and 6.3 without a mark, others 3.4 and 5.8."""

NEAR = 0.002
"""Places whose sides differ by no more than this part of the picture count as one."""

MIDDLE = Region(-1 / 6, 0.0, 4 / 3, 1.0)
"""The middle of 16:9 in 4:3."""


@dataclass(frozen=True, slots=True)
class PlaceCandidate:
    """A place and the score of its pilots in standard deviations of noise."""

    region: Region
    score: float


class _Judgement(NamedTuple):
    """A crop on the mean of a window: its score in standard deviations of noise in the best mode.

    Shares are the probabilities of its pilots' steps.
    """

    score: float
    mode: int
    window: int
    region: Region
    shares: FloatArray


class PlaceSearch:
    """Collect small frames and look for the pilots several times a superframe.

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
    crops : bool
        Whether other places than the usual ones are searched.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        timing: Timing,
        *,
        key: int = 0,
        strength: float = 1.0,
        whole: Region = WHOLE,
        crops: bool = True,
    ) -> None:
        self._timing, self._whole = timing, whole
        self._scores = PilotScores(PilotWatch(key, strength), shape)
        self._shift = round(timing.span * SHIFT)
        # Enough for three windows `_shift` apart; `_sum` follows the middle one.
        self._frames: deque[Small] = deque(maxlen=timing.window + 2 * self._shift)
        self._sum = np.zeros(shape, dtype=np.int32)
        self._means = np.zeros((3, *shape), dtype=np.float32)
        self._still = np.zeros(shape, dtype=np.float32)
        self._half = np.zeros((shape[0] // 2, shape[1] // 2), dtype=np.float32)
        self._spare = np.zeros(shape, dtype=np.int32)
        self._moving = False
        self._count = self._looks = 0
        scores, common = self._scores, self._scores.common
        # Crops of the whole picture, and of that inside its bars.
        self._tables = [
            PlaceTable(
                scores.pilots[common],
                scores.dither[common],
                scores.step,
                scores.signs[0, common],
                LOOKS,
            )
            for _ in range(2 * crops)
        ]

    def process(self, small: Small) -> list[PlaceCandidate]:
        """Take the next frame; return the places that look marked, usual ones first."""
        frames, window, shift = self._frames, self._timing.window, self._shift
        if len(frames) == frames.maxlen:
            _kernels.accumulate_into(frames[shift], -1, self._sum)
        frames.append(small)
        if len(frames) > 2 * shift:
            _kernels.accumulate_into(frames[-1 - shift], 1, self._sum)
        self._count += 1
        due = self._count * LOOKS >= (self._looks + LOOKS * 0.75) * self._timing.span
        if not due or len(frames) < window + 2 * shift:
            return []
        self._looks += 1
        if self._looks % 2 and not self._moving:
            return []
        _kernels.scale_into(self._sum, 1 / (SCALE * window), self._means[1])
        # Where the picture moves, its mean is blurred: a frame shows what the embedder saw.
        _kernels.scale_into(frames[shift + window // 2], 1 / SCALE, self._still)
        apart = self._still[::SPARSE, ::SPARSE] - self._means[1, ::SPARSE, ::SPARSE]
        self._moving = float(np.abs(apart).mean()) > MOVING
        return self._look()

    def _shift_means(self) -> None:
        """Compute the means of the windows before and after the middle one."""
        frames, window, shift = tuple(self._frames), self._timing.window, self._shift
        first, second = frames[:shift], frames[shift : 2 * shift]
        third, fourth = frames[window : window + shift], frames[window + shift :]
        for n, more, less in ((0, first, third), (2, fourth, second)):
            total = self._spare
            np.copyto(total, self._sum)
            for added, taken in zip(more, less, strict=True):
                _kernels.accumulate_into(added, 1, total)
                _kernels.accumulate_into(taken, -1, total)
            _kernels.scale_into(total, 1 / (SCALE * window), self._means[n])

    def _look(self) -> list[PlaceCandidate]:
        mean = self._means[1]
        self._scores.look_at(mean)
        halve_into(self._still, self._half)
        self._scores.take_texture(self._half)
        box = content_box(mean)
        usual = [self._whole, MIDDLE if box == WHOLE else box, *places_around(box)]
        # What looks like bars may be a part of the picture: a planet in a black sky.
        boxes = [self._whole] if box == WHOLE else [self._whole, box]
        found = [
            PlaceCandidate(region, self._scores.best(region, self._scores.shares(region))[0])
            for region in usual
        ]
        found = [candidate for candidate in found if candidate.score >= LIKELY]
        superframes, phase = divmod(self._looks, LOOKS)
        resting = superframes >= EAGER and superframes % REST
        others = [
            place
            for each, table in zip(boxes, self._tables, strict=False)
            if not resting or table.leads(phase)
            for place in self._crops(each, table, phase)
        ]
        # Next to a usual place it is that one: its sides are exact.
        found += [
            other
            for other in sorted(others, key=lambda candidate: -candidate.score)
            if not any(is_near(other.region, usual.region) for usual in found)
        ]
        return found

    def _crops(self, box: Region, table: PlaceTable, phase: int) -> list[PlaceCandidate]:
        """Refine the best crops of a box on the mean pictures themselves."""
        crops = table.look(self._means[1], self._still, self._half, box, phase)
        judged = [each for each in self._judge(1, crops) if each.score >= PROMISING][:JUDGED]
        if not judged:
            return []
        self._shift_means()
        promising = [each.region for each in judged]
        judged += self._judge(0, promising) + self._judge(2, promising)
        judged.sort(key=lambda each: -each.score)
        found: list[PlaceCandidate] = []
        # The likeliest crops are refined by climbing.
        for each in judged[:TRIED]:
            if each.score < HOPE:
                break
            self._scores.look_at(self._means[each.window])
            score = partial(self._scores.one, mode=each.mode, shares=each.shares)
            candidate = climb(score, each.region, each.score)
            if candidate.score >= FOUND:
                found.append(candidate)
        return found

    def _judge(self, window: int, crops: list[Region]) -> list[_Judgement]:
        """Score crops on the mean of a window; return their judgements, best first."""
        self._scores.look_at(self._means[window])
        judged = []
        for region in crops:
            shares = self._scores.shares(region)
            judged.append(_Judgement(*self._scores.best(region, shares), window, region, shares))
        return sorted(judged, key=lambda each: -each.score)


def climb(score: Callable[[Region], float], region: Region, value: float) -> PlaceCandidate:
    """Move sides of a place, alone and in pairs, in ever smaller steps while its score grows."""
    for step in CLIMB:
        better = True
        rounds = 0
        while better and rounds < 4:
            better = False
            rounds += 1
            for sides in SIDES:
                trial = _moved(region, step * sides)
                reached = score(trial)
                if reached > value:
                    region, value, better = trial, reached, True
    return PlaceCandidate(region, value)


def _moved(region: Region, cells: FloatArray) -> Region:
    """Move the left, right, upper and lower side of a place outwards by some cells."""
    left, right, top, bottom = (cells * np.repeat([1 / COLUMNS, 1 / ROWS], 2)).tolist()
    return Region(
        region.left - left * region.width,
        region.top - top * region.height,
        region.width * (1 + left + right),
        region.height * (1 + top + bottom),
    )


def is_near(a: Region, b: Region) -> bool:
    """Whether two places differ by no more than `NEAR` on any side."""
    across = max(abs(a.left - b.left), abs(a.left + a.width - b.left - b.width))
    down = max(abs(a.top - b.top), abs(a.top + a.height - b.top - b.height))
    return max(across, down) < NEAR
