"""Lattices of data and pilots in cells of any texture: which one, and how near its points.

A receiver's view of the texture is not exactly the embedder's, so all lattices count, each with its
probability. Specification: spec/video-carrier.md, section 4.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from watermark.video.profile import COARSE, PILOT_SPREADS, STRONG_TEXTURE, TEXTURE

FloatArray = NDArray[np.float64]

PILOT_TEXTURES = TEXTURE, STRONG_TEXTURE
"""Least textures for the second and the third of the pilots' steps."""

BLUR = 0.15
"""Uncertainty of a cell's texture, as a part of it; coding also lowers it a little."""

SEEN_TEXTURE = 0.93
"""Texture that a cell shows a receiver, as a part of the embedder's, with the mark in it."""

LEVELS = 256
"""Distances from a lattice's point, up to half a period, at which densities are tabulated."""


def lattice_shares(texture: FloatArray, limits: Sequence[float]) -> FloatArray:
    """Probabilities of the lattices of cells of these textures, shape (1 + len(limits), ...).

    Parameters
    ----------
    texture : ndarray of float64
        In luma of 8 bits.
    limits : sequence of float
        Textures from which an embedder takes the second lattice, the third and so on.

    Examples
    --------
    >>> lattice_shares(np.array([0.0, 1.9, 9.0]), [2.0]).round(1).tolist()
    [[1.0, 0.5, 0.0], [0.0, 0.5, 1.0]]
    """
    seen = np.log(np.maximum(texture, 1e-3) / SEEN_TEXTURE)
    above = [1 / (1 + np.exp(-np.clip((seen - np.log(limit)) / BLUR, -30, 30))) for limit in limits]
    bounds = np.stack([np.ones_like(seen), *above, np.zeros_like(seen)])
    return np.asarray(bounds[:-1] - bounds[1:])


def pilot_waves(place: FloatArray, texture: FloatArray) -> FloatArray:
    """How far pilots speak for bit 0, from 1 down to -1 for bit 1; 0 on average for noise.

    Parameters
    ----------
    place : ndarray of float64, shape (PILOTS,)
        Mean amplitudes less the dither, in the pilots' fine steps.
    texture : ndarray of float64, shape (PILOTS,)
        Textures of their cells in luma of 8 bits.

    Examples
    --------
    >>> pilot_waves(np.array([0.0, 0.5, 1.25]), np.zeros(3)).round(6).tolist()
    [1.0, -1.0, 0.0]
    """
    waves = np.cos(2 * np.pi * np.divide.outer(place, PILOT_SPREADS).T)
    return np.asarray(np.sum(lattice_shares(texture, PILOT_TEXTURES) * waves, axis=0))


def densities(
    place: FloatArray,
    bit: NDArray[np.int64] | int,
    shares: FloatArray,
    noises: tuple[float, ...],
    spreads: Sequence[int] = (1, COARSE),
) -> FloatArray:
    """Density of amplitudes, less the dither, around the lattices of a bit with noise.

    Parameters
    ----------
    place : ndarray of float64, shape (values,)
        In fine steps.
    bit : ndarray of int64, shape (values,), or int
    shares : ndarray of float64, shape (len(spreads), values)
        Probability of each lattice.
    noises : tuple of float
        Standard deviations in fine steps.
    spreads : sequence of int
        Steps of the lattices in fine ones.

    Returns
    -------
    ndarray of float64, shape (len(noises), values)

    Examples
    --------
    >>> on_a_point = densities(np.array([0.0]), 0, np.array([[1.0], [0.0]]), (0.1, 0.2, 0.4))
    >>> on_a_point.ravel().round(1).tolist()
    [10.0, 5.0, 2.7]
    """
    total = np.full((len(noises), place.size), 1e-4)
    for period, share in zip(spreads, shares, strict=True):
        away = place / period - np.asarray(bit) / 2
        levels = np.rint(np.abs(away - np.round(away)) * (2 * LEVELS)).astype(np.intp)
        # All points of a lattice together weigh the same, however few they are.
        total += share * _table(period, noises).take(levels, axis=1)
    return total


@lru_cache(maxsize=32)
def _table(period: int, noises: tuple[float, ...]) -> FloatArray:
    """Density at each distance from a point with each noise, shape (len(noises), LEVELS + 1)."""
    away, sigma = np.arange(LEVELS + 1) * period / (2 * LEVELS), np.array(noises)[:, None]
    around = [np.exp(-0.5 * ((away + neighbour * period) / sigma) ** 2) for neighbour in (-1, 0, 1)]
    return np.asarray(np.sum(around, axis=0) * period / sigma)
