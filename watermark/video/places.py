"""Crops of a box in a mean picture, ranked by the pilots.

In: mean pictures of windows and the box inside their bars; out: the best crops, refined. The
picture is resampled to about eight pixels a cell. Each pilot's amplitude is computed at every
displacement that a crop can cause, and becomes a vote whose weight falls with the amplitude's
gradient. The votes are added along the displacements of each crop, in rows first. The best are
refined on interpolated amplitudes; the caller judges them anew. Only pilots that are the same in
all modes vote.
Specification: spec/video-carrier.md, section 6.
"""

import numpy as np
from numpy.typing import NDArray

from watermark.video import _place_kernels as kernels
from watermark.video.grid import Region
from watermark.video.lattices import BLUR, PILOT_TEXTURES, SEEN_TEXTURE
from watermark.video.profile import COLUMNS, ROWS

FloatArray = NDArray[np.float64]
PixelArray = NDArray[np.float32]
IntArray = NDArray[np.int64]

CELL = 8
"""Pixels of a cell in the resampled picture, each way."""

HALVED_CELL = 7.9
"""Least pixels of a cell of the picture at hand whose texture is computed from half the size: a
third of the time. Smaller cells, between bars, would lose texture: with 7, one place of 12 did."""

STEP = 1 / 5
"""Distance of neighbouring crops in cells; only those with an even sum of steps are searched."""

CROP = 0.05
"""Largest crop of a side, in parts of the marked picture."""

LOOSE = 2
"""Steps that a side of the box may lie outside the marked picture, where it is no side of the
picture: bars end within a pixel of the small picture."""

MARGIN = 64
"""Pixels around the resampled picture: more than a cell and its displacements."""

MEMORY = 0.6
"""Weight of earlier superframes in the scores that rank the crops."""

VOTE_ERROR, PLACE_ERROR = 0.6, 0.25
"""Errors of place in pixels that the weights of votes, and of refined crops, allow for."""

RANKED, REFINED, RETURNED = 32, 12, 8
"""Crops that are judged on interpolated amplitudes, refined a little, refined more and returned. Of
48 receivers of random cuts of three films, most of a street in rain, 44 found theirs within 2 s and
all within 3 s; with 64 and 24 as many, with 8 refined 43."""

LASTING, ROUNDS = 4, 2
"""Crops at the head of the table, which are refined however poor they are in this look, and rounds
of the second refinement. A step beside the right place, a sharp picture shows nothing."""

REFINEMENT = 0.06
"""Step of the refinement in cells."""

SIDES = np.array([
    sign * np.array(sides)
    for sides in (
        (1, -1, 0, 0), (0, 0, 1, -1), (1, 1, 0, 0), (0, 0, 1, 1),
        (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1),
    )
    for sign in (1.0, -1.0)
])  # fmt: skip
"""Changes of the cells missing left, right, at the top and the bottom: shifts, stretches, single
sides. Shifts and stretches alone do not reach a place with one side wrong."""

VOTE = 24.0
"""Vote of a pilot that is sure. Sums of a row and of all pilots have to fit into their words."""


class PlaceTable:
    """Scores of all crops of a box, summed over windows at the same phase of the superframes.

    Parameters
    ----------
    pilots : ndarray of int64, shape (count, 3)
        Template, row and column of each, in ascending order of the rows.
    dither : ndarray of float64, shape (count,)
        Offsets of their lattices in steps.
    step : float
        Their fine step.
    signs : ndarray of float32, shape (count,)
        Their signs at even places.
    looks : int
        Windows a superframe.
    """

    def __init__(
        self, pilots: IntArray, dither: FloatArray, step: float, signs: PixelArray, looks: int
    ) -> None:
        self._pilots, self._looks = pilots, looks
        self._dither, self._step, self._signs = dither.astype(np.float32), step, signs
        place = (np.arange(CELL) + 0.5) / CELL
        factors = np.stack([np.sin(2 * np.pi * place), np.sin(np.pi * place) ** 2])
        norm = np.sqrt(np.prod(np.sum(factors**2, axis=1)))
        self._factors = np.asarray(factors / norm, dtype=np.float32)
        blur = np.exp(np.array([-2.0, 2.0]) * BLUR)
        limits = SEEN_TEXTURE * np.multiply.outer(PILOT_TEXTURES, blur)
        self._limits = limits.astype(np.float32)
        self._heads = np.zeros(looks)
        self._box: Region | None = None

    def leads(self, phase: int) -> bool:
        """Whether the best place of no other look has a greater sum."""
        return bool(self._heads[phase] >= self._heads.max())

    def look(
        self, mean: PixelArray, still: PixelArray, half: PixelArray, box: Region, phase: int
    ) -> list[Region]:
        """Return the likeliest places of the marked picture, crops of a box in a mean picture.

        Parameters
        ----------
        mean : ndarray of float32, shape (rows, columns)
            Mean luma of a window in levels of 8 bits.
        still : ndarray of float32, shape (rows, columns)
            A frame of it, which shows the texture.
        half : ndarray of float32, shape (rows // 2, columns // 2)
            The same at half the size.
        box : Region
            The picture inside its bars.
        phase : int
            Number of the look in its superframe.

        Returns
        -------
        list of Region
        """
        if self._box is None or _far(box, self._box):
            self._begin(box, mean.shape)
        assert self._box is not None
        if self._from_half:
            kernels.resample_into(half, *self._half_taps, MARGIN // 2, self._half)
        else:
            kernels.resample_into(still, *self._taps, MARGIN, self._picture)
            kernels.halve_into(self._picture, self._half)
        kernels.fine_texture_into(self._half, self._texture)
        kernels.resample_into(mean, *self._taps, MARGIN, self._picture)
        # 1. Fields: the mean of each pilot's cell at every displacement. 2. Votes: what each
        # displacement says about the pilot's sign. 3. Scores: sums of votes along all crops, with
        # those of looks before. 4. The best are refined.
        kernels.pilot_fields_into(
            self._picture, self._pilots, self._first_x, self._first_y, self._factors, self._fields
        )
        squares = kernels.pilot_votes_into(
            self._fields, self._texture, self._pilots, self._first_x, self._first_y, self._bounds,
            self._dither, self._step, self._signs, self._limits, VOTE_ERROR, VOTE, self._votes,
        )  # fmt: skip
        kernels.place_scores_into(
            self._votes, self._pilots, self._across, self._down, int(VOTE) * len(self._pilots),
            1 / max(1.0, squares), MEMORY, self._tables[phase], self._best, self._choice,
        )  # fmt: skip
        self._heads[phase] = self._best.max()
        return self._refine(self._box)

    def _begin(self, box: Region, shape: tuple[int, ...]) -> None:
        """Lay out the crops of a box in such a picture and the displacements that they cause."""
        self._box = box
        self._x = _crops(box.left, box.width, COLUMNS)
        self._y = _crops(box.top, box.height, ROWS)
        across, self._first_x, width = _displacements(self._x, COLUMNS)
        down, self._first_y, height = _displacements(self._y, ROWS)
        self._across = across.astype(np.uint64)
        self._down = down.astype(np.uint64)
        rows, columns = height + 2 * MARGIN, width + 2 * MARGIN
        axes = ((height, shape[0], box.top, box.height), (width, shape[1], box.left, box.width))
        self._taps = tuple(
            tap
            for count, size, start, length in axes
            for tap in source_taps(count, size, start * size, length * size)
        )
        cell = min(box.height * shape[0] / ROWS, box.width * shape[1] / COLUMNS)
        self._from_half = cell >= HALVED_CELL
        # Half a pixel at the end is left out.
        self._half_taps = tuple(
            tap
            for count, size, start, length in axes
            for tap in source_taps(
                count // 2, size // 2, start * size / 2, length * size * (count // 2) / count
            )
        )
        self._picture = np.zeros((rows, columns), dtype=np.float32)
        self._half = np.zeros((rows // 2, columns // 2), dtype=np.float32)
        self._texture = np.zeros((rows // 2 - 3, columns // 2 - 3), dtype=np.float32)
        self._bounds = np.array([MARGIN + height - CELL, MARGIN + width - CELL, MARGIN])
        self._size = np.array([width, height, MARGIN, COLUMNS, ROWS], dtype=np.float32)
        count, wide, high = len(self._pilots), across.max() + 1, down.max() + 1
        self._fields = np.zeros((count, high + 2, wide + 2), dtype=np.float32)
        self._votes = np.zeros((count, wide, -4 * (-high // 4)), dtype=np.int16)
        first = self._first_x[self._pilots[:, 2]], self._first_y[self._pilots[:, 1]]
        self._first = np.stack(first, axis=1).astype(np.float32)
        self._heads[:] = 0.0
        places = len(self._x), len(self._y)
        self._tables = np.zeros((self._looks, *places), dtype=np.float32)
        self._best = np.zeros(places[0], dtype=np.float32)
        self._choice = np.zeros(places[0], dtype=np.int64)

    def _refine(self, box: Region) -> list[Region]:
        """Judge the best crops anew and move their sides."""
        rows = np.argsort(-self._best)[:RANKED]
        places = np.hstack([self._x[rows], self._y[self._choice[rows]]])
        # The table remembers earlier looks. A step beside the place, this one may show nothing.
        likely = _apart(places, self._climb(places, SIDES[:8], 0), REFINED - LASTING)
        places = np.vstack([places[:LASTING], places[likely]])
        places = places[_apart(places, self._climb(places, SIDES[:8], 1), RETURNED)]
        scores = self._climb(places, SIDES, ROUNDS)
        return [_inside(box, places[n]) for n in _apart(places, scores, RETURNED)]

    def _climb(self, crops: FloatArray, sides: FloatArray, rounds: int) -> FloatArray:
        """Move crops, in place; return their scores."""
        scores = np.zeros(len(crops))
        kernels.climb_into(
            self._fields, self._texture, self._pilots, self._first, self._size, self._dither,
            self._step, self._signs, self._limits, PLACE_ERROR, REFINEMENT * sides, rounds, crops,
            scores,
        )  # fmt: skip
        return scores


def _apart(places: FloatArray, scores: FloatArray, count: int) -> list[int]:
    """Return indices of the best places, of which none is next to another."""
    near = np.abs(places[:, None] - places).max(axis=2) < 1.1 * STEP
    apart: list[int] = []
    taken = np.zeros(len(places), dtype=bool)
    for n in np.argsort(-scores).tolist():
        if len(apart) == count:
            break
        if not taken[n]:
            apart.append(n)
            taken |= near[n]
    return apart


def _crops(start: float, length: float, cells: int) -> FloatArray:
    """Pairs of cells that are missing at both ends of an axis, shape (places, 2)."""
    most = 2 * int(np.ceil(CROP * cells / STEP / 2 - 1e-9))
    ends = [np.arange(0 if free else -LOOSE, most + 1) * STEP for free in _edges(start, length)]
    first, second = np.meshgrid(*ends, indexing="ij")
    return np.stack([first.reshape(-1), second.reshape(-1)], axis=1)


def _edges(start: float, length: float) -> tuple[bool, bool]:
    """Whether each end of a box is one of the picture."""
    return abs(start) < 1e-6, abs(start + length - 1) < 1e-6


def _displacements(crops: FloatArray, cells: int) -> tuple[IntArray, IntArray, int]:
    """First pixel of each cell for each crop, less the least one; that one; pixels of the axis."""
    size = round(CELL * (cells - float(crops.sum(axis=1).mean())))
    middle = np.arange(cells) + 0.5
    lost = crops.sum(axis=1, keepdims=True)
    first = np.round(size * (middle - crops[:, :1]) / (cells - lost) - CELL / 2).astype(np.int64)
    least = first.min(axis=0)
    # A pixel more at each side, for the gradient.
    return first - least, least + MARGIN - 1, size


def source_taps(count: int, size: int, start: float, length: float) -> tuple[IntArray, PixelArray]:
    """Four source pixels of each of `count` new ones and their weights (Catmull and Rom 1974)."""
    place = start + (np.arange(count) + 0.5) * length / count - 0.5
    first = np.floor(place).astype(np.int64)
    f = place - first
    weights = [
        f * (f * (2 - f) - 1) / 2,
        1 + f * f * (3 * f - 5) / 2,
        f * (1 + f * (4 - 3 * f)) / 2,
        f * f * (f - 1) / 2,
    ]
    taps = np.clip(first[:, None] + np.arange(-1, 3), 0, size - 1)
    return taps, np.stack(weights, axis=1).astype(np.float32)


def _inside(box: Region, crops: FloatArray) -> Region:
    """Region of a marked picture whose box lost these cells: left, right, top, bottom."""
    left, right, top, bottom = crops
    width = box.width * COLUMNS / (COLUMNS - left - right)
    height = box.height * ROWS / (ROWS - top - bottom)
    return Region(box.left - left * width / COLUMNS, box.top - top * height / ROWS, width, height)


def _far(a: Region, b: Region) -> bool:
    """Whether two boxes differ by more than a quarter of a cell or in the sides they share."""
    same = _edges(a.left, a.width) == _edges(b.left, b.width)
    same &= _edges(a.top, a.height) == _edges(b.top, b.height)
    near = max(abs(a.left - b.left), abs(a.left + a.width - b.left - b.width)) < 0.25 / COLUMNS
    near &= max(abs(a.top - b.top), abs(a.top + a.height - b.top - b.height)) < 0.25 / ROWS
    return not (same and near)
