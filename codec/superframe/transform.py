"""The transform of the residual: markers' metric and KLT over parameters, cosines over time.

A block of 32 frames of parameters goes in and 32 P coefficients come out, in such units that the
sum of their squares is the squared displacement of all markers in all frames, and in scan order:
the largest expected first. The basis belongs to a voice (`codec.superframe.coding`).
Specification: spec/bitstream.md, section 6.
"""

import functools
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.cues.timeline import TICKS
from codec.errors import CueError

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


_GAINS = np.sqrt(np.where(np.arange(TICKS) == 0, 1.0, 2.0) / TICKS)

COSINES = _GAINS[:, None] * np.cos(
    np.pi / TICKS * np.arange(TICKS)[:, None] * (np.arange(TICKS) + 0.5)
)
"""The orthonormal DCT-II over the frames of a superframe, shape (32, 32) (T1)."""


@dataclass(frozen=True, slots=True)
class Basis:
    """An invertible map between blocks of parameters and coefficients.

    Attributes
    ----------
    matrix : ndarray of float64, shape (P, P)
        Row vectors of parameters times this are channels in millimetres.
    scales : ndarray of int64, shape (P, 32)
        Expected magnitude of every coefficient: 4 log2 of its standard deviation, rounded.
    """

    matrix: Array
    scales: Ints
    inverse: Array = field(init=False)
    order: Ints = field(init=False)
    scan_scales: Ints = field(init=False)
    before: Ints = field(init=False)
    after: Ints = field(init=False)

    def __post_init__(self) -> None:
        channels = len(self.matrix)
        if self.matrix.shape != (channels, channels) or self.scales.shape != (channels, TICKS):
            raise CueError(f"basis of {self.matrix.shape} with scales of {self.scales.shape}")
        order = np.argsort(-self.scales.T.reshape(-1), kind="stable")
        # Numbers count frequency by frequency, so that equal scales go by frequency first.
        channel, frequency = order % channels, order // channels
        rank = np.empty((channels, TICKS), dtype=np.int64)
        rank[channel, frequency] = np.arange(order.size)
        object.__setattr__(self, "inverse", np.linalg.inv(self.matrix))
        object.__setattr__(self, "order", channel * TICKS + frequency)
        object.__setattr__(self, "scan_scales", self.scales.reshape(-1)[self.order])
        object.__setattr__(self, "before", _neighbours(rank, channel, frequency))
        object.__setattr__(self, "after", _neighbours(rank, channel, frequency, after=True))

    def forward(self, block: Array) -> Array:
        """Return the coefficients of a block, shape (32, P) to (32 P,) in scan order."""
        return np.asarray((COSINES @ (block @ self.matrix)).T.reshape(-1)[self.order])

    def backward(self, coefficients: Array) -> Array:
        """Return the block of coefficients in scan order."""
        grid = np.empty(coefficients.size)
        grid[self.order] = coefficients
        channels = COSINES.T @ grid.reshape(-1, TICKS).T
        return np.asarray(channels @ self.inverse)

    def between(self, before: Array | None, after: Array | None) -> Array:
        """Return the likeliest block between two others; one of them may be unknown.

        Linear estimation (Wiener 1949), channel by channel, from the spectra that the scales imply.

        Parameters
        ----------
        before, after : ndarray of float64, shape (32, P), or None
        """
        known = [block for block in (before, after) if block is not None]
        if not known:
            return np.zeros((TICKS, len(self.matrix)))
        times = np.concatenate(
            [
                np.arange(TICKS) + shift
                for block, shift in ((before, -TICKS), (after, TICKS))
                if block is not None
            ]
        )
        channels = np.concatenate(known) @ self.matrix
        lags_in = np.abs(times[:, None] - times)
        lags_out = np.abs(np.arange(TICKS)[:, None] - times)
        guess = np.empty((TICKS, len(self.matrix)))
        for c, correlation in enumerate(_correlations(self.scales.tobytes())):
            square = correlation[lags_in] + _NOISE * correlation[0] * np.eye(len(times))
            guess[:, c] = correlation[lags_out] @ np.linalg.solve(square, channels[:, c])
        return np.asarray(guess @ self.inverse)


Bases = tuple[Basis, ...]
"""Bases, one named by each superframe (Q6): residual, loose, plain, filmed."""


_NOISE = 0.02
"""Assumed noise share of a channel's variance."""

_LAGS = 3 * TICKS
"""Ticks over which correlations are taken."""


@functools.lru_cache(maxsize=8)
def _correlations(scales: bytes) -> Array:
    """Return the covariance of each channel by lag in frames, shape (P, 96), from its scales."""
    power = 2.0 ** (np.frombuffer(scales, dtype=np.int64).reshape(-1, TICKS) / 2)
    fine = np.arange(16 * TICKS) / 16
    spectrum = np.stack([np.interp(fine, np.arange(TICKS), row) for row in power])
    waves = np.cos(np.pi * np.outer(fine, np.arange(_LAGS)) / TICKS)
    return np.asarray(spectrum @ waves / len(fine))


def _neighbours(rank: Ints, channel: Ints, frequency: Ints, *, after: bool = False) -> Ints:
    """Return for each coefficient the scan numbers of three others coded before it, or -1.

    They are those of the same channel one and two frequencies lower, and of the channel before
    at the same frequency (paragraph C3). With `after` they are those which count it in turn.
    """
    own, side = np.arange(channel.size), -1 if after else 1
    columns = []
    for d_channel, d_frequency in ((0, 1), (0, 2), (1, 0)):
        c, f = channel - side * d_channel, frequency - side * d_frequency
        there = (c >= 0) & (f >= 0) & (c < len(rank)) & (f < TICKS)
        number = rank[np.where(there, c, 0), np.where(there, f, 0)]
        columns.append(np.where(there & (side * (own - number) > 0), number, -1))
    return np.ascontiguousarray(np.stack(columns, axis=1))


def marker_metric(voice: Voice, poses: Array) -> Array:
    """Return the matrix G such that r G r' is the squared displacement of all markers, mm**2.

    Parameters
    ----------
    voice : Voice
    poses : ndarray of float64, shape (K, P)
        Where the models are linearised; the metric is the mean over them.
    """
    size = poses.shape[1]
    metric = np.zeros((size, size))
    steps = 1e-3 * np.maximum(np.std(poses, axis=0), 1e-2)
    for pose in poses:
        moved = np.concatenate([pose + np.diag(steps), pose - np.diag(steps)])
        markers = voice.reconstruct(moved).astype(np.float64).reshape(2, size, -1)
        jacobian = (markers[0] - markers[1]) / (2 * steps[:, None])
        metric += jacobian @ jacobian.T
    return metric / len(poses)


def klt(metric: Array, covariance: Array) -> Array:
    """Return the matrix that decorrelates parameters of a covariance under a metric.

    Parameters
    ----------
    metric, covariance : ndarray of float64, shape (P, P)

    Returns
    -------
    ndarray of float64, shape (P, P)
        For `Basis.matrix`; the channel of the greatest variance first.
    """
    floor = 1e-9 * np.trace(metric) / len(metric)
    root = np.linalg.cholesky(metric + floor * np.eye(len(metric)))
    values, vectors = np.linalg.eigh(root.T @ covariance @ root)
    vectors = vectors[:, np.argsort(-values, kind="stable")]
    signs = np.sign(vectors[np.abs(vectors).argmax(axis=0), np.arange(len(values))])
    return np.asarray(root @ (vectors * signs))


def scales_of(variances: Array) -> Ints:
    """Return the scales of coefficients with these variances, shape (P, 32) (T3).

    What training never saw keeps a least scale, so that it can still be coded.
    """
    quarter_octaves: Array = np.rint(2 * np.log2(np.maximum(variances, _LEAST**2)))
    return quarter_octaves.astype(np.int64)


_LEAST = 0.25
"""Least expected magnitude in mm."""
