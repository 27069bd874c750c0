"""The pattern of a superframe: which amplitude each template is moved by.

In: the mean amplitudes of a picture over a window, its textures and the payload; out: amplitudes at
any strength. Specification: spec/video-carrier.md, section 4.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.video.lattices import PILOT_TEXTURES
from watermark.video.modes import Mode
from watermark.video.profile import (
    COARSE,
    COLUMNS,
    LONE,
    PILOT_SPREADS,
    ROWS,
    STEPS,
    TEMPLATES,
    TEXTURE,
)

FloatArray = NDArray[np.float64]

SMALL_CELL = 80.0
"""Pixels of a cell below which every superframe has the next wider step: in cells of 8 by 8, one
block of a coder, MPEG-2 at 4 Mbit/s takes a quarter of the fine bits otherwise."""


EYE_NOISE = 2.0
"""Variance in luma of 8 bits of the noise that vision adds to a picture (Sheikh and Bovik, "Image
information and visual quality", IEEE TIP 15(2), 2006)."""

LEAST_PRICE = 0.25
"""Least price of a move, in that of one where a picture is full of detail: noise in a plain wall is
seen, whatever information is lost. In four films moves in cells of energy .5 and less cost .12 to
.6 of the VMAF that the same moves in textured cells do."""

SMOOTH = 0.5
"""Texture in luma of 8 bits up to which the pattern has to show no lattice of cells: more hides it
even in a frame at eight times its contrast."""


@dataclass(frozen=True, slots=True)
class Way:
    """Part of the way to its lattice point that an amplitude is moved, 0.3 to 1.

    Less is harder to see and leaves less room for noise; receivers take the rest for noise.

    Attributes
    ----------
    fine, coarse : float
        In cells with the fine and with the coarse step.
    """

    fine: float = 1.0
    coarse: float = 1.0


@dataclass(frozen=True, slots=True)
class Strength:
    """How strongly a superframe is marked.

    Attributes
    ----------
    rung : int
        Which of the profile's steps.
    first, rest : Way
        Of the values of L0, and of those of L1.
    lone : bool
        Whether L0 alone has all values, as in `LONE`.
    """

    rung: int
    first: Way = Way()
    rest: Way = Way()
    lone: bool = False

    @property
    def mode(self) -> int:
        """Which of an embedder's modes: those of its profile, then those of `LONE`."""
        return self.rung + len(STEPS) * self.lone


def fixed_strength(place: int, shape: tuple[int, int]) -> Strength:
    """Strength of the superframe at `place` that was not tried, in a picture of this shape.

    The first one is stronger, since the rate control of coders starts poor.

    Examples
    --------
    >>> fixed_strength(0, (720, 1280)).rung, fixed_strength(5, (720, 1280)).rung
    (1, 0)
    """
    return Strength(min(int(has_small_cells(shape)) + int(place == 0), len(STEPS) - 1))


def has_small_cells(shape: tuple[int, int]) -> bool:
    """Whether the cells of a picture of this height and width have less than `SMALL_CELL`."""
    return shape[0] * shape[1] < SMALL_CELL * ROWS * COLUMNS


@dataclass(frozen=True, slots=True)
class Design:
    """A superframe that waits for its strength.

    Attributes
    ----------
    place : int
        Of the superframe.
    host : ndarray of float64, shape (TEMPLATES, ROWS, COLUMNS)
        Mean amplitudes of the picture in luma of 8 bits.
    energy : ndarray of float64, shape (ROWS, COLUMNS)
        Mean over the frames of the sum of the squares of a cell's amplitudes.
    texture : ndarray of float64, shape (ROWS, COLUMNS)
        Texture of the cells.
    coded, lone : ndarray of int64, shape (DATA,)
        Coded bits of the payload, and of L0 alone.
    """

    place: int
    host: FloatArray
    energy: FloatArray
    texture: FloatArray
    coded: NDArray[np.int64]
    lone: NDArray[np.int64]

    def bits(self, mode: Mode) -> NDArray[np.int64]:
        """Bit of every value, pilots included, shape (POSITIONS,)."""
        layout = mode.layout
        bits = np.empty(self.host.size, dtype=np.int64)
        bits[layout.pilots] = layout.pilot_bits ^ (self.place & 1)
        bits[layout.data] = self.lone if mode.profile is LONE else self.coded
        return bits

    @property
    def textured(self) -> NDArray[np.bool_]:
        """Cells with the coarse step, shape (ROWS, COLUMNS)."""
        return self.texture > TEXTURE

    @property
    def prices(self) -> FloatArray:
        """What moves cost in cells with the fine and with the coarse step, shape (2,).

        Of the information that the eye gets of detail of energy E, a small move takes a part in
        proportion to E / (E + `EYE_NOISE`): where there is no detail, there is none to lose. Each
        is a sum over its cells, as a part of all cells.
        """
        price = np.maximum(LEAST_PRICE, self.energy / (self.energy + EYE_NOISE))
        kinds = ~self.textured, self.textured
        return np.array([np.sum(price[kind]) for kind in kinds]) / price.size

    @property
    def smooth(self) -> NDArray[np.bool_]:
        """Cells where nothing hides a lattice, shape (ROWS, COLUMNS)."""
        return self.texture <= SMOOTH

    def moves(self, modes: Sequence[Mode], strength: Strength) -> FloatArray:
        """Amplitudes to add at one strength, shape (TEMPLATES, ROWS, COLUMNS).

        Pilots end as far from their lattice points as L0, in luma, so that they show the noise.
        """
        mode = modes[strength.mode]
        shape, pilots = self.host.shape, mode.layout.pilots
        textures = np.tile(self.texture.reshape(-1), TEMPLATES)
        width = mode.step * np.where(textures > TEXTURE, float(COARSE), 1.0)
        first, rest = (
            np.where(textures > TEXTURE, way.coarse, way.fine)
            for way in (strength.first, strength.rest)
        )
        second = mode.layout.data[mode.profile.l0_coded :]
        first[second] = rest[second]
        kept = width * (1 - first)
        offset = mode.step * mode.layout.dither
        offset[pilots] *= mode.pilot_step / mode.step
        rank = np.searchsorted(PILOT_TEXTURES, textures[pilots])
        width[pilots] = mode.pilot_step * np.array(PILOT_SPREADS, dtype=np.float64)[rank]
        place = (self.host.reshape(-1) - offset) / width - self.bits(mode) / 2
        share = np.maximum(0.0, 1 - kept / width)
        return np.asarray(((np.round(place) - place) * width * share).reshape(shape))

    def mixed(
        self, modes: Sequence[Mode], strengths: Sequence[Strength], choice: NDArray[np.int64]
    ) -> FloatArray:
        """Amplitudes to add where each value has the strength of its own `choice`."""
        all_moves = np.stack([self.moves(modes, strength) for strength in strengths])
        choice = choice.reshape(self.host.shape)
        return np.asarray(np.take_along_axis(all_moves, choice[None], axis=0)[0])
