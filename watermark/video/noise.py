"""How much noise a value has, judged by known values whose surroundings are alike.

In: how well each amount of noise explains values whose bits are known, and the texture and the
motion around these and others; out: for each of the others the probability of every amount. A
kernel estimate (Nadaraya, "On estimating regression", 1964) of the log-likelihood of the noise.
Specification: spec/video-carrier.md, section 6.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from watermark.video.profile import TEXTURE

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

NOISES = tuple(0.06 * 1.25**n for n in range(13))
"""Standard deviations in steps that are told apart; at the last one the fine lattice shows nothing
any more."""

TEXTURE_OCTAVES, MOTION_OCTAVES = 0.5, 1.0
"""Standard deviations of the kernel in octaves of texture and of the variance over a window. From
.35 to 1 and from .5 to 2 what six films kept behind four coders changed by at most .8 %."""

WIDER = 3
"""Width of the kernel that stands in where few values are alike, in that of the usual one."""

STAND_IN = 8
"""Weight of the wider kernel's mean, in known values, however many it covers."""

ALL_KNOWN = 4
"""Weight of the whole picture's mean in that mean, in known values."""

MOST = 50
"""Known values for which those that are alike count at most. More would single out one of `NOISES`
where the truth lies between two, or differs more than texture and motion tell: with no limit, 100,
50 and 20 six films kept .487, .490, .493 and .500 of L1, and .337, .337, .337 and .334 of the worst
third of L0."""

LEAST_TEXTURE, LEAST_VARIANCE = 0.1, 0.02
"""Texture in luma and variance in squared luma of 8 bits below which surroundings are alike."""

_BINS = 40, 32  # two to a standard deviation: textures up to 100, variances up to 1300
_SIZE = _BINS[0] * _BINS[1]


def surroundings(texture: FloatArray, variance: FloatArray) -> IntArray:
    """Give the surroundings of values a number: those with the same one are alike.

    Cells with the fine and with the coarse step never are, for each step leaves a part of its own
    of the way to a lattice point.

    Parameters
    ----------
    texture : ndarray of float64, shape (values,)
        In luma of 8 bits.
    variance : ndarray of float64, shape (values,)
        Of an amplitude over the window, in squared luma.
    """
    row, column = (
        np.clip(np.log2(each / least + 1) / step, 0, bins - 1).astype(np.int64)
        for each, least, step, bins in (
            (texture, LEAST_TEXTURE, TEXTURE_OCTAVES / 2, _BINS[0]),
            (variance, LEAST_VARIANCE, MOTION_OCTAVES / 2, _BINS[1]),
        )
    )
    return (texture > TEXTURE) * _SIZE + row * _BINS[1] + column


def noise_shares(
    scores: FloatArray, known: IntArray, wanted: IntArray, *, themselves: bool = False
) -> FloatArray:
    """Probability of each of `NOISES` at the wanted surroundings, shape (len(NOISES), values).

    Parameters
    ----------
    scores : ndarray of float64, shape (len(NOISES), known values)
        Logarithms of the density of each known value with each noise.
    known, wanted : ndarray of int64
        Surroundings of known values and of those in question.
    themselves : bool
        Whether these are the same values, none of which may speak for itself.

    Examples
    --------
    Two still values near their points, two moving ones that are not:

    >>> still, moving = surroundings(np.full(2, 0.2), np.array([0.0, 300.0]))
    >>> scores = np.zeros((len(NOISES), 40))
    >>> scores[0, :20] = scores[-1, 20:] = 1.0
    >>> known = np.repeat([still, moving], 20)
    >>> noise_shares(scores, known, np.array([still, moving])).argmax(axis=0).tolist()
    [0, 12]
    """
    counted = np.vstack([scores, np.ones(scores.shape[1])])
    kinds: FloatArray = np.array([np.bincount(known, each, 2 * _SIZE) for each in counted])
    kinds = kinds.reshape(-1, 2, *_BINS)
    alike, around = _spread(kinds, 1), _spread(kinds, WIDER)
    everywhere = kinds.sum(axis=(1, 2, 3), keepdims=True)
    for each in (kinds.sum(axis=(2, 3), keepdims=True), around):
        everywhere = each + everywhere * (ALL_KNOWN / np.maximum(everywhere[-1], 1e-9))
    likely = alike[:-1] + STAND_IN * everywhere[:-1] / everywhere[-1]
    found = likely.reshape(len(scores), -1)[:, wanted]
    if themselves:
        found = found - scores
    found = found / np.maximum(1.0, (alike[-1].reshape(-1)[wanted] + STAND_IN) / MOST)
    found = np.exp(found - found.max(axis=0))
    return np.asarray(found / found.sum(axis=0))


def _spread(kinds: FloatArray, wider: int) -> FloatArray:
    """Add up the values around each bin, weighted by a kernel that is so many times wider."""
    rows, columns = (_kernel(bins, 2 * wider) for bins in _BINS)
    return np.asarray(rows @ kinds @ columns)


@lru_cache(maxsize=4)
def _kernel(bins: int, width: int) -> FloatArray:
    away = np.subtract.outer(np.arange(bins), np.arange(bins)) / width
    return np.asarray(np.exp(-0.5 * away**2))
