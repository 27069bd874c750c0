"""Where this cuer places her hand: the voice's placements, shifted and stretched to hers.

Placements differ between cuers, but all of a cuer's together: her face is longer, she points beside
her chin. Learning each placement by itself cannot tell a high throat from a low chin; a shift and a
stretch of all of them, with how often French uses each, can. Expectation and maximisation
(Dempster, Laird and Rubin 1977) from several starts, the likeliest wins.
"""

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from codec.analysis.recognise import Gaussians
from codec.cues.score import PLACEMENTS

FloatArray = NDArray[np.float64]

USED = {"rest": 0.1, "side": 0.485, "mouth": 0.143, "chin": 0.122, "cheek": 0.027, "throat": 0.123}
"""How often the hand is where: keys of French by the frequency of words, and rests."""

_SHIFT_SD_MM = 8.0
_STRETCH_SD = 0.08
_STARTS_MM = (-12.0, 0.0, 12.0)
_STRETCHES = (0.85, 1.0, 1.15)
_ROUNDS = 12
_LEAST_HOLDS = 10
_OFF = 0.02
"""Share of holds that are at no placement."""

_OFF_SD_MM = 120.0


def fit_placements(tips: FloatArray, places: Gaussians) -> Gaussians:
    """Return the placements of a cuer.

    Parameters
    ----------
    tips : ndarray of float64, shape (N, 3)
        Where the pointing finger was held, in the head's frame, mm.
    places : Gaussians
        The voice's placements, rest first; rest stays where it is.

    Returns
    -------
    Gaussians
        With the same covariances.
    """
    if len(tips) < _LEAST_HOLDS:
        return places
    best, likeliest = -np.inf, places.means
    for shift, stretch in itertools.product(_STARTS_MM, _STRETCHES):
        value, means = _climb(tips, places, shift, stretch)
        if value > best:
            best, likeliest = value, means
    return Gaussians(likeliest, places.covariances)


def _climb(
    tips: FloatArray, places: Gaussians, shift: float, stretch: float
) -> tuple[float, FloatArray]:
    """Return log likelihood and means that the vertical start `shift`, `stretch` leads to."""
    middle = places.means[1:].mean(0)
    out = places.means - middle
    variance = np.diagonal(places.covariances, axis1=1, axis2=2)
    use = np.log([USED[name] for name in PLACEMENTS])
    moved, scale = np.array([0.0, shift, 0.0]), np.array([1.0, stretch, 1.0])
    value = -np.inf
    for _ in range(_ROUNDS):
        means = places.means.copy()
        means[1:] = middle + moved + scale * out[1:]
        away = tips[:, None] - means
        log = use - 0.5 * ((away**2 / variance).sum(-1) + np.log(variance).sum(-1))
        off = np.log(_OFF) - 0.5 * (
            ((tips - middle) ** 2).sum(-1) / _OFF_SD_MM**2 + 3.0 * np.log(_OFF_SD_MM**2)
        )
        total = logsumexp(np.column_stack([log, off]), axis=1)
        value = float(total.sum()) - 0.5 * float(
            ((moved / _SHIFT_SD_MM) ** 2).sum() + (((scale - 1.0) / _STRETCH_SD) ** 2).sum()
        )
        share = np.exp(log - total[:, None])[:, 1:]
        weight = share[..., None] / variance[1:]
        # Depth is told least: it is shifted, not stretched.
        for axis in range(3):
            w = weight[..., axis]
            gap = tips[:, None, axis] - middle[axis] - out[None, 1:, axis]
            arm = out[1:, axis] if axis < 2 else np.zeros(len(out) - 1)
            normal = np.array(
                [[w.sum() + _SHIFT_SD_MM**-2, (w * arm).sum()],
                 [(w * arm).sum(), (w * arm**2).sum() + _STRETCH_SD**-2]]
            )  # fmt: skip
            right = np.array([(w * gap).sum(), (w * gap * arm).sum()])
            moved[axis], change = np.linalg.solve(normal, right)
            scale[axis] = 1.0 + change
    return value, means
