"""Inversion of markers that a model has made: all are seen, and they move without noise.

Every fourth frame is inverted by itself; those between begin at interpolated parameters, and need
half of the steps. A face's slopes hardly change: its frames take two steps with those of the
nearest fourth frame (chord method); a hand's frames would jump. A frame may have found another
solution than its neighbours, with more error: it begins anew at theirs, and the better one stays.
The result of a frame depends on the frames within `SIDE` of it alone.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.models.inversion import (
    NOISE_MM2,
    Confidence,
    MarkerModel,
    gauss_newton,
    invert,
    marker_weights,
)
from codec.cuer.models.threads import one_thread

Inverting = Callable[[Any, NDArray[np.float64], Confidence], NDArray[np.float64]]

ANCHORED = 4
"""Frames from one that is inverted by itself to the next."""

SIDE = 2 * ANCHORED
"""Frames on either side that the result of a frame may depend on."""

_CHORDS = 2
"""Steps of a frame with another one's slopes: more move no marker of a face."""

_POOR_MM = 1.5
"""Root mean square residual in mm from which a frame begins anew: half of such frames of the hand
gain by it (48 of 89)."""


def anchored(
    model: MarkerModel, markers: NDArray[np.float64], found: Inverting, *, chords: bool = False
) -> NDArray[np.float64]:
    """Return the parameters of markers that are all seen and move smoothly.

    Parameters
    ----------
    model : FaceModel or HandModel
    markers : ndarray of float64, shape (T, K, 3)
        Consecutive frames, T one more than a multiple of `ANCHORED`, millimetres.
    found : callable
        `invert_face` or `invert_hand`: every frame number `ANCHORED` is inverted by it.
    chords : bool
        Whether the others take the slopes of the nearest of these.

    Returns
    -------
    ndarray of float64, shape (T, P)
    """
    frames = np.arange(len(markers))
    between = frames % ANCHORED != 0
    seen = np.ones(markers.shape[:2], dtype=np.bool_)
    anchors = found(model, markers[~between], seen[~between])
    out = np.stack([np.interp(frames, frames[~between], x) for x in anchors.T], axis=1)
    if chords:
        _refine(model, markers, out)
    else:
        out[between] = invert(model, markers[between], seen[between], out[between], near=True)
    _repair(model, markers, out)
    return out


@one_thread
def _refine(
    model: MarkerModel, markers: NDArray[np.float64], parameters: NDArray[np.float64]
) -> None:
    """Improve the frames between every fourth one by the latter's slopes, in place."""
    anchors, near = parameters[::ANCHORED], markers[::ANCHORED]
    weight = marker_weights(
        model.residual(anchors, near), np.ones(near.shape[:2], dtype=np.bool_), robust=True
    )
    # Gauss-Newton at the anchors: step = (J'WJ)^-1 J'W r - NOISE (J'WJ)^-1 x, the latter pulling to
    # the mean.
    projection, inverse = gauss_newton(model, anchors, weight, model.deviations[:0])
    gain = (inverse @ projection).astype(np.float32)
    pull = NOISE_MM2 * inverse
    between = np.arange(len(markers)) % ANCHORED != 0
    # Each frame between takes the slopes of the nearer anchor (chord method: they stay the same).
    nearest = [slice(0, -1)] * (ANCHORED // 2) + [slice(1, None)] * (ANCHORED - 1 - ANCHORED // 2)
    now = markers[between]
    at = parameters[between].reshape(-1, ANCHORED - 1, anchors.shape[1])
    for _ in range(_CHORDS):
        flat = at.reshape(len(now), anchors.shape[1])
        residual = model.residual(flat, now).astype(np.float32)
        residual = residual.reshape(*at.shape[:2], gain.shape[2], 1)
        step = np.stack(
            [
                (gain[which] @ residual[:, n] - pull[which] @ at[:, n, :, None])[..., 0]
                for n, which in enumerate(nearest)
            ],
            axis=1,
        )
        at = at + step
    parameters[between] = at.reshape(len(now), anchors.shape[1])


def _repair(
    model: MarkerModel, markers: NDArray[np.float64], parameters: NDArray[np.float64]
) -> None:
    """Begin anew, from their neighbours' parameters, where frames with poor ones gain by it."""
    residual = _rms_mm(model, parameters, markers)
    good, poor = (np.flatnonzero(which) for which in (residual <= _POOR_MM, residual > _POOR_MM))
    if not len(poor) or not len(good):
        return
    after = np.searchsorted(good, poor)
    sides = good[np.stack([np.maximum(after - 1, 0), np.minimum(after, len(good) - 1)])]
    nearness = np.maximum(ANCHORED + 1 - np.abs(sides - poor), 0)
    whole = nearness.sum(axis=0)
    poor, sides, nearness = poor[whole > 0], sides[:, whole > 0], nearness[:, whole > 0]
    share = (nearness / nearness.sum(axis=0))[..., None]
    start = (share * parameters[sides]).sum(axis=0)
    seen = np.ones((len(poor), markers.shape[1]), dtype=np.bool_)
    found = invert(model, markers[poor], seen, start, near=True)
    better = _rms_mm(model, found, markers[poor]) < residual[poor]
    parameters[poor[better]] = found[better]


def _rms_mm(
    model: MarkerModel, parameters: NDArray[np.float64], markers: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the root mean square residual of each frame, shape (T,), mm."""
    squares = (model.residual(parameters, markers) ** 2).sum(axis=-1)
    return np.asarray(np.sqrt(squares.mean(axis=-1)))
